"""Refinement: after it, widths of sides and corners alone decide what fits where; and these widths."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.clearance_kernels import disc_clearance
from crowdsim.navmesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation_kernels import FULL, split_edge, split_is_robust
from crowdsim.navmesh.work_kernels import dequeue, enqueue, touch

_WEDGE = np.dtype([("side", np.int64)] + [(name, np.float64) for name in ("rx", "ry", "lx", "ly")], align=True)
"""A half-edge still to cross and the rays right and left of what is seen through it."""


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
def find_bottleneck(m, v, wedges):
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
def refine(m, w):
    """Add the foot of every bottleneck that runs across a side, for the waiting vertices and what changes; 0 or FULL.

    Afterwards each narrowest place between two obstacles is a side or the height of a corner over a constrained
    side, so that widths of sides and corners decide what fits where.
    """
    sides = m.sides
    vertices = m.vertices
    wedges = np.empty(256, _WEDGE)
    while w.progress[0].waiting > 0:
        v = dequeue(w)
        h, x, y = find_bottleneck(m, v, wedges)
        if h < 0:
            continue
        enqueue(w, v)
        f = split_edge(m, h, x, y, w.stack)
        if f < 0:
            return FULL
        touch(w, f)
        # What changed is the star of the new vertex.
        first = vertices[f].vhe
        g = first
        while True:
            u = sides[nxt(g)].org
            if vertices[u].vref > 0:
                enqueue(w, u)
            g = sides[prv(g)].twin
            if g == first:
                break
    return 0


@helper
def measure_triangle(m, t):
    """Fill ``clr`` of triangle t: what a turn around a corner leaves, the shorter side or the height over a wall."""
    sides = m.sides
    vertices = m.vertices
    for h in range(3 * t, 3 * t + 3):
        base = nxt(h)
        last = prv(h)
        sides[h].clr = 0.0
        if m.wind[t] != 0 or sides[h].cst != 0 or sides[last].cst != 0:
            continue
        v = vertices[sides[h].org]
        a = vertices[sides[base].org]
        b = vertices[sides[last].org]
        width = min(math.hypot(a.x - v.x, a.y - v.y), math.hypot(b.x - v.x, b.y - v.y))
        if sides[base].cst != 0:
            width = min(width, math.sqrt(point_segment_distance2(v.x, v.y, a.x, a.y, b.x, b.y)))
        sides[h].clr = width
