"""``crowdsim play``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.options import Debug, RecordingFile, read_size
from crowdsim.cli.run import require_writable


def play(
    file: RecordingFile,
    shot: Annotated[
        str | None, typer.Option("--shot", metavar="OUT.png", help="Write one picture instead of a window.")
    ] = None,
    film: Annotated[
        str | None, typer.Option("--film", metavar="OUT.mp4", help="Write a film instead of a window.")
    ] = None,
    time: Annotated[
        float | None, typer.Option("--time", min=0.0, metavar="S", help="Second of the recording to picture.")
    ] = None,
    view: Annotated[str, typer.Option("--view", help="Camera of a picture.")] = "overview",
    agent: Annotated[int | None, typer.Option("--agent", min=0, help="Character the camera looks at.")] = None,
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Pixels of the picture or film.")] = "1600x900",
    debug: Debug = False,
) -> None:
    """Show a recording in a window, or make a picture or a film of it."""
    if shot is not None and film is not None:
        raise typer.BadParameter("choose one of --shot and --film")
    pixels = read_size(size)
    out = shot if shot is not None else film
    if out is not None:
        require_writable(Path(out))

    from crowdsim.recording.reader import Recording

    with Recording.open(file) as recording:
        from crowdsim import playback

        if shot is not None:
            playback.shot(recording, shot, time=time, view=view, size=pixels, agent=agent)
        elif film is not None:
            playback.film(recording, film, size=pixels)
        else:
            playback.window(recording)
    if out is not None:
        typer.echo(out)
