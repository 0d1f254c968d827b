"""Reserved timelines: where an agent will be until it stands, and whether two of them ever meet.

A timeline samples track and body at the world's slots (every ``slot_frames`` frames of the global clock) from slot
``start`` on. After its last sample the agent stands there for ever, or is gone from slot ``gone`` on. Between
two samples, positions are interpolated linearly, and the body is at most BEND of the first sample off these. A body is
a disc as broad as its behavior, narrower with the arms held in, or, if it walks sideways, a capsule along its way.

Arguments of all helpers: a timeline (K, SAMPLE) with its ``start`` and ``gone`` slots; ``first_slot``, before which
meetings do not count; ``radius`` of the body at rest [m]; ``obstacles`` (Obstacles), ``everyone`` or ``others``
(Timelines, those of all rows), ``chain``, ``draft`` (a scratch chain) and ``playback`` as of
:mod:`crowdsim.crowd.state.timelines`; ``frame``, the one of the present node from which a chain goes on. ``graph`` is
the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`); ``a`` and ``b`` are two timelines (K, SAMPLE),
each with its own start and gone slots; ``me`` and ``row`` are rows, -1 for an agent that has yet to enter the world.
The columns of a timeline are those of :data:`crowdsim.crowd.state.components.SAMPLE`.
"""

import math

import numpy as np

from crowdsim.crowd.near.neighbor_kernels import OF_BODIES, OF_TIMELINES, cells_within, insert_row, rows_of_line
from crowdsim.crowd.state.body_kernels import meets_body
from crowdsim.crowd.state.components import BEND, RADIUS
from crowdsim.crowd.state.sampling_kernels import beside_discs, measure_bends, moving_gap, sample_places, sure_gap
from crowdsim.crowd.state.way_kernels import FOREVER, meets_oncoming, stops_in_passage, stops_in_way
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.geometry.segments_kernels import segment_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, ticks_played
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose
from crowdsim.navmesh.clearance.clearance_kernels import capsule_clearance, disc_clearance
from crowdsim.navmesh.mesh.address_kernels import mesh_at

ELBOW_ROOM = 0.1
"""Gap between the discs of two agents at rest [m]."""

BLOCKED = -1
"""No timeline: its stop touches an obstacle or is too long for a chain, or it comes near a movable about to appear."""

NARROW = -3
"""No timeline: it ends in a narrow passage, but does not begin in one, and that is not tolerated."""

IN_WAY = -4
"""No timeline: it ends in the way ahead of an agent that goes first, or meets a steered body."""

TOO_LONG = -2
"""No timeline: it takes more slots than there are."""

ROUNDING = 1e-9
"""Tolerance of comparisons of distances [m]."""

_STATIC_STRIDE = 4  # frames between two samples of the test against obstacles

BEYOND = 0.06
"""Clearance beyond a body's radius up to which it is measured [m]. The motion between two samples is tested, too, if it
is longer than what is measured at both ends together."""

_REACH_ROUNDING = 1e-3
"""Distance added to the length of a track, for rounding [m]: the points of a mesh lie on a grid."""

_WINDING = 0.01
"""Length by which a track is longer than the straight line between two samples, at most [m]."""


