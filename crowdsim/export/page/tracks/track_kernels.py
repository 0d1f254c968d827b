"""Code the tracks of a chunk of steps: what is usual takes few bits, what is not takes more.

Every value is coded as its difference from what could be expected, in contexts that say how much such differences
have been of late. What is expected follows from values that are coded before, so that a decoder expects the same:

- places: on with the velocity of the last step. Steered people hardly accelerate, or by as much as they can
  (2.5 m/s2): then one axis almost says what is left for the other.
- headings: of steered people, towards the direction of the last step, by a limited turn; else on with the last turn.
- frames of nodes: as usual, two per step of 1/30 s.
- phases: as :mod:`crowdsim.motion.deformed.phase_kernels` advances them along the coded track.

Numbers of steered people are coded by several contexts together
(:mod:`crowdsim.export.page.tracks.mixing_kernels`). Captured people are fewer and walk evenly: one context does.
The viewer's twin is ``source/track_decoder.js``. Both use only operations that IEEE 754 rounds in one way.

Arguments of all helpers: ``state``, ``out`` and ``models`` of the coder, as of
:mod:`crowdsim.export.page.tracks.range_kernels`, and its ``mixer``; columns of one person, (T,) integers, one for each
step: ``x`` and ``y`` in units of place, ``heading`` in units of turn, ``steered`` (0 or 1), ``node`` and ``frame`` (in
ticks) of captured ones, ``phase`` of steered ones in units of a cycle; ``first`` and ``end``, the steps from and before
which they are coded; ``units`` as of :func:`code_chunk`.
"""

from __future__ import annotations

import math

from crowdsim.export.page.tracks.expected_kernels import (
    CYCLE,
    MOST,
    NATURAL,
    PHASE_STEP,
    PLACE,
    REST,
    TURN,
    TURN_STEP,
    choose_turn,
    expected_phase,
    expected_turn,
    next_stand,
    passes,
    way_of,
    wrapped,
)
from crowdsim.export.page.tracks.mixing_kernels import put_leaf, put_mixed
from crowdsim.export.page.tracks.range_kernels import WHOLE, finish, put_bit, put_number, put_whole
from crowdsim.jit import helper, kernel

PLACE_BITS, TURN_BITS, NEAR_BITS, PHASE_BITS = 6, 7, 6, 6
"""Decisions for an integer near 0 of steered people: places, turns, turns near the expected one, phases."""
PLAIN_BITS, ON_BITS, FRAME_BITS = 7, 8, 6
"""The same of captured people: differences of places, turns, frames."""

_CLASSES = 9
"""Classes of the size of a difference, :func:`size_class`, and of a difference with its sign, :func:`_coarse`."""
_SIGNED = 2 * _CLASSES
_MOST_ACROSS = 29
"""Difference on the first axis beyond which contexts of the second one no longer differ."""
_PACES, _WAYS = 16, 16
"""Classes of speeds, and of directions, as contexts of places."""
_SPEEDS, _TURNS, _WANTED, _NEARS = 24, 21, 49, 8
"""Contexts of headings and phases: classes of speeds (1/16 m/s), turns, wanted turns; what the last 3 turns were."""
_KINDS, _AWAYS = 7, 16
"""Classes of phases: which rule applies, and how far the rear foot is left behind (2 cm)."""

# Where the models of each kind begin. Those of integers of any size: escapes, then what begins a run of steps.
_FIRST_X, _FIRST_Y, _FIRST_TURN, _FIRST_FRAME, _FIRST_PHASE = WHOLE, 3 * WHOLE, 5 * WHOLE, 7 * WHOLE, 8 * WHOLE
_PLAIN_X = 9 * WHOLE
_PLAIN_Y = _PLAIN_X + (_CLASSES << PLAIN_BITS)
_ON = _PLAIN_Y + (3 * _CLASSES << PLAIN_BITS)
_FRAME = _ON + (_SIGNED << ON_BITS)
_FOLLOWS = _FRAME + (_SIGNED << FRAME_BITS)
_STAYS = _FOLLOWS + 2 * _KINDS
MODELS = _STAYS + _KINDS
"""Number of models of a chunk."""

