"""Arcs around the corners of a mesh where a disc of one radius stands free, so that a taut string may bend there.

Arguments of all helpers: ``radius`` of the disc and ``least``, the clearance that counts as enough, slightly less [m];
angles are measured from the direction n, up to ``extent`` [rad]; ``arcs`` (na,) are records ARC of
:mod:`crowdsim.navmesh.shortest.tangent_graph_arrays`. Scratch are ``sights``, a stack of views (records SIGHT of
:mod:`crowdsim.navmesh.shortest.view_arrays`), ``found``, what is seen (int64), and ``spans``, the intervals of angles
that are taken (records _SPAN). ``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides``
and ``vertices`` are its records SIDE and VERTEX; n = (nx, ny) is a unit vector, c = (cx, cy) a direction of any length,
v a vertex or its place (vx, vy), a and b the ends of a wall, p the place of a corner, all in mesh coordinates [m]. The
half-edges that leave a vertex are its spokes; two constrained ones bound a wedge of free ground.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import acos, atan2, cos_sin, hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.shortest.tangent_graph_arrays import ARC
from crowdsim.navmesh.shortest.view_arrays import SIGHT
from crowdsim.navmesh.shortest.visibility_kernels import LOOKS
from crowdsim.navmesh.triangulation.refine_kernels import set_sight

_TURN = 2.0 * math.pi
"""A full turn [rad]."""

_FLAT = 1e-9
"""Corners that turn by less [rad] do not count as corners for a disc; for a point they do."""

_SPAN = np.dtype([("lo", np.float64), ("hi", np.float64)], align=True)
"""An interval of angles [rad]."""


@helper
def _look_around(m, px, py, h, reach2, sights, found, count):
    """Add what is seen from (px, py) across side ``h`` of its triangle to ``found``; return the new count.

    A vertex v is added as v, a constrained side s as -1 - s; the ends of ``h`` are not added. Sides whose squared
    distance is at least ``reach2`` [m2] are not crossed. ``sights`` has room for all triangles.
    """
    # The view: a stack of sides, each seen between a right ray r and a left ray l.
    sides = m.sides
    vertices = m.vertices
    right = vertices[sides[h].org]
    left = vertices[sides[nxt(h)].org]
    set_sight(sights[0], h, right.x - px, right.y - py, left.x - px, left.y - py)
    top = 1
    turns = LOOKS * sides.size
    while top > 0:
        turns -= 1
        # Each turn finds one more at most, and leaves one more view at most.
        if turns < 0 or count >= found.size or top >= sights.size:
            raise BoundExceeded
        top -= 1
        sight = sights[top]
        h = sight.side
        # A wall ends the view.
        if sides[h].constraints != 0:
            found[count] = -1 - h
            count += 1
            continue
        g = sides[h].twin
        a = vertices[sides[h].org]
        b = vertices[sides[g].org]
        if point_segment_distance2(px, py, a.x, a.y, b.x, b.y) >= reach2:
            continue
        rx = sight.rx
        ry = sight.ry
        lx = sight.lx
        ly = sight.ly
        # The far corner w of the triangle behind the side divides the view. Both parts go on if they are not empty: the
        # right one in the same row of the stack, the left one in the row after it.
        w = sides[prv(g)].org
        zx = vertices[w].x - px
        zy = vertices[w].y - py
        left_of_right = rx * zy - ry * zx >= 0.0
        right_of_left = zx * ly - zy * lx >= 0.0
        if left_of_right and right_of_left:
            found[count] = w
            count += 1
        if left_of_right:
            set_sight(sight, nxt(g), rx, ry, zx if right_of_left else lx, zy if right_of_left else ly)
            if sight.rx * sight.ly - sight.ry * sight.lx > 0.0:
                top += 1
        if right_of_left:
            sight = sights[top]
            set_sight(sight, prv(g), zx if left_of_right else rx, zy if left_of_right else ry, lx, ly)
            if sight.rx * sight.ly - sight.ry * sight.lx > 0.0:
                top += 1
    return count


@helper
def _block(spans, count, nx, ny, extent, cx, cy, half):
    """Insert the interval of angles within ``half`` [rad] of direction c into ``spans``; return the new count.

    Angles are measured from direction n; the interval is inserted for each turn in which it meets 0 to ``extent``. If
    ``half`` is not above 0, nothing is inserted. ``spans`` stay in the order of their lower ends.
    """
    middle = atan2(nx * cy - ny * cx, nx * cx + ny * cy)
    # Three turns: angles around a point obstacle go up to two turns.
    for turns in range(3):
        lo = middle - half + turns * _TURN
        hi = middle + half + turns * _TURN
        if half > 0.0 and hi > 0.0 and lo < extent:
            k = count
            while k > 0 and spans[k - 1].lo > lo:
                spans[k] = spans[k - 1]
                k -= 1
            spans[k].lo = lo
            spans[k].hi = hi
            count += 1
    return count


@helper
def _block_wall(spans, count, nx, ny, extent, vx, vy, radius, least, a, b):
    """Insert the places around the corner v where the inside of wall ab is closer than ``least`` [m].

    A place is the center of a disc that touches v: at ``radius`` [m] from it, at an angle from the direction (nx, ny),
    of which those from 0 to ``extent`` [rad] matter. The intervals of these angles are inserted into ``spans``; return
    the new count.
    """
    tx = b.x - a.x
    ty = b.y - a.y
    length = hypot(tx, ty)
    tx /= length
    ty /= length
    # v is left of the wall: its height over the wall, and its foot along the wall.
    height = tx * (vy - a.y) - ty * (vx - a.x)
    along = tx * (vx - a.x) + ty * (vy - a.y)
    # A place is closer than ``least`` to the wall's line if it lies more than ``below`` radii from v towards the wall.
    below = (height - least) / radius
    if below >= 1.0:
        return count
    # At the angle g clockwise of the wall's direction t, a place is taken if sin g > below and 0 < along + radius cos g
    # < length. The second condition holds for g in (lo, hi) and mirrored; the first one cuts these. It leaves angles
    # from -90 to 270 degrees, so the mirrored interval is taken a turn on, too.
    half = acos(max(below, -1.0))
    lo = acos(min(max((length - along) / radius, -1.0), 1.0))
    hi = acos(min(max(-along / radius, -1.0), 1.0))
    for first, last in ((lo, hi), (-hi, -lo), (_TURN - hi, _TURN - lo)):
        first = max(first, 0.5 * math.pi - half)
        last = min(last, 0.5 * math.pi + half)
        middle = 0.5 * (first + last)
        c, s = cos_sin(middle)
        cx = tx * c + ty * s
        cy = ty * c - tx * s
        count = _block(spans, count, nx, ny, extent, cx, cy, 0.5 * (last - first))
    return count


@helper
def _wedge_end(sides, first):
    """Return the last spoke of the free wedge that begins with the wall ``first``: the next constrained one.

    Spokes are passed counter-clockwise. At the end of a single wall it is ``first`` again.
    """
    h = first
    for _ in range(sides.size):
        h = sides[prv(h)].twin
        if sides[h].constraints != 0:
            return h
    raise BoundExceeded


@helper
def _taken_places(m, px, py, nx, ny, extent, begin, last, radius, least, sights, found, spans):
    """Collect the angles from direction n at which other obstacles take the places around the corner p; (spans, count).

    The wedge of the corner lies between the spokes ``begin`` and ``last``; it is all around if ``last`` is -1. The
    angles come as intervals, in the order of their lower ends, which may overlap.
    """
    sides = m.sides
    vertices = m.vertices
    taken = np.int64(0)
    h = begin
    # All triangles of the wedge: the far end of each spoke, and all that is seen across the outer sides.
    for _ in range(sides.size):
        # What is farther than twice ``least`` takes no place, but for the tiny difference from ``radius``.
        found[0] = sides[nxt(h)].org
        seen = _look_around(m, px, py, nxt(h), 4.0 * least * least, sights, found, np.int64(1))
        h = sides[prv(h)].twin
        if h == last:
            found[seen] = sides[nxt(h)].org
            seen += 1
        for i in range(seen):
            # A vertex adds at most three spans, a wall nine.
            if taken + 9 > spans.size:
                spans = longer(spans)
            if found[i] < 0:
                wall = -1 - found[i]
                a = vertices[sides[wall].org]
                b = vertices[sides[nxt(wall)].org]
                taken = _block_wall(spans, taken, nx, ny, extent, px, py, radius, least, a, b)
                continue
            # A vertex takes the places closer to it than ``least``: law of cosines.
            w = vertices[found[i]]
            dx = w.x - px
            dy = w.y - py
            distance2 = dx * dx + dy * dy
            if distance2 < 4.0 * least * least:
                cosine = (radius * radius + distance2 - least * least) / (2.0 * radius * math.sqrt(distance2))
                half = acos(min(max(cosine, -1.0), 1.0))
                taken = _block(spans, taken, nx, ny, extent, dx, dy, half)
        # The end of the wedge, or all around.
        if h in (last, begin):
            return spans, taken
    raise BoundExceeded


@helper
def _free_arcs(m, v, first, last, radius, least, arcs, count, sights, found, spans):
    """Add the arcs of vertex v between its spokes ``first`` and ``last`` to ``arcs``; all around if both are -1.

    Return (arcs, their number), as the array grows if it is full. ``count`` is their number before.
    """
    sides = m.sides
    vertices = m.vertices
    px = vertices[v].x
    py = vertices[v].y
    ax = 0.0
    ay = 0.0
    bx = 0.0
    by = 0.0
    nx = 1.0
    ny = 0.0
    # A point obstacle: angles of two turns, so that an arc across the direction n is found as a whole. Its part behind
    # n becomes an arc of its own, too.
    extent = 2.0 * _TURN
    begin = vertices[v].vhe
    if first >= 0:
        # The wedge lies between two walls with directions a and b; the disc touches the corner alone from a + 90 to b -
        # 90 degrees.
        begin = first
        a = vertices[sides[nxt(first)].org]
        b = vertices[sides[nxt(last)].org]
        ax = a.x - px
        ay = a.y - py
        bx = b.x - px
        by = b.y - py
        length = hypot(ax, ay)
        ax /= length
        ay /= length
        length = hypot(bx, by)
        bx /= length
        by /= length
        across = ax * by - ay * bx
        # A string bends only in a free wedge of more than half a turn, a x b < 0. (It is a full turn around the end of
        # a single wall, ``first`` equal to ``last``.) At a flat corner it does not, but a point (radius 0) that moves
        # along its walls meets it. If a and b nearly agree, the wedge is almost a full turn, not flat.
        flat = radius > 0.0 and ax * bx + ay * by <= 0.0
        if first != last and across > (-_FLAT if flat else _FLAT):
            return arcs, count
        nx = -ay
        ny = ax
        extent = math.pi
        if first != last:
            # The angle of the arc, 180 degrees if the wedge is all around the end of a wall.
            extent = max(atan2(-across, -ax * bx - ay * by), 0.0)
    taken = np.int64(0)
    if radius > 0.0:
        spans, taken = _taken_places(m, px, py, nx, ny, extent, begin, last, radius, least, sights, found, spans)
    # What lies between the taken angles is free; it may be a single angle, as for a point at a flat corner.
    at = 0.0
    for i in range(taken + 1):
        end = min(spans[i].lo, extent) if i < taken else extent
        # Around a point obstacle, arcs that begin in the second turn are those of the first one again.
        if end >= at and (first >= 0 or at < _TURN):
            # A free circle: two arcs, half a turn apart, so that tangents which cross the end of one are on the other.
            whole = first < 0 and end - at > _TURN
            for k in range(2 if whole else 1):
                if count == arcs.size:
                    arcs = longer(arcs)
                arc = arcs[count]
                count += 1
                arc.x = px
                arc.y = py
                arc.ax = ax
                arc.ay = ay
                arc.bx = bx
                arc.by = by
                turned = at + k * math.pi
                c, s = cos_sin(turned)
                arc.nx = nx * c - ny * s
                arc.ny = ny * c + nx * s
                arc.extent = _TURN if whole else end - at
                arc.vertex = v
        if i < taken:
            at = max(at, spans[i].hi)
    return arcs, count


@kernel
def find_arcs(m, radius, least):
    """Find ``arcs`` and ``arc_begin`` of :class:`crowdsim.navmesh.shortest.tangent_graph_arrays.TangentGraph`.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    radius, least : float
        Radius of the disc, and clearance that counts as enough, slightly less [m].

    Returns
    -------
    (na,) ARC
        The arcs in the order of their vertices.
    (nv + 1,) int64
        Arcs of vertex v are those from begin[v] up to begin[v + 1].
    """
    sides = m.sides
    vertices = m.vertices
    triangles = m.frame[0].triangles
    filled = m.frame[0].vertices
    arcs = np.empty(filled, ARC)
    begin = np.zeros(vertices.size + 1, np.int64)
    sights = np.empty(triangles + 8, SIGHT)
    found = np.empty(4 * triangles + 8, np.int64)
    spans = np.empty(64, _SPAN)
    count = np.int64(0)
    for v in range(vertices.size):
        begin[v] = count
        if v < BOX_CORNERS or v >= filled or vertices[v].vhe < 0:
            continue
        # One wedge for each wall that starts at v with free ground on its left; a point obstacle has none, and its arcs
        # go around.
        walls = 0
        h = vertices[v].vhe
        for _ in range(sides.size):
            if sides[h].constraints != 0:
                walls += 1
                if m.cover[h // 3] == 0:
                    last = _wedge_end(sides, h)
                    arcs, count = _free_arcs(m, v, h, last, radius, least, arcs, count, sights, found, spans)
            h = sides[prv(h)].twin
            if h == vertices[v].vhe:
                break
        else:
            raise BoundExceeded
        if walls == 0 and m.cover[h // 3] == 0:
            arcs, count = _free_arcs(m, v, NONE, NONE, radius, least, arcs, count, sights, found, spans)
    begin[vertices.size] = count
    return arcs[:count].copy(), begin
