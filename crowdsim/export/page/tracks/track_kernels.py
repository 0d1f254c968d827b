"""Code the tracks of a chunk of steps: what is usual takes few bits, what is not takes more.

Every value is coded as its difference from an expected value, in contexts that depend on how large such differences
have been in the last steps. The expected value follows from values that are coded before, so that a decoder expects the
same:

- places of steered people: on with the velocity of the last step. They hardly accelerate, or by as much as they can
  (2.5 m/s2): then the acceleration along one axis almost gives that along the other.
- headings of steered people: towards the direction of the last step, by a limited turn.
- phases: as :mod:`crowdsim.motion.deformed.phase_kernels` advances them along the coded track.
- places, headings and frames of captured people: see :mod:`crowdsim.export.page.tracks.played_kernels`.

Numbers of steered people are coded by several contexts together
(:mod:`crowdsim.export.page.tracks.mixing_kernels`). For captured people one context does, as they are expected well.
The viewer's twin is ``source/track_decoder.js``. Both use only operations that IEEE 754 rounds in one way.

Arguments of all helpers: ``state``, ``out`` and ``models`` of the coder, as of
:mod:`crowdsim.export.page.tracks.range_kernels`, and its ``mixer``; columns of one steered person, (T,) integers, one
for each step: ``x`` and ``y`` in units of place, ``heading`` in units of turn, ``phase`` in units of a cycle;
``begin``, the step from which the person is present, ``first`` and ``end``, the steps from and before which they are
coded; ``units`` as of :func:`code_chunk`.
"""

from __future__ import annotations

import math