# The same of models that are mixed: three contexts of each kind.
_X = (0, _SIGNED * _CLASSES << PLACE_BITS, _SIGNED * _CLASSES + _CLASSES**4 << PLACE_BITS)
_Y0 = _X[2] + (_PACES * _WAYS * 3 << PLACE_BITS)
_Y1 = _Y0 + (3 * 10 * (_MOST_ACROSS + 1) << PLACE_BITS)
_Y = (_Y0, _Y1, _Y1 + (_SIGNED * _CLASSES**2 << PLACE_BITS))
_IS_NEAR0 = _Y[2] + (_PACES * _WAYS * _SIGNED << PLACE_BITS)
_IS_NEAR1 = _IS_NEAR0 + (_NEARS * _SPEEDS * _WANTED << 1)
_IS_NEAR = (_IS_NEAR0, _IS_NEAR1, _IS_NEAR1 + (_NEARS * _TURNS * _WANTED << 1))
_NEAR0 = _IS_NEAR[2] + (_NEARS * _SPEEDS * _SPEEDS << 1)
_NEAR1 = _NEAR0 + (_SPEEDS << NEAR_BITS)
_NEAR = (_NEAR0, _NEAR1, _NEAR1 + (_SPEEDS * _TURNS << NEAR_BITS))
_TURN0 = _NEAR[2] + (_NEARS * _SPEEDS << NEAR_BITS)
_TURN1 = _TURN0 + (2 * _TURNS << TURN_BITS)
_TURN = (_TURN0, _TURN1, _TURN1 + (_WANTED * 8 << TURN_BITS))
_PHASE0 = _TURN[2] + (_TURNS * _TURNS << TURN_BITS)
_PHASE1 = _PHASE0 + (_KINDS * _SPEEDS * _SIGNED << PHASE_BITS)
_PHASE = (_PHASE0, _PHASE1, _PHASE1 + (_KINDS * _TURNS * _SIGNED << PHASE_BITS))
MIXED = _PHASE[2] + (_KINDS * _AWAYS * _SPEEDS << PHASE_BITS)
"""Number of models of a chunk that are mixed."""

# Where the weights of each kind begin.
_X_ROW, _Y_ROW = 0, _CLASSES << PLACE_BITS
_IS_NEAR_ROW = 2 * _Y_ROW
_NEAR_ROW = _IS_NEAR_ROW + (_NEARS << 1)
_TURN_ROW = _NEAR_ROW + (1 << NEAR_BITS)
_PHASE_ROW = _TURN_ROW + (1 << TURN_BITS)
ROWS = _PHASE_ROW + (_KINDS << PHASE_BITS)
"""Number of rows of weights of a chunk."""

_WINDOW = 10
"""Steps at either end of a track whose headings are rounded; more than half of the window of 0.85 s at 10 Hz."""


@helper
def size_class(size):
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
    return 2 * size_class(abs(value)) + (1 if value > 0 else 0)


@helper
def _coarse(value):
    """Return the class, 0 to 8, of a difference with its sign, 4 for 0."""
    size = abs(value)
    kind = 0 if size == 0 else 1 if size <= 2 else 2 if size <= 5 else 3 if size <= 11 else 4
    return 4 + kind if value > 0 else 4 - kind


