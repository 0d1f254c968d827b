"""``crowdsim analyze``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.options import Debug, Json, RecordingFile


def analyze(
    file: RecordingFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder to write [default: FILE without .h5, -analysis]."),
    ] = None,
    lines: Annotated[
        list[str] | None,
        typer.Option("--line", metavar="NAME=X0,Y0,X1,Y1", help="Another line at which passages count."),
    ] = None,
    areas: Annotated[
        list[str] | None,
        typer.Option(
            "--area", metavar="NAME=X0,Y0,X1,Y1", help="Another area: two corners of a rectangle, or all corners."
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Frames per second, a divisor of the recording's [default: 10]."),
    ] = None,
    voronoi_rate: Annotated[
        float, typer.Option("--voronoi-rate", metavar="HZ", help="Times a second at which areas are measured.")
    ] = 2.0,
    only: Annotated[
        str | None, typer.Option("--only", metavar="NAME,...", help="Only these, as evacuation,flow,diagram.")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure a recording as researchers of pedestrian dynamics do: flow, density, times, distances."""
    from crowdsim.analysis import report
    from crowdsim.analysis.analyze import analyze as analyze_recording
    from crowdsim.cli.progress import progress_bar
    from crowdsim.cli.tables import print_table
    from crowdsim.recording.reader import Recording

    with Recording.open(file) as recording:
        folder = Path(file).with_name(f"{Path(file).stem}-analysis") if output is None else output
        with progress_bar() as bar:
            bar.add_task(f"{file}: measuring", total=None)
            analysis = analyze_recording(
                recording,
                lines=lines or [],
                areas=areas or [],
                rate=rate,
                voronoi_rate=voronoi_rate,
                only=[name.strip() for name in only.split(",")] if only else [],
            )
            files = report.write_analysis(analysis, folder)
        if as_json:
            typer.echo(json.dumps(report.as_json(analysis, files)))
        else:
            print_table([*report.sentences(analysis), ("page", str(files[-1]))])
