"""Regions of a mesh that hang together by single sides, and the regions on the way to a goal.

A side is a bridge if free space falls apart without it; where bridges are taken away, regions are left. They form a
tree, so a way from start to goal passes the bridges between them one by one, whatever its radius: rooms off the way
need no search, and in each region the next bridge is a better aim than the goal. Bridges are those of Tarjan (1974).
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.half_edge_kernels import nxt

REGION = np.dtype([(name, np.int32) for name in ("top", "up", "depth", "root")], align=True)
"""A free triangle.

top: the triangle of its region that is nearest to the root of the tree, by which the region is known. up: half-edge
towards the root, -1 there; that of a top triangle is a bridge. depth: of a top triangle, how many bridges there are to
the root. root: the same for all triangles that free space joins, -1 where not free.
"""


_WALK = np.dtype([(name, np.int32) for name in ("number", "low", "turn", "order")], align=True)
"""A triangle in a walk through free space, depth first.

number: when it was found. low: least number next to what was found from it on, but for its way up. turn: sides seen.
order: the triangle that has this number.
"""


@kernel
def find_regions(m, regions):
    """Fill ``regions`` (nt,) of :data:`REGION`."""
    sides = m.sides
    triangles = m.frame[0].triangles
    walk = np.empty(triangles, _WALK)
    for t in range(triangles):
        walk[t].number = -1
        walk[t].turn = 0
    found = 0
    for root in range(triangles):
        if m.wind[root] != 0:
            regions[root].top = -1
            regions[root].root = -1
        if m.wind[root] != 0 or walk[root].number >= 0:
            continue
        first = found
        t = np.int64(root)
        regions[t].up = -1
        walk[t].number = found
        walk[t].low = found
        walk[found].order = t
        found += 1
        while True:
            up = np.int64(regions[t].up)
            at = walk[t]
            if at.turn < 3:
                h = 3 * t + at.turn
                at.turn += 1
                if sides[h].cst != 0 or h == up:
                    continue
                g = sides[h].twin
                s = g // 3
                if walk[s].number < 0:
                    regions[s].up = g
                    walk[s].number = found
                    walk[s].low = found
                    walk[found].order = s
                    found += 1
                    t = s
                else:
                    at.low = min(at.low, walk[s].number)
                continue
            if up < 0:
                break
            s = sides[up].twin // 3
            walk[s].low = min(walk[s].low, at.low)
            t = s
        for k in range(first, found):
            t = np.int64(walk[k].order)
            region = regions[t]
            region.root = root
            region.top = t
            region.depth = 0
            if region.up >= 0:
                above = regions[sides[region.up].twin // 3].top
                if walk[t].low < walk[t].number:
                    region.top = above
                else:
                    region.depth = regions[above].depth + 1


@helper
def _lay(m, waypoints, stamp, region, following, h, radius):
    """Aim the way in ``region`` at the bridge h that leads to the region ``following``."""
    a = m.vertices[m.sides[h].org]
    b = m.vertices[m.sides[nxt(h)].org]
    after = waypoints[following]
    ux = b.x - a.x
    uy = b.y - a.y
    length = math.hypot(ux, uy)
    inset = min(radius / length, 0.5)
    at = ((after.x - a.x) * ux + (after.y - a.y) * uy) / (length * length)
    at = min(max(at, inset), 1.0 - inset)
    point = waypoints[region]
    point.x = a.x + at * ux
    point.y = a.y + at * uy
    point.rest = after.rest + math.hypot(after.x - point.x, after.y - point.y)
    point.stamp = stamp


@helper
def lay_waypoints(m, regions, waypoints, stack, stamp, start, goal, gx, gy, radius):
    """Fill the ``waypoints`` of the regions from triangle ``start`` to ``goal``; whether free space joins the two.

    ``stack`` has fields ``item`` and room for all regions.
    """
    sides = m.sides
    if regions[start].root != regions[goal].root:
        return False
    a = np.int64(regions[start].top)
    b = np.int64(regions[goal].top)
    last = waypoints[b]
    last.x = gx
    last.y = gy
    last.rest = 0.0
    last.stamp = stamp
    count = 0
    while a != b:
        if regions[a].depth > regions[b].depth:
            stack[count].item = a
            count += 1
            a = np.int64(regions[sides[regions[a].up].twin // 3].top)
        else:
            h = np.int64(regions[b].up)
            above = np.int64(regions[sides[h].twin // 3].top)
            _lay(m, waypoints, stamp, above, b, h, radius)
            b = above
    while count > 0:
        count -= 1
        a = stack[count].item
        _lay(m, waypoints, stamp, a, b, np.int64(regions[a].up), radius)
        b = a
    return True
