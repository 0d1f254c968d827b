"""Searches of many paths on one mesh, by any number of threads with the same results."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.navmesh import path_kernels
from crowdsim.navmesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths import Floats, Paths
from crowdsim.navmesh.region_kernels import REGION, find_regions
from crowdsim.navmesh.workspace import workspace

_BATCH = 256
"""Searches below which another thread costs more than it saves."""


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
        self._regions = np.empty(self._triangles, REGION)
        find_regions(mesh, self._regions)

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

        All arrays are C-contiguous. ``clearance`` of a point is for the words of an error. So far, "best" is searched
        as "fast" is.
        """
        count = len(starts)
        if workers is None:
            workers = min(_processors(), count // _BATCH)
        status, lengths = np.empty(count, np.int8), np.empty(count)
        offsets = np.zeros(count + 1, np.int64)

        def work(first: int, last: int) -> Floats:
            # The place for the kernel of optimality "best": the same arguments and results.
            with workspace(self._triangles) as scratch:
                part = slice(first, last)
                return path_kernels.plan_paths(
                    self._mesh, self._regions, scratch, starts[part], goals[part], radii[part], least[part],
                    status[part], lengths[part], offsets[first + 1 : last + 1],
                )  # fmt: skip

        if workers <= 1:
            points = work(0, count)
        else:
            ends: NDArray[np.int64] = np.linspace(0, count, workers + 1).astype(np.int64)
            with ThreadPoolExecutor(workers) as pool:
                points = np.concatenate(list(pool.map(work, ends[:-1].tolist(), ends[1:].tolist())))
        np.cumsum(offsets, out=offsets)
        return Paths(status, lengths, offsets, points, starts, goals, radii, clearance)
