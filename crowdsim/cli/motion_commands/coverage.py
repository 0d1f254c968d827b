"""``crowdsim motion coverage``: the turns that a set of motions can follow, and the clearance that they need."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from crowdsim.cli.options import Debug, Joints, Json, MapDepth, Unit, read_joints, read_map_depth, read_unit

if TYPE_CHECKING:
    from crowdsim.motion.graph.motion_graph import MotionGraph


def coverage(
    motions: Annotated[
        str, typer.Argument(metavar="FOLDER|SET", help="A folder of captures, or default, happy or dance.")
    ] = "default",
    picture: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Draw the table.")] = None,
    depth: MapDepth = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Threads; the table does not depend on it. By default one per core.")
    ] = None,
    unit: Unit = None,
    joint: Joints = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show the percentage of turns that a set of motions can follow, by radius and clearance of all joints."""
    from crowdsim.cli.progress import progress_bar
    from crowdsim.cli.tables import print_rows
    from crowdsim.figures import write_figure
    from crowdsim.following.coverage import coverage_rows, draw_coverage, measure_coverage, missing_turns
    from crowdsim.following.maps.motion_maps import MotionMaps
    from crowdsim.processors import usable_processors

    sizes = read_map_depth(depth)
    threads = workers or usable_processors()
    motion, facings = _load(motions, read_unit(unit), read_joints(joint or []))
    with progress_bar() as bar:
        task = bar.add_task("maps")

        def tell(done: int, total: int) -> None:
            """Show how many nodes have a map, or how many cells of the table are done."""
            bar.update(task, completed=done, total=total)

        maps = MotionMaps.build(motion.arrays, **sizes, progress=tell, workers=threads)
        bar.update(task, description="turns", completed=0)
        measured = measure_coverage(motion, maps, facings, len(facings) - 1, workers=threads, progress=tell)
    if picture is not None:
        write_figure(draw_coverage(measured, Path(motions).name), picture)
    rows = coverage_rows(measured)
    for lacking in missing_turns(measured):
        typer.echo(lacking, err=True)
    if as_json:
        size = {"depth": maps.depth, "entries": maps.entry_count, "megabytes": round(maps.bytes / 1e6, 3)}
        typer.echo(json.dumps({"motions": motions, "maps": size, "percent": rows}))
        return
    print_rows(rows)


def _load(motions: str, meters_per_unit: float | None, joints: dict[str, str]) -> tuple[MotionGraph, Any]:
    """Return the graph of a folder of captures or a motion set, and the facings of its behaviors, preferred last.

    Facings (B, F) are the angles from the direction of motion at which each of B behaviors may face [rad]; rows are
    padded with nan to the largest number F of one behavior. Of captures only the frontal walk is taken, which faces
    ahead. ``meters_per_unit`` (None to find it out) and ``joints``, names by role, are for captures only.
    """
    import numpy as np

    from crowdsim.behaviors.behavior import FRONTAL
    from crowdsim.behaviors.library import load_behavior_set
    from crowdsim.environment.layers import LEGS, TORSO
    from crowdsim.errors import MotionError
    from crowdsim.motion.synthesis.styles import MANNERS

    bands = [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]
    if motions not in MANNERS:
        if not Path(motions).is_dir():
            raise MotionError(f"'{motions}' is neither a folder of captures nor one of {', '.join(MANNERS)}")
        found = load_behavior_set(
            [FRONTAL], bands, captures=Path(motions), meters_per_unit=meters_per_unit, joints=joints
        )
        for note in found.notes:
            typer.echo(note, err=True)
        return found.graph, np.zeros((1, 1))
    loaded = load_behavior_set(["lateral", "arm_constrained", "frontal"], bands, motion_set=motions)
    facings = np.full((len(loaded.behaviors), max(len(b.facings) for b in loaded.behaviors)), np.nan)
    for row, behavior in zip(facings, loaded.behaviors, strict=True):
        row[: len(behavior.facings)] = behavior.facings
    return loaded.graph, facings
