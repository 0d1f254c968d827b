"""``crowdsim play``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from crowdsim.cli.options import Debug, RecordingFile, read_size
from crowdsim.errors import DrawingUnavailable
from crowdsim.whole_files import require_writable

if TYPE_CHECKING:
    from crowdsim.recording.reader import Recording


def play(
    file: RecordingFile,
    shot: Annotated[
        str | None, typer.Option("--shot", metavar="OUT.png", help="Write one picture instead of a window.")
    ] = None,
    film: Annotated[
        str | None, typer.Option("--film", metavar="OUT.mp4", help="Write a film instead of a window.")
    ] = None,
    browser: Annotated[
        bool,
        typer.Option(
            "--browser",
            help="Show it in the browser instead of a window, as a temporary page, without --color and --size.",
        ),
    ] = False,
    time: Annotated[
        list[float] | None,
        typer.Option(
            "--time",
            min=0.0,
            metavar="S",
            help="Time of the picture in seconds [default: a busy moment]; repeat it for several, OUT-12.5.png.",
        ),
    ] = None,
    start: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Time at which a film begins in seconds.")
    ] = None,
    end: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Time at which a film ends in seconds.")
    ] = None,
    view: Annotated[str, typer.Option("--view", help="overview, top, or follow, which needs --agent.")] = "overview",
    agent: Annotated[int | None, typer.Option("--agent", min=0, help="Agent to follow.")] = None,
    color: Annotated[
        str,
        typer.Option("--color", help="Meaning of shirt colors: behavior, group, agent, level, or an attribute."),
    ] = "behavior",
    paths: Annotated[bool, typer.Option("--paths/--no-paths", help="Draw planned paths on the floor.")] = True,
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Pixels [default: 1600x900, of a film or window 1280x720]."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Show a recording in a window, or make a picture or a film of it."""
    if (shot is not None) + (film is not None) + browser > 1:
        raise typer.BadParameter("choose one of --shot, --film and --browser")
    times = list(dict.fromkeys(time or ()))  # each time once
    if times and shot is None:
        raise typer.BadParameter("only --shot takes a time", param_hint="--time")
    if film is None and (start is not None or end is not None):
        raise typer.BadParameter("only --film takes a part of the time", param_hint="--start, --end")
    camera: dict[str, Any] = {"view": view, "agent": agent, "color_by": color, "paths": paths}
    if size is not None:
        camera["size"] = read_size(size)
    out = shot if shot is not None else film
    if out is not None:
        require_writable(Path(out))

    from crowdsim.recording.reader import Recording

    with Recording.open(file) as recording:
        if browser:
            _open_page(recording, view, agent, paths)
        elif shot is not None:
            from crowdsim.playback.shot import shot as take_shot
            from crowdsim.playback.shot import shots

            if len(times) > 1:
                written = shots(recording, shot, times, **camera)
            else:
                written = [take_shot(recording, shot, time=times[0] if times else None, **camera)]
            typer.echo("\n".join(map(str, written)))
        elif film is not None:
            _make_film(recording, film, {**camera, "start": start or 0.0, "end": end})
        else:
            _open_window(recording, camera)
    if film is not None:
        typer.echo(film)


def _open_window(recording: Recording, camera: dict[str, Any]) -> None:
    """Play the recording in a window; without a display, say how to play it in a browser instead.

    ``camera`` holds the other arguments of :func:`~crowdsim.playback.window.window`.
    """
    from crowdsim.playback.window import window

    try:
        window(recording, **camera)
    except DrawingUnavailable as error:
        page = recording.path.with_suffix(".html")
        raise DrawingUnavailable(
            f"no display; 'crowdsim export {recording.path} -o {page}' makes a page that any browser plays\n{error}"
        ) from None


def _open_page(recording: Recording, view: str, agent: int | None, paths: bool) -> None:
    """Write a page to a temporary folder, which stays for the browser; open the page, and print its name.

    The page shows ``view``, with ``agent`` selected if it is given. Without ``paths`` it draws none at first, else the
    default ones of pages.
    """
    from crowdsim.export.page.page import PageOptions, write_page

    page = Path(tempfile.mkdtemp(prefix="crowdsim-")) / f"{recording.path.stem}.html"
    write_page(recording, page, PageOptions(paths=None if paths else "none"))
    link = [f"view={view}"] if agent is None else [f"agent={agent}", f"view={view}"]
    typer.launch(f"{page.as_uri()}#{'&'.join(link)}")
    typer.echo(page)


def _make_film(recording: Recording, out: str, camera: dict[str, Any]) -> None:
    """Write the film ``out`` with a progress bar; Ctrl-C ends it between two pictures.

    ``camera`` holds the other arguments of :func:`~crowdsim.playback.film.film`.
    """
    from crowdsim.cli.progress import Interruption, progress_bar
    from crowdsim.playback.film import film

    with progress_bar() as bar, Interruption() as interruption:
        task = bar.add_task(out, total=None)

        def show(done: int, count: int) -> None:
            """Show how many pictures are done; raise a signal that was held back."""
            interruption.heed()
            bar.update(task, completed=done, total=count)

        film(recording, out, progress=show, processes=2, **camera)
