"""Motion maps: for every node of the motion graph, the places to which motions lead that begin with it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.following.maps.map_kernels import (
    AHEAD_COLUMNS,
    BEHAVIOR,
    CELL,
    END_X,
    END_Y,
    IN_PLACE,
    LEVEL,
    WALKED,
    grow_maps,
)
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.arrays import GraphArrays

DEPTH = 4
REACH = 3.5
MAX_ENTRIES = 2500
"""Defaults of :meth:`MotionMaps.build`: largest number of edges of a branch, search cost [m], entries per map."""

_BATCHES = 16
_ROWS_AT_ONCE = 500_000
"""A build is cut into up to _BATCHES batches of nodes, or into more if they had room for more than _ROWS_AT_ONCE
entries: the units of work and of progress. Both are the same for any number of workers."""


class MapArrays(NamedTuple):
    """All maps one after the other, in the form that kernels read; entries of a map in the order of the search.

    N nodes, E entries, B behaviors.
    first: (N + 1,) int64; entries ``first[n]:first[n + 1]`` are the map of node n, the first of them is its root.
    key, order: (E,) int64 and int32, cells of each map in ascending order, and the entry in each, counted within the
    map.
    parent: (E,) int32, the entry before, counted within the map, -1 for the root.
    edge, node, level: (E,) int32, edge taken into the entry's node, that node, number of edges since the root.
    ahead: (E, AHEAD_COLUMNS) float32, in the order of ``key``: data for ranking an entry before it is laid down, see
    :mod:`crowdsim.following.maps.map_kernels`. Places are in the frame of the root's start.
    average: (N,) float64, mean length of a map's branches [m] (2012 paper, equation 2), each from the root's start to
    the start of an entry, blend offsets weighted.
    family: (N,) int32, equal for nodes with the same successors.
    ends_as: (N, B) bool, True if a node is of a behavior or has a successor of it.
    leads_to: (N,) int32, behavior of most successors; the least number of several, 0 without successors.
    late: (N,) float64, how much longer a node takes than its behavior does on average for the same distance [s].
    speeds: (B,) float64, speed at which each behavior walks [m/s], see :func:`_speeds`; infinite if it never does.
    outline_first: (N + 1,) int64, rows of ``outline`` for each node.
    outline: (S, 3) float64, x, y and arc length of points along each node's track, its end included, at most a cell
    apart [m].
    """

    first: NDArray[np.int64]
    key: NDArray[np.int64]
    order: NDArray[np.int32]
    parent: NDArray[np.int32]
    edge: NDArray[np.int32]
    node: NDArray[np.int32]
    level: NDArray[np.int32]
    ahead: NDArray[np.float32]
    average: NDArray[np.float64]
    family: NDArray[np.int32]
    ends_as: NDArray[np.bool_]
    leads_to: NDArray[np.int32]
    late: NDArray[np.float64]
    speeds: NDArray[np.float64]
    outline_first: NDArray[np.int64]
    outline: NDArray[np.float64]


@dataclass(frozen=True)
class MotionMaps:
    """Precomputed maps of one motion graph (2012 paper, section 4); made by :meth:`build`.

    Attributes
    ----------
    arrays : MapArrays
        The maps in the form that kernels read.

    Examples
    --------
    >>> maps = MotionMaps.build(load_behavior_set(["frontal"], [(0.0, 2.0)]).graph.arrays)
    >>> maps.depth
    4
    """

    arrays: MapArrays

    @property
    def entry_count(self) -> int:
        """Return the number of entries of all maps."""
        return len(self.arrays.key)

    @property
    def cell_count(self) -> int:
        """Return the number of occupied cells of all maps."""
        a = self.arrays
        return sum(len(np.unique(a.key[i:j])) for i, j in zip(a.first[:-1], a.first[1:], strict=True))

    @cached_property
    def depth(self) -> int:
        """Return the largest number of edges of a branch."""
        return max(int(self.arrays.level.max(initial=1)), 1)

    @cached_property
    def most_entries(self) -> int:
        """Return the number of entries of the largest map."""
        return int(np.diff(self.arrays.first).max(initial=1))

    @property
    def bytes(self) -> int:
        """Return the size of all arrays [bytes]."""
        return sum(column.nbytes for column in self.arrays)

    @classmethod
    def build(
        cls,
        graph: GraphArrays,
        depth: int = DEPTH,
        reach: float = REACH,
        max_entries: int = MAX_ENTRIES,
        progress: Callable[[int, int], None] | None = None,
        workers: int = 1,
    ) -> MotionMaps:
        """Grow the map of every node by Dijkstra's search over the search cost (2012 paper, algorithm 1).

        Parameters
        ----------
        graph : GraphArrays
            ``MotionGraph.arrays``.
        depth : int
            Largest number of edges of a branch. Deeper maps see farther and are larger and slower to query.
        reach : float
            Search cost (track length, turning, a little per node) up to which nodes are expanded [m].
        max_entries : int
            Largest number of entries of a map; all direct successors of a node always fit.
        progress : callable, optional
            Called with the number of nodes done and of all nodes.
        workers : int
            Number of threads; the result has the same bits for any number.

        Returns
        -------
        MotionMaps
            The maps.

        Raises
        ------
        MotionError
            If a number is out of range.
        """
        degree = int(np.diff(graph.edge_start).max(initial=0))
        if depth < 1 or not reach > 0.0 or max_entries < 1 or workers < 1:
            raise MotionError(
                "motion maps need depth >= 1, reach > 0, max_entries >= 1 and a worker, not"
                f" {depth}, {reach}, {max_entries} and {workers}"
            )
        nodes = len(graph.node_frames)
        capacity = max(max_entries, degree + 1)
        batch = max(min(_ROWS_AT_ONCE // capacity, -(-nodes // _BATCHES)), 1)
        parts = []
        with ThreadPoolExecutor(workers, thread_name_prefix="crowdsim") as pool:
            begins = range(0, nodes, batch)
            grown = [pool.submit(_grow, graph, i, min(i + batch, nodes), depth, float(reach), capacity) for i in begins]
            for i, part in zip(begins, grown, strict=True):
                parts.append(part.result())
                if progress is not None:
                    progress(min(i + batch, nodes), nodes)
        sizes, average, key, order, parent, edge, node, level, ahead = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        outline_first, outline = _outlines(graph)
        # Counts include the node itself, which ``leads_to`` takes off again.
        successors = _behavior_counts(graph)
        arrays = MapArrays(
            first=first,
            key=key,
            order=order,
            parent=parent,
            edge=edge,
            node=node,
            level=level,
            ahead=ahead,
            average=average,
            family=_families(graph),
            ends_as=successors > 0,
            leads_to=np.argmax(successors - np.eye(successors.shape[1])[graph.node_behavior], axis=1).astype(np.int32),
            late=_delays(graph),
            speeds=_speeds(graph),
            outline_first=outline_first,
            outline=outline,
        )
        return cls(arrays)


def _grow(
    graph: GraphArrays, begin: int, end: int, depth: int, reach: float, capacity: int
) -> tuple[NDArray[Any], ...]:
    """Return the maps of nodes ``begin`` to ``end`` (exclusive): sizes, averages, and columns of :class:`MapArrays`.

    Sizes are numbers of entries, averages mean lengths [m], both one for each map. The columns are key, order, parent,
    edge, node, level and ahead. Other arguments as of :func:`grow_maps`.
    """
    rows = (end - begin) * capacity
    first = np.empty(end - begin + 1, np.int64)
    key = np.empty(rows, np.int64)
    parent, edge, node, level = (np.empty(rows, np.int32) for _ in range(4))
    pose = np.empty((rows, 3), np.float32)
    length = np.empty(rows, np.float32)
    columns = (parent, edge, node, level)
    count = grow_maps(graph, begin, end, depth, reach, capacity, first, key, *columns, pose, length)
    sizes = np.diff(first)
    # Rows of each map in the order of their cells; ``order`` counts them within the map.
    ranks = np.concatenate([np.argsort(key[i:j], kind="stable") + i for i, j in pairwise(first.tolist())])
    order = (ranks - np.repeat(first[:-1], sizes)).astype(np.int32)
    average = np.add.reduceat(length[:count].astype(np.float64), first[:-1]) / sizes
    ahead = np.empty((count, AHEAD_COLUMNS), np.float32)
    nodes = node[ranks]
    ahead[:, [END_X, END_Y]] = compose(pose[ranks].astype(np.float64), graph.node_motion[nodes])[:, :2]
    ahead[:, WALKED] = length[ranks] + graph.node_length[nodes] - np.repeat(graph.node_length[begin:end], sizes)
    ahead[:, LEVEL] = level[ranks]
    ahead[:, BEHAVIOR] = graph.node_behavior[nodes]
    return sizes, average, key[ranks], order, *(column[:count].copy() for column in columns), ahead


def _families(graph: GraphArrays) -> NDArray[np.int32]:
    """Return a number for each node's set of successors, (N,), equal for equal sets, in order of first appearance."""
    numbers: dict[bytes, int] = {}
    family = np.empty(len(graph.node_frames), np.int32)
    for n in range(len(family)):
        successors = np.unique(graph.edge_target[graph.edge_start[n] : graph.edge_start[n + 1]]).tobytes()
        family[n] = numbers.setdefault(successors, len(numbers))
    return family


