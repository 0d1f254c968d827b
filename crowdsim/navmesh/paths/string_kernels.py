"""Turn the taut string of a disc into a path: check its polyline piece by piece and repair it where it is too close.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records
SIDE and VERTEX; ``nodes`` (k,) are records :data:`crowdsim.navmesh.paths.tangent_kernels.STRING_NODE`, the first
``count`` of them in use; ``stack`` is scratch, (k,) SWEPT of :mod:`crowdsim.navmesh.clearance.sweep_kernels`; a = (ax,
ay) and b = (bx, by) are unit vectors.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import atan2
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import capsule_nearest
from crowdsim.navmesh.clearance.sweep_kernels import sweep, walk
from crowdsim.navmesh.mesh.growing_kernels import longer_rows
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import COARSE, FINE, arc_corners, set_node, tangent

_REPAIRS = 60
"""Most repairs of one string before it counts as tangled."""

_NEAR = 1.01
"""Distance up to which the check of a piece looks, in shares of the least distance."""

_MARK = np.dtype([("points", np.int64), ("triangle", np.int64)], align=True)
"""State of the polyline before it bends around a node: its number of points, and the triangle of the last one."""


@helper
def tighten(nodes, count, i, last):
    """Drop nodes from i to ``last`` at which the string turns away from its obstacle, and neighbors that this affects.

    Return (number of nodes, first node with new neighbors). The number is -1 if two nodes are too close for a tangent;
    the node is i if none was dropped. ``nodes`` is changed: later nodes move to lower indices. The index ``last``
    stays, so it comes to mean a later node. i is at least 1.
    """
    first = i
    before, ax, ay = tangent(nodes[i - 1], nodes[i])
    while i < count - 1 and i <= last:
        after, bx, by = tangent(nodes[i], nodes[i + 1])
        # A turn to the other side than the obstacle's: the string does not touch it. The node before may change with
        # it.
        if nodes[i].q * (ax * by - ay * bx) < 0.0:
            for k in range(i, count - 1):
                nodes[k] = nodes[k + 1]
            count -= 1
            i = max(1, i - 1)
            first = min(first, i)
            before, ax, ay = tangent(nodes[i - 1], nodes[i])
        elif before and after:
            i += 1
            before = after
            ax = bx
            ay = by
        else:
            # One of the two tangents does not exist.
            return -1, first
    # If no node is left between start and goal, the loop has not tested that this tangent exists.
    exists, _, _ = tangent(nodes[0], nodes[1])
    return count if exists else -1, first


@helper
def arc_is_open(sides, vertices, v, ax, ay, bx, by, room):
    """Test that nothing but vertex v is closer to v than ``room`` [m] between bearings a and b, counter-clockwise.

    b is less than half a circle on from a. Return (bool, triangle of the fan around v); if True, the triangle holds b.
    The answer is False in doubt, too: a base, the side of a triangle opposite of v, counts as an obstacle if it is
    nearer than ``room``, although it may be open.
    """
    vx = vertices[v].x
    vy = vertices[v].y
    first = vertices[v].vhe
    h = first
    rounds = 0
    inside = False
    p = vertices[sides[nxt(h)].org]
    rx = p.x - vx
    ry = p.y - vy
    # Turn counter-clockwise from triangle to triangle; r and l are their right and left side, relative to v.
    for _ in range(2 * sides.size):
        back = prv(h)
        p = vertices[sides[back].org]
        lx = p.x - vx
        ly = p.y - vy
        # The fan begins with the triangle that holds bearing a.
        inside = inside or (rx * ay - ry * ax >= 0.0 and lx * ay - ly * ax < 0.0)
        if inside:
            # The nearest point of the base is its foot if that is inside, else an end.
            ux = lx - rx
            uy = ly - ry
            off = rx * uy - ry * ux
            along = rx * ux + ry * uy
            length2 = ux * ux + uy * uy
            if along < 0.0 and along > -length2:
                if off * off < room * room * length2:
                    return False, h // 3
            elif min(rx * rx + ry * ry, lx * lx + ly * ly) < room * room:
                return False, h // 3
            # This triangle holds bearing b.
            if lx * by - ly * bx < 0.0 and rx * by - ry * bx >= 0.0:
                return True, h // 3
            # A wall that ends at v lies between a and b.
            if sides[back].constraints != 0:
                return False, h // 3
        h = sides[back].twin
        rx = lx
        ry = ly
        # The first triangle may come up twice, as the walk can begin anywhere in the fan. More rounds are of no use.
        if h == first:
            rounds += 1
            if rounds == 2 or not inside:
                return False, h // 3
    raise BoundExceeded


@helper
def _trace(m, stack, nodes, count, least, marks, points, first):
    """Trace the polyline around the nodes from ``first`` on, up to its first piece that is closer than ``least`` [m].

    ``marks``, records :data:`_MARK` of the nodes, and ``points`` (k, 2) [m], which grows, hold what was traced before
    node ``first``, and are filled from there on.

    Return (points, their number, node, inside, vertex, edge, distance, x0, y0, x1, y1). ``node`` is -1 if nothing is
    too close. Otherwise the piece (x0, y0) -> (x1, y1) runs around node ``node`` (``inside``) or from there to the
    next, and comes as near as ``distance`` [m] to ``vertex`` or to the half-edge ``edge``; the other one is -1. If the
    piece starts outside of free space, or after rounding errors, ``distance`` is -1.0, ``vertex`` and ``edge`` are -1.
    """
    sides = m.sides
    vertices = m.vertices
    n = marks[first].points
    triangle = marks[first].triangle
    px = points[n - 1, 0]
    py = points[n - 1, 1]
    _, bx, by = tangent(nodes[first - 1], nodes[first])
    for i in range(first, count):
        node = nodes[i]
        marks[i].points = n
        marks[i].triangle = triangle
        ax = bx
        ay = by
        angle = 0.0
        # The angle by which the string turns around the node.
        if i < count - 1:
            _, bx, by = tangent(node, nodes[i + 1])
            angle = atan2(ax * by - ay * bx, ax * bx + ay * by)
            # A turn to the wrong side, beyond rounding, is one of more than half a circle.
            if node.q * angle < -1e-6 - 4e-6 * abs(node.q):
                angle += math.copysign(2.0 * math.pi, node.q)
        steps, cx, cy, c, s = arc_corners(node.q, ax, ay, angle, node.bulge)
        while n + steps > points.shape[0]:
            points = longer_rows(points)
        # Point 0 ends the tangent that leads here, the others go around the node.
        is_open = False
        for k in range(steps):
            x = node.x + cx
            y = node.y + cy
            cx, cy = c * cx - s * cy, s * cx + c * cy
            if k == 1 and abs(angle) < 3.0:
                # The tangents stay clear of all that is not between the ends of the arc. So if the fan of triangles
                # between these is open, the arc is free. Wider turns are swept piece by piece: the bearings of its ends
                # must be less than half a circle apart. They are the normals of the tangents, from the node outwards.
                # Room is needed up to the polyline's corners, and for the disc around these.
                room = abs(node.q) + math.sqrt(cx * cx + cy * cy)
                if node.q < 0.0:
                    is_open, fan = arc_is_open(sides, vertices, node.vertex, -by, bx, -ay, ax, room)
                else:
                    is_open, fan = arc_is_open(sides, vertices, node.vertex, ay, -ax, by, -bx, room)
                if is_open:
                    triangle = fan
            if not is_open:
                # Sweep the piece. In doubt the exact distance decides.
                free, end = sweep(sides, vertices, stack, triangle, px, py, x, y, least)
                if not free:
                    distance, _, vertex, edge = capsule_nearest(m, px, py, x, y, _NEAR * least, triangle)
                    if distance < least:
                        return points, n, i if k > 0 else i - 1, k > 0, vertex, edge, distance, px, py, x, y
                    end = triangle_of(m, x, y, triangle)
                triangle = end
            points[n, 0] = x
            points[n, 1] = y
            px = x
            py = y
            n += 1
        # The arc was not swept: find the triangle where it ends.
        if is_open:
            triangle = walk(sides, vertices, triangle, px, py)
            if triangle < 0:
                triangle = triangle_of(m, px, py, NONE)
    return points, n, -1, False, -1, -1, math.inf, 0.0, 0.0, 0.0, 0.0


@helper
def _turns_right(nodes, count, i):
    """Return True if the string turns to the correct side at node i, and both tangents there exist, or if i is an end.

    The correct side is that of the node's obstacle, on the left or on the right.
    """
    if i <= 0 or i >= count - 1:
        return True
    before, ax, ay = tangent(nodes[i - 1], nodes[i])
    after, bx, by = tangent(nodes[i], nodes[i + 1])
    return before and after and nodes[i].q * (ax * by - ay * bx) >= 0.0


@helper
def pull(m, stack, nodes, count, radius, least, start, taut):
    """Check and repair the string until nothing is too close; return (done, points (n, 2) [m], none if not done).

    The string has ``count`` ``nodes``, which change; a repair needs spare room behind them. It begins in triangle
    ``start``. Its arcs have the given ``radius``; a clearance of ``least``, slightly less, is enough [m]. A string that
    is ``taut`` already is not repaired, as there may be no other; its polyline only gets finer.
    """
    sides = m.sides
    vertices = m.vertices
    points = np.empty((2 * nodes.size + 64, 2))
    marks = np.empty(2 * nodes.size, _MARK)
    points[0, 0] = nodes[0].x
    points[0, 1] = nodes[0].y
    marks[1].points = 1
    marks[1].triangle = start
    # Not for a taut string: tightening takes turns of more than half a circle for wrong ones.
    if not taut:
        count, _ = tighten(nodes, count, np.int64(1), count)
    first = np.int64(1)
    # Bulges are not made finer than a quarter of the tolerance.
    finest = 0.25 * (radius - least)
    for _ in range(_REPAIRS):
        if count < 0:  # two nodes have no tangent
            break
        points, n, i, inside, vertex, edge, distance, px, py, x, y = _trace(
            m, stack, nodes, count, least, marks, points, first
        )
        if i < 0:
            return True, points[:n]
        # The piece starts outside of free space, or the distance is lost in rounding.
        if distance < 0.0:
            break
        dx = x - px
        dy = y - py
        crossed = False
        if vertex < 0:
            # Bend around the end of the side nearer to the piece, or the far one if the string is around the near one
            # already.
            vertex = sides[edge].org
            far = sides[nxt(edge)].org
            near_off = abs(dx * (vertices[vertex].y - py) - dy * (vertices[vertex].x - px))
            far_off = abs(dx * (vertices[far].y - py) - dy * (vertices[far].x - px))
            if near_off > far_off:
                vertex, far = far, vertex
            if nodes[i].vertex == vertex or nodes[i + 1].vertex == vertex:
                vertex = far
            crossed = distance == 0.0
        vx = vertices[vertex].x
        vy = vertices[vertex].y
        left = dx * (vy - py) - dy * (vx - px) > 0.0
        if distance > least - 2.0 * COARSE:
            # Too close by so little, corners of the polyline that stand off the arc may be the cause: make them finer.
            fine = False
            size = math.sqrt(dx * dx + dy * dy)
            along = (dx * (vx - px) + dy * (vy - py)) / size if size > 0.0 else 0.0
            along = min(max(along, 0.0), size)
            nx = px + along / size * dx if size > 0.0 else px
            ny = py + along / size * dy if size > 0.0 else py
            for k in range(i, i + 1 if inside else i + 2):
                node = nodes[k]
                if node.q == 0.0 or node.bulge <= finest:
                    continue
                # Corners that stand off away from the obstacle are not at fault, and call for a repair. A taut string
                # gets none: make all corners at the piece finer.
                if not taut:
                    if (vx - nx) * (nx - node.x) + (vy - ny) * (ny - node.y) <= 0.0:
                        continue
                    # Between two arcs the polyline is their tangent, but for the last ``over`` [m] up to its corners.
                    over = math.sqrt(node.bulge * (2.0 * radius + node.bulge))
                    if not inside and (along if k == i else size - along) > over:
                        continue
                node.bulge = FINE if node.bulge > FINE else max(0.125 * node.bulge, finest)
                fine = True
            if fine:
                first = max(1, i)  # trace again from there; the start, node 0, has no arc
                continue
        if taut:
            break
        # Bend around the vertex, on the other side if the piece crosses the obstacle. Give up if the string bends
        # around it already, if the vertex is on the other side of an arc than its node, or if there is no room left.
        q = radius if left != crossed else -radius
        if nodes[i].vertex == vertex or nodes[i + 1].vertex == vertex or (inside and q * nodes[i].q < 0.0):
            break
        if count == nodes.size:
            break
        # Insert the node after node i. If the string then does not turn around these two, they are in the wrong order.
        for k in range(count, i + 1, -1):
            nodes[k] = nodes[k - 1]
        set_node(nodes[i + 1], vx, vy, q, vertex)
        count += 1
        if inside and not (_turns_right(nodes, count, i) and _turns_right(nodes, count, i + 1)):
            nodes[i + 1] = nodes[i]
            set_node(nodes[i], vx, vy, q, vertex)
        i = max(1, i - 1)
        # Only the new node and those next to it have new tangents.
        count, first = tighten(nodes, count, i, i + 4)
        # The first new tangent leaves the node before, whose arc it changes: trace from there.
        first = max(1, first - 1)
    return False, points[:0]
