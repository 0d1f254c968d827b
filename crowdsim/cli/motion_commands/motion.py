"""``crowdsim motion``: inspect captures, build their graph, write built-in motion sets."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer

from crowdsim.cli.options import Debug, Joints, Json, Unit, read_joints, read_unit

motion = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Inspect motion captures and motion graphs.")

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="A folder of captures: BVH, or AMC with ASF files.")]


@motion.command()
def info(
    folder: Folder,
    unit: Unit = None,
    joint: Joints = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show a table of the captures: assumptions, parts that were cut out, and contents."""
    from crowdsim.cli.tables import print_rows
    from crowdsim.errors import MotionError
    from crowdsim.motion.analysis.capture_summary import summarize_all
    from crowdsim.motion.captures.reader import capture_paths

    meters, joints = read_unit(unit), read_joints(joint or [])
    rows = summarize_all(capture_paths(folder), meters, joints)
    if all(row["frames"] is None for row in rows):
        raise MotionError("\n".join(f"{row['file']}: {row['problem']}" for row in rows))
    notes = _walking(folder, meters, joints)
    if as_json:
        typer.echo(json.dumps({"files": rows, "notes": notes}))
    else:
        columns = [name for name in rows[0] if any(row[name] is not None for row in rows)]
        print_rows([{name: row[name] for name in columns} for row in rows])
        for note in notes:
            typer.echo(note)


def _walking(folder: Path, meters_per_unit: float | None, joints: dict[str, str]) -> list[str]:
    """Return sentences on the walk that a scenario would make of these captures, or on why it can make none.

    ``meters_per_unit`` is the length of a unit of the files [m], None to find it out; ``joints`` gives names of joints
    by role.
    """
    from crowdsim.behaviors.behavior import CAPTURED, FRONTAL
    from crowdsim.behaviors.library import load_behavior_set
    from crowdsim.environment.layers import LEGS, TORSO
    from crowdsim.errors import BehaviorError, MotionError

    try:
        bands = [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]
        found = load_behavior_set(CAPTURED, bands, captures=folder, meters_per_unit=meters_per_unit, joints=joints)
    except (MotionError, BehaviorError) as error:
        return [f"walking cannot be made from these captures: {error}"]
    frontal = next(behavior for behavior in found.behaviors if behavior.name == FRONTAL)
    legs, torso = frontal.radii
    return [
        f"walking takes {legs:.2f} m to each side at the legs ({frontal.widest[0]}) and {torso:.2f} m at the torso "
        f"({frontal.widest[1]})",
        *found.notes,
    ]


@motion.command()
def graph(
    folder: Folder,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE.npz", help="Save the graph there; it is built again if captures change."
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw the error image with both graphs' transitions.")
    ] = None,
    threshold: Annotated[
        float, typer.Option(metavar="METERS", help="Largest distance between two poses that a transition connects.")
    ] = 0.06,
    branching: Annotated[
        float | None,
        typer.Option(metavar="FACTOR", help="Choose the threshold by branching factor, between 1 and 2."),
    ] = None,
    best: Annotated[
        int | None, typer.Option(metavar="K", min=1, help="Keep the K nearest transitions from each segment.")
    ] = None,
    drift: Annotated[
        float,
        typer.Option(metavar="METERS", min=0.0, help="Leave out transitions that add more sliding of a planted foot."),
    ] = 0.005,
    detectors: Annotated[
        str, typer.Option(metavar="NAMES", help="Feature detectors, separated by commas.")
    ] = "crossing,standing",
    standard: Annotated[
        bool, typer.Option("--standard", help="Build a standard graph instead of a feature-based one.")
    ] = False,
    unit: Unit = None,
    joint: Joints = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Build the motion graph of the captures."""
    from crowdsim.cli.tables import print_table
    from crowdsim.motion.analysis.graph_file import GraphSettings, build_graph, graph_in_file
    from crowdsim.motion.captures.reader import capture_paths

    if not (threshold > 0.0 and math.isfinite(threshold)):
        raise typer.BadParameter(f"{threshold} is not a positive distance", param_hint="--threshold")
    if branching is not None and not 1.0 < branching < 2.0:
        raise typer.BadParameter(f"{branching} is not between 1 and 2, as all factors are", param_hint="--branching")
    names = tuple(name.strip() for name in detectors.split(",") if name.strip())
    if not names:
        raise typer.BadParameter("give the name of at least one, as in crossing,standing", param_hint="--detectors")
    meters, joints = read_unit(unit), read_joints(joint or [])
    settings = GraphSettings(standard, threshold, branching, best, drift, names, meters, joints or None)
    paths = capture_paths(folder)
    if output is None:
        made, built = build_graph(paths, settings), True
    else:
        made, built = graph_in_file(output, paths, settings)
    if picture is not None:
        _draw(paths, settings, picture)
    report = made.report
    counts: dict[str, Any] = {
        "kind": "standard" if standard else "feature-based",
        "segments": report.nodes,
        "edges": report.edges,
        "transitions": report.transitions,
        "branching": round(report.branching, 3),
        "out_degree": round(report.out_degree, 3),
        "threshold_m": round(report.threshold, 4),
        "dropped": len(report.dropped),
        "skating": report.skating,
        "built": built,
    }
    if as_json:
        typer.echo(json.dumps(counts))
        return
    print_table([(name, str(value)) for name, value in counts.items()])


@motion.command()
def synthesize(
    motion_set: Annotated[str, typer.Argument(metavar="SET", help="default, happy or dance.")],
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder for the clips; created if necessary.")],
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the clips of a built-in motion set as BVH, to look at or to use as captures."""
    from crowdsim.motion.captures.bvh_writer import write_bvh
    from crowdsim.motion.synthesis.library import motion_database
    from crowdsim.motion.synthesis.styles import find_manner

    clips = motion_database(find_manner(motion_set))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"cannot make {folder}: {error.strerror}", param_hint="FOLDER") from None
    for clip in clips:
        write_bvh(clip, folder / f"{clip.name}.bvh")
    frames = sum(clip.frame_count for clip in clips)
    if as_json:
        typer.echo(json.dumps({"set": motion_set, "folder": str(folder), "clips": len(clips), "frames": frames}))
        return
    typer.echo(f"{len(clips)} clips of {frames:,} frames in {folder}")


def _draw(paths: list[Path], settings: Any, picture: Path) -> None:
    """Draw the error image of the captures at ``paths`` and their feature-based graph, and write it to ``picture``.

    ``settings`` are a ``GraphSettings``; the picture shows the transitions of both graphs, whatever kind they choose.
    """
    from crowdsim.figures import write_figure
    from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
    from crowdsim.motion.analysis.graph_picture import draw_motion_graph
    from crowdsim.motion.graph.motion_graph import build_motion_graph

    sources = as_sources(read_clips(paths, settings.meters_per_unit, settings.joints), settings.detectors)
    made = build_motion_graph(
        sources, settings.threshold, settings.max_out_edges, settings.branching, settings.most_drift
    )
    write_figure(draw_motion_graph(sources, made), picture)
