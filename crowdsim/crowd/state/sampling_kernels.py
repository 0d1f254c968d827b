"""Timelines as samples: where a chain of nodes will be at the world's slots, how it bends in between, and gaps there.

Arguments: ``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`), ``chain`` and ``playback``
are those of :mod:`crowdsim.crowd.state.timelines`; the first ``count`` nodes of the chain count; ``frame`` is the one
of the first node from which it goes on; ``breadths`` (B, 2) are radius and half core of each behavior [m]. ``origin``
(3,), with ``cosine`` and ``sine`` of its heading, and ``blend_offset`` (3,) are those of a node; ``part`` is the
share of a frame, in [0, 1). ``out`` is the timeline that is filled, and ``axis`` a column of it.
The columns of a timeline (K, SAMPLE) are in :data:`crowdsim.crowd.state.components.SAMPLE`. For gaps, ``a`` and ``b``
are two timelines; one body moves straight from sample ``i`` of ``a`` to ``j``, the other from ``k`` of ``b`` to ``m``.
"""

import math

import numpy as np

from crowdsim.crowd.state.components import BEND, CORE, QUARTERS, RADIUS, REST
from crowdsim.crowd.state.timelines import Playback
from crowdsim.geometry.elementary_kernels import cos, cos_sin, hypot, sin
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, ticks_played
from crowdsim.motion.graph.track_kernels import blend_weight, node_end, track_pose_between

_DISCS = 4
"""Discs to either side of the middle of a capsule, where the motion of two bodies is followed exactly."""


@helper
def _set_sample(out, k, x, y, heading, breadth):
    """Write track and body to sample ``k`` of ``out``: the core lies across the direction that the body faces.

    ``breadth`` (2,) is the radius of the capsule and half the length of its core [m]; x, y: [m], heading: [rad]. BEND
    and all values behind it are set to 0.
    """
    out[k, 0] = x
    out[k, 1] = y
    out[k, RADIUS] = breadth[0]
    half = breadth[1]
    # A disc has no core, whatever its heading.
    out[k, CORE] = -half * sin(heading) if half > 0.0 else 0.0
    out[k, CORE + 1] = half * cos(heading) if half > 0.0 else 0.0
    out[k, BEND:] = 0.0


@helper
def from_stand(playback):
    """Return the playback of an agent that begins to walk now: at a full frame, at the natural rate."""
    rate = np.int64(FRAME_TICKS * playback.step_frames)
    return Playback(playback.clock, playback.slot_frames, playback.step_frames, playback.ramp, np.int64(0), rate, rate)


@kernel
def sample_chain(graph, chain, count, breadths, frame, playback, out):
    """Sample tracks and bodies of a chain at the slots; its first node is at frame ``frame`` now.

    ``out`` is filled from the present slot on. The first sample has the present body, and is placed so that linear
    interpolation gives the present position now. All samples after the end of the chain are at that end. Return the
    first slot at or after the end, or -1 if ``out`` has no sample at that slot.
    """
    ended = sample_places(graph, chain, count, breadths, frame, playback, out)
    if ended >= 0:
        measure_bends(graph, chain, count, breadths, frame, playback, ended, out)
    return ended


