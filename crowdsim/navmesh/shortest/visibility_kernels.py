"""The corners to which a disc can go straight: the view from a point or an arc across the triangles around it.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records
SIDE and VERTEX. ``aim``, ``sight`` and ``ellipse`` are records AIM, SIGHT and ELLIPSE of
:mod:`crowdsim.navmesh.shortest.view_arrays`, ``seen`` (k,) are records SEEN; ``radius`` is that of the disc [m],
``reach`` the distance behind a vertex from which on it bounds headings [m]; point 0 is (x0, y0), point 1 is (x1, y1)
[m]. ``eye`` is the Viewpoint.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, inlined
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.paths.tangent_kernels import PINCH

TOLERANCE = 1e-6
"""How far a tangent may miss the end of an arc, or a vertex in its way, by rounding [rad]; exact checks follow."""

LOOKS = np.int64(1024)
"""How often a look around crosses each side of the mesh at most: far more than any look that ends."""


@helper
def _aim(aim, x, y, q0, radius):
    """Fill ``aim``: distance and direction of (x, y), and the tangents to both sides of the circle around it.

    (x, y) is relative to the eye [m]; the circle around it has ``radius``. The tangents leave the circle around the
    eye, whose signed radius is q0 [m], as ``q`` of Viewpoint. Direction and headings are 0 at the eye itself.
    """
    # No division by 0 for a vertex at the eye.
    distance = math.sqrt(x * x + y * y)
    scale = 1.0 / max(distance, 1e-300)
    dx = x * scale
    dy = y * scale
    aim.distance = distance
    aim.dx = dx
    aim.dy = dy
    # The sine s of the angle between a tangent and the line of the centers is (q - q0) / distance, q = radius on the
    # left and -radius on the right. If the circles overlap, s exceeds 1 and is kept so; the heading is the one at 1. If
    # s is 0, as for a point, there is no need for the square root.
    s = (radius - q0) * scale
    c = 1.0 if s == 0.0 else math.sqrt(max(1.0 - s * s, 0.0))
    aim.left_s = s
    aim.left_c = c
    s = min(s, 1.0)
    aim.left_x = dx * c + dy * s
    aim.left_y = dy * c - dx * s
    s = (-radius - q0) * scale
    c = 1.0 if s == 0.0 else math.sqrt(max(1.0 - s * s, 0.0))
    aim.right_s = s
    aim.right_c = c
    s = max(s, -1.0)
    aim.right_x = dx * c + dy * s
    aim.right_y = dy * c - dx * s


@helper
def _report(seen, count, v, radius, aim, sight, margin):
    """Add the tangents to both sides of vertex v that the headings allow within ``margin`` [rad] to ``seen``.

    ``count`` tangents are there already; return the new count. ``aim`` is that of v, ``sight`` the view it is seen in.
    """
    right_bound = aim.distance >= sight.a_from
    left_bound = aim.distance >= sight.b_from
    for left in (True, False):
        tx = aim.left_x if left else aim.right_x
        ty = aim.left_y if left else aim.right_y
        # The circles overlap: no tangent.
        if abs(aim.left_s if left else aim.right_s) > 1.0 + PINCH:
            continue
        # Outside of the bounds of headings, if these hold for a vertex as far away.
        if right_bound and sight.ax * ty - sight.ay * tx < -margin:
            continue
        if left_bound and tx * sight.by - ty * sight.bx < -margin:
            continue
        if count == seen.size:
            raise BoundExceeded
        end = seen[count]
        count += 1
        end.vertex = v
        end.q = radius if left else -radius
        end.length = aim.distance * (aim.left_c if left else aim.right_c)
        end.tx = tx
        end.ty = ty
    return count


@helper
def _tighten_right(sight, aim, reach):
    """Bound the headings on the right by a vertex that tangents have on their right.

    The bound of the view stays if it is tighter, or if the vertex's circle overlaps that of the eye.
    """
    if aim.right_s >= -1.0 and sight.ax * aim.right_y - sight.ay * aim.right_x > 0.0:
        sight.ax = aim.right_x
        sight.ay = aim.right_y
        sight.a_from = aim.distance + reach


@helper
def _tighten_left(sight, aim, reach):
    """Bound the headings on the left by a vertex that tangents have on their left.

    The bound of the view stays if it is tighter, or if the vertex's circle overlaps that of the eye.
    """
    if aim.left_s <= 1.0 and aim.left_x * sight.by - aim.left_y * sight.bx > 0.0:
        sight.bx = aim.left_x
        sight.by = aim.left_y
        sight.b_from = aim.distance + reach


@helper
def set_ellipse(ellipse, x0, y0, x1, y1, length):
    """Set the ellipse of ways of at most ``length`` [m] between two points; if it is infinite, all places count.

    A finite length is more than the distance of the two points, which are not at one place.
    """
    dx = x1 - x0
    dy = y1 - y0
    distance = math.sqrt(dx * dx + dy * dy)
    ellipse.x = 0.5 * (x0 + x1)
    ellipse.y = 0.5 * (y0 + y1)
    ellipse.per_major = 0.0
    ellipse.per_minor = 0.0
    # The foci are the two points; the long axis is ``length``, more than their distance.
    if length < np.inf:
        ellipse.ux = dx / distance
        ellipse.uy = dy / distance
        ellipse.per_major = 2.0 / length
        ellipse.per_minor = 2.0 / math.sqrt(length * length - distance * distance)


@helper
def _meets(ellipse, a, b):
    """Return True if the side from vertex a to vertex b (records VERTEX) meets the ellipse or lies inside of it."""
    ax = a.x - ellipse.x
    ay = a.y - ellipse.y
    bx = b.x - ellipse.x
    by = b.y - ellipse.y
    # Scale the plane so that the ellipse becomes the unit circle.
    ux = ellipse.ux * ellipse.per_major
    uy = ellipse.uy * ellipse.per_major
    vx = -ellipse.uy * ellipse.per_minor
    vy = ellipse.ux * ellipse.per_minor
    x0 = ax * ux + ay * uy
    y0 = ax * vx + ay * vy
    x1 = bx * ux + by * uy
    y1 = bx * vx + by * vy
    return point_segment_distance2(0.0, 0.0, x0, y0, x1, y1) <= 1.0


@inlined
def _leads_on(sight, h, vertices, sides, eye, ellipse):
    """Return True if side h is open and a tangent may lead across it at the headings of the view ``sight``.

    Only sides seen from inside count: a view that sees slightly past vertices would otherwise go round and round those
    in line.
    """
    if sides[h].constraints != 0:
        return False
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    # The view is empty, the side is seen from outside, or it is on no way that is short enough.
    if sight.rx * sight.ly - sight.ry * sight.lx <= 0.0:
        return False
    if (a.x - eye.x) * (b.y - eye.y) - (a.y - eye.y) * (b.x - eye.x) <= 0.0:
        return False
    if ellipse.per_major > 0.0 and not _meets(ellipse, a, b):
        return False
    # The headings exclude each other only for corners beyond both bounds.
    if sight.ax * sight.by - sight.ay * sight.bx >= -eye.margin:
        return True
    far = max(sight.a_from, sight.b_from)
    return point_segment_distance2(eye.x, eye.y, a.x, a.y, b.x, b.y) < far * far


@inlined
def _first_sight(sight, h, v, w, eye):
    """Set the view across side h from v to w (records VERTEX), with the headings of the eye.

    If the eye has no bounds of headings, the headings run from v to w. Return False if the eye then is at v or w, else
    True.
    """
    sight.side = h
    sight.rx = v.x - eye.x
    sight.ry = v.y - eye.y
    sight.lx = w.x - eye.x
    sight.ly = w.y - eye.y
    sight.clipped = 0
    sight.a_from = 0.0
    sight.b_from = 0.0
    sight.ax = eye.ax
    sight.ay = eye.ay
    sight.bx = eye.bx
    sight.by = eye.by
    if eye.ax != 0.0 or eye.ay != 0.0:
        return True
    # All headings count: the ends of the side bound them, for corners behind these ends. There is nothing to clip to.
    right = math.sqrt(sight.rx * sight.rx + sight.ry * sight.ry)
    left = math.sqrt(sight.lx * sight.lx + sight.ly * sight.ly)
    if right == 0.0 or left == 0.0:
        return False
    sight.clipped = 1
    sight.ax = sight.rx / right
    sight.ay = sight.ry / right
    sight.bx = sight.lx / left
    sight.by = sight.ly / left
    sight.a_from = right + eye.radius
    sight.b_from = left + eye.radius
    return True


@inlined
def _clip(sight, eye):
    """Clip a view to the eye's headings, a to b, and 30 degrees more on both sides; return False if nothing is left.

    Only a view that begins at least four radii from the eye may be clipped: every corner there is within these bounds,
    as the sine of the angle from it to a tangent's heading is at most 2 radii over the distance, 0.5 for 30 degrees.

    sight: record :data:`~crowdsim.navmesh.shortest.view_arrays.SIGHT`, whose right bound is r and left bound l.
    """
    sight.clipped = 1
    # Turn a to the right and b to the left by 30 degrees, whose sine is 0.5.
    c = math.sqrt(0.75)
    ax = c * eye.ax + 0.5 * eye.ay
    ay = c * eye.ay - 0.5 * eye.ax
    bx = c * eye.bx - 0.5 * eye.by
    by = c * eye.by + 0.5 * eye.bx
    # Cut what lies outside of the bounds; nothing is left if all of the view does.
    if sight.rx * ay - sight.ry * ax > 0.0:
        if ax * sight.ly - ay * sight.lx < 0.0:
            return False
        sight.rx = ax
        sight.ry = ay
    if bx * sight.ly - by * sight.lx > 0.0:
        if sight.rx * by - sight.ry * bx < 0.0:
            return False
        sight.lx = bx
        sight.ly = by
    return True


@inlined
def _split(sight, other, zx, zy, aim, tolerance, reach):
    """Split a view at the vertex at z, relative to the eye [m]: ``sight`` keeps the right part, ``other`` the left one.

    Both see past the vertex by ``tolerance`` [m]. Beside the vertex, headings are bounded for corners more than
    ``reach`` behind it. sight, other: records :data:`~crowdsim.navmesh.shortest.view_arrays.SIGHT`. aim: the
    record AIM of the vertex, with its direction (dx, dy).
    """
    # The left part inherits all bounds of the view.
    other.clipped = sight.clipped
    other.lx = sight.lx
    other.ly = sight.ly
    other.ax = sight.ax
    other.ay = sight.ay
    other.bx = sight.bx
    other.by = sight.by
    other.a_from = sight.a_from
    other.b_from = sight.b_from
    # The left part begins slightly right of the vertex, but not outside of the old view. The right part ends slightly
    # left of it.
    other.rx = zx + tolerance * aim.dy
    other.ry = zy - tolerance * aim.dx
    if sight.rx * other.ry - sight.ry * other.rx < 0.0:
        other.rx = sight.rx
        other.ry = sight.ry
    zx -= tolerance * aim.dy
    zy += tolerance * aim.dx
    if zx * sight.ly - zy * sight.lx > 0.0:
        sight.lx = zx
        sight.ly = zy
    _tighten_left(sight, aim, reach)
    _tighten_right(other, aim, reach)


@helper
def see_corners(m, arc_begin, eye, h, view, count):
    """Add the tangents to corners seen across side ``h`` of a triangle at ``eye`` to the view; return the new count.

    No free tangent at the eye's headings is left out, but some are added that obstacles cut, and some twice.

    A free tangent and the line between the centers of its ends have no vertex between them. So a view from center to
    center sees all corners to which there are tangents. A tangent to a corner that is behind a vertex by more than the
    radii keeps the radius from this vertex, which bounds its headings.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    arc_begin : (nv + 1,) int64
        Vertex v has the arcs arc_begin[v]:arc_begin[v + 1]; those without are no corners.
    eye : Viewpoint
        Where the look starts.
    h : int
        The side. If the eye has no bounds of headings and is at an end of the side, nothing is added.
    view : View
        Scratch memory, and the tangents; places outside of its ellipse do not matter.
    count : int
        Tangents in the view so far.
    """
    sides = m.sides
    vertices = m.vertices
    sights = view.sights
    ellipse = view.ellipse[0]
    aim = view.aim[0]
    radius = eye.radius
    # The ends of the first side are reported, and bound the headings. An end at the eye itself has no tangent.
    v = sides[h].org
    w = sides[nxt(h)].org
    sight = sights[0]
    if not _first_sight(sight, h, vertices[v], vertices[w], eye):
        return count
    reach = radius + abs(eye.q)
    _aim(aim, vertices[w].x - eye.x, vertices[w].y - eye.y, eye.q, radius)
    if arc_begin[w] != arc_begin[w + 1] and aim.distance > 0.0:
        count = _report(view.seen, count, w, radius, aim, sight, eye.margin)
    _tighten_left(sight, aim, reach)
    _aim(aim, vertices[v].x - eye.x, vertices[v].y - eye.y, eye.q, radius)
    if arc_begin[v] != arc_begin[v + 1] and aim.distance > 0.0:
        count = _report(view.seen, count, v, radius, aim, sight, eye.margin)
    _tighten_right(sight, aim, reach)
    top = 1 if _leads_on(sight, h, vertices, sides, eye, ellipse) else 0
    # From four radii on views may be clipped, see `_clip`.
    near2 = (4.0 * radius) * (4.0 * radius)
    turns = LOOKS * sides.size
    while top > 0:
        # Cross one side after the other, depth first.
        turns -= 1
        if turns < 0:
            raise BoundExceeded
        top -= 1
        sight = sights[top]
        h = sight.side
        g = sides[h].twin
        a = vertices[sides[h].org]
        b = vertices[sides[g].org]
        # Far enough for all headings: cut the view to them.
        is_far = sight.clipped == 0 and point_segment_distance2(eye.x, eye.y, a.x, a.y, b.x, b.y) >= near2
        if is_far and not _clip(sight, eye):
            continue
        # Is the vertex opposite in view, up to the tolerance?
        w = sides[prv(g)].org
        zx = vertices[w].x - eye.x
        zy = vertices[w].y - eye.y
        _aim(aim, zx, zy, eye.q, radius)
        dx = eye.tolerance * aim.dx
        dy = eye.tolerance * aim.dy
        left_of_right = sight.rx * (zy + dx) - sight.ry * (zx - dy) >= 0.0
        right_of_left = (zx + dy) * sight.ly - (zy - dx) * sight.lx >= 0.0
        visible = left_of_right and right_of_left
        if visible and arc_begin[w] != arc_begin[w + 1]:
            count = _report(view.seen, count, w, radius, aim, sight, eye.margin)
        # The view goes on across the two other sides, or across the one it lies on.
        if visible:
            if top + 1 >= sights.size:
                raise BoundExceeded
            other = sights[top + 1]
            other.side = prv(g)
            _split(sight, other, zx, zy, aim, eye.tolerance, reach)
            sight.side = nxt(g)
            first = _leads_on(sight, nxt(g), vertices, sides, eye, ellipse)
            second = _leads_on(other, prv(g), vertices, sides, eye, ellipse)
            # Keep the parts that lead on, the left one on top.
            if first:
                top += 2 if second else 1
            elif second:
                sights[top] = sights[top + 1]
                top += 1
        # The vertex is left or right of the view. (Neither would mean behind the eye, which only rounding could give.)
        elif left_of_right or right_of_left:
            sight.side = nxt(g) if left_of_right else prv(g)
            if _leads_on(sight, sight.side, vertices, sides, eye, ellipse):
                top += 1
    return count
