"""Slow twin of giving way: tries the moves of one agent after another, and backtracks one by one if none fits.

The kernels jump back over agents that are not the cause, and keep everything in arrays. Both find the same moves, or
none, if the kernels have enough budget. Whether two timelines meet is decided by `pair_meets`, which has its own twin.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.giving_way.asking import Standing
from crowdsim.crowd.giving_way.give_way_kernels import (
    DETOUR_COST,
    IN_WAY_COST,
    OFF_WALLS,
    OTHER_WAY_COST,
    PASSAGE_COST,
)
from crowdsim.crowd.giving_way.moves import Moves
from crowdsim.crowd.state.body_kernels import BODY_ROOM
from crowdsim.crowd.state.components import CORE, QUARTERS, RADIUS, REST, SAMPLE, SLOT_FRAMES
from crowdsim.crowd.state.reservation_kernels import pair_meets
from crowdsim.crowd.state.timelines import Obstacles, Timelines
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, next_origin
from tests.reference.crowd import FOREVER, off_way, write_bends
from tests.reference.mixed_crowd import gap_to_piece

_STRIDE = 6  # frames between two poses that are tested for walls
_ROUNDING = 1e-9  # meters

Timeline = tuple[np.ndarray, int, int]
"""Samples (K, 13), slot of the first sample, slot from which on the row is gone."""


class Scene(NamedTuple):
    """The given situation: standing agents on a floor of one layer, and the frame (``clock``) of the request."""

    graph: GraphArrays
    moves: Moves
    floor: shapely.Polygon
    obstacles: Obstacles
    everyone: Timelines
    standing: Standing
    clock: int

    def timeline(self, row: int) -> Timeline:
        """Return the timeline that a row has reserved at first."""
        timelines = self.everyone
        return timelines.timeline[row], int(timelines.timeline_start[row]), int(timelines.gone_slot[row])


def give_way(scene: Scene, me: int, want: np.ndarray, gone: int) -> list[tuple[int, int]] | None:
    """Return rows and their moves, in order, after which ``me`` can reserve ``want``; None if there are none."""
    mine = want, scene.clock // SLOT_FRAMES, gone
    asked = _asked(scene, me, me, mine, {}, [])
    return None if asked is None else _let_move(scene, me, asked, {me: mine}, {}, strict=False)


def leave_way(scene: Scene, me: int, row: int) -> list[tuple[int, int]] | None:
    """Return rows and their moves by which ``row`` leaves the way of ``me``; None if there are none."""
    return _let_move(scene, me, [row], {}, {}, strict=True)


def _let_move(scene, me, trail, owned, moved, strict):
    """Find moves for the first row of ``trail`` without one, and all rows behind it, by backtracking.

    ``owned`` holds new timelines by row, ``moved`` the moves chosen so far.
    """
    if len(moved) == len(trail):
        return list(moved.items())
    row = trail[len(moved)]
    for move in moves_in_order(scene, me, row, strict and not moved):
        timeline, poses, ways = play(scene, row, move)
        asked = _asked(scene, me, row, (timeline, scene.clock // SLOT_FRAMES, FOREVER), owned, trail)
        if asked is None or not is_clear(scene, row, poses, ways) or meets_body(scene, timeline):
            continue
        its = {row: (timeline, scene.clock // SLOT_FRAMES, FOREVER)}
        found = _let_move(scene, me, trail + asked, owned | its, moved | {row: move}, strict)
        if found is not None:
            return found
    return None


def _asked(scene, me, row, timeline, owned, trail):
    """Return the rows that a timeline of ``row`` newly requires to move, ascending; None if one of them cannot."""
    asked = []
    for other in range(len(scene.everyone.timeline)):
        radii = float(scene.everyone.body_radius[row] + scene.everyone.body_radius[other])
        its = owned.get(other, scene.timeline(other))
        if other == row or not pair_meets(*timeline, *its, scene.clock // SLOT_FRAMES, radii, True):
            continue
        # A row that has moved already, the requester, or a row that may not move or has priority cannot be asked.
        if other in owned:
            return None
        if other in trail:
            continue
        if other == me or not scene.standing.may_move[other]:
            return None
        if scene.standing.rank[other] <= scene.standing.rank[me]:
            return None
        asked.append(other)
    return asked


def moves_in_order(scene: Scene, me: int, row: int, strict: bool) -> list[int]:
    """Return the moves of a row by cost; with ``strict`` only those that end outside of the way of ``me``."""
    moves, obstacles, standing = scene.moves, scene.obstacles, scene.standing
    node = standing.node[row]
    start = compose(standing.origin[row], scene.graph.node_motion[node])
    goal = standing.goal[row]
    width = scene.everyone.body_radius[me] + scene.everyone.body_radius[row]
    costs = []
    for move in range(moves.begin[node], moves.begin[node + 1]):
        end = compose(start, moves.shift[move])[:2]
        off = _off(standing.way[me], end)
        if strict and off < width:
            continue
        cost = moves.frames[move] / CAPTURE_RATE
        cost += DETOUR_COST * (np.hypot(*(goal - end)) - np.hypot(*(goal - start[:2])))
        cost += IN_WAY_COST * max(width - off, 0.0)
        if any(_off(line.reshape(2, 2), end) < obstacles.off_passages for line in obstacles.passages):
            cost += PASSAGE_COST
        cost += sum(OTHER_WAY_COST * max(width - _off(other, end), 0.0) for other in obstacles.ways)
        costs.append((cost, move))
    return [move for _, move in sorted(costs)]


def _off(way: np.ndarray, place: np.ndarray) -> float:
    """Return the distance of a place to a way; infinite if there is no way."""
    return np.inf if np.isnan(way).any() else off_way(way, place)[0]


def play(scene: Scene, row: int, move: int) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
    """Return the timeline of a move, the poses along it that are tested for walls, the last one first, and the ways.

    Each way leads along one node, that of the first from the first of the tested poses on.
    """
    graph, moves, clock = scene.graph, scene.moves, scene.clock
    node = int(scene.standing.node[row])
    end = compose(scene.standing.origin[row], graph.node_motion[node])
    track: list[np.ndarray] = [end]
    poses: list[np.ndarray] = []
    ways: list[np.ndarray] = []
    for k in range(moves.lengths[move]):
        edge = int(moves.edges[move, k])
        node = int(graph.edge_target[edge])
        origin = np.array(next_origin(graph, np.int64(edge), moves.twists[move, k], *end))
        offset = end - origin
        offset[2] = wrap_angle(offset[2])
        count = int(graph.node_frames[node])
        played = []
        for frame in range(count + 1):
            u = min(frame / BLEND_FRAMES, 1.0)
            pose = compose(origin, graph.tracks[graph.node_track[node] + frame])
            played.append(pose + (1.0 - u * u * (3.0 - 2.0 * u)) * offset)
        poses = played[count::-_STRIDE] + poses
        ways.append(np.array(played[0 if k else count % _STRIDE :])[:, :2])
        track += played[1:]
        end = compose(origin, graph.node_motion[node])
    radius, half = scene.obstacles.breadths[0]
    timeline = np.zeros((scene.everyone.timeline.shape[1], SAMPLE))
    for k, sample in enumerate(timeline):
        frame = max((clock // SLOT_FRAMES + k) * SLOT_FRAMES - clock, 0)
        x, y, heading = track[min(frame, len(track) - 1)]
        sample[:2], sample[RADIUS] = (x, y), radius
        sample[CORE], sample[CORE + 1] = -half * np.sin(heading), half * np.cos(heading)
    # The clock may lie within a slot: shift the first sample so that interpolation at the clock gives the row's place.
    share = clock % SLOT_FRAMES / SLOT_FRAMES
    timeline[0, :2] = (timeline[0, :2] - share * timeline[1, :2]) / (1.0 - share)
    write_bends(timeline, clock, half, lambda frame: track[min(frame, len(track) - 1)])
    return timeline, poses, ways


def is_clear(
    scene: Scene, row: int, poses: list[np.ndarray], ways: list[np.ndarray], off_walls: float = OFF_WALLS
) -> bool:
    """Return whether poses, the last one first, keep the widest clearance, and at the end more if the row had more.

    So do the ways between them.
    """
    own = float(scene.obstacles.radii.max())

    def clearance(pose: np.ndarray) -> float:
        place = shapely.Point(pose[:2]) if pose.ndim == 1 else shapely.LineString(pose)
        return scene.floor.exterior.distance(place) if scene.floor.contains(place) else 0.0

    before = min(clearance(scene.standing.origin[row]), own + off_walls)
    at_end = max(own, before - _ROUNDING)
    return clearance(poses[0]) >= at_end and all(clearance(pose) >= own for pose in (*poses, *ways))


def meets_body(scene: Scene, timeline: np.ndarray) -> bool:
    """Return whether a timeline comes too near to a steered body."""
    for here, there in zip(timeline, [*timeline[1:], timeline[-1]], strict=True):
        radius = max(np.hypot(*each[CORE : CORE + 2]) for each in (here, there)) + max(here[RADIUS], there[RADIUS])
        shares = np.linspace(0.0, 1.0, 5)[:, None]
        bent = (1.0 - shares) * here[:2] + shares * there[:2]
        bent[1:-1] += here[QUARTERS:REST].reshape(3, 2)
        pieces = [np.array([*here[:2], *there[:2], radius + BODY_ROOM])]
        pieces += [np.array([*begin, *end, radius + here[REST]]) for begin, end in pairwise(bent)]
        if any(gap_to_piece(body, piece) < 0.0 for body in scene.obstacles.bodies.rows for piece in pieces):
            return True
    return False
