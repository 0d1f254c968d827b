"""Tangents between the arcs of a mesh that a disc of one radius can follow.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; n = (nx, ny) is a unit vector; ``stack`` is
scratch, (k,) SWEPT of :mod:`crowdsim.navmesh.clearance.sweep_kernels`; ``radius`` is that of the disc, ``least`` the
clearance that counts as enough [m]; ``arcs`` (na,) are records ARC of
:mod:`crowdsim.navmesh.shortest.tangent_graph_arrays`, ``arc`` is one of them, ``tangents`` (k,) are records _TANGENT. i
and j are nodes: node 2 k passes arc k counter-clockwise, 2 k + 1 clockwise.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, is_free_way
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_of
from crowdsim.navmesh.shortest.tangent_graph_arrays import LINK, NODE
from crowdsim.navmesh.shortest.view_arrays import Viewpoint
from crowdsim.navmesh.shortest.visibility_kernels import TOLERANCE, see_corners

_TANGENT = np.dtype(
    [("i", np.int64), ("j", np.int64)] + [(n, np.float64) for n in ("length", "leave", "arrive")], align=True
)
"""A tangent from node i to node j: its length [m], and the angles leave and arrive [rad] of LINK."""


@helper
def touches(arc, nx, ny):
    """Return True if direction n is at a right angle or more from both walls of the arc's corner, within rounding.

    A disc that touches the corner at a place in that direction does not reach into the walls. A point obstacle
    has no walls: the answer is True for each direction.
    """
    return nx * arc.ax + ny * arc.ay <= TOLERANCE and nx * arc.bx + ny * arc.by <= TOLERANCE


@helper
def turned_to(arc, nx, ny):
    """Return the angle [rad] from n of the arc to the place in direction (nx, ny), or -1.0 if that is not on the arc.

    The angle is counter-clockwise, in [0, ``arc.extent``]. Places beyond an end by at most TOLERANCE count as at that
    end.
    """
    angle = atan2(arc.nx * ny - arc.ny * nx, arc.nx * nx + arc.ny * ny)
    # In [-TOLERANCE, 2 pi): a little before the begin counts as on it.
    if angle < -TOLERANCE:
        angle += 2.0 * math.pi
    if angle > arc.extent + TOLERANCE:
        return -1.0
    return min(max(angle, 0.0), arc.extent)


@helper
def nearest_end(arc, nx, ny, margin):
    """Return the angle [rad] at an end of the arc that direction n misses by less than ``margin`` [rad].

    It is 0 at the begin and ``arc.extent`` at the other end. If n misses both by less, the begin is taken; if it misses
    both by more, the answer is -1.0.
    """
    angle = atan2(arc.nx * ny - arc.ny * nx, arc.nx * nx + arc.ny * ny)
    if abs(angle) < margin:
        return 0.0
    # The extent may exceed pi: compare around the full turn.
    off = (angle - arc.extent) % (2.0 * math.pi)
    return arc.extent if min(off, 2.0 * math.pi - off) < margin else -1.0


@helper
def _add_tangent(m, stack, arcs, i, b, end, radius, least, tangents, count):
    """Add the tangent ``end`` from node i to the corner of arc b, if it is free and meets both arcs.

    ``end`` is a record SEEN of view_arrays, ``count`` the number of ``tangents``. Return (tangents, count), as the
    array grows if it is full.
    """
    one = arcs[i >> 1]
    other = arcs[b]
    # q and p: 1 with the corner on the left of the tangent, -1 on the right (of a point, end.q is 0.0 or -0.0). The
    # points of contact are a right angle from its heading.
    q = 1 - 2 * (i & 1)
    p = int(math.copysign(1.0, end.q))
    tx = end.tx
    ty = end.ty
    # The disc must not reach into the walls of either corner; and there must be an arc at both points of contact.
    if not (touches(one, q * ty, -q * tx) and touches(other, p * ty, -p * tx)):
        return tangents, count
    leave = turned_to(one, q * ty, -q * tx)
    arrive = turned_to(other, p * ty, -p * tx)
    if leave < 0.0 or arrive < 0.0:
        return tangents, count
    # A disc: test the segment between the points of contact exactly. For a point, to be seen is to be free.
    if least > 0.0:
        x0 = one.x + q * radius * ty
        y0 = one.y - q * radius * tx
        x1 = other.x + p * radius * ty
        y1 = other.y - p * radius * tx
        triangle = triangle_of(m, x0, y0, m.vertices[one.vertex].vhe // 3)
        if triangle < 0 or not is_free_way(m, stack, triangle, x0, y0, x1, y1, least):
            return tangents, count
    if count == tangents.size:
        tangents = longer(tangents)
    link = tangents[count]
    link.i = i
    link.j = 2 * b if p > 0 else 2 * b + 1
    link.length = end.length
    # Angles are measured in the direction of the node.
    link.leave = leave if q > 0 else one.extent - leave
    link.arrive = arrive if p > 0 else other.extent - arrive
    return tangents, count + 1


@kernel
def find_tangents(m, arcs, begin, radius, least, tolerance, view, first_node, last_node):
    """Find free tangents from nodes first_node up to last_node (exclusive), one for each pair of opposite ones.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    arcs, begin : (na,) ARC and (nv + 1,) int64
        Vertex v owns arcs[begin[v]:begin[v + 1]].
    radius, least : float
        Radius of the disc, and clearance that counts as enough, slightly less [m].
    tolerance : float
        How far views see past vertices, to the side, as corners may be off their places [m].
    view : View
        Scratch memory; its ellipse must be all zeros, so that all places count.
    first_node, last_node : int
        The nodes to look from.

    Returns
    -------
    (k,) _TANGENT
        The tangents.
    """
    sides = m.sides
    tangents = np.empty(8 * arcs.size + 64, _TANGENT)
    count = np.int64(0)
    seen = view.seen
    stamps = np.zeros(2 * m.vertices.size, np.int64)
    stamp = 0
    stack = np.empty(64, SWEPT)
    for i in range(first_node, last_node):
        arc = arcs[i >> 1]
        q = 1 - 2 * (i & 1)
        # Look in the headings at which an arc can be left, at most a quarter turn at a time; once if its extent is 0.
        parts = max(1, math.ceil(arc.extent / (0.5 * math.pi)))
        stamp += 1
        for part in range(parts):
            # Headings from a to b: the direction to the place on the arc, turned by a right angle.
            angle = arc.extent * part / parts
            c, s = cos_sin(angle)
            ax = -q * (arc.ny * c + arc.nx * s)
            ay = q * (arc.nx * c - arc.ny * s)
            angle = arc.extent * (part + 1) / parts
            c, s = cos_sin(angle)
            bx = -q * (arc.ny * c + arc.nx * s)
            by = q * (arc.nx * c - arc.ny * s)
            eye = Viewpoint(arc.x, arc.y, q * radius, radius, tolerance, TOLERANCE, ax, ay, bx, by)
            # Through all free triangles around the corner.
            h = m.vertices[arc.vertex].vhe
            first = h
            for _ in range(sides.size):
                if m.cover[h // 3] == 0:
                    found = see_corners(m, begin, eye, nxt(h), view, np.int64(0))
                    for k in range(found):
                        end = seen[k]
                        w = end.vertex
                        left = math.copysign(1.0, end.q) > 0.0
                        # Of a tangent and its opposite, one is kept: if it changes sides, the one from the lesser
                        # vertex (the opposite also goes from left to right); otherwise the one with the corners on its
                        # left.
                        if not left if q > 0 else left:
                            if w < arc.vertex:
                                continue
                        elif q < 0:
                            continue
                        # Views that meet behind another vertex report a corner twice: once it has given tangents, skip
                        # it.
                        mark = 2 * w + (1 if left else 0)
                        if stamps[mark] == stamp:
                            continue
                        old = count
                        for b in range(begin[w], begin[w + 1]):
                            tangents, count = _add_tangent(
                                m, stack, arcs, np.int64(i), b, end, radius, least, tangents, count
                            )
                        if count > old:
                            stamps[mark] = stamp
                h = sides[prv(h)].twin
                if h == first:
                    break
            else:
                raise BoundExceeded
    return tangents[:count].copy()


@kernel
def link_arcs(arcs, tangents, radius):
    """Make ``nodes`` and ``links`` of :class:`crowdsim.navmesh.shortest.tangent_graph_arrays.TangentGraph`.

    Return (nodes, links). ``tangents`` are those that :func:`find_tangents` finds from all nodes.
    """
    count = 2 * arcs.size
    nodes = np.zeros(count + 2, NODE)
    # Counting sort by node, both ways of each tangent: count, add up, put in place. Counts are kept two rows on: added
    # up, row n + 1 holds the begin of node n, and the begin of node n + 1 once the links of node n are in place. A
    # tangent leads from node i to j, the other way round from j ^ 1 to i ^ 1: the nodes that go around the same arcs in
    # the other direction.
    for tangent in tangents:
        nodes[tangent.i + 2].begin += 1
        nodes[(tangent.j ^ 1) + 2].begin += 1
    for n in range(count):
        nodes[n + 2].begin += nodes[n + 1].begin
    links = np.empty(2 * tangents.size, LINK)
    for tangent in tangents:
        for way in range(2):
            i = tangent.i if way == 0 else tangent.j ^ 1
            j = tangent.j if way == 0 else tangent.i ^ 1
            link = links[nodes[i + 1].begin]
            nodes[i + 1].begin += 1
            link.to = j
            # Backwards, the angles are measured from the other end of the arcs.
            link.leave = tangent.leave if way == 0 else arcs[i >> 1].extent - tangent.arrive
            link.arrive = tangent.arrive if way == 0 else arcs[j >> 1].extent - tangent.leave
            link.cost = tangent.length + radius * (link.leave - link.arrive)
    # The place of the disc where each node begins.
    for n in range(count):
        arc = arcs[n >> 1]
        angle = arc.extent if n & 1 else 0.0
        c, s = cos_sin(angle)
        nodes[n].x = arc.x + radius * (arc.nx * c - arc.ny * s)
        nodes[n].y = arc.y + radius * (arc.ny * c + arc.nx * s)
    return nodes[: count + 1].copy(), links
