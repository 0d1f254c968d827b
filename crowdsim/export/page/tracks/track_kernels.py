"""Code the tracks of a chunk of steps: what is usual takes few bits, what is not takes more.

Every value is coded as its difference from what could be expected, in a context that says how much such differences
have been of late. What is expected follows from values that are coded before, so that a decoder expects the same:

- places: on with the velocity of the last step. Steered people hardly accelerate, or by as much as they can
  (2.5 m/s2): then one axis almost says what is left for the other.
- headings: of steered people, towards the direction of the last step, by a limited turn; else on with the last turn.
- frames of nodes: as usual, two per step of 1/30 s.
- phases: on with the cadence of the speed, see :mod:`crowdsim.motion.deformed.phase_kernels`.

The viewer's twin is ``source/track_decoder.js``. Both use only operations that IEEE 754 rounds in one way.

Arguments of all helpers: ``state``, ``out`` and ``models`` of the coder, as of
:mod:`crowdsim.export.page.tracks.range_kernels`; columns of one person, (T,) integers, one for each step: ``x`` and
``y`` in units of place, ``heading`` in units of turn, ``steered`` (0 or 1), ``node`` and ``frame`` of captured ones,
``phase`` of steered ones; ``first`` and ``end``, the steps from and before which they are coded; ``units`` as of
:func:`code_chunk`.
"""

from __future__ import annotations

import math

from crowdsim.export.page.tracks.range_kernels import WHOLE, finish, put_bit, put_number, put_whole
from crowdsim.jit import helper, kernel

PLACE_BITS, TURN_BITS, NEAR_BITS, FRAME_BITS, PHASE_BITS = 7, 8, 6, 6, 7
"""Decisions for an integer near 0: differences of places, turns, turns near the expected one, frames, phases."""

_BUCKETS = 9
_MOST_ACROSS = 29
"""Difference on the first axis beyond which contexts of the second one no longer differ."""
_CLOSE = 31
"""A turn that is off by no more than this from the expected one is coded by that."""
_SLOWEST = 0.25
"""Speed below which the direction of a step says little of the heading [m/s]."""

# Where the models of each kind begin. Those of integers of any size: escapes, then what begins a run of steps.
_FIRST_X, _FIRST_Y, _FIRST_TURN, _FIRST_FRAME, _FIRST_PHASE = WHOLE, 3 * WHOLE, 5 * WHOLE, 7 * WHOLE, 8 * WHOLE
_X = 9 * WHOLE
_Y = _X + (2 * _BUCKETS * _BUCKETS << PLACE_BITS)
_PLAIN_X = _Y + (3 * 10 * (_MOST_ACROSS + 1) << PLACE_BITS)
_PLAIN_Y = _PLAIN_X + (_BUCKETS << PLACE_BITS)
_IS_CLOSE = _PLAIN_Y + (3 * _BUCKETS << PLACE_BITS)
_NEAR = _IS_CLOSE + 2 * 3 * 3
_TURN = _NEAR + (2 * 15 << NEAR_BITS)
_ON = _TURN + (2 * 2 * _BUCKETS << TURN_BITS)
_FRAME = _ON + (2 * _BUCKETS << TURN_BITS)
_RESTS = _FRAME + (2 * _BUCKETS << FRAME_BITS)
_PHASE = _RESTS + 16 * 7
MODELS = _PHASE + (16 * 7 << PHASE_BITS)
"""Number of models of a chunk."""


@helper
def bucket(size):
    """Return the class, 0 to 8, of the size of a difference: classes of small sizes are narrow."""
    if size <= 2:
        return size
    if size <= 4:
        return 3
    if size <= 7:
        return 4
    if size <= 11:
        return 5
    if size <= 17:
        return 6
    if size <= 24:
        return 7
    return 8


@helper
def _signed(value):
    """Return the class, 0 to 17, of a difference with its sign."""
    return 2 * bucket(abs(value)) + (1 if value > 0 else 0)


@helper
def direction(x, y):
    """Return the angle of a vector [rad], within 1e-5 (Abramowitz and Stegun 4.4.49)."""
    a = abs(x)
    b = abs(y)
    if a == 0.0 and b == 0.0:
        return 0.0
    z = min(a, b) / max(a, b)
    s = z * z
    angle = z * (0.999866 + s * (-0.3302995 + s * (0.180141 + s * (-0.085133 + s * 0.0208351))))
    if b > a:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@helper
