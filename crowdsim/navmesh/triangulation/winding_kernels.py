"""How many obstacles cover each triangle, from the winding along half-edges."""

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import locate, soil
from crowdsim.navmesh.triangulation.work_kernels import touch_triangle

_UNKNOWN = -(1 << 30)


@helper
def flood(m, stack):
    """Winding numbers of all triangles: 1 outside of the walkable area, 0 where nothing covers it."""
    sides = m.sides
    cover = m.cover
    frame = m.frame[0]
    for t in range(frame.triangles):
        cover[t] = _UNKNOWN
    outside = locate(m, frame.x0, frame.y0, np.int64(0))
    cover[outside] = 1
    stack[0] = outside
    top = 1
    while top > 0:
        top -= 1
        t = stack[top]
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g >= 0 and cover[g // 3] == _UNKNOWN:
                cover[g // 3] = cover[t] - sides[h].winding
                stack[top] = g // 3
                top += 1


@helper
def follow(m, w, count, begin):
    """Let windings follow a change along the ``count`` half-edges in the first column of ``pairs``; whether they do.

    What is right of these half-edges is taken for unchanged. ``stack`` is free to use from ``begin`` on. Where the
    half-edges contradict each other (an outline that snapping folded over), or what is right of them did change, the
    answer is False and windings are wrong. Windings that fit each other are right if the outside of the area has 1.
    """
    sides = m.sides
    cover = m.cover
    stack = w.stack
    budget = 2 * m.frame[0].triangles
    for i in range(count):
        h = w.pairs[i, 0]
        value = cover[sides[h].twin // 3] + sides[h].winding
        if cover[h // 3] == value:
            continue
        top = begin
        t = h // 3
        while True:
            if cover[t] != value:
                budget -= 1
                if budget < 0:
                    return False
                cover[t] = value
                soil(sides, t)
                touch_triangle(sides, w, t)
                for e in range(3 * t, 3 * t + 3):
                    g = sides[e].twin
                    if g >= 0 and cover[g // 3] != value - sides[e].winding:
                        if top == stack.size:
                            return False
                        stack[top] = e
                        top += 1
            if top == begin:
                break
            top -= 1
            e = stack[top]
            t = sides[e].twin // 3
            value = cover[e // 3] - sides[e].winding
    for i in range(count):
        h = w.pairs[i, 0]
        if cover[h // 3] != cover[sides[h].twin // 3] + sides[h].winding:
            return False
    return cover[m.vertices[0].vhe // 3] == 1


@helper
def flood_again(m, w):
    """Windings of all triangles anew, for the rare change that :func:`follow` cannot tell; all count as touched."""
    flood(m, w.stack)
    for t in range(m.frame[0].triangles):
        soil(m.sides, t)
        touch_triangle(m.sides, w, t)
