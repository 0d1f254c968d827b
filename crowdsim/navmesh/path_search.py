"""Searches of many paths on one mesh, by any number of threads with the same results."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.navmesh import path_kernels, shortest_kernels
from crowdsim.navmesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths import Floats, Paths
from crowdsim.navmesh.region_kernels import REGION, find_regions
from crowdsim.navmesh.tangent_graph import RadiusGraph
from crowdsim.navmesh.workspace import workspace

_BATCH = 256
"""Searches below which another thread costs more than it saves."""

_GRAPHS = 8
"""Radii whose tangent graphs are kept; the one used longest ago makes room."""


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _in_parts(work: Callable[[int, int], Floats], count: int, workers: int | None) -> Floats:
    """The points (k, 2) that ``work(first, last)`` gives for all of ``count`` searches, in their order."""
    workers = min(_processors(), count // _BATCH) if workers is None else min(workers, count)
    if workers <= 1:
        return work(0, count)
    ends: list[int] = np.linspace(0, count, workers + 1).astype(np.int64).tolist()
    with ThreadPoolExecutor(workers) as pool:
        return np.concatenate(list(pool.map(work, ends[:-1], ends[1:])))


class PathSearch:
    """What path searches on one mesh share. After an edit of the mesh, make a new one.

    Parameters
    ----------
    mesh
        The mesh; it must not change while this is used.
    """

    def __init__(self, mesh: MeshArrays) -> None:
        self._mesh = mesh
        self._triangles = int(mesh.frame["triangles"][0])
        self._regions: NDArray[np.void] | None = None
        self._graphs: OrderedDict[float, RadiusGraph] = OrderedDict()
        self._lock = threading.Lock()

    def graph(self, radius: float, least: float) -> RadiusGraph:
        """The tangent graph for ``radius``, made at the first call; ``least`` meters of clearance count as enough."""
        with self._lock:
            if radius not in self._graphs:
                self._graphs[radius] = RadiusGraph(self._mesh, radius, least, _processors())
            self._graphs.move_to_end(radius)
            while len(self._graphs) > _GRAPHS:
                self._graphs.popitem(last=False)
            return self._graphs[radius]

    def find(
        self,
        starts: Floats,
        goals: Floats,
        radii: Floats,
        least: Floats,
        optimality: str,
        workers: int | None,
        clearance: Callable[[ArrayLike], float],
    ) -> Paths:
        """Paths between ``starts`` and ``goals`` (n, 2) of ``radii`` (n,) that keep ``least`` (n,) of them.

        All arrays are C-contiguous. ``clearance`` of a point is for the words of an error.
        """
        count = len(starts)
        status, lengths = np.empty(count, np.int8), np.empty(count)
        offsets = np.zeros(count + 1, np.int64)
        find = self._find_best if optimality == "best" else self._find_fast
        points = find(starts, goals, radii, least, workers, status, lengths, offsets[1:])
        np.cumsum(offsets, out=offsets)
        return Paths(status, lengths, offsets, points, starts, goals, radii, clearance)

    def _find_fast(
        self,
        starts: Floats,
        goals: Floats,
        radii: Floats,
        least: Floats,
        workers: int | None,
        status: NDArray[np.int8],
        lengths: Floats,
        counts: NDArray[np.int64],
    ) -> Floats:
        with self._lock:
            if self._regions is None:
                self._regions = np.empty(self._triangles, REGION)
                find_regions(self._mesh, self._regions)

        def work(first: int, last: int) -> Floats:
            with workspace(self._triangles) as scratch:
                part = slice(first, last)
                return path_kernels.plan_paths(
                    self._mesh, self._regions, scratch, starts[part], goals[part], radii[part], least[part],
                    status[part], lengths[part], counts[part],
                )  # fmt: skip

        return _in_parts(work, len(starts), workers)

    def _find_best(
        self,
        starts: Floats,
        goals: Floats,
        radii: Floats,
        least: Floats,
        workers: int | None,
        status: NDArray[np.int8],
        lengths: Floats,
        counts: NDArray[np.int64],
    ) -> Floats:
        distinct = np.unique(radii)
        if len(distinct) > 1:
            return self._find_best_of_many(distinct, starts, goals, radii, least, workers, status, lengths, counts)
        if len(distinct) == 0:
            return np.empty((0, 2))
        graph = self.graph(float(radii[0]), float(least[0]))

        def work(first: int, last: int) -> Floats:
            with graph.scratch() as scratch:
                part = slice(first, last)
                return shortest_kernels.shortest_paths(
                    self._mesh, graph.arrays, scratch, starts[part], goals[part], graph.radius, graph.least,
                    graph.slack, status[part], lengths[part], counts[part],
                )  # fmt: skip

        return _in_parts(work, len(starts), workers)

    def _find_best_of_many(
        self,
        distinct: Floats,
        starts: Floats,
        goals: Floats,
        radii: Floats,
        least: Floats,
        workers: int | None,
        status: NDArray[np.int8],
        lengths: Floats,
        counts: NDArray[np.int64],
    ) -> Floats:
        """One radius after the other, as a graph serves one; the points in the order of the searches again."""
        pieces: list[Floats] = [np.empty((0, 2))] * len(starts)
        for radius in distinct:
            rows = np.flatnonzero(radii == radius)
            own_status, own_lengths, own_counts = status[rows], lengths[rows], counts[rows]
            points = self._find_best(
                starts[rows], goals[rows], radii[rows], least[rows], workers, own_status, own_lengths, own_counts
            )
            status[rows], lengths[rows], counts[rows] = own_status, own_lengths, own_counts
            for row, piece in zip(rows.tolist(), np.split(points, np.cumsum(own_counts)[:-1]), strict=True):
                pieces[row] = piece
        return np.concatenate(pieces)