@kernel
def pair_meets(a, a_start, a_gone, b, b_start, b_gone, first_slot, at_rest, present):
    """Return True if two bodies touch along their timelines at or after ``first_slot``, or come to rest too near.

    a, b: (K, 13) samples, from the slots a_start and b_start to before a_gone and b_gone. No contact is missed, to the
    end of time. What capsules and bends add to discs on straight pieces counts by an upper bound, so a near pass may
    count as a contact. ``at_rest`` is the sum of the radii of both bodies at rest [m]: if both stay for ever, their
    tracks end at least ``at_rest`` + ELBOW_ROOM apart, so that either can turn on the spot. ``present`` is True if both
    are in the world, False if one has yet to enter it. If both are present and too near already at ``first_slot``, they
    may come to rest as near, and overlap as much, as they do then; otherwise they could never part.
    """
    # One of them is gone by then.
    if first_slot >= a_gone or first_slot >= b_gone:
        return False
    # Samples at the first slot; before its begin and past its end a timeline stays at its first and last sample.
    ia = min(max(first_slot - a_start, 0), len(a) - 1)
    ib = min(max(first_slot - b_start, 0), len(b) - 1)
    apart = at_rest + ELBOW_ROOM
    overlap = 0.0  # least gap allowed
    # Two that are too near already only have to stay as far apart as they are.
    if present:
        apart = min(apart, hypot(a[ia, 0] - b[ib, 0], a[ia, 1] - b[ib, 1]) - ROUNDING)
        overlap = min(moving_gap(a, ia, ia, b, ib, ib) - ROUNDING, 0.0)
    first_a, first_b = ia, ib
    # Both stay for ever: compare the places where they come to rest.
    rest = hypot(a[-1, 0] - b[-1, 0], a[-1, 1] - b[-1, 1])
    if rest < apart and min(a_gone, b_gone) == FOREVER:
        return True
    last = max(a_start + len(a), b_start + len(b))
    # Compare the segments, from sample i to j of each, slot by slot, until one is gone or both are at rest.
    for slot in range(first_slot, last):
        if slot >= a_gone or slot >= b_gone:
            return False
        ia = min(max(slot - a_start, 0), len(a) - 1)
        ja = min(max(slot + 1 - a_start, 0), len(a) - 1)
        ib = min(max(slot - b_start, 0), len(b) - 1)
        jb = min(max(slot + 1 - b_start, 0), len(b) - 1)
        gap = moving_gap(a, ia, ja, b, ib, jb)
        if gap < overlap:
            return True
        # Tracks bend between samples, and capsules are broader than three discs: look closer where that could matter.
        bend = a[ia, BEND] + b[ib, BEND]
        # A capsule reaches beyond its discs by its radius at most, which is known without roots.
        if gap >= bend + max(a[ia, RADIUS], a[ja, RADIUS]) + max(b[ib, RADIUS], b[jb, RADIUS]):
            continue
        if gap < bend + beside_discs(a, ia, ja, 1) + beside_discs(b, ib, jb, 1):
            # Least gap allowed: as above, by the closer look.
            allowed = 0.0
            if present:
                allowed = min(sure_gap(a, first_a, first_a, b, first_b, first_b) - ROUNDING, 0.0)
            if sure_gap(a, ia, ja, b, ib, jb) < allowed:
                return True
    return False


@kernel
def meets_anyone(me, timeline, start, gone, first_slot, radius, others):
    """Return True if a candidate timeline of row ``me`` meets the timeline of another row (see `pair_meets`)."""
    return next_met(me, timeline, start, gone, first_slot, radius, others, 0) >= 0


@kernel
def next_met(me, timeline, start, gone, first_slot, radius, others, begin):
    """Return the first row, from number ``begin`` on, that a candidate timeline of row ``me`` meets; -1 if none."""
    starts, gones, circles = others.timeline_start, others.gone_slot, others.timeline_circle
    # Radius of a circle around the first sample that contains the candidate.
    reach = 0.0
    for k in range(len(timeline)):
        dx = timeline[k, 0] - timeline[0, 0]
        dy = timeline[k, 1] - timeline[0, 1]
        reach = max(reach, dx * dx + dy * dy)
    reach = math.sqrt(reach)
    # Gather the rows whose circles are within reach, by ascending number: the result must not depend on the cells.
    near, x, y = others.near, timeline[0, 0], timeline[0, 1]
    found = near.found
    count = 0
    farthest = reach + radius + near.spread[OF_TIMELINES] + near.spread[OF_BODIES] + ELBOW_ROOM
    low, high, first, last = cells_within(near, x, y, x, y, farthest)
    for line in range(first, last + 1):
        number, after = rows_of_line(near, line, low, high)
        while number < after:
            other = near.order[number]
            number += 1
            # A row that has left the world takes no room.
            if other < begin or other == me or gones[other] <= first_slot:
                continue
            dx = circles[other, 0] - x
            dy = circles[other, 1] - y
            far = circles[other, 2] + reach + (radius + others.body_radius[other]) + ELBOW_ROOM
            if dx * dx + dy * dy <= far * far:
                count = insert_row(found, count, other, len(found))
    for number in range(count):
        other = found[number]
        distance = radius + others.body_radius[other]
        # Sample at the first slot, clamped as in `pair_meets`.
        here = min(max(first_slot - starts[other], 0), others.timeline.shape[1] - 1)
        end = others.timeline.shape[1] - 1
        its = others.timeline[other]
        # Test the samples still to come, which may lie in a smaller area than the circle.
        if not _within_reach(timeline[0], its, here, end, reach + distance + ELBOW_ROOM):
            continue
        if pair_meets(timeline, start, gone, its, starts[other], gones[other], first_slot, distance, me >= 0):
            return other
    return -1


