"""Taut paths pinned in gates: where only a narrow behavior passes, the least of the way is walked with it.

A gate is a stretch of a channel that the widest behavior does not pass. Its circles around both ends of the first side
meet in front of it: up to there it walks, and from where those of the last side meet behind it.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import set_node
from crowdsim.planning.roadmap.funnel_kernels import keep_off

GATE = np.dtype(
    [("low", np.int64), ("high", np.int64), ("fits", np.int64), ("pinned", np.int64)]
    + [(name, np.float64) for name in ("ax", "ay", "bx", "by")],
    align=True,
)
"""Sides low <= k <= high of a channel, and the places in front of it and behind it.

fits: whether a taut path may be pinned there: both places are clear enough for the legs.
"""

_OFF = 2e-6
"""Meters that pins stay off the circles, so that there is a tangent."""


@helper
def circles_meet(ax, ay, bx, by, one, other, sign):
    """Where circles of radii ``one`` around a and ``other`` around b meet, to the left of a -> b for a ``sign`` of 1.

    Whether they do, x, y.
    """
    dx = bx - ax
    dy = by - ay
    gap = hypot(dx, dy)
    if gap == 0.0 or gap >= one + other:
        return False, 0.0, 0.0
    along = 0.5 * (gap * gap + one * one - other * other) / gap
    off2 = one * one - along * along
    if off2 <= 0.0:
        return False, 0.0, 0.0
    off = sign * math.sqrt(off2)
    return True, ax + (along * dx - off * dy) / gap, ay + (along * dy + off * dx) / gap


@helper
def _meeting(m, around, h, sign):
    """`circles_meet` for those of the widest behavior around both ends of half-edge h."""
    a = m.sides[h].org
    b = m.sides[nxt(h)].org
    top = around.shape[1] - 1
    p = m.vertices[a]
    q = m.vertices[b]
    return circles_meet(p.x, p.y, q.x, q.y, around[a, top] + _OFF, around[b, top] + _OFF, sign)


@helper
def find_gates(m, channel, levels, count, around, least, gates):
    """Fill ``gates`` with the stretches of the channel walked by a narrow behavior that the widest does not pass.

    least: clearance in meters that pins must have.
    """
    top = around.shape[1] - 1
    found = 0
    k = 0
    while k < count and found < gates.size:
        if levels[k] == top:
            k += 1
            continue
        gate = gates[found]
        gate.low = NONE
        gate.pinned = 0
        while k < count and levels[k] < top:
            narrow, x, y = _meeting(m, around, channel[k], 1.0)
            if narrow:
                if gate.low < 0:
                    gate.low = k
                    gate.ax = x
                    gate.ay = y
                gate.high = k
            k += 1
        if gate.low >= 0:
            _, gate.bx, gate.by = _meeting(m, around, channel[gate.high], -1.0)
            before, _ = disc_clearance(m, gate.ax, gate.ay, least, channel[gate.low] // 3)
            behind, _ = disc_clearance(m, gate.bx, gate.by, least, channel[gate.high] // 3)
            gate.fits = np.int64(min(before, behind) >= least)
            found += 1
    return found


@helper
def _is_beside(corner, gate):
    """Whether the corner ends a side of the gate."""
    return corner.last >= gate.low and corner.first <= gate.high


@helper
def pinned_path(nodes, size, corners, filled, around, gates, found, taut):
    """The taut path through the pins of all gates that are pinned, in ``taut``; its number of nodes, -1 if it tangles.

    nodes: the taut path without. Between gates it keeps off their corners what the widest behavior asks for.
    """
    top = around.shape[1] - 1
    taut[0] = nodes[0]
    written = np.int64(1)
    before = NONE  # the gate before
    low = np.int64(0)
    for g in range(found + 1):
        if g < found and gates[g].pinned == 0:
            continue
        for inside in range(2):
            # First the way to the gate, then the one through it.
            if g == found and inside == 1:
                break
            high = corners[filled - 1].last + 1
            if g < found:
                high = gates[g].high if inside == 1 else gates[g].low
            # This part of the taut path leads from the last place written to the gate's front, or on to its back.
            begin = written - 1
            fx = taut[begin].x
            fy = taut[begin].y
            tx = nodes[size - 1].x
            ty = nodes[size - 1].y
            if g < found:
                tx = gates[g].bx if inside == 1 else gates[g].ax
                ty = gates[g].by if inside == 1 else gates[g].ay
            for c in range(filled):
                corner = corners[c]
                if corner.last < low or corner.first > high:
                    continue
                corner.reach = corner.kept
                if inside == 0:
                    free = True
                    for i in range(found):
                        free = free and (gates[i].pinned == 1 or not _is_beside(corner, gates[i]))
                    if free:
                        beside = (g < found and _is_beside(corner, gates[g])) or (
                            before >= 0 and _is_beside(corner, gates[before])
                        )
                        corner.reach = around[corner.vertex, top] if beside else corner.most
                near = min(hypot(corner.x - fx, corner.y - fy), hypot(corner.x - tx, corner.y - ty))
                corner.reach = min(corner.reach, near - 0.5 * _OFF)
            # The corners that the taut path without pins winds around, with their reach on this part.
            for i in range(1, size - 1):
                for c in range(filled):
                    corner = corners[c]
                    if corner.vertex != nodes[i].vertex or corner.last < low or corner.first > high:
                        continue
                    at_gate = (g < found and _is_beside(corner, gates[g])) or (
                        before >= 0 and _is_beside(corner, gates[before])
                    )
                    if at_gate == (inside == 1) and written < taut.size - 1:
                        set_node(taut[written], corner.x, corner.y, corner.side * corner.reach, corner.vertex)
                        written += 1
                    break
            set_node(taut[written], tx, ty, 0.0, NONE)
            written += 1
            part = keep_off(taut[begin:], written - begin, corners, filled, low, high)
            if part < 0:
                return np.int64(-1)
            written = begin + part
            if written >= taut.size - 2:
                return np.int64(-1)
            low = high if inside == 1 or g == found else gates[g].low
        before = g
    return written
