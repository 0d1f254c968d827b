"""The ends of shortest paths: where they stand, what they see, and the tangents between them and arcs.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``graph`` is the TangentGraph of
:mod:`crowdsim.navmesh.shortest.tangent_graph_arrays`; ``scratch`` (ShortestScratch), ``disc`` (Disc) and ``stand``
(Stand) are those of :mod:`crowdsim.navmesh.shortest.shortest_scratch`; ``eye`` is a Viewpoint of view_arrays; ``least``
is the clearance that counts as enough [m], at most 0 for a point; ``found`` is the number of tangents in the view so
far; t is a triangle; (x, y) is a place, p0 = (x0, y0) the place from which a line of sight leads to (x1, y1) [m].
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.predicates_kernels import orient2d
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, side, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.shortest.shortest_scratch import Stand
from crowdsim.navmesh.shortest.tangent_graph_kernels import nearest_end, touches, turned_to
from crowdsim.navmesh.shortest.view_arrays import Viewpoint
from crowdsim.navmesh.shortest.visibility_kernels import TOLERANCE, see_corners


@helper
def _free_triangle(m, x, y, least):
    """Find a free triangle whose closure holds (x, y), for a path of a disc that needs the clearance ``least``.

    Return (triangle, True if there are others), or (-1, False) if the disc is not free there.

    There may be others if (x, y) is on a side or a corner or, for a disc, beyond a side by rounding to the grid.
    """
    sides = m.sides
    vertices = m.vertices
    t = triangle_of(m, x, y, NONE)
    if t < 0:
        return NONE, False
    # A disc: the exact clearance decides.
    if least > 0.0:
        # Only distances below ``least`` matter: 1 % more is enough to tell them.
        distance, _ = disc_clearance(m, x, y, 1.01 * least, t)
        if distance < least:
            return NONE, False
        for h in range(3 * t, 3 * t + 3):
            if side(vertices, sides[h].org, sides[nxt(h)].org, x, y) <= 0.0:
                return t, True
        return t, False
    # A point may stand on a wall or a corner: on one side of the triangle, or on two at their common corner.
    on = 0
    for h in range(3 * t, 3 * t + 3):
        if side(vertices, sides[h].org, sides[nxt(h)].org, x, y) == 0.0:
            on += 1
    if on > 0:
        for h in range(3 * t, 3 * t + 3):
            v = vertices[sides[h].org]
            # On a corner: the first free triangle around it. If all are blocked, the loop comes back to where it began.
            if on == 2 and v.x == x and v.y == y:
                # A corner of the mesh's box: no free triangle touches it, and the sides around it end at the hull.
                if sides[h].org < BOX_CORNERS:
                    return NONE, False
                first = h
                for _ in range(sides.size):
                    if m.cover[h // 3] == 0:
                        break
                    h = sides[prv(h)].twin
                    if h == first:
                        break
                else:
                    raise BoundExceeded
                t = h // 3
                break
            # On a side of a blocked triangle: the triangle behind it.
            if on == 1 and m.cover[t] != 0 and side(vertices, sides[h].org, sides[nxt(h)].org, x, y) == 0.0:
                t = sides[h].twin // 3
                break
    return (t, on > 0) if m.cover[t] == 0 else (NONE, False)


@helper
def stand_at(m, x, y, least):
    """Return the Stand at (x, y) of a disc that needs the clearance ``least``."""
    triangle, others = _free_triangle(m, x, y, least)
    return Stand(x, y, triangle, others)


@helper
def sees(m, t, x0, y0, x1, y1):
    """Return True if a point can go straight from (x0, y0), in the closure of free triangle t, to (x1, y1).

    If the line passes through a corner, or starts at one and leaves t there, the answer is False: the tangent graph
    knows of such paths. The line may end at a corner.
    """
    sides = m.sides
    vertices = m.vertices
    came = NONE
    # Walk along the line: leave each triangle across the side that the line crosses strictly between its ends.
    for _ in range(m.cover.size):
        out = NONE
        inside = True
        for h in range(3 * t, 3 * t + 3):
            a = vertices[sides[h].org]
            b = vertices[sides[nxt(h)].org]
            # The end of the line is beyond this side. (It is in the triangle if it is beyond none.)
            if orient2d(a.x, a.y, b.x, b.y, x1, y1) < 0.0:
                inside = False
                left = orient2d(x0, y0, x1, y1, b.x, b.y)
                right = orient2d(x0, y0, x1, y1, a.x, a.y)
                if h != came and left > 0.0 and right < 0.0:
                    out = h
        if inside:
            return True
        # The line passes through a corner, or meets a wall.
        if out < 0 or sides[out].constraints != 0:
            return False
        came = sides[out].twin
        t = came // 3
    # A straight line enters each triangle at most once, so the walk has ended before.
    return False


@helper
def see_each_other(m, t, x0, y0, x1, y1):
    """Return True if a point on a side or a corner of the free triangle t has a free straight line to (x1, y1).

    As in :func:`sees`, a line through a corner does not count.
    """
    sides = m.sides
    vertices = m.vertices
    # On a corner: try all free triangles around it.
    for h in range(3 * t, 3 * t + 3):
        v = vertices[sides[h].org]
        if v.x == x0 and v.y == y0:
            g = h
            for _ in range(sides.size):
                if m.cover[g // 3] == 0 and sees(m, g // 3, x0, y0, x1, y1):
                    return True
                g = sides[prv(g)].twin
                if g == h:
                    return False
            raise BoundExceeded
    # On a side: try the triangle behind it, too.
    for h in range(3 * t, 3 * t + 3):
        g = sides[h].twin
        on = side(vertices, sides[h].org, sides[nxt(h)].org, x0, y0) == 0.0
        if on and m.cover[g // 3] == 0 and sees(m, g // 3, x0, y0, x1, y1):
            return True
    return sees(m, t, x0, y0, x1, y1)


@helper
def _look(m, graph, scratch, eye, t, found):
    """Add what ``eye``, in the closure of triangle t, sees across the sides it is not on to the view.

    Return the new count.
    """
    for h in range(3 * t, 3 * t + 3):
        if side(m.vertices, m.sides[h].org, m.sides[nxt(h)].org, eye.x, eye.y) > 0.0:
            found = see_corners(m, graph.arc_begin, eye, h, scratch.outlook, found)
    return found


@helper
def find_ends(m, graph, scratch, stand, disc, to_goal):
    """Find the tangents between a stand and the arcs it sees; return their number. They fill ``ends`` of ``scratch``.

    The tangents lead from the arcs to the stand if ``to_goal`` is True, as for the goal, and from the stand to the arcs
    if False. Tangents outside of the ellipse of the view may be missing. No tangent is tested for obstacles in it.

    A disc may stand closer to an obstacle than its ``radius``, down to ``least``. A tangent that then misses the begin
    or the end of an arc by a small angle leads to that end instead. At the largest such angle, the tangent dips into
    the circle by the difference of ``radius`` and ``least``.
    """
    sides = m.sides
    vertices = m.vertices
    seen = scratch.outlook.seen
    ends = scratch.ends
    x = stand.x
    y = stand.y
    triangle = stand.triangle
    radius = disc.radius
    margin = TOLERANCE
    # Off by an angle e, a tangent dips in by radius (1 - cos e), about radius e * e / 2. For a point, radius and least
    # are both 0: no margin (and no division by 0).
    if disc.least > 0.0:
        margin += math.sqrt(2.0 * max(radius - disc.least, 0.0) / radius)
    eye = Viewpoint(x, y, 0.0, radius, disc.tolerance, margin, 0.0, 0.0, 0.0, 0.0)
    found = _look(m, graph, scratch, eye, triangle, np.int64(0))
    # A stand on a side or a corner also looks through the other triangles that touch it.
    if stand.others:
        for h in range(3 * triangle, 3 * triangle + 3):
            v = vertices[sides[h].org]
            if v.x == x and v.y == y:
                g = sides[prv(h)].twin
                for _ in range(sides.size):
                    if g == h:
                        break
                    if m.cover[g // 3] == 0:
                        found = _look(m, graph, scratch, eye, g // 3, found)
                    g = sides[prv(g)].twin
                else:
                    raise BoundExceeded
                break
            # On side h, but not at its other end, which has its own turn: look through the triangle behind it.
            w = sides[nxt(h)].org
            beyond = sides[h].twin // 3
            corner = vertices[w].x == x and vertices[w].y == y
            if not corner and side(vertices, sides[h].org, w, x, y) <= 0.0 and m.cover[beyond] == 0:
                found = _look(m, graph, scratch, eye, beyond, found)
    # The arcs of each corner seen that a tangent touches, exactly or nearly.
    count = 0
    for i in range(found):
        tangent = seen[i]
        # 1 if the corner is on the left as seen from the stand, -1 if on the right; for a point, q is 0.0 or -0.0.
        q = int(math.copysign(1.0, tangent.q))
        for k in range(graph.arc_begin[tangent.vertex], graph.arc_begin[tangent.vertex + 1]):
            # n: direction from the corner to the point of contact, a right angle from the heading.
            arc = graph.arcs[k]
            nx = q * tangent.ty
            ny = -q * tangent.tx
            length = tangent.length
            angle = turned_to(arc, nx, ny) if touches(arc, nx, ny) else -1.0
            if angle < 0.0:
                # Missed: lead to the near end of the arc, if it is within the margin.
                angle = nearest_end(arc, nx, ny, margin)
                if angle < 0.0:
                    continue
                c, s = cos_sin(angle)
                nx = arc.nx * c - arc.ny * s
                ny = arc.ny * c + arc.nx * s
                length = math.sqrt((arc.x + radius * nx - x) ** 2 + (arc.y + radius * ny - y) ** 2)
            # Node 2 k passes the arc counter-clockwise, 2 k + 1 clockwise; tangents to the goal are searched backwards.
            clockwise = (q < 0) != to_goal
            if count == ends.size:
                raise BoundExceeded
            end = ends[count]
            count += 1
            end.node = 2 * k + 1 if clockwise else 2 * k
            end.length = length
            end.turned = arc.extent - angle if clockwise else angle
            end.x = arc.x + radius * nx
            end.y = arc.y + radius * ny
    return count
