"""Scratch memory of searches for shortest paths: as large as a mesh and its tangent graph, and used again."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.clearance.sweep_kernels import SWEPT
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW
from crowdsim.navmesh.shortest.view_arrays import View, empty_view

LABEL = np.dtype(
    [(name, np.float64) for name in ("cost", "turned", "straight")] + [("before", np.int64), ("stamp", np.int64)],
    align=True,
)
"""The best arrival at a node of the tangent graph, in the query number ``stamp``.

cost: length up to the arc, less radius * ``turned`` [m]. turned: angle from the begin of the node's arc to the place of
arrival [rad]. straight: length of the tangent that arrives [m]. before: the node before, -1 for the start. (Fast paths
have another LABEL, see :mod:`crowdsim.navmesh.paths.workspace`.)
"""

ARRIVAL = np.dtype(
    [("cost", np.float64), ("turned", np.float64)] + [(name, np.int64) for name in ("node", "before", "next")],
    align=True,
)
"""One of several arrivals at a node of the tangent graph.

cost, turned: as in :data:`LABEL`. before: index of the arrival before it on its way, -1 for the start. next: index of
another arrival at the same node, -1 for none.
"""

END = np.dtype(
    [("node", np.int64), ("stamp", np.int64)] + [(name, np.float64) for name in ("length", "turned", "x", "y")],
    align=True,
)
"""A tangent between the start or the goal and an arc, in the query number ``stamp``.

node: node of the arc. length: length of the tangent [m]. turned: angle from the begin of the node's arc to the place
where the tangent meets it [rad]. x, y: that place, a place of the disc [m].
"""


class Disc(NamedTuple):
    """The moved disc: its radius, the clearance that counts as enough, and how far views see past vertices [m]."""

    radius: float
    least: float
    tolerance: float


class Stand(NamedTuple):
    """A place (x, y) [m] where a path starts or ends.

    triangle: a free triangle whose closure holds the place, -1 if the disc is not free there. others: True if closures
    of other triangles may hold the place as well.
    """

    x: float
    y: float
    triangle: int
    others: bool


class ShortestScratch(NamedTuple):
    """C-contiguous scratch arrays; only the stamp outlives a query."""

    labels: NDArray[Any]
    """(nodes,) records :data:`LABEL`."""
    goals: NDArray[Any]
    """(nodes,) records :data:`END`: the tangents to the goal."""
    ends: NDArray[Any]
    """(k,) records :data:`END`: tangents of the arcs that the start or the goal sees."""
    outlook: View
    """The view from the start or the goal."""
    heap: NDArray[Any]
    """(k,) records HEAP_ROW of heap_kernels; the search copies it into a larger one if it is full."""
    stack: NDArray[Any]
    """(k,) records of :mod:`crowdsim.navmesh.clearance.sweep_kernels`: SWEPT."""
    stamp: NDArray[np.int64]
    """(1,) number of the last query."""


def shortest_scratch(nodes: int, vertices: int, triangles: int) -> ShortestScratch:
    """Return scratch memory for a graph of so many ``nodes`` and a mesh of so many ``vertices`` and ``triangles``.

    The system provides memory only where it is written to. The heap is small, as a search copies it into a larger one
    if it is full; so is the stack, as the exact distance decides if it is too short for a sweep. ``ends`` have room for
    the tangents in a view, and for more at corners with several arcs.
    """
    return ShortestScratch(
        np.zeros(nodes, LABEL),
        np.zeros(nodes, END),
        np.empty(8 * vertices + 4 * nodes, END),
        empty_view(vertices, triangles),
        np.empty(4096, HEAP_ROW),
        np.empty(64, SWEPT),
        np.zeros(1, np.int64),
    )
