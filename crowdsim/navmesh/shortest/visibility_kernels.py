"""What corners a disc can go to straight: the view from a point or an arc across the triangles around it."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, inlined
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.paths.tangent_kernels import PINCH

SLACK = 1e-6
"""Radians by which a tangent may miss the end of an arc or a vertex in its way for rounding; exact checks follow."""


@helper
def _aim(aim, x, y, q0, radius):
    """Set the tangents from the circle q0 around the origin to both sides of the circle around (x, y)."""
    distance = math.sqrt(x * x + y * y)
    scale = 1.0 / max(distance, 1e-300)
    dx = x * scale
    dy = y * scale
    aim.distance = distance
    aim.dx = dx
    aim.dy = dy
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
    """Add the tangents to both sides of vertex v that the headings allow within ``margin``; the new count."""
    right_bound = aim.distance >= sight.a_from
    left_bound = aim.distance >= sight.b_from
    for left in (True, False):
        tx = aim.left_x if left else aim.right_x
        ty = aim.left_y if left else aim.right_y
        if abs(aim.left_s if left else aim.right_s) > 1.0 + PINCH:
            continue
        if right_bound and sight.ax * ty - sight.ay * tx < -margin:
            continue
        if left_bound and tx * sight.by - ty * sight.bx < -margin:
            continue
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
    """Bound the headings by a vertex that tangents leave on their right."""
    if aim.right_s >= -1.0 and sight.ax * aim.right_y - sight.ay * aim.right_x > 0.0:
        sight.ax = aim.right_x
        sight.ay = aim.right_y
        sight.a_from = aim.distance + reach


@helper
def _tighten_left(sight, aim, reach):
    """Bound the headings by a vertex that tangents leave on their left."""
    if aim.left_s <= 1.0 and aim.left_x * sight.by - aim.left_y * sight.bx > 0.0:
        sight.bx = aim.left_x
        sight.by = aim.left_y
        sight.b_from = aim.distance + reach


@helper
def set_ellipse(ellipse, x0, y0, x1, y1, length):
    """Set the ellipse of ways of at most ``length`` from point 0 to point 1; all places for an infinite length."""
    dx = x1 - x0
    dy = y1 - y0
    distance = math.sqrt(dx * dx + dy * dy)
    ellipse.x = 0.5 * (x0 + x1)
    ellipse.y = 0.5 * (y0 + y1)
    ellipse.per_major = 0.0
    ellipse.per_minor = 0.0
    if length < np.inf:
        ellipse.ux = dx / distance
        ellipse.uy = dy / distance
        ellipse.per_major = 2.0 / length
        ellipse.per_minor = 2.0 / math.sqrt(length * length - distance * distance)


@helper
def _meets(ellipse, a, b):
    """Whether the side from vertex a to vertex b meets the ellipse."""
    ax = a.x - ellipse.x
    ay = a.y - ellipse.y
    bx = b.x - ellipse.x
    by = b.y - ellipse.y
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
    """Whether a tangent may lead across side h, if that is free, at the headings of a view.

    Only outwards: a view that sees past vertices by a little would otherwise go round those that line up for ever.
    """
    if sides[h].constraints != 0:
        return False
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    if sight.rx * sight.ly - sight.ry * sight.lx <= 0.0:
        return False
    if (a.x - eye.x) * (b.y - eye.y) - (a.y - eye.y) * (b.x - eye.x) <= 0.0:
        return False
    if ellipse.per_major > 0.0 and not _meets(ellipse, a, b):
        return False
    if sight.ax * sight.by - sight.ay * sight.bx >= -eye.margin:
        return True
    far = max(sight.a_from, sight.b_from)
    return point_segment_distance2(eye.x, eye.y, a.x, a.y, b.x, b.y) < far * far


@inlined
def _first_sight(sight, h, v, w, eye):
    """Set the view across side h from vertex v to w; False for a point at one of the two.

    Without headings to keep to, these are from v to w.
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
    """Clip a view to the headings, less and more by 30 degrees; whether anything of it is left.

    These hold the directions of corners that are farther than four radii. The view may be wider than half a turn only
    if it does not reach far.
    """
    sight.clipped = 1
    c = math.sqrt(0.75)
    ax = c * eye.ax + 0.5 * eye.ay
    ay = c * eye.ay - 0.5 * eye.ax
    bx = c * eye.bx - 0.5 * eye.by
    by = c * eye.by + 0.5 * eye.bx
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
def _split(sight, other, zx, zy, aim, slack, reach):
    """Split a view at the vertex seen at z from the eye: ``sight`` keeps its right part, ``other`` takes the left one.

    Both see past the vertex by ``slack``, and what their headings leave beside it is bounded from ``reach`` beyond on.
    """
    other.clipped = sight.clipped
    other.lx = sight.lx
    other.ly = sight.ly
    other.ax = sight.ax
    other.ay = sight.ay
    other.bx = sight.bx
    other.by = sight.by
    other.a_from = sight.a_from
    other.b_from = sight.b_from
    other.rx = zx + slack * aim.dy
    other.ry = zy - slack * aim.dx
    if sight.rx * other.ry - sight.ry * other.rx < 0.0:
        other.rx = sight.rx
        other.ry = sight.ry
    zx -= slack * aim.dy
    zy += slack * aim.dx
    if zx * sight.ly - zy * sight.lx > 0.0:
        sight.lx = zx
        sight.ly = zy
    _tighten_left(sight, aim, reach)
    _tighten_right(other, aim, reach)


