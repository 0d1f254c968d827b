"""``crowdsim bench``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from crowdsim.cli.options import Debug, Json, read_map_depth


def bench(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Benchmark to run; omit it to list all.")] = None,
    maps: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="For navmesh: a folder of maps with known shortest lengths.")
    ] = None,
    worlds: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="For environment, planner, plan-soundness: the folder with small_house.glb and the other worlds.",
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="For planner: draw the times of all planners.")
    ] = None,
    captures: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="For motion-graph, planted-feet, motion-search, motion-maps: captures."),
    ] = None,
    rvo2: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="For crowd: the sources of RVO2, to compare its times.")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(metavar="MIN", help="For soak: simulated minutes to run [default: 60].")
    ] = None,
    depth: Annotated[
        str | None,
        typer.Option(
            "--depth",
            metavar="N|METERSm",
            help="For motion-maps: how far maps look ahead, in nodes, as 4, or in meters, as 3.5m.",
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Add the figures, with the commit, to the file of this machine in FOLDER."),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run a named benchmark; without a name, list them."""
    from dataclasses import asdict

    from crowdsim.bench.kept_figures import keep_figures
    from crowdsim.bench.registry import bench_names, run_bench
    from crowdsim.cli.tables import print_rows, print_table

    if name is None:
        if keep is not None:
            raise typer.BadParameter("name the benchmark whose figures are to be kept", param_hint="--keep")
        if as_json:
            typer.echo(json.dumps(bench_names()))
        else:
            print_table(list(bench_names().items()))
        return
    sizes = read_map_depth(depth)
    result = run_bench(
        name,
        maps=maps,
        worlds=worlds,
        captures=captures,
        picture=picture,
        depth=sizes or None,
        rvo2=rvo2,
        minutes=minutes,
    )
    kept = None if keep is None else keep_figures(result, keep)
    if as_json:
        typer.echo(json.dumps(asdict(result)))
        return
    print_rows(result.rows)
    if result.headline:
        typer.echo()
        print_table([(figure, f"{result.figures[figure]:g}") for figure in result.headline])
    if kept is not None:
        typer.echo(f"\n{len(result.figures)} figures kept in {kept}")
    typer.echo(f"\n{result.machine['processor']}, {result.machine['cores']} cores")
    if result.load > 0.5 * int(result.machine["cores"]):
        typer.echo(f"the machine was busy before (load {result.load:.1f}): times may be too long")
