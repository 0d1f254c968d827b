"""Measure what turns a set of motions can follow, by the turn's radius and the clearance.

Each trial is a straight, a turn and a straight, on which every joint of the body must stay within the clearance. Turns
that are never followed show which motions a set lacks (2012 paper, section 7).
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
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowStatus, search_path
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.navmesh.navmesh import NavMesh

Floats = NDArray[np.float64]

RADII = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
"""Radii of turns to either side [m]; a straight is added."""

CLEARANCES = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5)
"""Clearances of the trials [m]."""
ANGLES = (45.0, 90.0, 135.0)
"""Angles of the turns [degrees]."""
LEADS = (1.5, 1.7, 1.9, 2.1)
"""Lengths of the straight before a turn [m]; several, so that the result does not depend on where steps fall."""

_AFTER = 1.5
"""Length of the straight behind a turn [m]."""
_SPACING = 0.1
"""Largest distance between samples of a path [m]."""
_BUDGET = 200
"""Map queries per trial."""
_RADIUS = 0.05
"""Radius of the discs tested [m]; any will do, as on open ground all are free."""


@dataclass(frozen=True)
class Coverage:
    """Shares of the trials that were followed.

    curvature: (K,) one over the radius of a turn, positive to the left [1/m]. clearance: (C,) [m]. share: (K, C), from
    0 to 1.
    """

    curvature: Floats
    clearance: Floats
    share: Floats


class _Samples(NamedTuple):
    """A path at equal steps, as of :class:`crowdsim.following.follower.follow_workspace.Samples`."""

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

    Parameters
    ----------
    motion, maps: motion graph and its maps.
    facings: (B, F) angles off the direction of motion at which the body may face [rad], padded with nan.
    behavior: the behavior planned everywhere.
    radii, clearances: [m].
    workers: number of threads; the result is the same for any number.
    progress: called with the number of table cells done and of all cells.

    Returns
    -------
    Turns from the sharpest to the left over the straight to the sharpest to the right; clearances as given.

    Raises
    ------
    MotionError: if there are no radii or clearances, or a number is not positive.
    """
    if not radii or not clearances or min(*radii, *clearances) <= 0.0 or workers < 1:
        raise MotionError(
            f"coverage needs radii and clearances above 0 and a worker, not {radii}, {clearances}, {workers}"
        )
    graph = motion.arrays
    # One behavior, in an empty place: only the path's clearance limits the body.
    reach = body_reach(graph, motion.poses, np.full(len(facings), clearances[0]))
    # No path leads farther from the origin than two radii and the straights.
    side = 2.0 * (max(radii) + max(clearances)) + max(LEADS) + _AFTER
    ground = NavMesh(shapely.box(-side, -side, side, side)).arrays
    # Start from a stand, an idle node that is being played already, if there is one.
    idle = np.flatnonzero(graph.node_idle & (graph.node_behavior == behavior))
    start_node = int(idle[0]) if len(idle) else NONE
    discs = np.full((len(facings), 1), _RADIUS)
    options = FollowOptions(budget=_BUDGET)
    # Turns to the left, straight on, turns to the right.
    bends = [1.0 / radius for radius in sorted(radii)]
    curvature = [*bends, 0.0, *[-bend for bend in reversed(bends)]]

    rooms = sorted(set(clearances))

    def shares_of(bend: float) -> list[float]:
        """Return the share of trials that are followed, for each clearance, on paths that turn with ``bend`` [1/m].

        A trial that is followed with one clearance counts as followed with all greater ones.
        """
        paths = _paths(bend, behavior)
        found = [False] * len(paths)
        shares = []
        for clearance in rooms:
            kept = reach._replace(room=np.full(len(facings), clearance), least=clearance)
            character = Character(graph, maps, discs, facings, kept)
            for number, path in enumerate(paths):
                if not found[number]:
                    start = path.pose[0].copy()
                    result = search_path(character, path, (ground,), start, start_node, options)
                    found[number] = result.status == FollowStatus.FOUND
            shares.append(sum(found) / len(found))
        return [shares[rooms.index(clearance)] for clearance in clearances]

    table = []
    with ThreadPoolExecutor(workers, thread_name_prefix="crowdsim") as pool:
        # Report progress in cells of the table.
        for done, shares in enumerate(pool.map(shares_of, curvature), 1):
            table.append(shares)
            if progress is not None:
                for cell in range(1, len(clearances) + 1):
                    progress((done - 1) * len(clearances) + cell, len(curvature) * len(clearances))
    return Coverage(np.array(curvature), np.array(clearances), np.array(table))


def coverage_rows(coverage: Coverage) -> list[dict[str, Any]]:
    """Return a row for each turn: percentage of the trials followed, by clearance."""
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


def missing_turns(coverage: Coverage) -> list[str]:
    """Return a sentence for each kind of path (straight, left, right) that is never followed at the most clearance."""
    most = coverage.share[:, int(np.argmax(coverage.clearance))]
    kinds = (
        ("walking straight on", coverage.curvature == 0.0, "a straight walk of four steps or more"),
        ("turns to the left", coverage.curvature > 0.0, "walks that turn left by 45 and by 90 degrees"),
        ("turns to the right", coverage.curvature < 0.0, "walks that turn right by 45 and by 90 degrees"),
    )
    return [f"no motion follows {what}: add {how}" for what, rows, how in kinds if rows.any() and not most[rows].any()]


def _paths(bend: float, behavior: int) -> list[_Samples]:
    """Return paths that turn with the curvature ``bend`` [1/m], left positive, by each angle after each straight.

    They begin at the origin along x, with ``behavior`` planned everywhere; a curvature of 0 gives one straight path for
    each length.
    """
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
    """Return a matplotlib figure of the table for the motions ``name``, from red (no trial followed) to green (all)."""
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
