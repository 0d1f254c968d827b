"""Ways ahead that others keep free, narrow passages in which no row stops, and ranks that followers take over.

A way is a polyline (P, 2) [m]: the next meters of an agent's plan after the end of its timeline; nan without one.
The lower rank goes first. docs/waiting.md has the rules.

``ways`` (N, P, 2) are those of all rows; ``ranks`` (N,), ``pose`` (N, 3) and ``may_move`` (N,) (True: the row stands
and has not decided yet in this step) are columns of all rows, too. A ``timeline`` (K, SAMPLE) has the columns of
:data:`crowdsim.crowd.state.components.SAMPLE`; ``near`` are the rows by cells
(:class:`crowdsim.crowd.near.neighbors.Neighbors`).
"""

import math

from crowdsim.crowd.near.neighbor_kernels import OF_WAYS, cells_within, insert_row, rows_of_line
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel

FOREVER = 9223372036854775807
"""Slot of leaving of an agent that never leaves; also a rank behind all others."""

IN_PASSAGE = 1 << 62
"""Amount by which the rank of an agent at rest in a narrow passage is lower. It is larger than all ranks but LAST of
:mod:`crowdsim.crowd.state.components`."""


@helper
def nearest_of_way(way, x, y):
    """Return the distance from (x, y) to a polyline (P, 2) [m], and the vector along its nearest segment (x, y) [m].

    For a row without a way (nan), they are infinite and (0, 0).
    """
    least = math.inf
    ux = uy = 0.0
    for k in range(len(way) - 1):
        ax, ay = way[k, 0], way[k, 1]
        bx, by = way[k + 1, 0], way[k + 1, 1]
        square = point_segment_distance2(x, y, ax, ay, bx, by)
        if square < least:
            least = square
            ux, uy = bx - ax, by - ay
    return math.sqrt(least), ux, uy


@helper
def near_any(segments, x, y, distance):
    """Return True if (x, y) is nearer than ``distance`` to one of ``segments`` (M, 4): x, y of both ends [m]."""
    for m in range(len(segments)):
        s = segments[m]
        if point_segment_distance2(x, y, s[0], s[1], s[2], s[3]) < distance * distance:
            return True
    return False


@kernel
def stops_in_passage(timeline, passages, distance):
    """Return True if a timeline ends, but does not begin, within ``distance`` [m] of any of ``passages``.

    ``passages`` (S, 4) are segments: x, y of both ends [m]. An agent that is near one already may stop near one again.
    """
    return near_any(passages, timeline[-1, 0], timeline[-1, 1], distance) and not near_any(
        passages, timeline[0, 0], timeline[0, 1], distance
    )


@helper
def meets_oncoming(timeline, chain, available, ways, passages, distance, radius):
    """Return True if a timeline enters a narrow passage, and another agent's way leads through a passage against it.

    It enters one of ``passages`` (S, 4) if it ends nearer to one than ``distance`` [m], and begins farther from all
    than the ``radius`` of its body [m]. ``chain`` (:class:`crowdsim.crowd.state.timelines.Chain`) holds the present
    node and the next ``available`` nodes of the plan; ``ways`` (W, P, 2) are those of the others [m].
    """
    if not near_any(passages, timeline[-1, 0], timeline[-1, 1], distance):
        return False
    if near_any(passages, timeline[0, 0], timeline[0, 1], radius):
        return False
    for way in ways:
        for point in range(len(way) - 1):
            x, y = way[point, 0], way[point, 1]
            # Direction of the own plan at the node that passes nearest to that point of the way, if any passes nearer
            # than ``distance``. It is taken over three nodes, as the plan may turn on the spot in one.
            least = distance * distance
            ux = uy = 0.0
            for k in range(available):
                ax, ay = chain.origins[k, 0], chain.origins[k, 1]
                bx, by = chain.origins[k + 1, 0], chain.origins[k + 1, 1]
                square = point_segment_distance2(x, y, ax, ay, bx, by)
                if square < least:
                    least = square
                    further = min(k + 3, available)
                    ux, uy = chain.origins[further, 0] - ax, chain.origins[further, 1] - ay
            # There the way leads against the own direction (more than 120 degrees off), in a passage. Without a near
            # node of the plan, (ux, uy) is (0, 0), and nothing is against it.
            vx, vy = way[point + 1, 0] - x, way[point + 1, 1] - y
            against = ux * vx + uy * vy < -0.5 * hypot(ux, uy) * hypot(vx, vy)
            if against and near_any(passages, x, y, distance):
                return True
    return False


