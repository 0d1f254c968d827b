"""Code the tracks of captured people by the nodes that they play.

A track follows its node: it is the node's own track, put where the node begins, its origin. The blend offset, the end
of the node before less this origin, fades out over the first BLEND_FRAMES frames
(:mod:`crowdsim.motion.graph.track_kernels`). So the origin of each node is coded, as seen from the end of the node
before. If the track found from it is too far off, as for agents that have just been steered, the difference is coded,
and the origin is moved by it.

A page shows the track found in this way, not rounded to whole units: places are off by TOLERANCE units at most along
each axis, headings by one step of turns.

Arguments of all helpers: ``state``, ``out`` and ``models`` of the coder, as of
:mod:`crowdsim.export.page.tracks.range_kernels`; ``nodes``, a :class:`NodeTracks`; of one person, for T steps:
``exact`` (3, T) float64 x, y and heading in units of place and turn, ``track`` (4, T) integers, x, y and heading as a
decoder finds them and the frame of the node, ``node`` (T,) the nodes; ``frame``, counted from the first row of its
node, one or (T,) [ticks: FRAME_TICKS to a frame]; ``begin``, the step from which the person is present, ``first`` and
``end``, the steps from and before which columns are coded; ``units`` as of
:mod:`crowdsim.export.page.tracks.expected_kernels`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.page.tracks.context_kernels import (
    CHANGE,
    CHANGE_BITS,
    FIRST_FRAME,
    FIRST_TURN,
    FIRST_X,
    FIRST_Y,
    FRAME,
    FRAME_BITS,
    IS_OFF,
    OFF,
    OFF_BITS,
    ORIGIN,
    ORIGIN_BITS,
    signed_class,
)
from crowdsim.export.page.tracks.expected_kernels import NATURAL, PLACE, PLAYED_TURN_STEP, TURN
from crowdsim.export.page.tracks.range_kernels import put_bit, put_number, put_whole
from crowdsim.jit import helper
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, blend_weight

TRACK_UNITS = 10_000
"""Integer units per meter and radian of the tracks of nodes."""
TOLERANCE = 0.7
"""Largest error of a place along each axis [units of place]."""
_LEAST_SHARE = 0.1
"""Least share of a blend offset that is taken as faded: so errors of rounding grow tenfold at most."""
_WHOLE_TURN = 2.0 * math.pi * TRACK_UNITS
"""Whole turn in the units of tracks of nodes."""


class NodeTracks(NamedTuple):
    """Tracks of the nodes of a recording.

    Attributes
    ----------
    first, frames : (nodes,) int32
        Node n has the rows ``first[n]`` to ``first[n] + frames[n]``, both included.
    rows : (P, 3) int64
        x, y and heading relative to the first row of the node, in TRACK_UNITS.
    """

    first: NDArray[np.int32]
    frames: NDArray[np.int32]
    rows: NDArray[np.int64]


@helper
def _cos_sin_of(angle, turn):
    """Return cosine and sine of an angle, in units of which ``turn`` make a whole turn.

    By a short series (error below 1e-12), because the functions of libraries differ between machines, and the viewer
    must find the same.
    """
    # The nearest quarter turn, and the rest, at most an eighth of a turn [rad].
    quarter = math.floor(4.0 * angle / turn + 0.5)
    r = (angle - quarter * (0.25 * turn)) * (2.0 * math.pi / turn)
    s = r * r
    c = 1.0 / 40320.0 - s * (1.0 / 3628800.0 - s / 479001600.0)
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * c)))
    d = 1.0 / 362880.0 - s * (1.0 / 39916800.0 - s / 6227020800.0)
    d = r * (1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s * d))))
    side = quarter % 4
    if side == 1:
        return -d, c
    if side == 2:
        return -c, -d
    if side == 3:
        return d, -c
    return c, d


@helper
def _in_node(nodes, node, frame):
    """Return the track (x, y, heading) in a frame of a node [TRACK_UNITS], and the share of a blend offset left there.

    All four are interpolated linearly between rows.
    """
    frame = min(frame, nodes.frames[node] * FRAME_TICKS)
    whole = frame // FRAME_TICKS
    part = (frame - whole * FRAME_TICKS) / FRAME_TICKS
    row = nodes.first[node] + whole
    now = nodes.rows[row]
    after = nodes.rows[min(row + 1, nodes.first[node] + nodes.frames[node])]
    left = blend_weight(whole)
    left += part * (blend_weight(whole + 1) - left)
    return (
        now[0] + part * (after[0] - now[0]),
        now[1] + part * (after[1] - now[1]),
        now[2] + part * (after[2] - now[2]),
        left,
    )


@helper
def _from_origin(x, y, heading, units):
    """Return the displacement (x, y) of a node [TRACK_UNITS] from its origin, in the world [units of place].

    ``heading`` is that of the origin [units of turn].
    """
    c, s = _cos_sin_of(heading, float(units[TURN]))
    to_place = units[PLACE] / TRACK_UNITS
    return to_place * (c * x - s * y), to_place * (s * x + c * y)


@helper
def _track_at(nodes, node, frame, origin, offset, units):
    """Return the track (x, y, heading) in a frame of a node that begins at ``origin`` [units of place and turn].

    ``origin`` is (3,): x, y, heading. ``offset`` (3,) is the blend offset: the end of the node before, less ``origin``.
    """
    x, y, h, left = _in_node(nodes, node, frame)
    x, y = _from_origin(x, y, origin[2], units)
    return (
        origin[0] + x + left * offset[0],
        origin[1] + y + left * offset[1],
        origin[2] + units[TURN] / _WHOLE_TURN * h + left * offset[2],
    )


@helper
def _origin_of(nodes, node, frame, shown, units):
    """Return the origin (x, y, heading) of a node whose track is at ``shown`` (3,) in a frame, without blend offset."""
    x, y, h, _ = _in_node(nodes, node, frame)
    heading = shown[2] - units[TURN] / _WHOLE_TURN * h
    x, y = _from_origin(x, y, heading, units)
    return shown[0] - x, shown[1] - y, heading


@helper
def _begins(node, frame, t):
    """Return whether another node begins in step ``t``, or the same one again."""
    return node[t] != node[t - 1] or frame[t] < frame[t - 1]


@helper
def _origin_seen(nodes, exact, track, node, t, end, ended, units):
    """Return the origin of the node that begins in step ``t``, as seen from ``ended``, the end of the node before.

    It is (along, across, turn), rounded: the displacement along and across the heading of ``ended`` [half units of
    place], and the turn [steps]. It is measured in the first step in which nothing of the blend offset is left, or else
    in the last step of the node before ``end``.
    """
    frame = track[3]
    turn = float(units[TURN])
    for later in range(t + 1, end):
        if frame[t] >= BLEND_FRAMES * FRAME_TICKS or _begins(node, frame, later):
            break
        t = later
    x, y, h, left = _in_node(nodes, node[t], frame[t])
    share = 1.0 / max(1.0 - left, _LEAST_SHARE)
    # The exact track is origin + (own track, turned by the origin) + left * (ended - origin). Solve for origin - ended,
    # first for its heading, which turns the own track.
    off = exact[2, t] - units[TURN] / _WHOLE_TURN * h - ended[2]
    heading = (off - turn * math.floor(off / turn + 0.5)) * share
    x, y = _from_origin(x, y, ended[2] + heading, units)
    dx = (exact[0, t] - x - ended[0]) * share
    dy = (exact[1, t] - y - ended[1]) * share
    c, s = _cos_sin_of(ended[2], turn)
    return (
        math.floor(2.0 * (c * dx + s * dy) + 0.5),
        math.floor(2.0 * (c * dy - s * dx) + 0.5),
        math.floor(heading / units[PLAYED_TURN_STEP] + 0.5),
    )


@helper
def put_played(state, out, models, nodes, exact, track, node, begin, first, end, units):
    """Code places and headings from step ``first`` to before ``end``, in all of which nodes are played."""
    x, y, heading, frame = track[0], track[1], track[2], track[3]
    turn = float(units[TURN])
    step = units[PLAYED_TURN_STEP]
    # The node's origin, its blend offset, the end of the node before, and the track as it is shown.
    origin, offset, ended, shown = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    was_off = 0
    for t in range(first, end):
        # The first step of a person is coded as it is, in whole units; later ones from what is expected.
        if t == begin:
            put_whole(state, out, models, FIRST_X, math.floor(exact[0, t] + 0.5))
            put_whole(state, out, models, FIRST_Y, math.floor(exact[1, t] + 0.5))
            put_whole(state, out, models, FIRST_TURN, math.floor(exact[2, t] + 0.5))
            for k in range(3):
                shown[k] = math.floor(exact[k, t] + 0.5)
        elif t == first:
            # The person was steered before: expect that it moves on as in the last step.
            shown[0], shown[1], shown[2] = x[t - 1], y[t - 1], heading[t - 1]
            if t > begin + 1:
                shown[0] += x[t - 1] - x[t - 2]
                shown[1] += y[t - 1] - y[t - 2]
        else:
            if _begins(node, frame, t):
                last = node[t - 1]
                ended[0], ended[1], ended[2] = _track_at(
                    nodes, last, nodes.frames[last] * FRAME_TICKS, origin, offset, units
                )
                seen = _origin_seen(nodes, exact, track, node, t, end, ended, units)
                for k in range(3):
                    put_number(state, out, models, ORIGIN + (k << ORIGIN_BITS), ORIGIN_BITS, seen[k])
                c, s = _cos_sin_of(ended[2], turn)
                origin[0] = ended[0] + 0.5 * (c * seen[0] - s * seen[1])
                origin[1] = ended[1] + 0.5 * (s * seen[0] + c * seen[1])
                origin[2] = ended[2] + seen[2] * step
                for k in range(3):
                    offset[k] = ended[k] - origin[k]
            shown[0], shown[1], shown[2] = _track_at(nodes, node[t], frame[t], origin, offset, units)
        if t > begin:
            # If the track is too far off, code the difference, and move the node's origin by it.
            off_x = exact[0, t] - shown[0]
            off_y = exact[1, t] - shown[1]
            off_turn = exact[2, t] - shown[2]
            off_turn = (off_turn - turn * math.floor(off_turn / turn + 0.5)) / step
            is_off = 1 if max(abs(off_x), abs(off_y)) > TOLERANCE or abs(off_turn) > 1.0 else 0
            # Contexts: whether the blend offset still fades, and whether the track was off in the last step.
            fades = 1 if frame[t] < BLEND_FRAMES * FRAME_TICKS else 0
            put_bit(state, out, models, IS_OFF + 2 * fades + was_off, is_off)
            was_off = is_off
            if is_off:
                moved = math.floor(off_x + 0.5), math.floor(off_y + 0.5), math.floor(off_turn + 0.5)
                for k in range(3):
                    put_number(state, out, models, OFF + (k << OFF_BITS), OFF_BITS, moved[k])
                    by = moved[k] * (step if k == 2 else 1)
                    shown[k] += by
                    origin[k] += by
        # The first node may be played from any frame on: its origin follows from the track in that frame.
        if t == first:
            origin[0], origin[1], origin[2] = _origin_of(nodes, node[t], frame[t], shown, units)
        x[t] = math.floor(shown[0] + 0.5)
        y[t] = math.floor(shown[1] + 0.5)
        heading[t] = math.floor(shown[2] + 0.5)


@helper
def put_frames(state, out, models, nodes, track, node, first, end, units):
    """Code frames from step ``first`` to before ``end``, in all of which nodes are played.

    A frame usually advances by NATURAL in a step. Coded is by how much the advance beyond NATURAL has changed since the
    step before. A node that is followed by another one is expected to have been played to its end.
    """
    frame = track[3]
    last = 0
    for t in range(first, end):
        if t == first:
            put_whole(state, out, models, FIRST_FRAME, frame[t])
            continue
        # A node that is played again at once counts as the same one: its frame goes back.
        off = frame[t] - frame[t - 1] - units[NATURAL]
        if node[t] != node[t - 1]:
            off += nodes.frames[node[t - 1]] * FRAME_TICKS
            put_number(state, out, models, CHANGE, CHANGE_BITS, off - last)
        else:
            put_number(state, out, models, FRAME + (signed_class(last) << FRAME_BITS), FRAME_BITS, off - last)
        last = off
