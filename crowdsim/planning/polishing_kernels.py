"""The cheapest string along a way over the roadmap: how wide it winds around each corner is found by trying."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT
from crowdsim.navmesh.half_edge_kernels import nxt, triangle_of
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.planning.fitting_kernels import annotate
from crowdsim.planning.string_kernels import (
    CORNER,
    FULL,
    channel_corners,
    fill_gaps,
    keep_off,
    road_channel,
    taut_string,
)

PARTS = (0.0, 0.9)
"""How much of a gap the two circles around its corners fill at first: none more than a narrow behavior asks for, or
nearly all, so that the path is in the middle."""

BESIDE = 0.3
"""Meters before and after a section of a narrow behavior where corners are tried."""

WORTH = 0.1
"""Cost above which meters of a narrow behavior are worth trying to save."""

MOST_TRIALS = 24
"""Strings that are tried at most, as each takes some 50 microseconds."""

GAIN = 1e-4
"""Cost that a change has to save."""


@helper
def _fit(m, channel, count, v, radius, around, reach):
    """Make room in the gaps at corner v for reach[v], as far as that goes."""
    sides = m.sides
    vertices = m.vertices
    for k in range(count):
        a = sides[channel[k]].org
        b = sides[nxt(channel[k])].org
        if a == v or b == v:
            w = b if a == v else a
            gap = FULL * math.hypot(vertices[a].x - vertices[b].x, vertices[a].y - vertices[b].y)
            if reach[v] + reach[w] > gap:
                reach[w] = min(reach[w], max(radius, around[w, 0], gap - reach[v]))
                reach[v] = max(radius, around[v, 0], min(reach[v], gap - reach[w]))


@helper
def _beside_narrow(points, sections, costs, least, x, y, within):
    """Whether (x, y) is closer than ``within`` to the polyline, in or beside a section that may be worth shortening.

    That is one whose meters beyond the ``least`` length of sections cost more than :data:`WORTH`.
    """
    preferred = costs[costs.size - 1]
    at = 0.0
    for i in range(points.shape[0] - 1):
        ax = points[i, 0]
        ay = points[i, 1]
        bx = points[i + 1, 0]
        by = points[i + 1, 1]
        length = math.hypot(bx - ax, by - ay)
        for k in range(sections.shape[0]):
            if (
                (costs[int(sections[k, 0])] - preferred) * (sections[k, 2] - sections[k, 1] - least) > WORTH
                and sections[k, 1] - BESIDE < at + length
                and at < sections[k, 2] + BESIDE
                and point_segment_distance2(x, y, ax, ay, bx, by) < within * within
            ):
                return True
        at += length
    return False


@kernel
def polish_road(m, upper, points, road, around, reach, ends, radii, costs, turned, terms, radius, least, rounds):
    """Polyline (n, 2), its sections (k, 3) and cost, of the cheapest string found along a road; no rows if it tangles.

    The string keeps ``radius`` in the lowest mesh m, ``least`` of it at least. upper: tuple of the other meshes.
    around: (nv, n) of `corner_radii`. reach: (nv,) scratch. radii: (n, m - 1) as of `annotate`. ``rounds``:
    how often all corners beside sections of narrow behaviors are tried with the radius of each behavior.
    """
    top = costs.size - 1
    channel = np.empty(road.shape[0] + 1, np.int64)
    levels = np.empty(road.shape[0] + 1, np.int64)
    corners = np.empty(2 * road.shape[0] + 2, CORNER)
    stack = np.empty(64, SWEPT)
    line = np.empty((0, 2))
    sections = np.empty((0, 3))
    cost = math.inf
    start = triangle_of(m, ends[0, 0], ends[0, 1], NONE)
    goal = triangle_of(m, ends[1, 0], ends[1, 1], NONE)
    count = road_channel(m, points, road, start, goal, top, channel, levels)
    if count < 0:
        return line, sections, cost
    filled = channel_corners(m, channel, count, around, radius, ends, corners)
    # First the strings of all parts, then one corner after the other.
    tried = 0
    before = math.inf
    last = len(PARTS) + rounds * filled * (top + 1)
    pulled = 0
    while tried < last and pulled < MOST_TRIALS:
        if tried < len(PARTS):
            fill_gaps(m, channel, levels, count, around, corners, filled, PARTS[tried], radius, reach)
        else:
            step = tried - len(PARTS)
            if cost == math.inf:
                break
            if step % (filled * (top + 1)) == 0:
                if cost == before:
                    break
                before = cost
            c = (step // (top + 1)) % filled
            j = step % (top + 1)
            corner = corners[c]
            v = corner.vertex
            if j == 0 and not _beside_narrow(
                line, sections, costs, terms[1], corner.x, corner.y, 1.01 * around[v, top] + 1e-3
            ):
                tried += top + 1
                continue
            r = min(corner.most, max(radius, around[v, j]))
            if abs(r - corner.kept) < 1e-6:
                tried += 1
                continue
            for i in range(filled):
                reach[corners[i].vertex] = corners[i].kept
            reach[v] = r
            _fit(m, channel, count, v, radius, around, reach)
            for i in range(filled):
                corners[i].reach = reach[corners[i].vertex]
        tried += 1
        pulled += 1
        nodes, size = taut_string(m, channel, count, reach, ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])
        size = keep_off(nodes, size, corners, filled)
        if size < 0:
            continue
        done, found = pull(m, stack, nodes, size, radius, least, start, np.bool_(False))
        if not done:
            continue
        length = 0.0
        for i in range(found.shape[0] - 1):
            length += math.hypot(found[i + 1, 0] - found[i, 0], found[i + 1, 1] - found[i, 1])
        if length * costs[top] >= cost:
            continue
        labels, value, _ = annotate(upper, radii, costs, turned, terms, found)
        if value < cost - (GAIN if tried > len(PARTS) else 0.0):
            line, sections, cost = found, labels, value
            for i in range(filled):
                corners[i].kept = corners[i].reach
    return line, sections, cost
