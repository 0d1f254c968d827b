"""Timelines as samples: where a chain of nodes will be at the world's slots, and how far it bends in between.

Arguments: ``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`), ``chain`` and ``playback``
are those of :mod:`crowdsim.crowd.state.timelines`; ``frame`` is the one of the first node from which the chain goes on.
The columns of a timeline (K, 13) are in :data:`crowdsim.crowd.state.components.SAMPLE`.
"""

import numpy as np

from crowdsim.crowd.state.components import BEND, CORE, QUARTERS, RADIUS, REST
from crowdsim.crowd.state.timelines import Playback
from crowdsim.geometry.elementary_kernels import cos, hypot, sin
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, ticks_played
from crowdsim.motion.graph.track_kernels import node_end, track_pose_between


@helper
def _set_sample(out, k, x, y, heading, breadth):
    """Write track and body to sample ``k`` of ``out`` (K, 13): the core lies across the direction that the body faces.

    ``breadth`` (2,) is the radius of the capsule and half the length of its core [m]; heading: [rad].
    """
    out[k, 0] = x
    out[k, 1] = y
    out[k, RADIUS] = breadth[0]
    half = breadth[1]
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

    ``breadths`` (B, 2) and ``playback`` are those of :mod:`crowdsim.crowd.state.timelines`. ``out`` (K, 13) is filled
    from the present slot on. The first sample has the present body, and is placed so that linear interpolation gives
    the present position now. After the end of the chain the samples stay there. Return the first slot at or after the
    end, or -1 if the chain takes more slots than ``out`` has.
    """
    nodes, origins, blend_offsets = chain.nodes, chain.origins, chain.blend_offsets
    clock, slot_frames = playback.clock, playback.slot_frames
    k = 0
    begin = np.int64(0)  # ticks of the chain up to the current node
    slot = clock // slot_frames
    first = np.int64(frame) * FRAME_TICKS
    played = first + playback.part  # ticks of the chain at the slot
    for c in range(count):
        node = nodes[c]
        ticks = np.int64(graph.node_frames[node]) * FRAME_TICKS
        breadth = breadths[graph.node_behavior[node]]
        before = k
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
            # A node between two samples has none: the segment must be as broad as its body.
            out[k - 1, RADIUS] = max(out[k - 1, RADIUS], breadth[0] + breadth[1])
        begin += ticks
    if k == len(out):
        return -1
    ended = slot
    o = origins[count - 1]
    x, y, h = node_end(graph, np.int64(nodes[count - 1]), o[0], o[1], o[2])
    while k < len(out):
        _set_sample(out, k, x, y, h, breadths[graph.node_behavior[nodes[count - 1]]])
        k += 1
    # The present lies between two slots: extrapolate the first sample backwards.
    rest = (clock // slot_frames + 1) * slot_frames - clock
    if rest < slot_frames:
        for axis in range(2):
            out[0, axis] = out[1, axis] - (out[1, axis] - out[0, axis]) * slot_frames / rest
    _measure_bends(graph, chain, count, breadths, frame, playback, ended, out)
    # Standing bodies sway, also in the rest of the slot in which the chain ends.
    last = nodes[count - 1]
    sway = sway_behind(graph, np.int64(last), breadths[graph.node_behavior[last], 1])
    for standing in range(max(ended - clock // slot_frames - 1, 0), len(out)):
        out[standing, BEND] += sway
        out[standing, REST] += sway
    return ended


@kernel
def sway_behind(graph, node, half):
    """Return how far a body comes off the end of a node while it stands there, in an idle node that may follow [m].

    ``half`` is the half length of its core [m].
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
def _measure_bends(graph, chain, count, breadths, frame, playback, ended, out):
    """Write to each sample of ``out`` how the body comes off its straight motion to the next one, at any frame.

    ``ended`` is the first slot at or after the end of the chain, behind which nothing moves.
    """
    clock, slot_frames = playback.clock, playback.slot_frames
    start = clock // slot_frames
    first = np.int64(frame) * FRAME_TICKS
    c = 0
    begin = np.int64(0)  # ticks of the chain up to node c
    ticks = np.int64(graph.node_frames[chain.nodes[0]]) * FRAME_TICKS
    # Of each frame of a slot: how far the track is off the straight line (x, y), and the end of the core off its own.
    offs = np.zeros((slot_frames + 1, 3))
    for at in range(clock + 1, ended * slot_frames + 1):
        k = (at - 1) // slot_frames - start
        inside = at - (start + k) * slot_frames
        if inside == slot_frames:
            _write_bends(offs, slot_frames, k, out)
            offs[:] = 0.0
            continue
        # The node that is played at this frame, and the pose in it.
        played = first + ticks_played(playback, at - clock)
        while played >= begin + ticks and c + 1 < count:
            begin += ticks
            c += 1
            ticks = np.int64(graph.node_frames[chain.nodes[c]]) * FRAME_TICKS
        into = min(played - begin, ticks)
        whole, part = into // FRAME_TICKS, (into % FRAME_TICKS) / FRAME_TICKS
        o, s = chain.origins[c], chain.blend_offsets[c]
        node = np.int64(chain.nodes[c])
        x, y, h = track_pose_between(graph, node, whole, part, o[0], o[1], o[2], s[0], s[1], s[2])
        share = inside / slot_frames
        offs[inside, 0] = x - _between(out, k, 0, share)
        offs[inside, 1] = y - _between(out, k, 1, share)
        half = breadths[graph.node_behavior[node], 1]
        if half > 0.0 and _has_core(out, k) and _has_core(out, k + 1):
            cx = -half * sin(h) - _between(out, k, CORE, share)
            cy = half * cos(h) - _between(out, k, CORE + 1, share)
            offs[inside, 2] = hypot(cx, cy)


@helper
def _write_bends(offs, slot_frames, k, out):
    """Write BEND, QUARTERS and REST of sample ``k``, from how far each frame (slot_frames + 1, 3) is off."""
    quarter = slot_frames // 4
    for s in range(3):
        for axis in range(2):
            out[k, QUARTERS + 2 * s + axis] = offs[(s + 1) * quarter, axis]
    for frame in range(1, slot_frames):
        out[k, BEND] = max(out[k, BEND], hypot(offs[frame, 0], offs[frame, 1]) + offs[frame, 2])
        # The piece between two quarters on which the frame lies.
        begin = min(frame // quarter, 3) * quarter
        share = (frame - begin) / quarter
        dx = offs[frame, 0] - offs[begin, 0] - share * (offs[begin + quarter, 0] - offs[begin, 0])
        dy = offs[frame, 1] - offs[begin, 1] - share * (offs[begin + quarter, 1] - offs[begin, 1])
        out[k, REST] = max(out[k, REST], hypot(dx, dy) + offs[frame, 2])


@helper
def _has_core(out, k):
    """Return True if the body at sample ``k`` is a capsule; else the segment beside it is as broad as a disc."""
    return out[k, CORE] != 0.0 or out[k, CORE + 1] != 0.0


@helper
def _between(out, k, axis, share):
    """Return what column ``axis`` of a timeline is ``share`` of the way from sample ``k`` to the next one."""
    return out[k, axis] + share * (out[k + 1, axis] - out[k, axis])
