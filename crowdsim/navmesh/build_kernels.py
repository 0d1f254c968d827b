"""From snapped rings to a finished mesh: constraints, free triangles, refinement, corner widths, hints."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS
from crowdsim.navmesh.triangulation_kernels import (
    FULL,
    insert_point,
    insert_segment,
    locate,
    nxt,
    prv,
    split_edge,
    split_is_robust,
)

_UNKNOWN = -(1 << 30)


@helper
def _start_box(m):
    """Two triangles that fill the box."""
    f = m.frame
    for v in range(BOX_CORNERS):
        m.vx[v] = f[1] if v in (0, 3) else f[3]
        m.vy[v] = f[2] if v in (0, 1) else f[4]
    for h, v in enumerate((0, 1, 2, 0, 2, 3)):
        m.org[h] = v
        m.vhe[v] = h
    m.twin[2] = 3
    m.twin[3] = 2
    m.counts[0] = BOX_CORNERS
    m.counts[1] = 2


@helper
def _flood(m, stack):
    """Winding numbers of all triangles: 1 outside of the walkable area, 0 where nothing covers it."""
    for t in range(m.counts[1]):
        m.wind[t] = _UNKNOWN
    outside = locate(m, m.frame[1], m.frame[2], np.int64(0))
    m.wind[outside] = 1
    stack[0] = outside
    top = 1
    while top > 0:
        top -= 1
        t = np.int64(stack[top])
        for h in range(3 * t, 3 * t + 3):
            g = np.int64(m.twin[h])
            if g >= 0 and m.wind[g // 3] == _UNKNOWN:
                m.wind[g // 3] = m.wind[t] - m.win[h]
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
def _find_bottleneck(m, v, sides, rays):
    """A constrained side seen from vertex v across other sides, where the passage between v and its foot is narrowest.

    Returns (half-edge, foot x, foot y), or -1 for the half-edge. Such a place is where a disc around the middle between
    v and the foot touches nothing else; so the foot is not farther along any seen vertex w than w itself, which bounds
    the search. ``sides`` (k,) and ``rays`` (k, 4) hold the sides still to cross with the wedge seen through them.
    """
    px = m.vx[v]
    py = m.vy[v]
    first = np.int64(m.vhe[v])
    corner = first
    while True:
        base = nxt(corner)
        x = np.int64(m.org[base])
        y = np.int64(m.org[prv(corner)])
        top = 0
        if m.wind[corner // 3] == 0 and m.cst[base] == 0:
            sides[0] = base
            rays[0, 0] = m.vx[x] - px
            rays[0, 1] = m.vy[x] - py
            rays[0, 2] = m.vx[y] - px
            rays[0, 3] = m.vy[y] - py
            top = 1
        while top > 0:
            top -= 1
            g = np.int64(m.twin[np.int64(sides[top])])
            rx = rays[top, 0]
            ry = rays[top, 1]
            lx = rays[top, 2]
            ly = rays[top, 3]
            apex = np.int64(m.org[prv(g)])
            zx = m.vx[apex] - px
            zy = m.vy[apex] - py
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
                a = np.int64(m.org[h])
                b = np.int64(m.org[nxt(h)])
                ax = m.vx[a] - px
                ay = m.vy[a] - py
                bx = m.vx[b] - px
                by = m.vy[b] - py
                lo, hi = _cut(0.0, 1.0, ax * r1 - ay * r0, bx * r1 - by * r0)
                lo, hi = _cut(lo, hi, l0 * ay - l1 * ax, l0 * by - l1 * bx)
                for w in (x, y, a, b):
                    wx = m.vx[w] - px
                    wy = m.vy[w] - py
                    most = wx * wx + wy * wy
                    lo, hi = _cut(lo, hi, ax * wx + ay * wy - most, bx * wx + by * wy - most)
                if lo > hi:
                    continue
                if m.cst[h] == 0:
                    if top < sides.size:
                        sides[top] = h
                        rays[top, 0] = r0
                        rays[top, 1] = r1
                        rays[top, 2] = l0
                        rays[top, 3] = l1
                        top += 1
                    continue
                ex = bx - ax
                ey = by - ay
                length2 = ex * ex + ey * ey
                part = -(ax * ex + ay * ey) / length2
                if part <= lo or part >= hi:
                    continue
                cell = m.frame[0]
                fx = np.rint((px + ax + part * ex) / cell) * cell
                fy = np.rint((py + ay + part * ey) / cell) * cell
                width = math.hypot(fx - px, fy - py)
                # Next to an end of the side, the edge to that end measures the passage as well.
                aside = min(part, 1.0 - part) * math.sqrt(length2)
                if aside < 8.0 * cell or aside * aside < 1e-7 * width * width:
                    continue
                middle, _ = disc_clearance(m, 0.5 * (px + fx), 0.5 * (py + fy), width, corner // 3)
                if middle >= 0.5 * width - cell and split_is_robust(m, h, fx, fy):
                    return h, fx, fy
        corner = np.int64(m.twin[prv(corner)])
        if corner == first:
            return np.int64(-1), 0.0, 0.0


@helper
def _refine(m, waiting, queued, stack):
    """Add the foot of every bottleneck that runs across a side, for the ``queued`` vertices and what changes; status.

    Afterwards each narrowest place between two obstacles is a side or the height of a corner over a constrained
    side, so that widths of sides and corners decide what fits where.
    """
    sides = np.empty(256, np.int32)
    rays = np.empty((256, 4))
    room = waiting.size
    head = 0
    count = 0
    for v in range(BOX_CORNERS, m.counts[0]):
        if queued[v]:
            waiting[count] = v
            count += 1
    while count > 0:
        v = np.int64(waiting[head])
        head = (head + 1) % room
        count -= 1
        queued[v] = 0
        h, x, y = _find_bottleneck(m, v, sides, rays)
        if h < 0:
            continue
        f = split_edge(m, h, x, y, stack)
        if f < 0:
            return FULL
        # What changed is the star of the new vertex.
        first = np.int64(m.vhe[f])
        g = first
        while True:
            w = np.int64(m.org[nxt(g)])
            if m.vref[w] > 0 and not queued[w]:
                queued[w] = 1
                waiting[(head + count) % room] = w
                count += 1
            g = np.int64(m.twin[prv(g)])
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
    for h in range(3 * m.counts[1]):
        base = nxt(h)
        last = prv(h)
        m.clr[h] = 0.0
        if m.wind[h // 3] != 0 or m.cst[h] != 0 or m.cst[last] != 0:
            continue
        v = np.int64(m.org[h])
        a = np.int64(m.org[base])
        b = np.int64(m.org[last])
        px = m.vx[v]
        py = m.vy[v]
        width = min(math.hypot(m.vx[a] - px, m.vy[a] - py), math.hypot(m.vx[b] - px, m.vy[b] - py))
        if m.cst[base] != 0:
            width = min(width, math.sqrt(point_segment_distance2(px, py, m.vx[a], m.vy[a], m.vx[b], m.vy[b])))
        m.clr[h] = width


@helper
def _fill_hints(m):
    f = m.frame
    cell = f[0]
    t = np.int64(0)
    nx = m.counts[2]
    for row in range(m.counts[3]):
        for step in range(nx):
            column = step if row % 2 == 0 else nx - 1 - step
            x = min(np.rint((f[1] + (column + 0.5) * f[5]) / cell) * cell, f[3])
            y = min(np.rint((f[2] + (row + 0.5) * f[5]) / cell) * cell, f[4])
            t = locate(m, x, y, t)
            m.hints[row * nx + column] = t


@kernel
def build(m, points, ring_ends, order, queued):
    """Add rings or single points, ``points`` (n, 2) on the grid, to an empty or a finished mesh; 0, FULL or STUCK.

    Ring k is points[ring_ends[k-1]:ring_ends[k]] with blocked space on the left of each side; points past the last ring
    are obstacles of their own. ``order`` (n,) is a good order of insertion; ``queued`` has a 0 for each vertex there is
    room for. After FULL or STUCK the mesh is useless.
    """
    stack = np.empty(3 * m.wind.size + 64, np.int32)
    pairs = np.empty((3 * m.wind.size + 64, 2), np.int32)
    ids = np.empty(points.shape[0], np.int64)
    fresh = m.counts[0] == 0
    if fresh:
        _start_box(m)
    hint = np.int64(0) if fresh else np.int64(-1)
    for k in order:
        v = insert_point(m, points[k, 0], points[k, 1], hint, stack)
        if v < 0:
            return v
        ids[k] = v
        m.vref[v] += 1
        queued[v] = 1
        hint = np.int64(m.vhe[v]) // 3
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
    for v in range(BOX_CORNERS, m.counts[0]):
        if fresh:
            m.vref[v] = max(m.vref[v], 1)  # crossings of input segments are corners too
            queued[v] = 1
        elif queued[v] == 1:
            # Around a new vertex the triangles are new.
            first = np.int64(m.vhe[v])
            h = first
            while True:
                w = np.int64(m.org[nxt(h)])
                if m.vref[w] > 0 and queued[w] == 0:
                    queued[w] = 2
                h = np.int64(m.twin[prv(h)])
                if h == first:
                    break
    status = _refine(m, np.empty(m.vx.size, np.int32), queued, stack)
    if status < 0:
        return status
    _measure_corners(m)
    if fresh:
        _fill_hints(m)
    return 0