@helper
def _within_reach(center, other, first, last, reach):
    """Return True if any sample ``first`` to ``last`` of ``other`` is within ``reach`` [m] of the sample ``center``."""
    for k in range(first, last + 1):
        dx = other[k, 0] - center[0]
        dy = other[k, 1] - center[1]
        if dx * dx + dy * dy <= reach * reach:
            return True
    return False


@kernel
def node_is_free(graph, node, origin, blend_offset, obstacles, hints):
    """Return True if the disc of a node's behavior keeps clear of all layers' obstacles along the whole node.

    ``origin`` and ``blend_offset`` (3,) place the node in the world; ``hints`` (layers,) are the triangles found last
    on each layer, -1 for none, and are updated.
    """
    frames = np.int64(graph.node_frames[node])
    node = np.int64(node)
    dx, dy, dh = blend_offset[0], blend_offset[1], blend_offset[2]
    # Distance from its origin that the track of the node stays within.
    reach = graph.node_length[node] + hypot(dx, dy) + _REACH_ROUNDING
    for k in range(len(obstacles.layers)):
        mesh = mesh_at(obstacles.layers[k])
        need = obstacles.radii[graph.node_behavior[node], k]
        # In the open one look is enough: nothing stands where the body could come to.
        distance, hints[k] = disc_clearance(mesh, origin[0], origin[1], need + reach, hints[k])
        if distance >= need + reach:
            continue
        left = math.inf  # clearance beyond the body at the sample before
        frame = np.int64(-_STATIC_STRIDE)  # one stride before the first sample, which is frame 0
        while frame < frames:
            before = frame
            frame = min(frame + _STATIC_STRIDE, frames)
            x, y, _ = track_pose(graph, node, frame, origin[0], origin[1], origin[2], dx, dy, dh)
            distance, hints[k] = disc_clearance(mesh, x, y, need + BEYOND, hints[k])
            if distance < need:
                return False
            room = left + distance - need
            if not stays_free(graph, mesh, node, before, frame, origin, blend_offset, need, room, hints[k]):
                return False
            left = distance - need
    return True


@helper
def stays_free(graph, mesh, node, first, last, origin, blend_offset, need, room, hint):
    """Return True if a disc that keeps clear of one layer's obstacles at frame ``last`` does so from ``first`` on.

    ``mesh`` (MeshArrays) is that layer's, ``hint`` the triangle to look in first, -1 for none; ``origin`` and
    ``blend_offset`` (3,) are those of the node. ``room`` [m] is the sum of the clearances at frames ``first`` and
    ``last`` beyond the radius ``need`` of the disc; one that was not measured counts as 0. If the track in between is
    no longer than ``room``, the disc cannot reach an obstacle. Otherwise its straight motion from frame to frame is
    tested. An infinite ``room`` means that ``last`` is the first frame of a test: nothing lies between.
    """
    ox, oy, oh = origin[0], origin[1], origin[2]
    dx, dy, dh = blend_offset[0], blend_offset[1], blend_offset[2]
    if room == math.inf:
        return True
    x, y, _ = track_pose(graph, node, first, ox, oy, oh, dx, dy, dh)
    ex, ey, _ = track_pose(graph, node, last, ox, oy, oh, dx, dy, dh)
    if room >= hypot(ex - x, ey - y) + _WINDING:
        return True
    for frame in range(first + 1, last + 1):
        bx, by, _ = track_pose(graph, node, np.int64(frame), ox, oy, oh, dx, dy, dh)
        distance, hint = capsule_clearance(mesh, x, y, bx, by, need, hint)
        if distance < need:
            return False
        x, y = bx, by
    return True


