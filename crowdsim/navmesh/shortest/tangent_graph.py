"""The tangent graph of a mesh for one radius, made on all processors, and the scratch memory of searches in it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.shortest import arc_kernels, tangent_graph_kernels
from crowdsim.navmesh.shortest.shortest_scratch import Disc, ShortestScratch, shortest_scratch
from crowdsim.navmesh.shortest.tangent_graph_arrays import TangentGraph
from crowdsim.navmesh.shortest.view_arrays import empty_view

_TOLERANCE_CELLS = 4.0
"""Grid cells by which a view sees past vertices, to the side.

Inner vertices of a wall are rounded to the grid: one that stands out must not hide what lies along the wall.
"""


_ROUNDING_CELLS = 1.0 / 64.0
"""Grid cells by which arcs exceed the clearance that counts as enough: far more than rounding, far less than a cell."""


class RadiusGraph:
    """All arcs around corners, and the tangents between them, that a disc of one radius can follow.

    The disc is as small as the tolerance allows. So a gap exactly as wide as a disc of the requested radius leaves it
    room, more than corners can lose by moving to the grid. A disc of exactly that radius would be stuck between arcs
    that touch or miss each other by rounding, although the tolerance lets it pass.

    ``asked`` is the requested radius [m], 0 for a point; ``disc`` is the Disc of the graph, ``arrays`` its
    TangentGraph.

    Parameters
    ----------
    mesh
        The mesh; it must not change while the graph is used.
    radius, least
        Radius of the disc, and the clearance that counts as enough for it [m]. If ``least`` is not positive, the disc
        is a point.
    workers
        Threads that make the graph; it is the same for any number.
    """

    def __init__(self, mesh: MeshArrays, radius: float, least: float, workers: int) -> None:
        cell = float(mesh.frame["cell"][0])
        # The requested radius, and the disc of the graph, which is as small as the tolerance allows.
        self.asked, self.disc = radius, Disc(least + _ROUNDING_CELLS * cell, least, _TOLERANCE_CELLS * cell)
        if least <= 0.0:
            self.asked, self.disc = 0.0, Disc(0.0, 0.0, 0.0)
        self._vertices, self._triangles = len(mesh.vertices), int(mesh.frame["triangles"][0])
        self._idle: list[ShortestScratch] = []
        self._lock = threading.Lock()
        arcs, begin = arc_kernels.find_arcs(mesh, self.disc.radius, self.disc.least)

        def tangents(first: int, last: int) -> np.ndarray:
            """Return the tangents (k,), records _TANGENT, from nodes ``first`` up to ``last`` (exclusive)."""
            view = empty_view(self._vertices, self._triangles)
            part: np.ndarray = tangent_graph_kernels.find_tangents(mesh, arcs, begin, *self.disc, view, first, last)
            return part

        # Each thread looks from a share of the nodes, of which an arc has two.
        ends = np.linspace(0, 2 * len(arcs), max(workers, 1) + 1).astype(np.int64).tolist()
        if workers <= 1:
            found = tangents(0, 2 * len(arcs))
        else:
            with ThreadPoolExecutor(workers) as pool:
                found = np.concatenate(list(pool.map(tangents, ends[:-1], ends[1:])))
        nodes, links = tangent_graph_kernels.link_arcs(arcs, found, self.disc.radius)
        self.arrays = TangentGraph(arcs, begin, nodes, links)

    @contextmanager
    def scratch(self) -> Iterator[ShortestScratch]:
        """Yield scratch memory to one thread; it is kept for the next search, but dropped after an error."""
        with self._lock:
            found = self._idle.pop() if self._idle else None
        if found is None:
            found = shortest_scratch(len(self.arrays.nodes), self._vertices, self._triangles)
        yield found
        with self._lock:
            self._idle.append(found)
