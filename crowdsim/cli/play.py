"""``crowdsim play``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from crowdsim.cli.options import Debug, RecordingFile, read_size
from crowdsim.cli.run import require_writable

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
    time: Annotated[
        float | None,
        typer.Option("--time", min=0.0, metavar="S", help="Second of the picture [default: a telling moment]."),
    ] = None,
    view: Annotated[str, typer.Option("--view", help="overview, top, or follow, which needs --agent.")] = "overview",
    agent: Annotated[int | None, typer.Option("--agent", min=0, help="Character to follow.")] = None,
    color: Annotated[
        str, typer.Option("--color", help="What shirts show: behavior, agent, level, or an attribute of the scenario.")
    ] = "behavior",
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Pixels [default: 1600x900, of a film or window 1280x720]."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Show a recording in a window, or make a picture or a film of it."""
    if shot is not None and film is not None:
        raise typer.BadParameter("choose one of --shot and --film")
    if time is not None and shot is None:
        raise typer.BadParameter("only --shot takes a time", param_hint="--time")
    camera: dict[str, Any] = {"view": view, "agent": agent, "color_by": color}
    if size is not None:
        camera["size"] = read_size(size)
    out = shot if shot is not None else film
    if out is not None:
        require_writable(Path(out))

    from crowdsim.recording.reader import Recording

    with Recording.open(file) as recording:
        if shot is not None:
            from crowdsim.playback.shot import shot as take_shot

            take_shot(recording, shot, time=time, **camera)
        elif film is not None:
            _make_film(recording, film, camera)
        else:
            from crowdsim.playback.window import window

            window(recording, **camera)
    if out is not None:
        typer.echo(out)


def _make_film(recording: Recording, out: str, camera: dict[str, Any]) -> None:
    from crowdsim.cli.progress import Interruption, progress_bar
    from crowdsim.playback.film import film

    with progress_bar() as bar, Interruption() as interruption:
        task = bar.add_task(out, total=None)

        def show(done: int, count: int) -> None:
            interruption.heed()
            bar.update(task, completed=done, total=count)

        film(recording, out, progress=show, **camera)
