"""Searches of many paths on one mesh, by any number of threads with the same results."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths import path_kernels
from crowdsim.navmesh.paths.batch import Batch
from crowdsim.navmesh.paths.paths import Floats, Paths
from crowdsim.navmesh.paths.region_kernels import REGION, find_regions
from crowdsim.navmesh.paths.workspace import Workspaces
from crowdsim.navmesh.shortest import shortest_kernels
from crowdsim.navmesh.shortest.tangent_graph import RadiusGraph

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
    workspaces
        Scratch memory of the searches, which outlives this.
    """

    def __init__(self, mesh: MeshArrays, workspaces: Workspaces) -> None:
        self._mesh = mesh
        self._workspaces = workspaces
        self._triangles = int(mesh.frame["triangles"][0])
        self._regions: NDArray[np.void] | None = None
        self._graphs: OrderedDict[float, RadiusGraph] = OrderedDict()
        self._lock = threading.Lock()

    def regions(self) -> NDArray[np.void]:
        """Regions (nt,) of :func:`crowdsim.navmesh.paths.region_kernels.find_regions`, found at the first call."""
        with self._lock:
            if self._regions is None:
                regions = np.empty(self._triangles, REGION)
                find_regions(self._mesh, regions)
                self._regions = regions
            return self._regions

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
        batch = Batch(starts, goals, radii, least, status, lengths, offsets[1:])
        find = self._find_best if optimality == "best" else self._find_fast
        points = find(batch, workers)
        np.cumsum(offsets, out=offsets)
        return Paths(status, lengths, offsets, points, starts, goals, radii, clearance)

    def _find_fast(self, batch: Batch, workers: int | None) -> Floats:
        regions = self.regions()

        def work(first: int, last: int) -> Floats:
            part = batch.part(first, last)
            with self._workspaces.lent(self._triangles) as scratch:
                points: Floats = path_kernels.plan_paths(self._mesh, regions, scratch, part)
            return points

        points = _in_parts(work, len(batch.starts), workers)
        tangled = np.flatnonzero(batch.status == path_kernels.TANGLED)
        if len(tangled) == 0:
            return points
        # One in many thousands; the shortest path is found another way, which takes longer.
        pieces, again = batch.pieces(points), batch.copy(tangled)
        batch.take(pieces, tangled, again, self._find_best(again, 1))
        for row in tangled[again.status == path_kernels.OK].tolist():  # fast paths are as long as their polylines
            batch.lengths[row] = hypot(*np.diff(pieces[row], axis=0).T).sum()
        return np.concatenate(pieces)

    def _find_best(self, batch: Batch, workers: int | None) -> Floats:
        distinct = np.unique(batch.radii)
        if len(distinct) == 0:
            return np.empty((0, 2))
        if len(distinct) > 1:  # a graph serves one radius
            pieces = [np.empty((0, 2))] * len(batch.radii)
            for radius in distinct:
                rows = np.flatnonzero(batch.radii == radius)
                own = batch.copy(rows)
                batch.take(pieces, rows, own, self._find_best(own, workers))
            return np.concatenate(pieces)
        graph = self.graph(float(batch.radii[0]), float(batch.least[0]))

        def work(first: int, last: int) -> Floats:
            part = batch.part(first, last)
            with graph.scratch() as scratch:
                points: Floats = shortest_kernels.shortest_paths(
                    self._mesh, graph.arrays, scratch, part, graph.asked, graph.disc
                )
            return points

        return _in_parts(work, len(batch.starts), workers)