def _behavior_counts(graph: GraphArrays) -> NDArray[np.int32]:
    """Return how often each behavior occurs among a node and its successors, (N, B)."""
    nodes = len(graph.node_frames)
    table = np.zeros((nodes, int(graph.node_behavior.max(initial=0)) + 1), np.int32)
    table[np.arange(nodes), graph.node_behavior] = 1
    source = np.repeat(np.arange(nodes), np.diff(graph.edge_start))
    np.add.at(table, (source, graph.node_behavior[graph.edge_target]), 1)
    return table


def _delays(graph: GraphArrays) -> NDArray[np.float64]:
    """Return how much longer each node takes than its behavior does on average for the same distance, (N,) [s].

    It is 0 at least. The average of a behavior is that of all its nodes but turns in place, which are late themselves
    by nearly all of their time.
    """
    seconds = graph.node_frames / CAPTURE_RATE
    moved = hypot(graph.node_motion[:, 0], graph.node_motion[:, 1])
    moves = moved >= IN_PLACE
    behaviors = int(graph.node_behavior.max(initial=0)) + 1
    way, time = (np.bincount(graph.node_behavior[moves], column[moves], behaviors) for column in (moved, seconds))
    pace = np.divide(time, way, out=np.zeros(behaviors), where=way > 0.0)
    late: NDArray[np.float64] = np.maximum(seconds - moved * pace[graph.node_behavior], 0.0)
    return late