@kernel
def append_stop(graph, chain, count):
    """Append the nodes that bring a chain of ``count`` nodes to a stand, in place.

    Return the new count; -1 if the arrays of the chain have no room.
    """
    nodes, origins, blend_offsets = chain.nodes, chain.origins, chain.blend_offsets
    node = nodes[count - 1]
    while graph.stop_edge[node] >= 0:
        if count == len(nodes):
            return -1
        # Each node begins where the one before ends; the offset between both poses fades along it.
        edge = graph.stop_edge[node]
        o = origins[count - 1]
        ex, ey, eh = node_end(graph, np.int64(node), o[0], o[1], o[2])
        x, y, h = next_origin(graph, np.int64(edge), 0.0, ex, ey, eh)
        node = graph.edge_target[edge]
        nodes[count] = node
        origins[count, 0] = x
        origins[count, 1] = y
        origins[count, 2] = h
        blend_offsets[count, 0] = ex - x
        blend_offsets[count, 1] = ey - y
        blend_offsets[count, 2] = wrap_angle(eh - h)
        count += 1
    return count


@kernel
def comes_near(timeline, segments, distance):
    """Return True if the track comes nearer than ``distance`` to any of ``segments`` (M, 4), x, y of both ends [m]."""
    square = distance * distance
    for k in range(len(timeline) - 1):
        ax, ay, bx, by = timeline[k, 0], timeline[k, 1], timeline[k + 1, 0], timeline[k + 1, 1]
        for m in range(len(segments)):
            s = segments[m]
            if segment_segment_distance2(ax, ay, bx, by, s[0], s[1], s[2], s[3]) < square:
                return True
    return False


@helper
def _copy_chain(chain, to):
    """Copy a chain element by element: the shape checks of whole arrays take three seconds to compile."""
    for k in range(len(chain.nodes)):
        to.nodes[k] = chain.nodes[k]
        for axis in range(3):
            to.origins[k, axis] = chain.origins[k, axis]
            to.blend_offsets[k, axis] = chain.blend_offsets[k, axis]


@helper
def lay_out(graph, obstacles, frame, playback, chain, draft, taken, leaves, tolerant, timeline):
    """Sample the present node of a chain and ``taken`` next ones, then the stop unless the agent ``leaves`` the world.

    ``timeline`` and ``draft`` are overwritten. Return the first slot at or after the end of the last of these nodes;
    or, below 0, why they are not allowed: BLOCKED, TOO_LONG, NARROW (never if ``tolerant``) or IN_WAY. An agent that
    leaves does not stop anywhere, so it is not tested for NARROW, and for IN_WAY against steered bodies only.
    """
    _copy_chain(chain, draft)
    count = taken + 1
    if not leaves:
        # The plan's nodes are free of obstacles; the nodes of the stop are not tested yet.
        hints = np.full(len(obstacles.layers), np.int64(-1))
        count = append_stop(graph, draft, taken + 1)
        for c in range(taken + 1, count):
            if not node_is_free(graph, draft.nodes[c], draft.origins[c], draft.blend_offsets[c], obstacles, hints):
                return BLOCKED
        # The chain has no room for the stop.
        if count < 0:
            return BLOCKED
    ended = sample_places(graph, draft, count, obstacles.breadths, frame, playback, timeline)
    if ended < 0:
        return TOO_LONG
    # The rules of docs/waiting.md, cheapest first: room for movables about to appear, passages, ways, steered bodies.
    if len(obstacles.kept_free) and comes_near(timeline, obstacles.kept_free, obstacles.distance):
        return BLOCKED
    if not (leaves or tolerant) and stops_in_passage(timeline, obstacles.passages, obstacles.off_passages):
        return NARROW
    if not leaves and stops_in_way(timeline, obstacles.ways, obstacles.way_width):
        return IN_WAY
    # Other bodies count between samples, too.
    measure_bends(graph, draft, count, obstacles.breadths, frame, playback, ended, timeline)
    if meets_body(obstacles.agent, timeline, obstacles.bodies):
        return IN_WAY
    return ended


