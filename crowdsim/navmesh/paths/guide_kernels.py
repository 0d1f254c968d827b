"""Distances to a goal from the sides of a mesh, which guide searches after obstacles have made ways longer.

Sides are known by the vertices at their ends, which keep their numbers when obstacles come and go. The distances are
those of the mesh without these obstacles. A guide only says where to look first, so an unknown or changed side does no
harm.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``guide`` (k,) are records :data:`GUIDE`;
a side goes from vertex ``origin`` to vertex ``end``; ``radius`` is that of the disc [m].
"""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt

GUIDE = np.dtype([("side", np.int64), ("left", np.float64), ("right", np.float64)], align=True)
"""A row of a hash table of sides. The table has one row more than a power of two.

side: one more than the origin, shifted left by 32 bits, plus the vertex at the other end; 0 if the row is empty. left,
right: distances to the goal [m] from the left and the right end of the side, which is cut by the radius at both ends,
at most to its middle, for ways that leave the side's triangle across it; infinite if no way was followed there. The
last row belongs to no side: its ``left`` is the limit [m] up to which ways were followed. It bounds keys of the search,
in which meters to go count GREED times.
"""

GREED = 1.05
"""Weight of a meter still to go, against a meter gone.

Ways are seldom as short as the estimate, so a weight of 1 searches much that is too long. A greater weight searches
less and finds slightly longer ways (docs/navmesh.md, "Queries").
"""

_SPREAD = 0x1E3779B97F4A7C15
"""Multiplier without pattern, for Knuth's multiplicative hashing."""


@helper
def _row(guide, origin, end):
    """Return the index of the row of the side between two vertices, or of the empty row where it belongs."""
    # Linear probing in the rows before the last one: their number is a power of two, so size - 2 is their bit mask. The
    # lowest 24 bits of the product are mixed least.
    side = ((origin + 1) << 32) + end
    i = ((side * _SPREAD) >> 24) & (guide.size - 2)
    while guide[i].side != side and guide[i].side != 0:
        i = (i + 1) & (guide.size - 2)
    return i


@helper
def guided_estimate(sides, vertices, guide, label, radius, otherwise):
    """Estimate the length [m] of a way from the start over the label's interval to the goal; meters to go are weighted.

    The weight is GREED. The estimate is at most the limit of ``guide``, but at least ``otherwise``, the estimate [m]
    without a guide; it is ``otherwise`` if the side is not in ``guide``. ``label`` is a record LABEL of the workspace.
    """
    h = np.int64(label.h)
    origin = sides[h].org
    end = sides[nxt(h)].org
    row = guide[_row(guide, origin, end)]
    if row.side == 0:
        return otherwise
    limit = guide[guide.size - 1].left
    # No way was followed across this side: with meters to go weighted, all ways over it exceed the limit, so they are
    # longer than limit / GREED. The limit itself is close enough.
    if row.left == math.inf:
        return max(limit, otherwise)
    a = vertices[origin]
    b = vertices[end]
    ux = b.x - a.x
    uy = b.y - a.y
    length = math.sqrt(ux * ux + uy * uy)
    ux /= length
    uy /= length
    inset = min(radius, 0.5 * length)
    # Positions along the side from its cut right end: the root's foot, then the ends of the interval.
    root = (label.rx - a.x) * ux + (label.ry - a.y) * uy - inset
    off = (label.rx - a.x) * uy - (label.ry - a.y) * ux
    low = (label.px - a.x) * ux + (label.py - a.y) * uy - inset
    high = (label.lx - a.x) * ux + (label.ly - a.y) * uy - inset
    # At a point ``at`` of the side, the way to go is at least the way from either end less the piece of the side up to
    # that end. Take the point at which both bounds are equal: at any other point the greater bound is more, by at least
    # as much as the way from the root to the point can be less.
    width = length - 2.0 * inset
    at = min(max(0.5 * (row.right - row.left + width), low), high)
    rest = max(row.right - at, row.left - width + at)
    # Not all ways beyond the limit were followed, so there may be shorter ones than known: estimate the limit at most.
    return max(min(label.spent + GREED * (math.sqrt((at - root) ** 2 + off * off) + rest), limit), otherwise)


@helper
def add_sides(m, guide):
    """Put all sides that can be crossed into the empty ``guide``; the distances stay as they are."""
    sides = m.sides
    for h in range(3 * m.frame[0].triangles):
        if sides[h].constraints == 0 and m.cover[h // 3] == 0:
            origin = sides[h].org
            end = sides[nxt(h)].org
            guide[_row(guide, origin, end)].side = ((origin + 1) << 32) + end


@helper
def clear_guide(guide):
    """Forget all distances of ``guide``, but not its sides: it knows ways up to 0 m."""
    for i in range(guide.size):
        guide[i].left = math.inf
        guide[i].right = math.inf
    guide[guide.size - 1].left = 0.0


@helper
def fill_guide(m, labels, used, radius, limit, guide):
    """Enter the first ``used`` labels of a search from the goal, complete up to keys of ``limit`` [m], into ``guide``.

    ``labels`` are records LABEL of the workspace. Keys estimate whole ways between goal and start, and count meters
    to go GREED times. So the search is complete only up to ways of about limit / GREED. Distances only get less here:
    clear the guide before.
    """
    guide[guide.size - 1].left = limit
    sides = m.sides
    vertices = m.vertices
    for i in range(used):
        label = labels[i]
        h = np.int64(label.h)
        origin = sides[h].org
        end = sides[nxt(h)].org
        # The ends of the side, cut by the radius.
        a = vertices[origin]
        b = vertices[end]
        ux = b.x - a.x
        uy = b.y - a.y
        k = min(radius / math.sqrt(ux * ux + uy * uy), 0.5)
        ux *= k
        uy *= k
        # Ways to the goal cross the side in the opposite direction, so left and right change places.
        row = guide[_row(guide, end, origin)]
        lx = label.lx
        ly = label.ly
        px = label.px
        py = label.py
        # From the goal to the ends of the interval, then along the side to its cut ends.
        at_left = label.spent + math.sqrt((lx - label.rx) ** 2 + (ly - label.ry) ** 2)
        at_right = label.spent + math.sqrt((px - label.rx) ** 2 + (py - label.ry) ** 2)
        at_left += math.sqrt((b.x - ux - lx) ** 2 + (b.y - uy - ly) ** 2)
        at_right += math.sqrt((a.x + ux - px) ** 2 + (a.y + uy - py) ** 2)
        row.right = min(row.right, at_left)
        row.left = min(row.left, at_right)
