"""Tracks of captured bodies between two steps: along the tracks of the nodes that they play.

A straight line from step to step would turn a corner at each step, and a body whose clip sways or turns meanwhile would
be jerked along it. Between steps a body plays known frames of its nodes. They lack only the blend offset, which fades
meanwhile, so only this is interpolated.

Arguments of all helpers: ``nodes``, the :class:`NodeTracks`; ``frame``, of a node, also between two frames; ``begin``
and ``end``, frames of a node; ``spans`` (2,), lengths of the floor along x and y [m], 0 if it is not periodic there;
poses are x, y [m] and heading [rad]; ``natural``, frames that a step takes at the natural rate; ``old`` and ``new``,
nodes at both ends of a step (-1 for none), with ``old_frame`` and ``new_frame``, and the track poses ``old_pose`` and
``new_pose`` there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import shorter_way, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import blend_weight

_NOTHING = 1e-9

_MOST_WHOLE = 20.0
"""Largest factor by which the change of a turn in one step is extrapolated to that of the whole blend offset: a larger
one would magnify rounding."""


class NodeTracks(NamedTuple):
    """Tracks of N nodes: node n has rows ``first[n]`` to ``first[n] + frames[n]``, both included.

    first, frames: (N,) int32. rows: (T, 3) float64, poses relative to the first row of their node [m], [rad].
    """

    first: NDArray[np.int32]
    frames: NDArray[np.int32]
    rows: NDArray[np.float64]


@helper
def split_step(last, since, frame, natural):
    """Return how a step is divided between two nodes, of which the first one ends in it: (share, end, begin).

    The first node is played from frame ``since`` to ``end``, during the first ``share`` (0 to 1) of the step. Then the
    next one is played from ``begin`` to ``frame``. ``last`` is the last frame of the first node.
    """
    advance = last - since + frame
    # All frames of both nodes are played: divide the step in proportion.
    if 2.0 * advance <= 3.0 * natural:
        return (last - since) / advance if advance > 0.0 else 1.0, last, 0.0
    # More than 1.5 times the usual frames: the agent has left an idle node and skips the rest of it. The next node is
    # played from its begin, so that no movement is left out; until then the idle node goes on. Only agents that enter a
    # node in its middle have more frames of it behind them than a step has.
    share = max(1.0 - frame / natural, 0.0)
    begin = 0.0 if 2.0 * frame <= 3.0 * natural else frame - natural
    return share, min(since + share * natural, last), begin


@helper
def _in_clip(nodes, node, frame):
    """Return the track pose of a node in a frame, relative to the pose in its first frame; interpolated between frames.

    Beyond its last frame, the pose in the last one.
    """
    last = nodes.first[node] + nodes.frames[node]
    row = min(nodes.first[node] + int(frame), last)
    after = min(row + 1, last)
    part = frame - int(frame)
    a, b = nodes.rows[row], nodes.rows[after]
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * wrap_angle(b[2] - a[2])


@helper
def _beyond(nodes, node, begin, start, end):
    """Return the pose in frame ``end`` of a body that is at ``start`` in frame ``begin`` and moves as its node does."""
    ax, ay, ah = _in_clip(nodes, node, begin)
    bx, by, bh = _in_clip(nodes, node, end)
    c, s = cos_sin(start[2] - ah)
    x = start[0] + c * (bx - ax) - s * (by - ay)
    y = start[1] + s * (bx - ax) + c * (by - ay)
    return x, y, start[2] + wrap_angle(bh - ah)


@helper
def _along_node(nodes, node, begin, start, end, goal, frame, spans):
    """Return the pose in ``frame`` of a body that is at ``start`` in frame ``begin`` and at ``goal`` in frame ``end``.

    Its track is that of the node, moved and turned in the world. ``goal`` may differ from where this leads from
    ``start``: the difference comes in as the blend offset fades, or evenly if none fades in these frames.
    """
    ax, ay, ah = _in_clip(nodes, node, begin)
    bx, by, bh = _in_clip(nodes, node, end)
    px, py, ph = _in_clip(nodes, node, frame)
    # share: part of the difference that has come in at ``frame``: as much as the blend offset has lost of what it loses
    # in these frames. whole: all that it still has at ``begin`` over what it loses in these frames.
    before, after = blend_weight(begin), blend_weight(end)
    share, whole = (frame - begin) / max(end - begin, _NOTHING), 1.0
    if before - after > _NOTHING:
        share = (before - blend_weight(frame)) / (before - after)
        whole = min(before / (before - after), _MOST_WHOLE)
    # Turn of the node in the world after the blend offset has faded, extrapolated from its change in these frames. The
    # node's positions are turned by it, and moved by (ox, oy) so that frame ``begin`` is at ``start``.
    turn = start[2] - ah
    change = wrap_angle(goal[2] - bh - turn)
    c, s = cos_sin(turn + whole * change)
    ox, oy = start[0] - (c * ax - s * ay), start[1] - (s * ax + c * ay)
    way_x = shorter_way(goal[0] - (c * bx - s * by) - ox, spans[0])
    way_y = shorter_way(goal[1] - (s * bx + c * by) - oy, spans[1])
    return c * px - s * py + ox + share * way_x, s * px + c * py + oy + share * way_y, ph + turn + share * change


@helper
def track_between(nodes, natural, spans, old, old_frame, old_pose, new, new_frame, new_pose, share):
    """Return the track pose at a share of the step from ``old_frame`` of node ``old`` to ``new_frame`` of node ``new``.

    The poses are those at both ends. A body without a node (-1) at one of them, or that plays no frame, goes straight.
    On a periodic floor the result may lie beyond its ends, except at share 1.
    """
    # At the end of the step, exactly the new pose, which lies on the floor.
    if share >= 1.0:
        return new_pose[0], new_pose[1], new_pose[2]
    # The same node at an earlier frame has ended and begun again: two nodes.
    same = old == new and new_frame >= old_frame
    if old < 0 or new < 0 or (same and new_frame - old_frame < _NOTHING):
        x = old_pose[0] + share * shorter_way(new_pose[0] - old_pose[0], spans[0])
        y = old_pose[1] + share * shorter_way(new_pose[1] - old_pose[1], spans[1])
        return x, y, old_pose[2] + share * wrap_angle(new_pose[2] - old_pose[2])
    start, goal = (old_pose[0], old_pose[1], old_pose[2]), (new_pose[0], new_pose[1], new_pose[2])
    if same:
        frame = old_frame + share * (new_frame - old_frame)
        return _along_node(nodes, new, old_frame, start, new_frame, goal, frame, spans)
    # The old node ends within the step: go on along it to where the next one begins.
    part, end, begin = split_step(float(nodes.frames[old]), old_frame, new_frame, natural)
    if share < part:
        return _beyond(nodes, old, old_frame, start, old_frame + (end - old_frame) * share / part)
    middle = _beyond(nodes, old, old_frame, start, end)
    frame = begin + (new_frame - begin) * (share - part) / max(1.0 - part, _NOTHING)
    return _along_node(nodes, new, begin, middle, new_frame, goal, frame, spans)


@kernel
def tracks_between(nodes, natural, spans, old, old_frame, old_pose, new, new_frame, new_pose, share, out):
    """Write the track poses of A bodies at a share of a step to ``out`` (A, 3) float64, see :func:`track_between`.

    nodes: :class:`NodeTracks`. natural: frames that a step takes at the natural rate. spans: (2,) float64, lengths of
    the floor along x and y [m], 0 if it is not periodic there. old, new: (A,) int32 nodes at the begin and the end of
    the step, -1 for none. old_frame, new_frame: (A,) float64, their frames there. old_pose, new_pose: (A, 3) float64
    track poses there, x, y [m], heading [rad]. share: 0 to 1, the same for all.
    """
    for a in range(len(out)):
        out[a] = track_between(
            nodes, natural, spans, old[a], old_frame[a], old_pose[a], new[a], new_frame[a], new_pose[a], share
        )
