"""Searches of many paths on one mesh, by any number of threads with the same results."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths import component_kernels, path_kernels
from crowdsim.navmesh.paths.batch import Batch
from crowdsim.navmesh.paths.paths import Floats, Paths
from crowdsim.navmesh.paths.reachability import ComponentCache
from crowdsim.navmesh.paths.region_kernels import REGION, find_regions
from crowdsim.navmesh.paths.workspace import Workspaces
from crowdsim.navmesh.shortest import shortest_kernels
from crowdsim.navmesh.shortest.tangent_graph import RadiusGraph
from crowdsim.processors import usable_processors

_BATCH = 256
"""Number of searches below which another thread costs more than it saves."""

_GRAPHS = 8
"""Number of radii whose tangent graphs are kept; the one used longest ago makes room."""


FAR = 1.05
"""Fast paths longer than this multiple of the straight line are looked for from the goal back, too.

A search that takes a wrong turn one way hardly ever does so the other way as well. No path is shorter than the straight
line, so none that is 5 % too long is left out; in the open few are looked for twice.
"""

GAIN = 0.99
"""The path found backwards is taken if it is shorter than this multiple of the other one."""


def _in_parts(work: Callable[[int, int], Floats], count: int, workers: int | None) -> Floats:
    """Return the points (k, 2) that ``work(first, last)`` finds for all of ``count`` searches, in their order.

    ``workers`` is the number of threads; None for as many as pay.
    """
    workers = min(usable_processors(), count // _BATCH) if workers is None else min(workers, count)
    if workers <= 1:
        return work(0, count)
    ends: list[int] = np.linspace(0, count, workers + 1).astype(np.int64).tolist()
    with ThreadPoolExecutor(workers) as pool:
        return np.concatenate(list(pool.map(work, ends[:-1], ends[1:])))


class PathSearch:
    """Caches that path searches on one mesh share. After an edit of the mesh, make a new one.

    Parameters
    ----------
    mesh
        The mesh; it must not change while this is used.
    workspaces
        Scratch memory of the searches, which is kept longer than this.
    """

    def __init__(self, mesh: MeshArrays, workspaces: Workspaces) -> None:
        self._mesh = mesh
        self._workspaces = workspaces
        self._triangles = int(mesh.frame["triangles"][0])
        self._regions: NDArray[np.void] | None = None
        self._graphs: OrderedDict[float, RadiusGraph] = OrderedDict()
        self._components = ComponentCache()
        self._lock = threading.Lock()

    def regions(self) -> NDArray[np.void]:
        """Return the regions (nt,), :data:`crowdsim.navmesh.paths.region_kernels.REGION`, found at the first call."""
        with self._lock:
            if self._regions is None:
                regions = np.empty(self._triangles, REGION)
                find_regions(self._mesh, regions)
                self._regions = regions
            return self._regions

    def graph(self, radius: float, least: float) -> RadiusGraph:
        """Return the tangent graph for ``radius`` [m], made if it is not among those kept, of the radii used last.

        A clearance of ``least`` counts as enough [m].
        """
        with self._lock:
            if radius not in self._graphs:
                self._graphs[radius] = RadiusGraph(self._mesh, radius, least, usable_processors())
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
        """Find paths from ``starts`` to ``goals`` (n, 2) [m] for ``radii`` (n,) [m].

        ``least`` (n,) is the clearance that counts as enough: the radius less the tolerance, the same for equal radii
        [m].

        All arrays are C-contiguous. ``optimality`` is "best" or "fast", ``workers`` the number of threads, None for as
        many as pay. ``clearance`` returns the clearance [m] of a point (x, y), for error messages.
        """
        count = len(starts)
        status, lengths = np.empty(count, np.int8), np.empty(count)
        # The batch fills in the number of points of each path; added up, they are the ends of paths among the points.
        offsets = np.zeros(count + 1, np.int64)
        batch = Batch(starts, goals, radii, least, status, lengths, offsets[1:])
        find = self._find_best if optimality == "best" else self._find_fast
        points = self._find_joined(batch, workers, find)
        np.cumsum(offsets, out=offsets)
        return Paths(status, lengths, offsets, points, starts, goals, radii, clearance)

    def components(self, points: Floats, radius: float, least: float) -> NDArray[np.int64]:
        """Return the component (n,) of a disc of ``radius`` [m] at each of ``points`` (n, 2) [m], -1 if not free.

        A clearance of ``least`` counts as enough [m].
        """
        # Not even a point gets through without a gap: corners at closed sides have the clearance 0, which a width of 0
        # would pass. A quarter of a cell is far below the tolerance.
        least = max(least, 0.25 * float(self._mesh.frame["cell"][0]))
        labels, count = self._components.labels(self._mesh, 2.0 * least)
        out = np.empty(len(points), np.int64)
        component_kernels.components(self._mesh, labels, count, points, radius, least, out)
        return out

    def are_apart(self, starts: Floats, goals: Floats, radius: float, least: float) -> NDArray[np.bool_]:
        """Return (n,) True if the disc is free at a start and at its goal, but no way leads from one to the other.

        Arguments are those of :meth:`find`, for one radius. The labels of components show this at once; a search would
        have to look everywhere.
        """
        one, other = self.components(np.concatenate([starts, goals]), radius, least).reshape(2, -1)
        apart: NDArray[np.bool_] = (one != other) & (one >= 0) & (other >= 0)
        return apart

    def _find_joined(self, batch: Batch, workers: int | None, find: Callable[[Batch, int | None], Floats]) -> Floats:
        """Let ``find`` search the queries of the batch that may have a path; return the points (k, 2) [m] of all.

        The results of the batch are filled in, also of queries without a path. ``find(batch, workers)`` fills in the
        results of a batch and returns its points, as :meth:`_find_fast` does.
        """
        apart = np.zeros(len(batch.radii), np.bool_)
        for radius in np.unique(batch.radii).tolist():
            rows = np.flatnonzero(batch.radii == radius)
            apart[rows] = self.are_apart(batch.starts[rows], batch.goals[rows], radius, float(batch.least[rows[0]]))
        if not apart.any():
            return find(batch, workers)
        batch.status[apart], batch.lengths[apart], batch.counts[apart] = path_kernels.NO_PASSAGE, np.nan, 0
        rest = np.flatnonzero(~apart)
        pieces = [np.empty((0, 2))] * len(apart)
        if len(rest):
            own = batch.copy(rest)
            batch.take(pieces, rest, own, find(own, workers))
        return np.concatenate(pieces)

    def _find_fast(self, batch: Batch, workers: int | None) -> Floats:
        """Find fast paths and fill in the results of the batch; return the points (k, 2) of all."""
        points = self._search(batch, workers)
        tangled = np.flatnonzero(batch.status == path_kernels.TANGLED)
        beeline = hypot(*(batch.goals - batch.starts).T)
        far = np.flatnonzero((batch.status == path_kernels.OK) & (batch.lengths > FAR * beeline))
        if len(tangled) == 0 and len(far) == 0:
            return points
        pieces = batch.pieces(points)
        if len(tangled) > 0:
            # One in many thousands; the shortest path is found another way, which takes longer.
            again = batch.copy(tangled)
            batch.take(pieces, tangled, again, self._find_best(again, 1))
            for row in tangled[again.status == path_kernels.OK].tolist():  # fast paths are as long as their polylines
                batch.lengths[row] = hypot(*np.diff(pieces[row], axis=0).T).sum()
        if len(far) > 0:
            again = batch.copy(far)
            # Results go into the arrays of ``again``, which are copies.
            back = again._replace(starts=again.goals, goals=again.starts)
            found = back.pieces(self._search(back, workers))
            shorter = (back.status == path_kernels.OK) & (back.lengths < GAIN * batch.lengths[far])
            for i in np.flatnonzero(shorter).tolist():
                pieces[far[i]] = found[i][::-1]
                batch.lengths[far[i]], batch.counts[far[i]] = back.lengths[i], back.counts[i]
        return np.concatenate(pieces)

    def _search(self, batch: Batch, workers: int | None) -> Floats:
        """Find one fast path per query and fill in the results; return the points (k, 2). Some may be TANGLED."""
        regions = self.regions()

        def work(first: int, last: int) -> Floats:
            """Search the queries from ``first`` up to ``last`` (exclusive); return their points (k, 2) [m]."""
            part = batch.part(first, last)
            with self._workspaces.lent(self._triangles) as scratch:
                points: Floats = path_kernels.plan_paths(self._mesh, regions, scratch, part)
            return points

        return _in_parts(work, len(batch.starts), workers)

    def _find_best(self, batch: Batch, workers: int | None) -> Floats:
        """Find shortest paths and fill in the results of the batch; return the points (k, 2) of all."""
        distinct = np.unique(batch.radii)
        if len(distinct) == 0:
            return np.empty((0, 2))
        # A graph serves one radius.
        if len(distinct) > 1:
            pieces = [np.empty((0, 2))] * len(batch.radii)
            for radius in distinct:
                rows = np.flatnonzero(batch.radii == radius)
                own = batch.copy(rows)
                batch.take(pieces, rows, own, self._find_best(own, workers))
            return np.concatenate(pieces)
        graph = self.graph(float(batch.radii[0]), float(batch.least[0]))

        def work(first: int, last: int) -> Floats:
            """Search the queries from ``first`` up to ``last`` (exclusive); return their points (k, 2) [m]."""
            part = batch.part(first, last)
            with graph.scratch() as scratch:
                points: Floats = shortest_kernels.shortest_paths(
                    self._mesh, graph.arrays, scratch, part, graph.asked, graph.disc
                )
            return points

        return _in_parts(work, len(batch.starts), workers)
