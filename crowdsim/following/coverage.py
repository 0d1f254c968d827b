"""What a set of motions can follow: how often it leads around a turn, by the turn's radius and the room there is.

Each trial is a straight, a turn and a straight, in which every joint of the body is to keep within the clearance. Turns
to which nothing leads tell what motions a set lacks (2012 paper, section 7).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.errors import MotionError
from crowdsim.following.follower.body_reach import body_reach
from crowdsim.following.follower.path_follower import Character, FollowOptions, FollowStatus, follow_path
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.navmesh.navmesh import NavMesh

Floats = NDArray[np.float64]

RADII = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
"""Meters, radii of turns to either side; the straight comes besides."""

CLEARANCES = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5)
ANGLES = (45.0, 90.0, 135.0)
LEADS = (1.5, 1.7, 1.9, 2.1)
"""Meters of the straight before a turn: motions that fit must not be a matter of where their steps fall."""

_AFTER = 1.5
_SPACING = 0.1
_BUDGET = 200
_RADIUS = 0.05  # meters of the discs tested: on open ground they are free anyway


@dataclass(frozen=True)
class Coverage:
    """How many trials were followed.

    curvature: (K,) one over the radius of a turn, positive to the left. clearance: (C,) meters. share: (K, C), 0 to 1.
    """

    curvature: Floats
    clearance: Floats
    share: Floats


class _Samples(NamedTuple):
    pose: Floats
    arc: Floats
    behavior: NDArray[np.int32]


def measure_coverage(
    motion: MotionGraph,
    maps: MotionMaps,
    facings: Floats,
    behavior: int = 0,
    radii: Sequence[float] = RADII,
    clearances: Sequence[float] = CLEARANCES,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Coverage:
    """Follow turns of each radius to both sides, and a straight, with each clearance.

    facings: (B, F) radians the body may face off its direction of motion, padded with nan. behavior: the one that is
    planned everywhere. workers: threads, with the same result for any number. progress: called with the cells of the
    table that are done and their number. MotionError where a number is not positive.
    """
    if not radii or not clearances or min(*radii, *clearances) <= 0.0 or workers < 1:
        raise MotionError(
            f"coverage needs radii and clearances above 0 and a worker, not {radii}, {clearances}, {workers}"
        )
    graph = motion.arrays
    reach = body_reach(graph, motion.poses, np.full(len(facings), clearances[0]))
    ground = NavMesh(shapely.box(-100.0, -100.0, 100.0, 100.0)).arrays
    idle = np.flatnonzero(graph.node_idle & (graph.node_behavior == behavior))
    start_node = int(idle[0]) if len(idle) else NONE
    discs = np.full((len(facings), 1), _RADIUS)
    options = FollowOptions(budget=_BUDGET)
    bends = [1.0 / radius for radius in sorted(radii)]
    curvature = [*bends, 0.0, *[-bend for bend in reversed(bends)]]

    def share(place: tuple[float, float]) -> float:
        bend, clearance = place
        kept = reach._replace(room=np.full(len(facings), clearance), least=clearance)
        character = Character(graph, maps, discs, facings, kept)
        found = [
            follow_path(character, path, (ground,), path.pose[0].copy(), start_node, options)
            for path in _paths(bend, behavior)
        ]
        return sum(one.status == FollowStatus.FOUND for one in found) / len(found)

    cells = [(bend, clearance) for bend in curvature for clearance in clearances]
    shares = []
    with ThreadPoolExecutor(workers, thread_name_prefix="crowdsim") as pool:
        for done, result in enumerate(pool.map(share, cells), 1):
            shares.append(result)
            if progress is not None:
                progress(done, len(cells))
    table = np.array(shares).reshape(len(curvature), len(clearances))
    return Coverage(np.array(curvature), np.array(clearances), table)


def coverage_rows(coverage: Coverage) -> list[dict[str, Any]]:
    """A line for each turn: percent of the trials that were followed, by clearance."""
    rows = []
    for curvature, shares in zip(coverage.curvature, coverage.share, strict=True):
        turn = "straight"
        if curvature != 0.0:
            turn = f"{'left' if curvature > 0.0 else 'right'}, {1.0 / abs(curvature):g} m"
        percents = {
            f"{clearance:g} m": round(100.0 * share, 1)
            for clearance, share in zip(coverage.clearance.tolist(), shares.tolist(), strict=True)
        }
        rows.append({"turn": turn, **percents})
    return rows


def _paths(bend: float, behavior: int) -> list[_Samples]:
    """Paths that turn with the curvature ``bend`` (1/m, to the left) by each angle after each straight."""
    paths = []
    for lead in LEADS:
        for degrees in ANGLES if bend != 0.0 else (0.0,):
            turn = math.copysign(math.radians(degrees), bend)
            around = turn / bend if bend != 0.0 else _AFTER
            length = lead + around + _AFTER
            arc = np.linspace(0.0, length, math.ceil(length / _SPACING) + 1)
            within = np.clip(arc - lead, 0.0, around)
            heading = bend * within
            if bend == 0.0:
                x, y = arc, np.zeros_like(arc)
            else:
                beyond = np.maximum(arc - lead - around, 0.0)
                x = np.minimum(arc, lead) + sin(heading) / bend + beyond * cos(turn)
                y = (1.0 - cos(heading)) / bend + beyond * sin(turn)
            paths.append(_Samples(np.column_stack([x, y, heading]), arc, np.full(len(arc), behavior, np.int32)))
    return paths


def draw_coverage(coverage: Coverage, name: str) -> Any:
    """The table as a picture (matplotlib figure): green where everything is followed, red where nothing is."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.5 + 1.0 * len(coverage.clearance), 1.5 + 0.45 * len(coverage.curvature)), dpi=110)
    axes = figure.subplots()
    shown = axes.imshow(coverage.share, cmap="RdYlGn", vmin=0.0, vmax=1.0, aspect="auto")
    axes.set_xticks(range(len(coverage.clearance)), [f"{clearance:g}" for clearance in coverage.clearance])
    axes.set_yticks(range(len(coverage.curvature)), [str(row["turn"]) for row in coverage_rows(coverage)])
    axes.set_xlabel("clearance, m")
    axes.set_title(f"Turns that {name} follows")
    for i, row in enumerate(coverage.share):
        for k, share in enumerate(row):
            axes.text(k, i, f"{100.0 * share:.0f}", ha="center", va="center", fontsize=9)
    figure.colorbar(shown, ax=axes, label="share of trials followed")
    figure.tight_layout()
    return figure
