"""The taut string of a disc made a path: its polyline checked piece by piece, and repaired where it is too close."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import atan2
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import capsule_nearest
from crowdsim.navmesh.clearance.sweep_kernels import sweep, walk
from crowdsim.navmesh.mesh.growing_kernels import longer_rows
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import COARSE, FINE, arc_corners, set_node, tangent

_REPAIRS = 60

_NEAR = 1.01
"""How far around a piece its check looks, in shares of the least distance."""

_MARK = np.dtype([("points", np.int64), ("triangle", np.int64)], align=True)
"""Where the polyline is before it bends around a node: how many points it has, and the triangle of the last."""


@helper
def tighten(nodes, count, i, last):
    """Drop nodes from i to ``last`` at which the string turns away from its obstacle, and more as it moves by that.

    Returns the new number, or -1 if nodes are pinched, and the first node whose neighbors have changed.
    """
    first = i
    before, ax, ay = tangent(nodes[i - 1], nodes[i])
    while i < count - 1 and i <= last:
        after, bx, by = tangent(nodes[i], nodes[i + 1])
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
            return -1, first
    exists, _, _ = tangent(nodes[0], nodes[1])
    return count if exists else -1, first


@helper
def arc_is_open(sides, vertices, v, ax, ay, bx, by, room):
    """Whether nothing but vertex v is closer to it than ``room`` between the bearings a and b, counter-clockwise.

    Returns a triangle of the fan as well, the one of b if so. False in doubt: where a base of the fan is nearer.
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
    while True:
        back = prv(h)
        p = vertices[sides[back].org]
        lx = p.x - vx
        ly = p.y - vy
        inside = inside or (rx * ay - ry * ax >= 0.0 and lx * ay - ly * ax < 0.0)
        if inside:
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
            if lx * by - ly * bx < 0.0 and rx * by - ry * bx >= 0.0:
                return True, h // 3
            if sides[back].constraints != 0:
                return False, h // 3
        h = sides[back].twin
        rx = lx
        ry = ly
        if h == first:
            rounds += 1
            if rounds == 2 or not inside:
                return False, h // 3


@helper
def _trace(m, stack, nodes, count, least, marks, points, first):
    """Polyline around the nodes from ``first`` on and its first piece closer than ``least`` to an obstacle.

    What was traced before stands in ``marks`` and ``points``; these are filled.

    Returns (points, their number, node, inside, vertex, edge, distance, x0, y0, x1, y1): ``node`` is -1 where nothing
    is too close; otherwise the piece x0, y0 -> x1, y1 runs along node ``node`` (``inside``) or from it to the next, and
    comes too close to a vertex or an edge.
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
        if i < count - 1:
            _, bx, by = tangent(node, nodes[i + 1])
            angle = atan2(ax * by - ay * bx, ax * bx + ay * by)
            if node.q * angle < -1e-6 - 4e-6 * abs(node.q):  # a turn of more than half a circle, not rounding
                angle += math.copysign(2.0 * math.pi, node.q)
        steps, cx, cy, c, s = arc_corners(node.q, ax, ay, angle, node.bulge)
        while n + steps > points.shape[0]:
            points = longer_rows(points)
        is_open = False
        for k in range(steps):
            x = node.x + cx
            y = node.y + cy
            cx, cy = c * cx - s * cy, s * cx + c * cy
            if k == 1 and abs(angle) < 3.0:
                # The tangents keep clear of what is not between the ends of the arc, and so does the arc then.
                room = abs(node.q) + math.sqrt(cx * cx + cy * cy)
                if node.q < 0.0:
                    is_open, fan = arc_is_open(sides, vertices, node.vertex, -by, bx, -ay, ax, room)
                else:
                    is_open, fan = arc_is_open(sides, vertices, node.vertex, ay, -ax, by, -bx, room)
                if is_open:
                    triangle = fan
            if not is_open:
                if triangle < 0:
                    triangle = triangle_of(m, px, py, NONE)
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
        if is_open:
            triangle = walk(sides, vertices, triangle, px, py)
            if triangle < 0:
                triangle = triangle_of(m, px, py, NONE)
    return points, n, -1, False, -1, -1, math.inf, 0.0, 0.0, 0.0, 0.0


@helper
def _turns_right(nodes, count, i):
    """Whether the string turns towards its obstacle at node i."""
    if i <= 0 or i >= count - 1:
        return True
    before, ax, ay = tangent(nodes[i - 1], nodes[i])
    after, bx, by = tangent(nodes[i], nodes[i + 1])
    return before and after and nodes[i].q * (ax * by - ay * bx) >= 0.0


@helper
def pull(m, stack, nodes, count, radius, least, start, taut):
    """Check and repair until nothing is too close; (repaired, points).

    A string that is ``taut`` already is not repaired, as there may be no other; its polyline gets finer at most.
    """
    sides = m.sides
    vertices = m.vertices
    points = np.empty((2 * nodes.size + 64, 2))
    marks = np.empty(2 * nodes.size, _MARK)
    points[0, 0] = nodes[0].x
    points[0, 1] = nodes[0].y
    marks[1].points = 1
    marks[1].triangle = start
    if not taut:  # which takes turns of more than half a circle for wrong ones
        count, _ = tighten(nodes, count, np.int64(1), count)
    first = np.int64(1)
    finest = 0.25 * (radius - least)
    for _ in range(_REPAIRS):
        if count < 0:
            break
        points, n, i, inside, vertex, edge, distance, px, py, x, y = _trace(
            m, stack, nodes, count, least, marks, points, first
        )
        if i < 0:
            return True, points[:n]
        if distance < 0.0:
            break
        dx = x - px
        dy = y - py
        crossed = False
        if vertex < 0:
            # The end of the side nearer to the piece, or the far one if the string is around the near one already.
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
            # Corners that stand off an arc may be all that is wrong, where they do so towards what is too close.
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
                if not taut:
                    if (vx - nx) * (nx - node.x) + (vy - ny) * (ny - node.y) <= 0.0:
                        continue
                    # Between two arcs the polyline is their tangent, but for as far as it overshoots it to its corners.
                    over = math.sqrt(node.bulge * (2.0 * radius + node.bulge))
                    if not inside and (along if k == i else size - along) > over:
                        continue
                node.bulge = FINE if node.bulge > FINE else max(0.125 * node.bulge, finest)
                fine = True
            if fine:
                first = max(1, i)
                continue
        if taut:
            break
        q = radius if left != crossed else -radius
        if nodes[i].vertex == vertex or nodes[i + 1].vertex == vertex or (inside and q * nodes[i].q < 0.0):
            break
        if count == nodes.size:
            break
        for k in range(count, i + 1, -1):
            nodes[k] = nodes[k - 1]
        set_node(nodes[i + 1], vx, vy, q, vertex)
        count += 1
        if inside and not (_turns_right(nodes, count, i) and _turns_right(nodes, count, i + 1)):
            nodes[i + 1] = nodes[i]
            set_node(nodes[i], vx, vy, q, vertex)
        i = max(1, i - 1)
        count, first = tighten(nodes, count, i, i + 4)
        first = max(1, first - 1)
    return False, points[:0]
