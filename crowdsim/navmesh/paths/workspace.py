"""Scratch memory of path searches: as large as a mesh, and used again from query to query without being cleared."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW

LABEL = np.dtype(
    [(name, np.float64) for name in ("rx", "ry", "spent", "lx", "ly", "px", "py")]
    + [(name, np.int32) for name in ("h", "before", "corner", "ends")],
    align=True,
)
"""Ways across one side: straight from a root across the part of the side that the root sees.

rx, ry: the root, the last place where the way bends [m]. spent: length of the way up to it [m]. lx, ly, px, py: left
and right end of the part of side h [m]. corner: twice the half-edge that the root is an end of, plus 1 for its right
end; -1 for the start. before: the label whose end became the root, or -1. ends: 1 if the left end is also the left end
of the cut side, so that the way may bend there; plus 2 if the right end is also its right end. (Searches for shortest
paths have another LABEL, see :mod:`crowdsim.navmesh.shortest.shortest_scratch`.)
"""

REACHED = np.dtype([("spent", np.float64), ("stamp", np.int64)], align=True)
"""Least length [m] of a way up to an end of a side that became a root, in the query number ``stamp``."""

WAYPOINT = np.dtype([("x", np.float64), ("y", np.float64), ("rest", np.float64), ("stamp", np.int64)], align=True)
"""Where the way leaves a region towards the goal, and the length of the rest [m], in the query number ``stamp``."""


class Workspace(NamedTuple):
    """C-contiguous scratch arrays with room for a mesh of nt triangles; only the stamp outlives a query."""

    labels: NDArray[Any]
    """(6 nt,) records :data:`LABEL`."""
    heap: NDArray[Any]
    """(6 nt,) records HEAP_ROW of :mod:`crowdsim.navmesh.mesh.heap_kernels`."""
    reached: NDArray[Any]
    """(6 nt,) records :data:`REACHED`: row 2 h is for the left end of half-edge h, row 2 h + 1 for its right end."""
    waypoints: NDArray[Any]
    """(nt,) records :data:`WAYPOINT` of regions, at their top triangles."""
    stamp: NDArray[np.int64]
    """(1,) number of the last query."""


def empty_workspace(triangles: int) -> Workspace:
    """Return a workspace for meshes of up to ``triangles``; the system provides memory only where it is written to."""
    return Workspace(
        np.empty(6 * triangles, LABEL),
        np.empty(6 * triangles, HEAP_ROW),
        np.zeros(6 * triangles, REACHED),
        np.zeros(triangles, WAYPOINT),
        np.zeros(1, np.int64),
    )


class Workspaces:
    """Workspaces of searches on a mesh and its copies; each serves one thread at a time, and is kept for the next."""

    def __init__(self) -> None:
        self._idle: list[Workspace] = []
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[Workspaces], tuple[()]]:
        """Copy and pickle without scratch memory: a copy starts with none."""
        return Workspaces, ()

    @contextmanager
    def lent(self, triangles: int) -> Iterator[Workspace]:
        """Yield a workspace for a mesh of so many ``triangles`` to one thread.

        It is kept for the next search afterwards, but dropped after an error.
        """
        with self._lock:
            fit = next((k for k, idle in enumerate(self._idle) if len(idle.waypoints) >= triangles), None)
            found = None if fit is None else self._idle.pop(fit)
            if found is None:
                # Drop the others: they are too small for the mesh as it is now.
                self._idle.clear()
        if found is None:
            # Room for a power of two, so that a mesh that grows a little still fits.
            found = empty_workspace(1 << max(triangles - 1, 1).bit_length())
        yield found
        with self._lock:
            self._idle.append(found)