@helper
def sample_places(graph, chain, count, breadths, frame, playback, out):
    """Sample and return as :func:`sample_chain` does, but leave BEND and all values behind it at 0.

    They cost as much again; :func:`measure_bends` fills them.
    """
    nodes, origins, blend_offsets = chain.nodes, chain.origins, chain.blend_offsets
    clock, slot_frames = playback.clock, playback.slot_frames
    k = 0
    begin = np.int64(0)  # ticks of the chain up to the current node
    slot = clock // slot_frames
    first = np.int64(frame) * FRAME_TICKS
    played = first + playback.part  # ticks of the chain at sample k; the first is taken now
    for c in range(count):
        node = nodes[c]
        ticks = np.int64(graph.node_frames[node]) * FRAME_TICKS
        breadth = breadths[graph.node_behavior[node]]
        before = k  # number of samples set before this node
        # All slots that fall into this node; the first sample belongs to the present node in any case.
        while k < len(out) and (played < begin + ticks or k == 0):
            at = min(played - begin, ticks)
            whole, part = at // FRAME_TICKS, (at % FRAME_TICKS) / FRAME_TICKS
            o = origins[c]
            s = blend_offsets[c]
            x, y, h = track_pose_between(graph, np.int64(node), whole, part, o[0], o[1], o[2], s[0], s[1], s[2])
            _set_sample(out, k, x, y, h, breadth)
            k += 1
            slot += 1
            played = first + ticks_played(playback, slot * slot_frames - clock)
        if k == before and k > 0:
            # No sample fell into this node: the segment across it, from the last sample on, must be as broad as its
            # body, taken as a disc.
            out[k - 1, RADIUS] = max(out[k - 1, RADIUS], breadth[0] + breadth[1])
        begin += ticks
    # All samples lie before the end: there is none left at it.
    if k == len(out):
        return -1
    ended = slot
    o = origins[count - 1]
    x, y, h = node_end(graph, np.int64(nodes[count - 1]), o[0], o[1], o[2])
    while k < len(out):
        _set_sample(out, k, x, y, h, breadths[graph.node_behavior[nodes[count - 1]]])
        k += 1
    # If the present lies between two slots, the first sample is set to it so far: extrapolate it back to its slot.
    rest = (clock // slot_frames + 1) * slot_frames - clock
    if rest < slot_frames:
        for axis in range(2):
            out[0, axis] = out[1, axis] - (out[1, axis] - out[0, axis]) * slot_frames / rest
    return ended


@kernel
def sway_behind(graph, node, half):
    """Return how far a body comes off the end of a node while it stands there, in an idle node that may follow [m].

    ``half`` is the half length of its core [m], whose ends move on arcs. Return 0 if no idle node may follow.
    """
    most = 0.0
    for edge in range(graph.edge_start[node], graph.edge_start[node + 1]):
        idle = graph.edge_target[edge]
        if graph.node_idle[idle]:
            first = graph.node_track[idle]
            for row in range(first, first + graph.node_frames[idle] + 1):
                off = hypot(graph.tracks[row, 0], graph.tracks[row, 1]) + half * abs(graph.tracks[row, 2])
                most = max(most, off)
    return most


@helper
def measure_bends(graph, chain, count, breadths, frame, playback, ended, out):
    """Write BEND, QUARTERS and REST of all samples: how far the body is off its straight motion between them.

    ``out`` was filled by :func:`sample_places`. ``ended`` is the first slot at or after the end of the chain, from
    which on the body stands and only sways.
    """
    clock, slot_frames = playback.clock, playback.slot_frames
    start = clock // slot_frames
    first = np.int64(frame) * FRAME_TICKS
    c = 0
    begin = np.int64(0)  # ticks of the chain up to node c
    node = np.int64(chain.nodes[0])
    ticks = np.int64(graph.node_frames[node]) * FRAME_TICKS
    cosine, sine = cos_sin(chain.origins[0, 2])
    # For each frame of a slot [m]: offset of the track from the straight line (x, y), and distance of the end of the
    # core from its interpolated place. It stays 0 for frames before the present one.
    offs = np.zeros((slot_frames + 1, 3))
    for at in range(clock + 1, ended * slot_frames + 1):
        k = (at - 1) // slot_frames - start
        inside = at - (start + k) * slot_frames  # frames since the sample
        # The next sample is reached: all frames of the slot are known.
        if inside == slot_frames:
            _write_bends(offs, slot_frames, k, out)
            offs[:] = 0.0
            continue
        # The node that is played at this frame, and the place in it.
        played = first + ticks_played(playback, at - clock)
        while played >= begin + ticks and c + 1 < count:
            begin += ticks
            c += 1
            node = np.int64(chain.nodes[c])
            ticks = np.int64(graph.node_frames[node]) * FRAME_TICKS
            cosine, sine = cos_sin(chain.origins[c, 2])
        into = min(played - begin, ticks)
        whole, part = into // FRAME_TICKS, (into % FRAME_TICKS) / FRAME_TICKS
        x, y = _place_between(graph, node, whole, part, chain.origins[c], cosine, sine, chain.blend_offsets[c])
        share = inside / slot_frames
        offs[inside, 0] = x - _between(out, k, 0, share)
        offs[inside, 1] = y - _between(out, k, 1, share)
        # Only for capsules the heading matters; from a capsule to a disc and back, a larger disc is used (body_of).
        half = breadths[graph.node_behavior[node], 1]
        if half > 0.0 and _has_core(out, k) and _has_core(out, k + 1):
            o, s = chain.origins[c], chain.blend_offsets[c]
            _, _, h = track_pose_between(graph, node, whole, part, o[0], o[1], o[2], s[0], s[1], s[2])
            cx = -half * sin(h) - _between(out, k, CORE, share)
            cy = half * cos(h) - _between(out, k, CORE + 1, share)
            offs[inside, 2] = hypot(cx, cy)
    # Standing bodies sway, also in the rest of the slot in which the chain ends.
    last = np.int64(chain.nodes[count - 1])
    sway = sway_behind(graph, last, breadths[graph.node_behavior[last], 1])
    for standing in range(max(ended - start - 1, 0), len(out)):
        out[standing, BEND] += sway
        out[standing, REST] += sway


@helper
def _place(graph, node, frame, origin, cosine, sine, blend_offset):
    """Return x, y [m] of :func:`crowdsim.motion.graph.track_kernels.track_pose`, equal to the last bit.

    ``cosine`` and ``sine`` of the heading of ``origin`` are given, so that they are computed once for a node.
    """
    row = graph.node_track[node] + frame
    tx, ty = graph.tracks[row, 0], graph.tracks[row, 1]
    x, y = origin[0] + cosine * tx - sine * ty, origin[1] + sine * tx + cosine * ty
    w = blend_weight(frame)
    return x + w * blend_offset[0], y + w * blend_offset[1]


@helper
def _place_between(graph, node, frame, part, origin, cosine, sine, blend_offset):
    """Return x, y [m] of :func:`track_pose_between`, equal to the last bit, but faster as it leaves out headings."""
    ax, ay = _place(graph, node, frame, origin, cosine, sine, blend_offset)
    if part <= 0.0 or frame >= graph.node_frames[node]:
        return ax, ay
    bx, by = _place(graph, node, frame + 1, origin, cosine, sine, blend_offset)
    return ax + part * (bx - ax), ay + part * (by - ay)


@helper
def _write_bends(offs, slot_frames, k, out):
    """Write BEND, QUARTERS and REST of sample ``k``, of which BEND and REST are 0 before.

    ``offs`` (slot_frames + 1, 3) [m] says how far the body is off its straight motion at each frame: offset of the
    track (x, y), and distance of the end of the core from its interpolated place. It is 0 in both end rows.
    """
    quarter = slot_frames // 4
    for s in range(3):
        for axis in range(2):
            out[k, QUARTERS + 2 * s + axis] = offs[(s + 1) * quarter, axis]
    for frame in range(1, slot_frames):
        out[k, BEND] = max(out[k, BEND], hypot(offs[frame, 0], offs[frame, 1]) + offs[frame, 2])
        # Piece from one quarter to the next on which the frame lies. If the frames of a slot are not a multiple of 4,
        # those left over belong to the last piece.
        begin = min(frame // quarter, 3) * quarter
        share = (frame - begin) / quarter
        dx = offs[frame, 0] - offs[begin, 0] - share * (offs[begin + quarter, 0] - offs[begin, 0])
        dy = offs[frame, 1] - offs[begin, 1] - share * (offs[begin + quarter, 1] - offs[begin, 1])
        out[k, REST] = max(out[k, REST], hypot(dx, dy) + offs[frame, 2])


@helper
def _has_core(out, k):
    """Return True if the body at sample ``k`` is a capsule, not a disc."""
    return out[k, CORE] != 0.0 or out[k, CORE + 1] != 0.0


@helper
def _between(out, k, axis, share):
    """Return column ``axis`` of a timeline, interpolated at ``share`` of the way from sample ``k`` to the next one."""
    return out[k, axis] + share * (out[k + 1, axis] - out[k, axis])


@helper
def body_of(a, i, j):
    """Return the radius of a body from sample ``i`` to ``j`` [m], and True if it is a capsule at both.

    If it is a capsule at one of them only, it may change to the disc at any time in between, so it counts as a disc
    that contains both.
    """
    if _has_core(a, i) and _has_core(a, j):
        return max(a[i, RADIUS], a[j, RADIUS]), True
    at_i = a[i, RADIUS] + hypot(a[i, CORE], a[i, CORE + 1])
    at_j = a[j, RADIUS] + hypot(a[j, CORE], a[j, CORE + 1])
    return max(at_i, at_j), False


@helper
def moving_gap(a, i, j, b, k, m):
    """Return the least gap of two bodies [m] while they move straight from sample ``i`` to ``j`` and ``k`` to ``m``.

    It is negative if they overlap. A capsule is replaced by three discs, in the middle and at both ends of its core.
    Each body has the larger radius of its two samples all the way.
    """
    my_radius, my_discs = body_of(a, i, j)
    its_radius, its_discs = body_of(b, k, m)
    radii = my_radius + its_radius
    mine = 1 if my_discs else 0
    its = 1 if its_discs else 0
    least = math.inf
    for p in range(-mine, mine + 1):
        for q in range(-its, its + 1):
            # Relative motion of two discs: a point that moves from d to d + e. It is nearest to the origin at d + t e,
            # t in [0, 1]. If it does not move, any t will do.
            dx = a[i, 0] + p * a[i, CORE] - b[k, 0] - q * b[k, CORE]
            dy = a[i, 1] + p * a[i, CORE + 1] - b[k, 1] - q * b[k, CORE + 1]
            ex = a[j, 0] + p * a[j, CORE] - b[m, 0] - q * b[m, CORE] - dx
            ey = a[j, 1] + p * a[j, CORE + 1] - b[m, 1] - q * b[m, CORE + 1] - dy
            square = ex * ex + ey * ey
            t = 0.0
            if square > 0.0:
                t = min(max(-(dx * ex + dy * ey) / square, 0.0), 1.0)
            cx = dx + t * ex
            cy = dy + t * ey
            least = min(least, cx * cx + cy * cy)
    return math.sqrt(least) - radii


@helper
def _at_quarter(a, i, j, quarter, p, axis):
    """Return a coordinate of a point of a core after ``quarter`` quarters (0 to 4) of the way from ``i`` to ``j`` [m].

    ``p`` is the place on the core, -1 and 1 at its ends; ``axis`` is 0 for x, 1 for y. The offset QUARTERS is added
    after one to three quarters, unless the body stays in one sample (``i`` is ``j``), as past the end of its timeline.
    """
    share = 0.25 * quarter
    core = a[i, CORE + axis] + share * (a[j, CORE + axis] - a[i, CORE + axis])
    place = a[i, axis] + share * (a[j, axis] - a[i, axis]) + p * core
    if j > i and 0 < quarter < 4:
        place += a[i, QUARTERS + 2 * (quarter - 1) + axis]
    return place


@helper
def beside_discs(a, i, j, pieces):
    """Return how far a capsule reaches beyond discs along its core [m].

    One disc is at the middle of the core, and ``pieces`` discs are to either side of it, evenly up to the end. The body
    moves from sample ``i`` to ``j``; return 0 unless it is a capsule at both.
    """
    radius, is_capsule = body_of(a, i, j)
    if not is_capsule:
        return 0.0
    # Half the core, the longer one of both samples: the centers of neighboring discs are half / pieces apart.
    half = max(hypot(a[i, CORE], a[i, CORE + 1]), hypot(a[j, CORE], a[j, CORE + 1]))
    # The outlines of two neighboring discs cross halfway between their centers, ``away`` from either: there the discs
    # reach less far off the core than the capsule, which reaches ``radius``. Discs too far apart to cross do not cover
    # the core halfway at all (0).
    away = 0.5 * half / pieces
    return radius - math.sqrt(max(radius * radius - away * away, 0.0))


@helper
def sure_gap(a, i, j, b, k, m):
    """Return a lower bound of the gap of two bodies [m] from sample ``i`` to ``j`` and from ``k`` to ``m``.

    Tracks are followed in straight pieces from quarter to quarter, and capsules are nine discs. The distance of bodies
    from these pieces (REST) and what capsules reach beyond their discs are subtracted.
    """
    my_radius, my_discs = body_of(a, i, j)
    its_radius, its_discs = body_of(b, k, m)
    mine = _DISCS if my_discs else 0
    its = _DISCS if its_discs else 0
    least = math.inf
    for p in range(-mine, mine + 1):
        for q in range(-its, its + 1):
            u, v = p / _DISCS, q / _DISCS
            dx = _at_quarter(a, i, j, 0, u, 0) - _at_quarter(b, k, m, 0, v, 0)
            dy = _at_quarter(a, i, j, 0, u, 1) - _at_quarter(b, k, m, 0, v, 1)
            for quarter in range(1, 5):
                ex = _at_quarter(a, i, j, quarter, u, 0) - _at_quarter(b, k, m, quarter, v, 0)
                ey = _at_quarter(a, i, j, quarter, u, 1) - _at_quarter(b, k, m, quarter, v, 1)
                least = min(least, point_segment_distance2(0.0, 0.0, dx, dy, ex, ey))
                dx, dy = ex, ey
    gap = math.sqrt(least) - my_radius - its_radius
    return gap - a[i, REST] - b[k, REST] - beside_discs(a, i, j, _DISCS) - beside_discs(b, k, m, _DISCS)
