"""From snapped rings to a finished mesh: constraints, free triangles, refinement, corner widths, hints."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import disc_clearance
from crowdsim.navmesh.half_edge_kernels import locate, nxt, prv
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation_kernels import FULL, insert_point, split_edge, split_is_robust

_UNKNOWN = -(1 << 30)

_WEDGE = np.dtype([("side", np.int64)] + [(name, np.float64) for name in ("rx", "ry", "lx", "ly")], align=True)
"""A half-edge still to cross and the rays right and left of what is seen through it."""


@helper
def _start_box(m):
    """Two triangles that fill the box."""
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    for v in range(BOX_CORNERS):
        vertices[v].x = frame.x0 if v == 0 or v == 3 else frame.x1
        vertices[v].y = frame.y0 if v < 2 else frame.y1
    for h, v in enumerate((0, 1, 2, 0, 2, 3)):
        sides[h].org = v
        vertices[v].vhe = h
    sides[2].twin = 3
    sides[3].twin = 2
    frame.vertices = BOX_CORNERS
    frame.triangles = 2


@helper
def _flood(m, stack):
    """Winding numbers of all triangles: 1 outside of the walkable area, 0 where nothing covers it."""
    sides = m.sides
    wind = m.wind
    frame = m.frame[0]
    for t in range(frame.triangles):
        wind[t] = _UNKNOWN
    outside = locate(m, frame.x0, frame.y0, np.int64(0))
    wind[outside] = 1
    stack[0] = outside
    top = 1
    while top > 0:
        top -= 1
        t = stack[top]
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g >= 0 and wind[g // 3] == _UNKNOWN:
                wind[g // 3] = wind[t] - sides[h].win
                stack[top] = g // 3
                top += 1


@helper
def _cut(lo, hi, at0, at1):
    """Part lo..hi of a segment where a function, linear from at0 to at1 along the segment, is not positive."""
    if at0 > 0.0 and at1 > 0.0:
        return 1.0, 0.0
    if at0 > 0.0:
        return max(lo, at0 / (at0 - at1)), hi
    if at1 > 0.0:
        return lo, min(hi, at0 / (at0 - at1))
    return lo, hi


@helper
def _find_bottleneck(m, v, wedges):
    """A constrained side seen from vertex v across other sides, where the passage between v and its foot is narrowest.

    Returns (half-edge, foot x, foot y), or -1 for the half-edge. Such a place is where a disc around the middle between
    v and the foot touches nothing else; so the foot is not farther along any seen vertex w than w itself, which bounds
    the search. ``wedges`` (k,) is room for the sides still to cross.
    """
    sides = m.sides
    vertices = m.vertices
    wind = m.wind
    cell = m.frame[0].cell
    px = vertices[v].x
    py = vertices[v].y
    first = vertices[v].vhe
    corner = first
    while True:
        base = nxt(corner)
        x = sides[base].org
        y = sides[prv(corner)].org
        top = 0
        if wind[corner // 3] == 0 and sides[base].cst == 0:
            wedge = wedges[0]
            wedge.side = base
            wedge.rx = vertices[x].x - px
            wedge.ry = vertices[x].y - py
            wedge.lx = vertices[y].x - px
            wedge.ly = vertices[y].y - py
            top = 1
        while top > 0:
            top -= 1
            wedge = wedges[top]
            g = sides[wedge.side].twin
            rx = wedge.rx
            ry = wedge.ry
            lx = wedge.lx
            ly = wedge.ly
            apex = sides[prv(g)].org
            zx = vertices[apex].x - px
            zy = vertices[apex].y - py
            for h in (nxt(g), prv(g)):
                # x -> apex is seen right of the apex, apex -> y left of it.
                r0 = rx
                r1 = ry
                l0 = lx
                l1 = ly
                if h == nxt(g):
                    if lx * zy - ly * zx < 0.0:
                        l0 = zx
                        l1 = zy
                elif rx * zy - ry * zx > 0.0:
                    r0 = zx
                    r1 = zy
                if r0 * l1 - r1 * l0 <= 0.0:
                    continue
                a = sides[h].org
                b = sides[nxt(h)].org
                ax = vertices[a].x - px
                ay = vertices[a].y - py
                bx = vertices[b].x - px
                by = vertices[b].y - py
                lo, hi = _cut(0.0, 1.0, ax * r1 - ay * r0, bx * r1 - by * r0)
                lo, hi = _cut(lo, hi, l0 * ay - l1 * ax, l0 * by - l1 * bx)
                for w in (x, y, a, b):
                    wx = vertices[w].x - px
                    wy = vertices[w].y - py
                    most = wx * wx + wy * wy
                    lo, hi = _cut(lo, hi, ax * wx + ay * wy - most, bx * wx + by * wy - most)
                if lo > hi:
                    continue
                if sides[h].cst == 0:
                    if top < wedges.size:
                        wedge = wedges[top]
                        wedge.side = h
                        wedge.rx = r0
                        wedge.ry = r1
                        wedge.lx = l0
                        wedge.ly = l1
                        top += 1
                    continue
                ex = bx - ax
                ey = by - ay
                length2 = ex * ex + ey * ey
                part = -(ax * ex + ay * ey) / length2
                if part <= lo or part >= hi:
                    continue
                fx = np.rint((px + ax + part * ex) / cell) * cell
                fy = np.rint((py + ay + part * ey) / cell) * cell
                width = math.hypot(fx - px, fy - py)
                # Next to an end of the side, the edge to that end measures the passage as well.
                aside = min(part, 1.0 - part) * math.sqrt(length2)
                if aside < 8.0 * cell or aside * aside < 1e-7 * width * width:
                    continue
                middle, _ = disc_clearance(m, 0.5 * (px + fx), 0.5 * (py + fy), width, corner // 3)
                if middle >= 0.5 * width - cell and split_is_robust(sides, vertices, h, fx, fy):
                    return h, fx, fy
        corner = sides[prv(corner)].twin
        if corner == first:
            return NONE, 0.0, 0.0


@helper
def _refine(m, waiting, queued, stack):
    """Add the foot of every bottleneck that runs across a side, for the ``queued`` vertices and what changes; status.

    Afterwards each narrowest place between two obstacles is a side or the height of a corner over a constrained
    side, so that widths of sides and corners decide what fits where.
    """
    sides = m.sides
    vertices = m.vertices
    wedges = np.empty(256, _WEDGE)
    room = waiting.size
    head = 0
    count = 0
    for v in range(BOX_CORNERS, m.frame[0].vertices):
        if queued[v]:
            waiting[count] = v
            count += 1
    while count > 0:
        v = waiting[head]
        head = (head + 1) % room
        count -= 1
        queued[v] = 0
        h, x, y = _find_bottleneck(m, v, wedges)
        if h < 0:
            continue
        f = split_edge(m, h, x, y, stack)
        if f < 0:
            return FULL
        # What changed is the star of the new vertex.
        first = vertices[f].vhe
        g = first
        while True:
            w = sides[nxt(g)].org
            if vertices[w].vref > 0 and not queued[w]:
                queued[w] = 1
                waiting[(head + count) % room] = w
                count += 1
            g = sides[prv(g)].twin
            if g == first:
                break
        if not queued[v]:
            queued[v] = 1
            waiting[(head + count) % room] = v
            count += 1
    return 0


@helper
def _measure_corners(m):
    """Fill ``clr``: what a turn around each corner leaves, the shorter side or the height over a constrained base."""
    sides = m.sides
    vertices = m.vertices
    for h in range(3 * m.frame[0].triangles):
        base = nxt(h)
        last = prv(h)
        sides[h].clr = 0.0
        if m.wind[h // 3] != 0 or sides[h].cst != 0 or sides[last].cst != 0:
            continue
        v = vertices[sides[h].org]
        a = vertices[sides[base].org]
        b = vertices[sides[last].org]
        width = min(math.hypot(a.x - v.x, a.y - v.y), math.hypot(b.x - v.x, b.y - v.y))
        if sides[base].cst != 0:
            width = min(width, math.sqrt(point_segment_distance2(v.x, v.y, a.x, a.y, b.x, b.y)))
        sides[h].clr = width


@helper
def _fill_hints(m):
    frame = m.frame[0]
    cell = frame.cell
    t = NONE
    nx = frame.nx
    for row in range(frame.ny):
        for step in range(nx):
            column = step if row % 2 == 0 else nx - 1 - step
            x = min(np.rint((frame.x0 + (column + 0.5) * frame.hint_cell) / cell) * cell, frame.x1)
            y = min(np.rint((frame.y0 + (row + 0.5) * frame.hint_cell) / cell) * cell, frame.y1)
            t = locate(m, x, y, t)
            m.hints[row * nx + column] = t


@kernel
def build(m, points, ring_ends, order, queued):
    """Add rings or single points, ``points`` (n, 2) on the grid, to an empty or a finished mesh; 0, FULL or STUCK.

    Ring k is points[ring_ends[k-1]:ring_ends[k]] with blocked space on the left of each side; points past the last ring
    are obstacles of their own. ``order`` (n,) is a good order of insertion; ``queued`` has a 0 for each vertex there is
    room for. After FULL or STUCK the mesh is useless.
    """
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    stack = np.empty(3 * m.wind.size + 64, np.int64)
    pairs = np.empty((3 * m.wind.size + 64, 2), np.int64)
    ids = np.empty(points.shape[0], np.int64)
    fresh = frame.vertices == 0
    if fresh:
        _start_box(m)
    hint = np.int64(0) if fresh else NONE
    for k in order:
        v = insert_point(m, points[k, 0], points[k, 1], hint, stack)
        if v < 0:
            return v
        ids[k] = v
        vertices[v].vref += 1
        queued[v] = 1
        hint = vertices[v].vhe // 3
    begin = 0
    for end in ring_ends:
        for i in range(begin, end):
            a = ids[i]
            b = ids[i + 1 if i + 1 < end else begin]
            if a != b:
                status = insert_segment(m, a, b, 1, stack, pairs)
                if status < 0:
                    return status
        begin = end
    _flood(m, stack)
    for v in range(BOX_CORNERS, frame.vertices):
        if fresh:
            vertices[v].vref = max(vertices[v].vref, 1)  # crossings of input segments are corners too
            queued[v] = 1
        elif queued[v] == 1:
            # Around a new vertex the triangles are new.
            first = vertices[v].vhe
            h = first
            while True:
                w = sides[nxt(h)].org
                if vertices[w].vref > 0 and queued[w] == 0:
                    queued[w] = 2
                h = sides[prv(h)].twin
                if h == first:
                    break
    status = _refine(m, np.empty(vertices.size, np.int64), queued, stack)
    if status < 0:
        return status
    _measure_corners(m)
    if fresh:
        _fill_hints(m)
    return 0