@helper
def _put_places(state, out, models, mixer, x, y, steered, first, end, units):
    """Code places (T,) x and y from step ``first`` to before ``end``.

    The first place is coded as it is and the second one by its difference from the first; all later ones by their
    acceleration, the second difference: that along x first, then that along y, which it helps to expect.
    """
    # Accelerations (ax, ay) of the last step and (bx, by) of the one before, and the size of the latter.
    ax = 0
    ay = 0
    bx = 0
    by = 0
    before = 0
    for t in range(first, end):
        if t < first + 2:
            second = WHOLE * (t - first)
            put_whole(state, out, models, _FIRST_X + second, x[t] - (x[t - 1] if t > first else 0))
            put_whole(state, out, models, _FIRST_Y + second, y[t] - (y[t - 1] if t > first else 0))
            continue
        # How much has it accelerated in the last two steps? The last one counts twice.
        lately = size_class((2 * (abs(ax) + abs(ay)) + before) // 3)
        before = abs(ax) + abs(ay)
        some = min(lately // 3, 2)
        if steered[t] == 0:
            ax = x[t] - 2 * x[t - 1] + x[t - 2]
            put_number(state, out, models, _PLAIN_X + (lately << PLAIN_BITS), PLAIN_BITS, ax)
            ay = y[t] - 2 * y[t - 1] + y[t - 2]
            context = _PLAIN_Y + (3 * size_class(abs(ax)) + some << PLAIN_BITS)
            put_number(state, out, models, context, PLAIN_BITS, ay)
            continue
        # Contexts: the last acceleration, those of the last two steps, and the velocity.
        speed, ahead = way_of(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2], units)
        way = _WAYS * min(int(10.0 * speed), _PACES - 1) + (_WAYS * ahead // units[TURN]) % _WAYS
        recent = _CLASSES * (_CLASSES * (_CLASSES * _coarse(ax) + _coarse(ay)) + _coarse(bx)) + _coarse(by)
        at = (
            _X[0] + (_SIGNED * lately + _signed(ax) << PLACE_BITS),
            _X[1] + (recent << PLACE_BITS),
            _X[2] + (3 * way + some << PLACE_BITS),
        )
        bx = ax
        by = ay
        ax = x[t] - 2 * x[t - 1] + x[t - 2]
        put_mixed(state, out, models, mixer, at, _X_ROW + (lately << PLACE_BITS), PLACE_BITS, ax)
        # The second axis: besides, what is known of the first one. Its first context packs the size of ax, the class of
        # the size of the last ay, two classes taken as one, and the sign of that ay.
        across = 10 * min(abs(ax), _MOST_ACROSS) + 2 * (size_class(abs(by)) // 2) + (1 if by > 0 else 0)
        at = (
            _Y[0] + (3 * across + some << PLACE_BITS),
            _Y[1] + (_CLASSES * (_CLASSES * _signed(ax) + _coarse(by)) + _coarse(bx) << PLACE_BITS),
            _Y[2] + (_SIGNED * way + _signed(ax) << PLACE_BITS),
        )
        ay = y[t] - 2 * y[t - 1] + y[t - 2]
        put_mixed(state, out, models, mixer, at, _Y_ROW + (size_class(abs(ax)) << PLACE_BITS), PLACE_BITS, ay)


@helper
def _turn_class(turn, most):
    """Return the class, 0 to 20, of a turn; ``most`` is the largest one of a steered agent in a step."""
    return min(max(10 * turn // most, -10), 10) + 10


@helper
def _put_headings(state, out, models, mixer, x, y, exact, heading, steered, first, end, units, slack):
    """Code headings (T,) near the ``exact`` ones (T,) float64 [units of turn] from step ``first`` to before ``end``.

    ``heading`` becomes what a decoder finds. Turns of steered agents are coded as :func:`choose_turn` says, within
    ``slack`` (2,); those of captured ones by their difference from the last turn, in steps of TURN_STEP.
    """
    turn = units[TURN]
    step = units[TURN_STEP]
    most = units[MOST]
    # The last turns, by how many steps, and whether the last three were other than expected, as bits; and the sum of
    # the errors so far.
    last = 0
    before = 0
    steps = 0
    lately = 0
    total = 0.0
    none = 0.0 * slack
    for t in range(first, end):
        if t < first + 2:
            begin = _FIRST_TURN + WHOLE * (t - first)
            heading[t] = math.floor(exact[t] + 0.5)
            put_whole(state, out, models, begin, heading[t] - (heading[t - 1] if t > first else 0))
            continue
        # The exact turn from the heading coded last.
        asked = exact[t] - heading[t - 1]
        asked -= turn * math.floor(asked / turn + 0.5)
        if steered[t] == 0:
            off = math.floor((asked - last) / step + 0.5)
            put_number(state, out, models, _ON + (_signed(last // step) << ON_BITS), ON_BITS, off)
            last += off * step
            heading[t] = heading[t - 1] + last
            total = 0.0
            continue
        speed, ahead = way_of(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2], units)
        pace = min(int(16.0 * speed), _SPEEDS - 1)
        speed, _ = way_of(x[t] - x[t - 1], y[t] - y[t - 1], units)
        next_pace = min(int(16.0 * speed), _SPEEDS - 1)
        wanted, expected, near = expected_turn(ahead, heading[t - 1], units)
        wish = min(max(8 * wanted // most, -24), 24) + 24
        # Where the window that smooths headings is cut, errors do not cancel.
        inside = first + _WINDOW <= t < end - _WINDOW
        way, off = choose_turn(asked, expected, near, steps, total, units, slack if inside else none)
        at = (
            _IS_NEAR[0] + (_WANTED * (_SPEEDS * lately + pace) + wish << 1),
            _IS_NEAR[1] + (_WANTED * (_TURNS * lately + _turn_class(last, most)) + wish << 1),
            _IS_NEAR[2] + (_SPEEDS * (_SPEEDS * lately + next_pace) + pace << 1),
        )
        put_leaf(state, out, mixer, at, _IS_NEAR_ROW + (lately << 1), 1, way)
        # If a limited turn is met, near is 0 and nothing is left to code.
        if way == 0 and near > 0:
            at = (
                _NEAR[0] + (pace << NEAR_BITS),
                _NEAR[1] + (_TURNS * next_pace + _turn_class(expected, most) << NEAR_BITS),
                _NEAR[2] + (_SPEEDS * lately + next_pace << NEAR_BITS),
            )
            put_mixed(state, out, models, mixer, at, _NEAR_ROW, NEAR_BITS, off)
        elif way == 1:
            at = (
                _TURN[0] + (2 * _turn_class(last, most) + (1 if wanted > 0 else 0) << TURN_BITS),
                _TURN[1] + (8 * wish + pace // 3 << TURN_BITS),
                _TURN[2] + (_TURNS * _turn_class(last, most) + _turn_class(before, most) << TURN_BITS),
            )
            put_mixed(state, out, models, mixer, at, _TURN_ROW, TURN_BITS, off)
        lately = (2 * lately + way) % _NEARS
        before = last
        last = (expected if way == 0 else 0) + off * step
        steps = off if way == 1 else 0
        heading[t] = heading[t - 1] + last
        total += last - asked


@helper
def _put_frames(state, out, models, frame, node, first, end, natural):
    """Code frames (T,) of the nodes that are played from step ``first`` to before ``end``, all of which are captured.

    They usually go on by ``natural`` in a step; coded is the change of what they go on beyond that.
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
def _put_phases(state, out, models, mixer, x, y, heading, phase, own, first, end, units):
    """Code phases (end - first,) from step ``first`` on, along the track (T,).

    What a decoder finds, which is off by half a step of phases at most, replaces those from step ``own[0]`` to before
    ``own[1]``.
    """
    step = units[PHASE_STEP]
    # Where the body was when it was over the foot that is now behind, as far as it is known.
    ax = x[first]
    ay = y[first]
    turned = heading[first]
    off = 0
    exact = phase[0]
    value = exact
    put_whole(state, out, models, _FIRST_PHASE, value)
    for t in range(first + 1, end):
        away = math.sqrt(float((x[t] - ax) * (x[t] - ax) + (y[t] - ay) * (y[t] - ay))) / units[PLACE]
        after, kind, speed = expected_phase(value, x, y, heading, t, away, turned, units)
        stand = next_stand(value, units[CYCLE])
        wanted = phase[t - first]
        # The step that brings it nearest to the exact phase, but not back.
        off_before = off
        off = max((2 * (wanted - after) + step) // (2 * step), -((after - value) // step))
        # A body at rest has to be at rest in the page too, and one that goes on must not be kept from it. So a phase
        # that comes to the next stand, or that rounding would carry past it, becomes that stand; and one that stays
        # though it is expected to advance, stays.
        comes = abs(wanted - stand) <= REST and after != stand
        comes = comes or (wanted <= stand and after + off * step > stand)
        stays = not comes and wanted == exact and after != value
        put_bit(state, out, models, _FOLLOWS + 2 * kind + (1 if off_before == 0 else 0), 1 if comes or stays else 0)
        if comes or stays:
            put_bit(state, out, models, _STAYS + kind, 1 if stays else 0)
            now = value if stays else stand
            off = 0
        else:
            pace = min(int(16.0 * speed), _SPEEDS - 1)
            turn = _turn_class(abs(wrapped(heading[t] - heading[t - 1], units[TURN])), units[MOST])
            at = (
                _PHASE[0] + (_SIGNED * (_SPEEDS * kind + pace) + _signed(off_before) << PHASE_BITS),
                _PHASE[1] + (_SIGNED * (_TURNS * kind + turn) + _signed(off_before) << PHASE_BITS),
                _PHASE[2] + (_SPEEDS * (_AWAYS * kind + min(int(50.0 * away), _AWAYS - 1)) + pace << PHASE_BITS),
            )
            put_mixed(state, out, models, mixer, at, _PHASE_ROW + (kind << PHASE_BITS), PHASE_BITS, off)
            now = after + off * step
        if passes(value, now, units[CYCLE]):
            ax = x[t]
            ay = y[t]
            turned = heading[t]
        exact = wanted
        value = now
        if own[0] <= t < own[1]:
            phase[t - first] = value


@kernel
def code_chunk(tracks, headings, here, steered, node, stretches, phases, own, units, slack, models, mixer, state, out):
    """Code the tracks of N agents in T steps, agent by agent; return the number of bytes.

    Parameters
    ----------
    tracks: (4, N, T) int64 x, y, heading and frame in the units of a page; only values of those present count. Headings
        are set to those that a decoder finds. headings: (N, T) float64, the exact ones in units of turn.
    here, steered: (N, T) uint8, whether an agent is present, and steered. node: (N, T) int32, -1 for none.
    stretches: (S, 4) int64 agent, first step, step after the last, and index of the first of their phases, sorted
        by agent. phases: (P,) int64, set to what a decoder finds in the steps from ``own[0]`` to before ``own[1]``.
    units: (UNITS,) int64, see :mod:`crowdsim.export.page.tracks.expected_kernels`.
    slack: largest error of a steered heading, and of the sum of these errors so far [units of turn]; 0, 0 to round.
    models: (MODELS, 2) uint16, all EVEN. mixer: new, with MIXED models and ROWS. state: see range_kernels. out: uint8,
        large enough.
    """
    count, steps = here.shape
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
            _put_places(state, out, models, mixer, x, y, steered[who], first, end, units)
            exact = headings[who]
            _put_headings(state, out, models, mixer, x, y, exact, heading, steered[who], first, end, units, slack)
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
            _put_frames(state, out, models, tracks[3, who], node[who], first, end, units[NATURAL])
            first = end
        # Phases, in its stretches as a steered agent.
        while stretch < len(stretches) and stretches[stretch, 0] == who:
            first = stretches[stretch, 1]
            end = stretches[stretch, 2]
            at = stretches[stretch, 3]
            shown = phases[at : at + end - first]
            _put_phases(state, out, models, mixer, x, y, heading, shown, own, first, end, units)
            stretch += 1
    return finish(state, out)