@kernel
def stops_in_way(timeline, ways, width):
    """Return True if a timeline must not end where it does, nearer than ``width`` [m] to one of ``ways`` (W, P, 2).

    It may end behind the begin of the way. It may also end in a way in which it begins, if it moves along it, not
    against it.
    """
    x, y = timeline[-1, 0], timeline[-1, 1]
    for way in ways:
        ax, ay = way[0, 0], way[0, 1]
        # Behind the begin of the way.
        if (x - ax) * (way[1, 0] - ax) + (y - ay) * (way[1, 1] - ay) < 0.0:
            continue
        away, ux, uy = nearest_of_way(way, x, y)
        if away < width:
            # It was not in the way at its begin, or moves against the way.
            before, _, _ = nearest_of_way(way, timeline[0, 0], timeline[0, 1])
            if before >= width or (x - timeline[0, 0]) * ux + (y - timeline[0, 1]) * uy < 0.0:
                return True
    return False


@kernel
def lay_way(origins, following, pose, meters, out):
    """Fill ``out`` (P, 2) with the way from ``pose`` through the origins of nodes ``following`` and later of a plan.

    ``origins`` (n, 3) are those of all its nodes. Of them and of ``pose`` only the first two values are read, x and y
    [m]. The way ends with the first node farther than ``meters`` along it, with the last node, or when ``out`` is full;
    without nodes it is one point. The rest of ``out`` repeats its last point. Return the largest distance of a point of
    the way from its begin [m].
    """
    out[0, 0], out[0, 1] = pose[0], pose[1]
    farthest = 0.0
    gone = 0.0
    # Skip nodes that begin nearer than this to the last point, so that P points are enough for all meters. The last
    # node is never skipped.
    least = meters / (len(out) - 1)
    k = 0
    for node in range(following, len(origins)):
        length = hypot(origins[node, 0] - out[k, 0], origins[node, 1] - out[k, 1])
        if length < least and node + 1 < len(origins):
            continue
        k += 1
        out[k, 0], out[k, 1] = origins[node, 0], origins[node, 1]
        gone += length
        farthest = max(farthest, hypot(out[k, 0] - pose[0], out[k, 1] - pose[1]))
        if k + 1 == len(out) or gone > meters:
            break
    # Fill up with the last point.
    for rest in range(k + 1, len(out)):
        out[rest, 0], out[rest, 1] = out[k, 0], out[k, 1]
    return farthest


@kernel
def rank_behind(row, ways, ranks, width, reach, near):
    """Return the lowest rank of the rows that ``row`` follows on its way, plus 1; FOREVER if it follows none.

    It follows rows whose ways begin ahead of the begin of its own way, nearer than ``reach`` [m] to it and nearer than
    ``width`` [m] to its own way, and lead in the direction of its own way there.
    """
    best = FOREVER
    way = ways[row]
    ox, oy = way[0, 0], way[0, 1]
    if math.isnan(ox):
        return best
    low, high, first, last = cells_within(near, ox, oy, ox, oy, reach + near.spread[OF_WAYS])
    for line in range(first, last + 1):
        number, after = rows_of_line(near, line, low, high)
        while number < after:
            other = near.order[number]
            number += 1
            # Only a lower rank than the best one so far can improve it, so the order of the rows does not matter.
            if other == row or ranks[other] >= best:
                continue
            x, y = ways[other, 0, 0], ways[other, 0, 1]
            # Also True for a row without a way (nan).
            if not hypot(x - ox, y - oy) < reach:
                continue
            off, ux, uy = nearest_of_way(way, x, y)
            if off < width:
                # Its way begins ahead, and its first segment is within 45 degrees (cosine 0.7) of the own way.
                vx, vy = ways[other, 1, 0] - x, ways[other, 1, 1] - y
                ahead = (x - ox) * ux + (y - oy) * uy
                if ahead > 0.0 and vx * ux + vy * uy > 0.7 * hypot(vx, vy) * hypot(ux, uy):
                    best = ranks[other] + 1
    return best


