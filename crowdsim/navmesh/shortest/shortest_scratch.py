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
"""How a node of the tangent graph is reached best, in the query that ``stamp`` tells.

cost: meters up to the arc less radius * ``turned``. turned: radians turned of the arc on arrival. straight:
length of the tangent that arrives, meters. before: the node
before, -1 for the start.
"""

ARRIVAL = np.dtype(
    [("cost", np.float64), ("turned", np.float64)] + [(name, np.int64) for name in ("node", "before", "next")],
    align=True,
)
"""One of several arrivals at a node of the tangent graph.

cost, turned: as of a label. before: the arrival before, -1 for the start. next: another arrival at the node, or -1.
"""

END = np.dtype(
    [("node", np.int64), ("stamp", np.int64)] + [(name, np.float64) for name in ("length", "turned", "x", "y")],
    align=True,
)
"""A tangent of the given length between the start or the goal and the place (x, y) on the arc of ``node``, where
``turned`` (radians) is turned of it; ``stamp`` as above."""


class Disc(NamedTuple):
    """What is moved: radius, the clearance that counts as enough for it, and what walls may hide; meters."""

    radius: float
    least: float
    slack: float


class Stand(NamedTuple):
    """A place, a free triangle whose closure holds it (-1 where the disc is not free), and whether there are others."""

    x: float
    y: float
    triangle: int
    others: bool


class ShortestScratch(NamedTuple):
    """C-contiguous arrays; only the stamp outlives a query."""

    labels: NDArray[Any]
    """(nodes,) records :data:`LABEL`."""
    goals: NDArray[Any]
    """(nodes,) records :data:`END`: the tangent to the goal."""
    ends: NDArray[Any]
    """(k,) records :data:`END`: what the start or the goal sees."""
    outlook: View
    """What is seen from the start or the goal."""
    heap: NDArray[Any]
    """(k,) records HEAP_ROW to begin with."""
    stack: NDArray[Any]
    """(k,) records of :mod:`crowdsim.navmesh.clearance.sweep_kernels`: SWEPT."""
    stamp: NDArray[np.int64]
    """(1,) number of the last query."""


def shortest_scratch(nodes: int, vertices: int, triangles: int) -> ShortestScratch:
    """Scratch memory for a graph of so many nodes; the system gives memory only where it is written to."""
    return ShortestScratch(
        np.zeros(nodes, LABEL),
        np.zeros(nodes, END),
        np.empty(8 * vertices + 4 * nodes, END),
        empty_view(vertices, triangles),
        np.empty(4096, HEAP_ROW),
        np.empty(64, SWEPT),
        np.zeros(1, np.int64),
    )