def _speeds(graph: GraphArrays) -> NDArray[np.float64]:
    """Return the speed at which each behavior walks, (B,) [m/s]: three quarters of its nodes that move are slower.

    Nodes that start, stop or turn are slower, and a few steps are quicker. It is infinite for a behavior without nodes
    that move.
    """
    moved = hypot(graph.node_motion[:, 0], graph.node_motion[:, 1])
    speed = moved * CAPTURE_RATE / graph.node_frames
    speeds = np.full(int(graph.node_behavior.max(initial=0)) + 1, np.inf)
    for behavior in range(len(speeds)):
        walking = np.sort(speed[(graph.node_behavior == behavior) & (moved >= IN_PLACE)])
        if len(walking):
            speeds[behavior] = walking[len(walking) * 3 // 4]
    return speeds


def _outlines(graph: GraphArrays) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return each node's track resampled by arc length; a track no longer than a cell gives only its end.

    Two arrays as ``outline_first`` and ``outline`` of :class:`MapArrays`.
    """
    outlines = []
    for track, frames in zip(graph.node_track, graph.node_frames, strict=True):
        points = graph.tracks[track : track + frames + 1, :2]
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        pieces = max(1, int(np.ceil(arc[-1] / CELL)))
        at = arc[-1] * np.arange(1, pieces + 1) / pieces
        outlines.append(np.column_stack([np.interp(at, arc, points[:, 0]), np.interp(at, arc, points[:, 1]), at]))
    first = np.concatenate([[0], np.cumsum([len(o) for o in outlines])]).astype(np.int64)
    return first, np.concatenate(outlines)
