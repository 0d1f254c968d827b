"""Pin taut paths in gates, so that the narrow behavior is walked over the shortest distance.

A gate is a stretch of the channel that the widest behavior does not pass. The circles that it keeps around both ends of
the gate's first side meet in front of the gate: a path can be walked with the widest behavior up to there. Those of the
last side meet behind the gate: from there on it can again. ``m`` is the legs' mesh, ``around`` (nv, n) the distance
that each of n behaviors, the widest last, keeps from each of the mesh's nv vertices [m].

``sign`` is 1 for the left of a direction, -1 for the right; a and b are centers of circles [m]. A half-edge has the
triangle that the path leaves across it on its left, so left is in front of a gate and right behind it.
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
"""Sides low <= k <= high of a channel, with the places a in front of the gate and b behind it.

fits: 1 if a taut path may be pinned there, as both places are clear enough for the legs. pinned: 1 if it is.
"""

_OFF = 2e-6
"""Distance that pins stay off the circles [m], so that a tangent exists: rounding could move a pin from a circle to its
inside."""


@helper
def circles_meet(ax, ay, bx, by, one, other, sign):
    """Return (True, x, y) if circles of radii ``one`` around a and ``other`` around b meet, else (False, 0, 0).

    Of the two points it is the one to the left of a -> b for a ``sign`` of 1, to the right for -1; all in meters.
    """
    dx = bx - ax
    dy = by - ay
    gap = hypot(dx, dy)
    # Both around one point, or too far apart to meet.
    if gap == 0.0 or gap >= one + other:
        return False, 0.0, 0.0
    # Distance from a along ab to the line through both points, and from ab to each of them.
    along = 0.5 * (gap * gap + one * one - other * other) / gap
    off2 = one * one - along * along
    # One circle is inside the other.
    if off2 <= 0.0:
        return False, 0.0, 0.0
    off = sign * math.sqrt(off2)
    return True, ax + (along * dx - off * dy) / gap, ay + (along * dy + off * dx) / gap


@helper
def _meeting(m, around, h, sign):
    """Return (True, x, y) if the widest behavior's circles around both ends of half-edge h meet, else (False, 0, 0).

    Of the two points [m] it is the one to the left of h for a ``sign`` of 1, to the right for -1.
    """
    start = m.sides[h].org
    end = m.sides[nxt(h)].org
    # The last column is the widest behavior.
    top = around.shape[1] - 1
    p = m.vertices[start]
    q = m.vertices[end]
    return circles_meet(p.x, p.y, q.x, q.y, around[start, top] + _OFF, around[end, top] + _OFF, sign)


@helper
def find_gates(m, channel, levels, count, around, least, gates):
    """Fill ``gates``, records :data:`GATE`, with the channel's stretches of narrower behaviors; return their number.

    channel: half-edges that the path crosses, ``count`` of them. levels: behavior with which each is crossed. A stretch
    is made of sides in a row that are crossed with a narrower behavior than the widest. It is a gate only if it has a
    side for which the widest behavior's circles around both ends meet. Gates for which ``gates`` has no room are left
    out. least: clearance that pins must have [m].
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
        # One gate lasts from the first to the last narrow side of a stretch without the widest behavior.
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
            # Other obstacles than the side's two ends may be in the way of the legs.
            before, _ = disc_clearance(m, gate.ax, gate.ay, least, channel[gate.low] // 3)
            behind, _ = disc_clearance(m, gate.bx, gate.by, least, channel[gate.high] // 3)
            gate.fits = np.int64(min(before, behind) >= least)
            found += 1
    return found


@helper
def _is_beside(corner, gate):
    """Return True if the corner (CORNER of funnel_kernels) ends a side of the gate (:data:`GATE`)."""
    return corner.last >= gate.low and corner.first <= gate.high


@helper
def pinned_path(nodes, size, corners, filled, around, gates, found, taut):
    """Write the taut path through the pins of all pinned gates to ``taut``; return its node count, -1 if it tangles.

    The count is -1 as well if ``taut`` has no room. nodes, taut: records STRING_NODE of
    :mod:`crowdsim.navmesh.paths.tangent_kernels`; ``nodes`` is the taut path without pins, the first ``size`` in use.
    corners: records CORNER of :mod:`crowdsim.planning.roadmap.funnel_kernels`, the first ``filled`` in use, whose
    ``reach`` changes. gates: :data:`GATE`, the first ``found`` in use, in the order of the path.

    Between gates the path keeps the distance from the gates' corners that the widest behavior needs.
    """
    top = around.shape[1] - 1
    taut[0] = nodes[0]
    written = np.int64(1)
    before = NONE  # the gate before
    low = np.int64(0)
    for g in range(found + 1):
        # A gate without pins lies within the part that leads up to the next one.
        if g < found and gates[g].pinned == 0:
            continue
        for inside in range(2):
            # First the part up to the gate (inside = 0), then the part through it (inside = 1). Behind the last gate:
            # the part to the goal.
            if g == found and inside == 1:
                break
            high = corners[filled - 1].last + 1
            if g < found:
                high = gates[g].high if inside == 1 else gates[g].low
            # The part leads from the last node written, f, to t: the front of the gate, its back, or the goal.
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
                # Reach of each corner on this part. Through a gate: as without pins. Between gates: the widest
                # behavior's beside these two gates, elsewhere as much as passes; corners of gates not pinned stay as
                # they were.
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
                # No circle may cover an end of the part; pins stay off the widest circles by _OFF, so half of it is
                # left.
                near = min(hypot(corner.x - fx, corner.y - fy), hypot(corner.x - tx, corner.y - ty))
                corner.reach = min(corner.reach, near - 0.5 * _OFF)
            # Start from the corners that the unpinned path winds around, with their reach on this part: through a gate
            # all of them, between gates those beside neither gate. The string winds around the gates' own corners only
            # where it comes closer to them than the widest behavior's reach: keep_off adds those.
            for i in range(1, size - 1):
                for c in range(filled):
                    corner = corners[c]
                    if corner.vertex != nodes[i].vertex or corner.last < low or corner.first > high:
                        continue
                    at_gate = (g < found and _is_beside(corner, gates[g])) or (
                        before >= 0 and _is_beside(corner, gates[before])
                    )
                    if inside == 1 or not at_gate:
                        # The last node is for the end of this part.
                        if written >= taut.size - 1:
                            return np.int64(-1)
                        set_node(taut[written], corner.x, corner.y, corner.side * corner.reach, corner.vertex)
                        written += 1
                    break
            set_node(taut[written], tx, ty, 0.0, NONE)
            written += 1
            # Then wind it around the other corners of this part.
            part = keep_off(taut[begin:], written - begin, corners, filled, low, high)
            if part < 0:
                return np.int64(-1)
            written = begin + part
            # The next part needs room, too.
            if written >= taut.size - 2:
                return np.int64(-1)
            # The next part begins where this one ends; the side between them belongs to both.
            low = high
        before = g
    return written