from crowdsim.export.page.tracks.context_kernels import (
    AWAYS,
    CLASSES,
    FIRST_PHASE,
    FIRST_TURN,
    FIRST_X,
    FIRST_Y,
    FOLLOWS,
    IS_NEAR_MODELS,
    IS_NEAR_ROW,
    MOST_ACROSS,
    NEAR_BITS,
    NEAR_MODELS,
    NEAR_ROW,
    NEARS,
    PACES,
    PHASE_BITS,
    PHASE_MODELS,
    PHASE_ROW,
    PLACE_BITS,
    SIGNED,
    SPEEDS,
    STAYS,
    TURN_BITS,
    TURN_MODELS,
    TURN_ROW,
    TURNS,
    WANTED,
    WAYS,
    X_MODELS,
    X_ROW,
    Y_MODELS,
    Y_ROW,
    coarse_class,
    signed_class,
    size_class,
    turn_class,
)
from crowdsim.export.page.tracks.expected_kernels import (
    CYCLE,
    MOST,
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
from crowdsim.export.page.tracks.played_kernels import put_frames, put_played
from crowdsim.export.page.tracks.range_kernels import WHOLE, finish, put_bit, put_whole
from crowdsim.jit import helper, kernel

_WINDOW = 10
"""Number of steps at either end of a track whose headings are rounded: more than half of the window of 0.85 s that
smooths headings, at 10 steps a second."""


@helper
def _put_places(state, out, models, mixer, x, y, begin, first, end, units):
    """Code places (T,) x and y from step ``first`` to before ``end``.

    When a person appears, the first place is coded as it is, and the second one by its difference from the first. All
    others are coded by their acceleration, the second difference, first along x. Its size there is a context of that
    along y.
    """
    # Accelerations (ax, ay) of the last step and (bx, by) of the one before, and the size of the latter.
    ax = 0
    ay = 0
    bx = 0
    by = 0
    before = 0
    for t in range(first, end):
        if t < begin + 2:
            second = WHOLE * (t - begin)
            put_whole(state, out, models, FIRST_X + second, x[t] - (x[t - 1] if t > begin else 0))
            put_whole(state, out, models, FIRST_Y + second, y[t] - (y[t - 1] if t > begin else 0))
            continue
        # Classes of the mean acceleration in the last two steps, of which the last counts twice: nine, and three wide.
        lately = size_class((2 * (abs(ax) + abs(ay)) + before) // 3)
        before = abs(ax) + abs(ay)
        some = min(lately // 3, 2)
        # Contexts: the last acceleration, those of the last two steps, and the velocity.
        speed, ahead = way_of(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2], units)
        way = WAYS * min(int(10.0 * speed), PACES - 1) + (WAYS * ahead // units[TURN]) % WAYS
        recent = CLASSES * (
            CLASSES * (CLASSES * coarse_class(ax) + coarse_class(ay)) + coarse_class(bx)
        ) + coarse_class(by)
        at = (
            X_MODELS[0] + (SIGNED * lately + signed_class(ax) << PLACE_BITS),
            X_MODELS[1] + (recent << PLACE_BITS),
            X_MODELS[2] + (3 * way + some << PLACE_BITS),
        )
        bx = ax
        by = ay
        ax = x[t] - 2 * x[t - 1] + x[t - 2]
        put_mixed(state, out, models, mixer, at, X_ROW + (lately << PLACE_BITS), PLACE_BITS, ax)
        # The second axis has contexts with the acceleration of the first one, ax; by is the last one along y. The first
        # context packs the size of ax, the class of the size of by, two classes taken as one, and the sign of by.
        across = 10 * min(abs(ax), MOST_ACROSS) + 2 * (size_class(abs(by)) // 2) + (1 if by > 0 else 0)
        at = (
            Y_MODELS[0] + (3 * across + some << PLACE_BITS),
            Y_MODELS[1] + (CLASSES * (CLASSES * signed_class(ax) + coarse_class(by)) + coarse_class(bx) << PLACE_BITS),
            Y_MODELS[2] + (SIGNED * way + signed_class(ax) << PLACE_BITS),
        )
        ay = y[t] - 2 * y[t - 1] + y[t - 2]
        put_mixed(state, out, models, mixer, at, Y_ROW + (size_class(abs(ax)) << PLACE_BITS), PLACE_BITS, ay)


@helper
def _put_headings(state, out, models, mixer, x, y, headings, begin, first, end, stop, units, slack):
    """Code headings from step ``first`` to before ``end``.

    ``headings`` are two arrays: the exact ones (T,) float64 [units of turn], and (T,) integers, which are set to what a
    decoder finds. Turns are chosen by :func:`choose_turn`, within ``slack`` (2,). The person is present up to before
    step ``stop``.
    """
    exact, heading = headings
    turn = units[TURN]
    step = units[TURN_STEP]
    most = units[MOST]
    # The last turn and the one before; the steps of the last one, if it was counted from no turn, else 0; which of the
    # last three were counted from no turn, not from the expected one, as bits; and the sum of the errors so far.
    last = 0
    before = 0
    steps = 0
    lately = 0
    total = 0.0
    none = 0.0 * slack
    for t in range(first, end):
        if t < begin + 2:
            model = FIRST_TURN + WHOLE * (t - begin)
            heading[t] = math.floor(exact[t] + 0.5)
            put_whole(state, out, models, model, heading[t] - (heading[t - 1] if t > begin else 0))
            continue
        # The exact turn from the heading coded last, within half a turn.
        exact_turn = exact[t] - heading[t - 1]
        exact_turn -= turn * math.floor(exact_turn / turn + 0.5)
        # Contexts: the speeds of the last step and of this one, the wanted turn in eighths of the largest, and the last
        # turns.
        speed, ahead = way_of(x[t - 1] - x[t - 2], y[t - 1] - y[t - 2], units)
        pace = min(int(16.0 * speed), SPEEDS - 1)
        speed, _ = way_of(x[t] - x[t - 1], y[t] - y[t - 1], units)
        next_pace = min(int(16.0 * speed), SPEEDS - 1)
        wanted, expected, near = expected_turn(ahead, heading[t - 1], units)
        wish = min(max(8 * wanted // most, -24), 24) + 24
        # Near both ends the window that smooths headings is cut, and errors do not cancel.
        inside = begin + _WINDOW <= t < stop - _WINDOW
        way, off = choose_turn(exact_turn, expected, near, steps, total, units, slack if inside else none)
        at = (
            IS_NEAR_MODELS[0] + (WANTED * (SPEEDS * lately + pace) + wish << 1),
            IS_NEAR_MODELS[1] + (WANTED * (TURNS * lately + turn_class(last, most)) + wish << 1),
            IS_NEAR_MODELS[2] + (SPEEDS * (SPEEDS * lately + next_pace) + pace << 1),
        )
        # First from which turn it is counted, then by how many steps.
        put_leaf(state, out, mixer, at, IS_NEAR_ROW + (lately << 1), 1, way)
        # If ``near`` is 0, the expected turn is met exactly, and nothing is left to code.
        if way == 0 and near > 0:
            at = (
                NEAR_MODELS[0] + (pace << NEAR_BITS),
                NEAR_MODELS[1] + (TURNS * next_pace + turn_class(expected, most) << NEAR_BITS),
                NEAR_MODELS[2] + (SPEEDS * lately + next_pace << NEAR_BITS),
            )
            put_mixed(state, out, models, mixer, at, NEAR_ROW, NEAR_BITS, off)
        elif way == 1:
            at = (
                TURN_MODELS[0] + (2 * turn_class(last, most) + (1 if wanted > 0 else 0) << TURN_BITS),
                TURN_MODELS[1] + (8 * wish + pace // 3 << TURN_BITS),
                TURN_MODELS[2] + (TURNS * turn_class(last, most) + turn_class(before, most) << TURN_BITS),
            )
            put_mixed(state, out, models, mixer, at, TURN_ROW, TURN_BITS, off)
        lately = (2 * lately + way) % NEARS
        before = last
        last = (expected if way == 0 else 0) + off * step
        steps = off if way == 1 else 0
        heading[t] = heading[t - 1] + last
        total += last - exact_turn


@helper
def _put_phases(state, out, models, mixer, x, y, heading, phase, own, first, end, units):
    """Code phases (end - first,) from step ``first`` on, along the track (T,).

    Those from step ``own[0]`` to before ``own[1]`` are replaced by what a decoder finds. It differs by half a step of
    phases at most, unless the phase would have to go back.
    """
    step = units[PHASE_STEP]
    # Where the body was, and with which heading, when it was over the foot that is now behind. This is not known of the
    # foot at the start: the first step stands in for it.
    ax = x[first]
    ay = y[first]
    turned = heading[first]
    off = 0
    exact = phase[0]
    value = exact
    put_whole(state, out, models, FIRST_PHASE, value)
    for t in range(first + 1, end):
        away = math.sqrt(float((x[t] - ax) * (x[t] - ax) + (y[t] - ay) * (y[t] - ay))) / units[PLACE]
        after, kind, speed = expected_phase(value, x, y, heading, t, away, turned, units)
        stand = next_stand(value, units[CYCLE])
        wanted = phase[t - first]
        # The number of steps that brings the phase nearest to the exact one, but not back.
        off_before = off
        off = max((2 * (wanted - after) + step) // (2 * step), -((after - value) // step))
        # A body at rest has to be at rest in the page too, and one that goes on must not be kept from it. So a phase
        # that comes to the next stand, or that rounding would carry past it, becomes that stand; and one that stays
        # though it is expected to advance, stays.
        comes = abs(wanted - stand) <= REST and after != stand
        comes = comes or (wanted <= stand and after + off * step > stand)
        stays = not comes and wanted == exact and after != value
        # First whether the phase comes to a stand or stays, then which of the two; or else its number of steps.
        put_bit(state, out, models, FOLLOWS + 2 * kind + (1 if off_before == 0 else 0), 1 if comes or stays else 0)
        if comes or stays:
            put_bit(state, out, models, STAYS + kind, 1 if stays else 0)
            now = value if stays else stand
            off = 0
        else:
            pace = min(int(16.0 * speed), SPEEDS - 1)
            turn = turn_class(abs(wrapped(heading[t] - heading[t - 1], units[TURN])), units[MOST])
            at = (
                PHASE_MODELS[0] + (SIGNED * (SPEEDS * kind + pace) + signed_class(off_before) << PHASE_BITS),
                PHASE_MODELS[1] + (SIGNED * (TURNS * kind + turn) + signed_class(off_before) << PHASE_BITS),
                PHASE_MODELS[2] + (SPEEDS * (AWAYS * kind + min(int(50.0 * away), AWAYS - 1)) + pace << PHASE_BITS),
            )
            put_mixed(state, out, models, mixer, at, PHASE_ROW + (kind << PHASE_BITS), PHASE_BITS, off)
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
def code_chunk(tracks, exact, here, node, nodes, stretches, phases, own, units, slack, coder):
    """Code the tracks of N agents in T steps, agent by agent; return the number of bytes.

    Parameters
    ----------
    tracks: (4, N, T) int64 x, y, heading and frame in the units of a page. The first three become what a decoder finds,
        in whole units; of frames, only those of nodes count.
    exact: (3, N, T) float64 x, y and heading in these units.
    here: (N, T) uint8, whether an agent is present.
    node: (N, T) int32 node that an agent plays; -1 if it is steered.
    nodes: a :class:`crowdsim.export.page.tracks.played_kernels.NodeTracks`.
    stretches: (S, 4) int64 agent, first step, step after the last, and index of the first of their phases, sorted by
        agent, then by time.
    phases: (P,) int64, set to what a decoder finds in the steps from ``own[0]`` to before ``own[1]``.
    own: (2,) int64, the steps that belong to this chunk and to no other.
    units: (UNITS,) int64, see :mod:`crowdsim.export.page.tracks.expected_kernels`.
    slack: (2,) float64, largest error of a steered heading, and of the sum of these errors so far [units of turn]; 0, 0
        to round.
    coder: a new :class:`crowdsim.export.page.tracks.mixing_kernels.Coder`; its ``out`` has to be large enough.
    """
    state, out, models, mixer = coder
    count, steps = here.shape
    stretch = 0
    for who in range(count):
        x, y, heading = tracks[0, who], tracks[1, who], tracks[2, who]
        track, exact_track = tracks[:, who], exact[:, who]
        for t in range(steps):
            x[t] = math.floor(exact_track[0, t] + 0.5)
            y[t] = math.floor(exact_track[1, t] + 0.5)
        begin = 0
        while begin < steps:
            if here[who, begin] == 0:
                begin += 1
                continue
            # A run of steps in which the agent is present, coded in parts in which it is either captured or steered.
            stop = begin
            while stop < steps and here[who, stop]:
                stop += 1
            first = begin
            while first < stop:
                played = node[who, first] >= 0
                end = first
                while end < stop and (node[who, end] >= 0) == played:
                    end += 1
                if played:
                    put_frames(state, out, models, nodes, track, node[who], first, end, units)
                    put_played(state, out, models, nodes, exact_track, track, node[who], begin, first, end, units)
                else:
                    _put_places(state, out, models, mixer, x, y, begin, first, end, units)
                    headings = exact_track[2], heading
                    _put_headings(state, out, models, mixer, x, y, headings, begin, first, end, stop, units, slack)
                first = end
            begin = stop
        # Phases, in its stretches as a steered agent.
        while stretch < len(stretches) and stretches[stretch, 0] == who:
            first = stretches[stretch, 1]
            end = stretches[stretch, 2]
            at = stretches[stretch, 3]
            shown = phases[at : at + end - first]
            _put_phases(state, out, models, mixer, x, y, heading, shown, own, first, end, units)
            stretch += 1
    return finish(state, out)