@helper
def enters_against(timeline, chain, available, obstacles):
    """Return True if a timeline enters a narrow passage against another agent; see `meets_oncoming`.

    ``available`` nodes of the plan follow the first one of the ``chain``.
    """
    off, radius = obstacles.off_passages, obstacles.body_radius
    return meets_oncoming(timeline, chain, available, obstacles.ways, obstacles.passages, off, radius)


@helper
def _fixed_until(graph, chain, taken, frame, playback, most):
    """Return the slot before which a timeline of ``taken`` nodes stays the same if more nodes are taken.

    It is ``most`` at most. The piece from one sample to the next depends on what is played until the sample behind
    both: the second one is at least as broad as a short node that is played between it and the one behind.
    """
    # Ticks of the present node and those taken, behind which more nodes or the stop follow.
    ticks = np.int64(0)
    for c in range(taken + 1):
        ticks += np.int64(graph.node_frames[chain.nodes[c]]) * FRAME_TICKS
    first = np.int64(frame) * FRAME_TICKS
    slot = playback.clock // playback.slot_frames
    while slot < most and first + ticks_played(playback, (slot + 2) * playback.slot_frames - playback.clock) < ticks:
        slot += 1
    return slot


@kernel
def reserve(
    graph, obstacles, everyone, row, frame, playback, chain, draft, first, available, ends_plan, strict, timeline
):
    """Find the shortest continuation that ends standing, or gone, touches no obstacle and meets no timeline.

    Entry 0 of ``chain`` is the present node, entries 1 to ``available`` are the next nodes of the plan, of which at
    least ``first`` are taken. ``draft`` is scratch of the same size. ``ends_plan``: the agent leaves the world
    after the last of them. ``strict``: it stops in no narrow passage, even if the plan offers no other place.

    Return the number of nodes taken, 0 if there is no continuation; the slot from which the agent is gone, FOREVER if
    it stands; and True if, without other agents, it could leave or stand outside of narrow passages. The timeline found
    (or the last one that was tried) is left in ``timeline``.
    """
    forever = np.int64(FOREVER)
    start = playback.clock // playback.slot_frames
    # Stops in narrow passages are allowed only if the plan offers no other place to stand at all.
    stands = False  # True if there is such a place; only the first round, which is not tolerant, finds out
    for tolerant in range(1 if strict else 2):
        for taken in range(first, available + 1):
            leaves = ends_plan and taken == available
            found = lay_out(graph, obstacles, frame, playback, chain, draft, taken, leaves, tolerant, timeline)
            if found == TOO_LONG:
                break  # more nodes hardly ever take less time
            stands = stands or (not tolerant and (found >= 0 or found == IN_WAY))
            if found < 0:
                continue  # it cannot come to a stand after this node; try the next
            if not leaves and enters_against(timeline, chain, available, obstacles):
                continue
            gone = found if leaves else forever
            if not meets_anyone(row, timeline, start, gone, start, obstacles.body_radius, everyone):
                return taken, gone, stands
            # It meets another timeline. If that is before its stop sets in, all longer continuations do, too; else one
            # with more nodes may get past.
            fixed = _fixed_until(graph, chain, taken, frame, playback, start + len(timeline))
            if meets_anyone(row, timeline, start, fixed, start, obstacles.body_radius, everyone):
                break
        if stands:
            break
    return 0, forever, stands
