"""``crowdsim sweep``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from crowdsim.cli.options import Debug, Json, Scenario

FAILED = 4
"""Exit code if all points failed."""


def sweep(
    scenario: Scenario,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the sweep; one that was stopped goes on.")],
    seeds: Annotated[
        str | None, typer.Option("--seeds", metavar="1-20", help="Seeds of the runs [default: the scenario's].")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=V1,V2", help="Values of a key of the scenario; several combine."),
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, max=1024, help="Number of runs at a time; results never depend on it.")
    ] = 2,
    keep: Annotated[
        Literal["none", "recordings", "failures"],
        typer.Option(
            help="Recordings that stay: none, all (recordings), or only those in which not all arrive (failures)."
        ),
    ] = "none",
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS|local", help="Run on a Dask scheduler, or on a local Dask cluster."),
    ] = None,
    figures: Annotated[
        str | None, typer.Option("--draw", metavar="COLUMN,...", help="Columns of the table to draw, as t95,mean_time.")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run a scenario with many seeds and values, and write a table and a picture; go on where it was stopped."""
    from crowdsim.cli.progress import WHOLE_RUN, FirstRunElsewhere, progress_bar
    from crowdsim.cli.tables import print_table
    from crowdsim.sweeps.points import points_of
    from crowdsim.sweeps.sweep import sweep as run_sweep

    points = points_of(scenario, seeds, settings or [])
    counted = [0, len(points)]  # points done, and all, for the message of an interruption
    bar = progress_bar(WHOLE_RUN)
    task = bar.add_task(f"{scenario}: sweeping", total=len(points))
    with bar, FirstRunElsewhere(bar):

        def progress(done: int, total: int, failed: int) -> None:
            """Show how many points are done, and how many of them failed."""
            counted[0] = done
            title = f"{scenario}: sweeping" + (f", {failed} failed" if failed else "")
            bar.update(task, completed=done, total=total, description=title)

        try:
            done = run_sweep(
                points,
                folder,
                jobs=jobs,
                keep=keep,
                dask=dask,
                figures=[name.strip() for name in figures.split(",")] if figures else [],
                progress=progress,
                note=lambda text: bar.console.print(f"note: {text}", highlight=False, soft_wrap=True),
            )
        except KeyboardInterrupt as stop:
            raise type(stop)(
                f"stopped: {counted[0]} of {counted[1]} points are done; the same command goes on from there"
            ) from None
    summary = {
        "points": len(points),
        "done_before": done.done_before,
        "failed": done.failed,
        "table": str(done.table),
        "picture": str(done.picture),
    }
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        print_table([(key.replace("_", " "), str(value)) for key, value in summary.items()])
    if done.failed:
        first = next(outcome.error for _, outcome in done.rows if outcome.error)
        typer.echo(f"{done.failed} of {len(points)} points failed; the first one: {first}", err=True)
    if done.failed == len(points):
        raise typer.Exit(FAILED)