@helper
def see_corners(m, arc_begin, eye, h, view, count):
    """Add the tangents to corners that are seen across side ``h`` of a triangle at ``eye`` to the view; the new count.

    ``eye`` is a :class:`crowdsim.navmesh.shortest.view_arrays.Viewpoint`. Vertex v has the arcs
    arc_begin[v]:arc_begin[v + 1]; those without are no corners. No free tangent is left out, but some are added that
    other obstacles cut, and some twice. Places outside of the view's ellipse do not matter.

    A free tangent and the line between the centers of its ends have no vertex between them. So who looks from center to
    center sees all corners there are tangents to; a tangent to a corner beyond a vertex by more than the radii keeps
    the radius from this vertex, which bounds the headings.
    """
    sides = m.sides
    vertices = m.vertices
    sights = view.sights
    ellipse = view.ellipse[0]
    aim = view.aim[0]
    radius = eye.radius
    # The ends of the first side.
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
    near2 = (4.0 * radius) * (4.0 * radius)
    while top > 0:
        # Across one side after the other.
        top -= 1
        sight = sights[top]
        h = sight.side
        g = sides[h].twin
        a = vertices[sides[h].org]
        b = vertices[sides[g].org]
        is_far = sight.clipped == 0 and point_segment_distance2(eye.x, eye.y, a.x, a.y, b.x, b.y) >= near2
        if is_far and not _clip(sight, eye):
            continue
        # The vertex opposite: is it in view?
        w = sides[prv(g)].org
        zx = vertices[w].x - eye.x
        zy = vertices[w].y - eye.y
        _aim(aim, zx, zy, eye.q, radius)
        dx = eye.slack * aim.dx
        dy = eye.slack * aim.dy
        left_of_right = sight.rx * (zy + dx) - sight.ry * (zx - dy) >= 0.0
        right_of_left = (zx + dy) * sight.ly - (zy - dx) * sight.lx >= 0.0
        visible = left_of_right and right_of_left
        if visible and arc_begin[w] != arc_begin[w + 1]:
            count = _report(view.seen, count, w, radius, aim, sight, eye.margin)
        # The view goes on over the two other sides, or over the one that it is on.
        if visible:
            other = sights[top + 1]
            other.side = prv(g)
            _split(sight, other, zx, zy, aim, eye.slack, reach)
            sight.side = nxt(g)
            first = _leads_on(sight, nxt(g), vertices, sides, eye, ellipse)
            second = _leads_on(other, prv(g), vertices, sides, eye, ellipse)
            if first:
                top += 2 if second else 1
            elif second:
                sights[top] = sights[top + 1]
                top += 1
        elif left_of_right or right_of_left:
            sight.side = nxt(g) if left_of_right else prv(g)
            if _leads_on(sight, sight.side, vertices, sides, eye, ellipse):
                top += 1
    return count