def wrapped(value, turn):
    """Return an integer angle, of ``turn`` in a whole turn, between minus half a turn and half a turn."""
    value = (value + turn // 2) % turn
    return value - turn // 2


@helper
def cadence(speed, angle, turn):
    """Return the expected cadence [cycles/s] at a speed [m/s], ``angle`` [rad] off the heading, turning [rad/s].

    That of :func:`crowdsim.motion.deformed.phase_kernels.phase_rate` for the motion relative to the hips.
    """
    off = abs(angle)
    # The hips turn along with the motion, the less so the slower it is, and the farther it is aside.
    follows = min(speed / 0.4, 1.0)
    hip = 0.0 if off >= 1.4 else min(off, 1.4 - off)
    rest = off - hip * follows * follows
    s = rest * rest
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0))))
    c = min(max(c, -1.0), 1.0)
    along = speed * abs(c)
    across = speed * math.sqrt(1.0 - c * c)
    rate = math.sqrt(0.39 * along) / 0.78
    if c < 0.0:
        rate *= 1.35
    turning = abs(turn)
    rate = max(rate, min(0.5 * min(1.0, across / 0.1) + 1.1 * across, 1.7))
    rate = max(rate, min(0.35 * min(1.0, turning / 0.2) + 0.4 * turning, 1.5))
    rate = max(rate, speed / 1.6)
    if rate < 0.45:
        # Too slow to walk: a step is finished.
        return 0.6 if speed > 0.1 else 0.75
    return rate