@kernel
def rank_at(turn, behind, x, y, passages, radius):
    """Return the rank of a row that comes to rest at (x, y) [m].

    It is the lower one of ``turn``, its own rank, and ``behind``, the one right behind a row that it follows
    (`rank_behind`). Nearer to one of ``passages`` (M, 4) than the ``radius`` of its body [m], it is lower by
    IN_PASSAGE, so that the row goes before all who are outside of passages: most bodies cannot turn about in a passage,
    so the others have to make room for the row to come out. Either argument may be lowered by IN_PASSAGE already (it is
    negative then); that is undone first.
    """
    rank = min(turn + IN_PASSAGE if turn < 0 else turn, behind + IN_PASSAGE if behind < 0 else behind)
    # Rows that go nowhere stay last: their rank, LAST, is not below IN_PASSAGE.
    return rank - IN_PASSAGE if rank < IN_PASSAGE and near_any(passages, x, y, radius) else rank


@kernel
def ways_before(row, ways, ranks, reach, near, out):
    """Gather the ways of rows with a lower rank that begin within ``reach`` [m] of the begin of the way of ``row``.

    Fill ``out`` (W, P, 2), by ascending row number, and return the number of ways filled in: W at most, those of the
    lowest row numbers, and 0 if ``row`` has no way.
    """
    x, y = ways[row, 0, 0], ways[row, 0, 1]
    if math.isnan(x):
        return 0
    count = 0
    low, high, first, last = cells_within(near, x, y, x, y, reach + near.spread[OF_WAYS])
    for line in range(first, last + 1):
        number, after = rows_of_line(near, line, low, high)
        while number < after:
            other = near.order[number]
            number += 1
            # The distance to a row without a way is nan, and the comparison False.
            if ranks[other] < ranks[row] and hypot(ways[other, 0, 0] - x, ways[other, 0, 1] - y) < reach:
                count = insert_row(near.found, count, other, min(len(out), len(near.found)))
    # Copy them in the order of their numbers.
    for number in range(count):
        its = ways[near.found[number]]
        for k in range(ways.shape[1]):
            out[number, k, 0] = its[k, 0]
            out[number, k, 1] = its[k, 1]
    return count


@kernel
def next_in_way(ways, ranks, may_move, me, pose, width, begin, near):
    """Return the first row, from number ``begin`` on, that stands in the way of row ``me`` and ranks behind it.

    It may move, and is nearer than ``width`` to the way [m]. Return -1 if there is none, or ``me`` has no way.
    """
    way = ways[me]
    left = right = way[0, 0]
    bottom = top = way[0, 1]
    if math.isnan(left):
        return -1
    # Bounding box of the way, to find the cells.
    for k in range(1, len(way)):
        left, right = min(left, way[k, 0]), max(right, way[k, 0])
        bottom, top = min(bottom, way[k, 1]), max(top, way[k, 1])
    best = -1
    low, high, first, last = cells_within(near, left, bottom, right, top, width)
    for line in range(first, last + 1):
        number, after = rows_of_line(near, line, low, high)
        while number < after:
            row = near.order[number]
            number += 1
            # The lowest number wins, whatever the order of the cells.
            if begin <= row and (best < 0 or row < best) and may_move[row] and ranks[row] > ranks[me]:
                off, _, _ = nearest_of_way(way, pose[row, 0], pose[row, 1])
                if off < width:
                    best = row
    return best
