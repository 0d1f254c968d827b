"""Moves: short motions from a stand to a stand, by which a standing agent can give way at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.track_kernels import next_origin, node_end

MOVE_NODES = 6
"""Largest number of nodes of a move."""

MOVE_SECONDS = 4.5
"""Longest duration of a move [s]: a turn about and a long step."""

LEAST_MOVE = 0.15
"""Shortest length of a move that makes room for others [m]; shorter ones only turn."""

FARTHEST_MOVE = 1.3
"""Largest length of a move [m]."""

# Of the moves from one idle node that end in the same square of side _CELL [m], with headings in the same interval of
# length _TURNED [rad], the quickest is kept.
_CELL = 0.15
_TURNED = 0.8
_NOTABLE_TURN = 0.2  # an edge with a smaller range of extra rotation is not varied; a smaller turn counts as none [rad]
_NOTABLE_STEP = 0.3  # shortest step behind a turn [m]


class Moves(NamedTuple):
    """M moves, those from the same idle node one after the other, the quickest first."""

    begin: NDArray[np.int32]
    """(N + 1,) int32: moves ``begin[n]:begin[n + 1]`` set out from node n; none if it is not idle."""
    lengths: NDArray[np.int32]
    """(M,) int32: number of nodes of each."""
    edges: NDArray[np.int32]
    """(M, MOVE_NODES) int32: edges of the motion graph to these nodes, -1 behind the last."""
    twists: NDArray[np.float64]
    """(M, MOVE_NODES) extra rotation at each edge [rad], 0 behind the last."""
    shift: NDArray[np.float64]
    """(M, 3) end relative to the end of the idle node: x, y [m], heading [rad]."""
    frames: NDArray[np.int32]
    """(M,) int32: duration in frames."""


class _Move(NamedTuple):
    """A move under construction: its edges with their extra rotations [rad], last node, and duration [frames].

    ``end`` is its end relative to the end of the idle node (x, y [m], heading [rad]). Without edges it is the stand in
    the idle node, which is ``last`` then.
    """

    edges: tuple[int, ...]
    twists: tuple[float, ...]
    end: tuple[float, float, float]
    last: int
    frames: int

    @property
    def length(self) -> float:
        """Return the distance from start to end [m]."""
        return float(hypot(self.end[0], self.end[1]))


def moves_of(graph: GraphArrays) -> Moves:
    """Find all moves of a motion graph, by the idle node from which they set out.

    A step is one node that ends standing, or one node and the stop behind it. A move is a step; two steps with the same
    last node; or a turn and a step behind it. If the body holds its arms in, a node that lets them go may come first.
    Moves end LEAST_MOVE to FARTHEST_MOVE away; of those that end in nearly the same pose, only the quickest is
    returned. The clips decide which moves there are: without side steps, these are turns with steps behind them.
    """
    rows: list[_Move] = []
    begin = np.zeros(len(graph.node_frames) + 1, np.int32)
    for node in range(len(graph.node_frames)):
        if graph.node_idle[node]:
            rows += _moves_from(graph, node)
        begin[node + 1] = len(rows)
    edges = np.full((len(rows), MOVE_NODES), NONE, np.int32)
    twists = np.zeros((len(rows), MOVE_NODES))
    for row, move in enumerate(rows):
        edges[row, : len(move.edges)] = move.edges
        twists[row, : len(move.edges)] = move.twists
    return Moves(
        begin=begin,
        lengths=np.array([len(move.edges) for move in rows], np.int32),
        edges=edges,
        twists=twists,
        shift=np.array([move.end for move in rows], np.float64).reshape(-1, 3),
        frames=np.array([move.frames for move in rows], np.int32),
    )


def _moves_from(graph: GraphArrays, idle: int) -> list[_Move]:
    """Return the moves from node ``idle``, the quickest of each cell of end poses, in the order of duration."""
    start = _Move((), (), (0.0, 0.0, 0.0), idle, 0)
    steps = _steps(graph, start, twisted=True)
    # An agent with its arms held in may have to let them go first, which is a step in place: moves may go on behind it
    # as if they began there.
    for first in list(steps):
        if not any(first.twists) and first.length < LEAST_MOVE and abs(first.end[2]) < _NOTABLE_TURN:
            steps += _steps(graph, first, twisted=True)
    found = list(steps)
    for first in steps:
        # Only steps without extra rotation are continued: that leaves few combinations.
        if any(first.twists):
            continue
        # A second step. After a turn, any step that is long enough; after a step, one with the same last node: the same
        # step once more, or another one with the same stop.
        turns = first.length < LEAST_MOVE
        for move in _steps(graph, first, twisted=False):
            further = float(hypot(move.end[0] - first.end[0], move.end[1] - first.end[1]))
            if further > _NOTABLE_STEP if turns else move.last == first.last:
                found.append(move)
    # Edges and rotations decide between moves of equal duration, so that the order is always the same.
    best: dict[tuple[int, ...], _Move] = {}
    for move in sorted(found, key=lambda m: (m.frames, m.edges, m.twists)):
        if LEAST_MOVE <= move.length <= FARTHEST_MOVE:
            cell = (round(move.end[0] / _CELL), round(move.end[1] / _CELL), round(move.end[2] / _TURNED))
            best.setdefault(cell, move)
    return list(best.values())


def _steps(graph: GraphArrays, before: _Move, twisted: bool) -> list[_Move]:
    """Return all continuations of ``before`` by one step that ends where an idle node may follow.

    A step is one node, and the stop behind it if the node does not end standing. ``twisted``: return each step also
    with the least and the largest extra rotation of the edge to its first node, if these are notably apart.
    """
    found = []
    for edge in range(graph.edge_start[before.last], graph.edge_start[before.last + 1]):
        if graph.node_idle[graph.edge_target[edge]]:
            continue
        low, high = float(graph.edge_low[edge]), float(graph.edge_high[edge])
        for twist in (0.0, low, high) if twisted and high - low > _NOTABLE_TURN else (0.0,):
            move: _Move | None = _with(graph, before, edge, twist)
            while move is not None and graph.stop_edge[move.last] != NONE:
                move = _with(graph, move, int(graph.stop_edge[move.last]), 0.0)
            if move is not None and _may_idle(graph, move.last):
                found.append(move)
    return found


def _with(graph: GraphArrays, move: _Move, edge: int, twist: float) -> _Move | None:
    """Return a move continued along ``edge``, with an extra rotation ``twist`` [rad], by the node that it leads to.

    Return None if the move would have more than MOVE_NODES nodes or take longer than MOVE_SECONDS.
    """
    node = int(graph.edge_target[edge])
    frames = move.frames + int(graph.node_frames[node])
    if len(move.edges) == MOVE_NODES or frames > MOVE_SECONDS * CAPTURE_RATE:
        return None
    x, y, heading = node_end(graph, node, *next_origin(graph, edge, twist, *move.end))
    end = float(x), float(y), float(wrap_angle(heading))
    return _Move((*move.edges, edge), (*move.twists, twist), end, node, frames)


def _may_idle(graph: GraphArrays, node: int) -> bool:
    """Return True if a node ends standing and an idle node may follow."""
    after = graph.edge_target[graph.edge_start[node] : graph.edge_start[node + 1]]
    return bool(graph.node_ends_standing[node] and graph.node_idle[after].any())
