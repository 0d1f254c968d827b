"""``crowdsim export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.options import Debug, RecordingFile


def export(
    file: RecordingFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT", help="File to write; its ending names the format.")
    ],
    kind: Annotated[
        str | None, typer.Option("--format", metavar="NAME", help="Format, if OUT does not end with it.")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Frames per second, a divisor of the recording's rate [default: all; at most 15 in glb, usdc and bvh "
            "of more than 50 agents].",
        ),
    ] = None,
    start: Annotated[
        float | None, typer.Option("--start", min=0.0, metavar="S", help="Time of the first frame in seconds.")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--end", min=0.0, metavar="S", help="Time of the last frame in seconds.")
    ] = None,
    agents: Annotated[
        str | None, typer.Option("--agents", metavar="3,7|GROUP", help="Only these agents or groups.")
    ] = None,
    layer: Annotated[
        str | None,
        typer.Option(
            "--layer", metavar="NAME", help="Layer whose walkable area is written with the tracks [default: first]."
        ),
    ] = None,
    paths: Annotated[
        str | None, typer.Option("--paths", metavar="all|selected|none", help="Paths that a page draws at first.")
    ] = None,
    title: Annotated[str | None, typer.Option("--title", metavar="TEXT", help="Title of a page.")] = None,
    points: Annotated[bool, typer.Option("--points", help="In USD, draw capsules instead of bodies.")] = False,
    show: Annotated[bool, typer.Option("--open", help="Open the file with the desktop's program for it.")] = False,
    debug: Debug = False,
) -> None:
    """Export a recording to a format of other programs."""
    from crowdsim.export.formats import export as export_recording
    from crowdsim.export.options import ExportOptions
    from crowdsim.recording.reader import Recording

    with Recording.open(file) as recording:
        options = ExportOptions(layer=layer, paths=paths, title=title, points=points or None)
        written = export_recording(
            recording, output, kind=kind, rate=rate, start=start, end=end, agents=agents, options=options
        )
    typer.echo(written)
    if show:
        typer.launch(str(written))
