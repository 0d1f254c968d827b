"""Regions of a mesh that are joined by single sides, and the regions on the way to a goal.

A side is a bridge if free space would fall apart without it. Without its bridges, free space is left as regions, which
form a tree. So a way from start to goal crosses the bridges between them one by one, for any radius: regions off the
way need no search, and in each region the next bridge is a better aim than the goal. Bridges are found as by Tarjan
(1974).

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``regions`` (nt,) are records
:data:`REGION`; ``waypoints`` (nt,), records WAYPOINT, and ``stamp``, the number of the query, are those of the
:class:`crowdsim.navmesh.paths.workspace.Workspace`; g = (gx, gy) is the goal [m].
"""

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE

REGION = np.dtype([(name, np.int32) for name in ("top", "up", "depth", "root")], align=True)
"""The region of a free triangle.

top: the triangle of its region nearest to the root of the tree; it identifies the region. up: half-edge towards the
root, -1 at the root; of a top triangle it is a bridge. depth: for a top triangle, the number of bridges to the root.
root: the same for all triangles that free space joins, -1 for blocked ones.
"""


_WALK = np.dtype([(name, np.int32) for name in ("triangle", "up", "before", "low", "todo", "source")], align=True)
"""A triangle in a depth-first walk through free space, in the order of discovery, and a stack of half-edges.

up: half-edge by which it was found, -1 for the first. before: index of the triangle it was found from. low: least index
adjacent to it or to what was found from it, except along ``up``. todo, source: stacked half-edges of triangles to
visit, and the index each is visited from.
"""


@kernel
def find_regions(m, regions):
    """Fill ``regions`` (nt,), records :data:`REGION`, with the region of each triangle.

    Blocked triangles get -1 for root and top.
    """
    sides = m.sides
    triangles = m.frame[0].triangles
    # Each triangle takes one half-edge off the stack and puts two on it; the first one puts three.
    walk = np.empty(triangles + 3, _WALK)
    for t in range(triangles):
        regions[t].root = -1
        regions[t].top = -1
    found = 0
    # One walk for each part of free space.
    for root in range(triangles):
        if m.cover[root] != 0 or regions[root].root >= 0:
            continue
        first = found
        t = np.int64(root)
        up = NONE
        before = NONE
        top = 0
        while True:
            # ``depth`` holds the index in the order of discovery until the regions are known.
            low = found
            region = regions[t]
            region.root = root
            region.depth = found
            # Stack the neighbors not found yet; those found already bound ``low``.
            for h in range(3 * t, 3 * t + 3):
                if sides[h].constraints == 0 and h != up:
                    g = sides[h].twin
                    other = regions[g // 3]
                    if other.root < 0:
                        walk[top].todo = g
                        walk[top].source = found
                        top += 1
                    else:
                        low = min(low, np.int64(other.depth))
            at = walk[found]
            at.triangle = t
            at.up = up
            at.low = low
            at.before = before
            found += 1
            # Take the next triangle that was not found in the meantime.
            t = NONE
            while top > 0 and t < 0:
                top -= 1
                up = np.int64(walk[top].todo)
                before = np.int64(walk[top].source)
                if regions[up // 3].root < 0:
                    t = up // 3
            if t < 0:
                break
        # Pass ``low`` on from each triangle to the one it was found from.
        for k in range(found - 1, first, -1):
            at = walk[k]
            beyond = walk[at.before]
            beyond.low = min(beyond.low, at.low)
        # In the order of discovery: if only ``up`` leads from a triangle, and those found from it, to earlier ones,
        # then ``up`` is a bridge, and the triangle begins a region.
        for k in range(first, found):
            at = walk[k]
            region = regions[at.triangle]
            region.up = at.up
            region.top = at.triangle
            region.depth = 0
            if k > first:
                above = np.int64(regions[walk[at.before].triangle].top)
                if at.low < k:
                    region.top = above
                else:
                    region.depth = regions[above].depth + 1


@helper
def _lay(m, waypoints, stamp, region, following, h, radius):
    """Set the waypoint of ``region`` on the bridge h between it and the region ``following``, next towards the goal.

    Regions are given by their top triangles, the bridge by either half-edge; ``radius`` is that of the disc [m].
    """
    a = m.vertices[m.sides[h].org]
    b = m.vertices[m.sides[nxt(h)].org]
    after = waypoints[following]
    ux = b.x - a.x
    uy = b.y - a.y
    length = hypot(ux, uy)
    # The foot of the next waypoint, on the bridge cut by the radius at both ends, at most to its middle.
    inset = min(radius / length, 0.5)
    at = ((after.x - a.x) * ux + (after.y - a.y) * uy) / (length * length)
    at = min(max(at, inset), 1.0 - inset)
    point = waypoints[region]
    point.x = a.x + at * ux
    point.y = a.y + at * uy
    point.rest = after.rest + hypot(after.x - point.x, after.y - point.y)
    point.stamp = stamp


@helper
def lay_waypoints(m, regions, waypoints, stack, stamp, start, goal, gx, gy, radius):
    """Fill ``waypoints`` of the regions on the way from triangle ``start`` to ``goal``, both free; return True.

    Return False if free space does not join the two. ``stack`` is scratch: records with a field ``item``, with room for
    all regions. ``radius`` is that of the disc [m], by which bridges are cut; no bridge counts as too narrow.
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
    # Climb from both ends to their common region, from the deeper one first. Waypoints are set from the goal on, so
    # those of the start's branch wait on the stack.
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