@helper
def _put_places(state, out, models, x, y, steered, first, end):
    """Code places (T,) x and y from step ``first`` to before ``end``."""
    ax = 0
    ay = 0
    before = 0
    for t in range(first, end):
        if t < first + 2:
            second = WHOLE * (t - first)
            put_whole(state, out, models, _FIRST_X + second, x[t] - (x[t - 1] if t > first else 0))
            put_whole(state, out, models, _FIRST_Y + second, y[t] - (y[t - 1] if t > first else 0))
            continue
        # Contexts: how much it has accelerated in the last two steps, and of steered people, how on this axis in the
        # last one. Captured people are fewer and walk evenly: more contexts would learn too little of them.
        lately = bucket((2 * (abs(ax) + abs(ay)) + before) // 3)
        before = abs(ax) + abs(ay)
        context = _X + (2 * _BUCKETS * lately + _signed(ax) << PLACE_BITS)
        if steered[t] == 0:
            context = _PLAIN_X + (lately << PLACE_BITS)
        ax = x[t] - 2 * x[t - 1] + x[t - 2]
        put_number(state, out, models, context, PLACE_BITS, ax)
        # The context of the second axis packs the size of ax, the class of the last ay in two classes each, and its
        # sign.
        across = 10 * min(abs(ax), _MOST_ACROSS) + 2 * (bucket(abs(ay)) // 2) + (1 if ay > 0 else 0)
        context = _Y + (3 * across + min(lately // 3, 2) << PLACE_BITS)
        if steered[t] == 0:
            context = _PLAIN_Y + (3 * bucket(abs(ax)) + min(lately // 3, 2) << PLACE_BITS)
        ay = y[t] - 2 * y[t - 1] + y[t - 2]
        put_number(state, out, models, context, PLACE_BITS, ay)


@helper
def _put_headings(state, out, models, x, y, heading, steered, first, end, units):
    """Code headings (T,) from step ``first`` to before ``end``."""
    # Units a meter and a turn, steps a second, and the largest turn in a step. ``close``: whether the last turn was not
    # near the expected one.
    place, turn, rate, most = units[0], units[1], units[2], units[4]
    close = 0
    last = 0
    for t in range(first, end):
        if t < first + 2:
            begin = _FIRST_TURN + WHOLE * (t - first)
            put_whole(state, out, models, begin, heading[t] - (heading[t - 1] if t > first else 0))
            continue
        now = wrapped(heading[t] - heading[t - 1], turn)
        if steered[t] == 0:
            put_number(state, out, models, _ON + (_signed(last) << TURN_BITS), TURN_BITS, now - last)
            last = now
            continue
        dx = x[t - 1] - x[t - 2]
        dy = y[t - 1] - y[t - 2]
        speed = math.sqrt(float(dx * dx + dy * dy)) * rate / place
        ahead = math.floor(direction(float(dx), float(dy)) * turn / (2.0 * math.pi) + 0.5)
        wanted = wrapped(ahead - heading[t - 1], turn)
        expected = min(max(wanted, -most), most)
        # Contexts: whether the last turn was near the expected one; is it limited; does the direction say anything?
        kind = 3 * (0 if speed > _SLOWEST + 0.02 else 1 if speed > _SLOWEST - 0.02 else 2)
        kind += 0 if abs(wanted) < most else 1 if wanted > 0 else 2
        is_close = abs(now - expected) <= _CLOSE
        put_bit(state, out, models, _IS_CLOSE + 9 * close + kind, 0 if is_close else 1)
        if is_close:
            context = 2 * min(int(10.0 * speed), 14) + (1 if abs(wanted) < most else 0)
            put_number(state, out, models, _NEAR + (context << NEAR_BITS), NEAR_BITS, now - expected)
        else:
            context = 2 * _signed(last) + (1 if wanted > 0 else 0)
            put_number(state, out, models, _TURN + (context << TURN_BITS), TURN_BITS, now)
        close = 0 if is_close else 1
        last = now


@helper
def _put_frames(state, out, models, frame, node, first, end, natural):
    """Code frames (T,) of the nodes that are played from step ``first`` to before ``end``, all of which are captured.

    ``natural`` is how far frames usually go on in a step.
    """
    last = 0
    for t in range(first, end):
        if t == first or node[t] != node[t - 1]:
            put_whole(state, out, models, _FIRST_FRAME, frame[t])
            last = 0
            continue
        off = frame[t] - frame[t - 1] - natural
        put_number(state, out, models, _FRAME + (_signed(last) << FRAME_BITS), FRAME_BITS, off - last)
        last = off


@helper
def _put_phases(state, out, models, x, y, heading, phase, first, end, units):
    """Code phases (end - first,) from step ``first`` on, along the track (T,)."""
    place, turn, rate, cycle = units[0], units[1], units[2], units[3]
    off = 0
    moved = 1
    put_whole(state, out, models, _FIRST_PHASE, phase[0])
    for t in range(first + 1, end):
        dx = x[t] - x[t - 1]
        dy = y[t] - y[t - 1]
        speed = math.sqrt(float(dx * dx + dy * dy)) * rate / place
        ahead = math.floor(direction(float(dx), float(dy)) * turn / (2.0 * math.pi) + 0.5)
        angle = wrapped(ahead - heading[t], turn) * (2.0 * math.pi) / turn
        turning = wrapped(heading[t] - heading[t - 1], turn) * (2.0 * math.pi) / turn * rate
        expected = math.floor(cadence(speed, angle, turning) / rate * cycle + 0.5)
        before = phase[t - 1 - first]
        advance = phase[t - first] - before
        # Contexts: may it come to a stand here, or set off? How much off was the last one, did it move at all? A body
        # below stepping speed rests in the first fifth of a half cycle, with both feet down, and sets off in its first
        # half. ``past`` is what has passed of the half cycle.
        past = (2 * before) % cycle
        context = (1 if speed < 0.35 and 10 * past <= 2 * cycle else 0) + (2 if 100 * past < 52 * cycle else 0)
        context = 2 * (2 * (4 * min(bucket(abs(off)), 6) + context) + moved) + (1 if off > 0 else 0)
        put_bit(state, out, models, _RESTS + context, 1 if advance == 0 else 0)
        moved = 0 if advance == 0 else 1
        if moved:
            off = advance - expected
            put_number(state, out, models, _PHASE + (context << PHASE_BITS), PHASE_BITS, off)


@kernel
def code_chunk(tracks, here, steered, node, stretches, phases, units, models, state, out):
    """Code the tracks of N agents in T steps, agent by agent; return the number of bytes.

    Parameters
    ----------
    tracks: (4, N, T) int64 x, y, heading and frame in the units of a page; only values of those present count.
    here, steered: (N, T) uint8, whether an agent is present, and steered. node: (N, T) int32, -1 for none.
    stretches: (S, 4) int64 agent, first step, step after the last, and index of the first of their phases, sorted
        by agent. phases: (P,) int64.
    units: (6,) int64 units of places per meter, headings per turn, steps per second, phases per cycle, the largest turn
        of a steered agent in a step, and by how much frames usually go on in a step.
    models: (MODELS, 2) uint16, all EVEN. state: see range_kernels. out: uint8, large enough.
    """
    count, steps = here.shape
    natural = units[5]
    stretch = 0
    for who in range(count):
        x = tracks[0, who]
        y = tracks[1, who]
        heading = tracks[2, who]
        # Places and headings, in each run of steps in which the agent is present.
        first = 0
        while first < steps:
            if here[who, first] == 0:
                first += 1
                continue
            end = first
            while end < steps and here[who, end]:
                end += 1
            _put_places(state, out, models, x, y, steered[who], first, end)
            _put_headings(state, out, models, x, y, heading, steered[who], first, end, units)
            first = end
        # Frames, in each run of steps in which it plays nodes.
        first = 0
        while first < steps:
            if node[who, first] < 0:
                first += 1
                continue
            end = first
            while end < steps and node[who, end] >= 0:
                end += 1
            _put_frames(state, out, models, tracks[3, who], node[who], first, end, natural)
            first = end
        # Phases, in its stretches as a steered agent.
        while stretch < len(stretches) and stretches[stretch, 0] == who:
            first = stretches[stretch, 1]
            end = stretches[stretch, 2]
            at = stretches[stretch, 3]
            _put_phases(state, out, models, x, y, heading, phases[at : at + end - first], first, end, units)
            stretch += 1
    return finish(state, out)
