"""The arrays of the tangent graph of one mesh and one radius.

A shortest path of a disc consists of arcs around corners and tangents between them. Arc k can be passed in two
directions: node 2 k passes it counter-clockwise, with the corner on the left, node 2 k + 1 clockwise. Backwards, a node
n is n ^ 1, and a link i -> j is j ^ 1 -> i ^ 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ARC = np.dtype(
    [(name, np.float64) for name in ("x", "y", "ax", "ay", "bx", "by", "nx", "ny", "extent")] + [("vertex", np.int64)],
    align=True,
)
"""Places around a corner where the disc touches nothing but this corner.

x, y: the corner [m]. a, b: unit vectors of the walls that begin and end the free side of the corner, counter-clockwise;
zero for a point obstacle. n: unit vector from the corner to the first place, if passed counter-clockwise. extent: angle
of the arc [rad], from 0 for a single place to 2 pi. vertex: vertex of the corner. (arc_span_kernels has another ARC.)
"""

LINK = np.dtype(
    [("to", np.int64), ("cost", np.float64), ("leave", np.float64), ("arrive", np.float64)],
    align=True,
)
"""A tangent to node ``to``, from the node that the link belongs to.

leave: angle from the begin of the arc that the tangent leaves to the place where it leaves [rad]. arrive: angle from
the begin of the arc of ``to`` to the place where it arrives [rad]. Each arc begins at one end or the other, by the
direction in which its node passes it. cost: length of the tangent, plus radius * leave, less radius * arrive [m].
"""

NODE = np.dtype([("begin", np.int64), ("x", np.float64), ("y", np.float64)], align=True)
"""An arc passed in one direction. begin: index of its first link. x, y: place of the disc where the way begins [m]."""


class TangentGraph(NamedTuple):
    """Arcs and tangents for one radius (na arcs, nl links)."""

    arcs: NDArray[Any]
    """(na,) records :data:`ARC`, in order of their vertices."""
    arc_begin: NDArray[np.int64]
    """(nv + 1,) arcs of vertex v are arcs[arc_begin[v]:arc_begin[v + 1]]."""
    nodes: NDArray[Any]
    """(2 na + 1,) records :data:`NODE`; the last one only marks the end of the links."""
    links: NDArray[Any]
    """(nl,) records :data:`LINK`; those of node n are links[nodes[n].begin:nodes[n + 1].begin]."""
