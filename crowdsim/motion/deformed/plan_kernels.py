"""Footsteps of tracks: where feet stand, how low the pelvis must be for them, and how they leave and land.

There is one footstep per half cycle; half cycles with even numbers are the left foot's. Each footstep depends only on
about a cycle of the track before and after it, so a plan of any long enough part of a track gives the same poses.

Arguments of all helpers:

- ``model``: ClipModel. ``step``: time between samples [s]. ``u``: phase since a foot landed [cycles].
- ``samples`` (T, COLUMNS): padded tracks, one after the other. :mod:`crowdsim.motion.deformed.body_kernels` names the
  columns. ``firsts``, ``counts`` (A,): first row and number of rows of each track. ``first``, ``last``: the first row
  of one track, and the row behind its last one. ``scratch`` (T,): memory for one column.
- ``steps`` (H, STEP_COLUMNS): footsteps. Those of track k are rows ``rows[k]`` to before ``rows[k + 1]``, and
  ``halves[k]`` is the number of the half cycle of the first of them.
"""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper, kernel
from crowdsim.motion.deformed.body_kernels import (
    AHEAD,
    DROP,
    FOOT_LENGTH,
    HEADING,
    PHASE,
    SHARE,
    SOLE_DOWN,
    TWIST,
    X,
    Y,
    ankle_over,
    hip_of,
    lacking,
    pelvis_of,
    reaching_pitch,
    sampled,
    standing_yaw,
    track_at,
)
from crowdsim.motion.deformed.phase_kernels import REFERENCE, STANCE, STAND, hip_turn
from crowdsim.motion.deformed.spline_kernels import time_of_value

# Columns of a step: the print, then the ankle as the foot lifts and as it lands.
PRINT = 0  # x, y of the ball [m], heading [rad]
LIFT = 3  # ankle x, y, z [m], pitch, heading [rad], and the ankle's speed along x, y, z [m/cycle]
LAND = 11  # the same eight as the foot lands on this print
ASIDE = 19  # distance that the foot swings out to pass the other one, on its way from this print to its next [m]
STEP_COLUMNS = 20

PAD = 14
"""Samples added before and after each track."""
_LONGEST_LOOK = 0.6
"""Time after a landing in which the track decides where the foot stands; the track after it does not count [s]."""
_AT_REST = 1e-4
"""Largest distance of a phase from that of a stand at which it counts as one [half cycles]."""
_DIGITS = 1.2e-7
"""Relative rounding of phases in recordings, which have seven digits."""
_SLOWEST = 0.45
"""Least cadence by which speeds are divided to get strides, so that slow cadences make no long ones [cycles/s]."""
_TURN_STRIDE = 0.2
"""Stride that turning counts as [m/rad]."""
_LARGEST_SHARE = 1.25
"""Largest stride as a multiple of the clip's."""
_APART = 1.8
"""Distance between feet side by side, as a multiple of the half width of steps."""
_STOOD = 1.2
"""Time between landings from which the later foot no longer pushes the earlier one [s]."""
_PASSING = 0.095
"""Least distance across between a swinging foot and the one that it passes [m]."""
_LONG, _LONG_BY = 0.32, 0.12
"""Distance ahead from which feet may be in line, and the last part of it, over which the least distance across fades
to nothing [m]."""
_MOST_ASIDE = 0.2
"""Largest distance that a foot swings aside, or is pushed aside in the first pass [m]."""
_DEEPEST = 0.2
"""Largest drop of the pelvis [m]."""
_HEEL_FROM, _HEEL_BY = 0.2, 0.3
"""Phase after landing from which a heel may rise to spare the pelvis, and range over which it gains freedom."""
_HEEL_MOST = 1.15
"""Largest pitch that the heel then may have [rad]."""
_HANN = (0.09549150281252627, 0.6545084971874737, 1.0, 0.6545084971874737, 0.09549150281252627)
"""Weights of a Hann window over five samples, at the middles of its fifths; their sum is 2.5."""


@helper
def _smooth(values, column, first, last, scratch):
    """Smooth rows ``first`` to before ``last`` of a column by a Hann window of five samples, half a second at 10 Hz.

    The first and the last row stand for those that are missing beyond them. ``scratch`` has at least ``last`` values.
    """
    # Sum first and write later, as each row needs its neighbors as they were.
    for row in range(first, last):
        total = 0.0
        for k in range(5):
            total += _HANN[k] * values[min(max(row + k - 2, first), last - 1), column]
        scratch[row] = total / 2.5
    for row in range(first, last):
        values[row, column] = scratch[row]


@helper
def _speeds(samples, row, first, last, step):
    """Return speeds at a row: x, y [m/s], turn [rad/s], phase [cycles/s].

    By central differences, one-sided ones in the first and the last row.
    """
    before = max(row - 1, first)
    after = min(row + 1, last - 1)
    seconds = (after - before) * step
    return (
        (samples[after, X] - samples[before, X]) / seconds,
        (samples[after, Y] - samples[before, Y]) / seconds,
        (samples[after, HEADING] - samples[before, HEADING]) / seconds,
        (samples[after, PHASE] - samples[before, PHASE]) / seconds,
    )


@helper
def _stands(phase):
    """Return True if a phase is that of a body at rest, STAND after a landing."""
    # Rounded phases of recordings: the tolerance grows with the phase.
    halves = 2.0 * phase
    return abs(halves - math.floor(halves) - 2.0 * STAND) < max(_AT_REST, _DIGITS * halves)


@kernel
def fill_samples(model, tracks, starts, step, firsts, samples, scratch):
    """Fill the samples from which bodies are posed: padded tracks, headings of the hips, and strides.

    Strides are multiples of the clip's. The column DROP is set to 0 here.

    Parameters
    ----------
    tracks: (N, 4) float64 x, y [m], heading of the chest [rad] without jumps, phase [cycles].
    starts: (A + 1,) int64 rows at which tracks begin, and N.
    firsts: (A,) int64 rows of ``samples`` (T, COLUMNS) at which the padding before each track begins.
    """
    for body in range(len(firsts)):
        count = starts[body + 1] - starts[body]
        first = firsts[body]
        total = count + 2 * PAD
        # Padding: the track goes on as it begins and ends. It rests there if its phase is that of a stand there, or if
        # it has a single sample. beyond: samples before (< 0) or after the track, 0 in it.
        for row in range(total):
            inside = min(max(row - PAD, 0), count - 1)
            beyond = row - PAD - inside
            source = starts[body] + inside
            if beyond != 0 and _stands(tracks[source, PHASE]):
                beyond = 0
            for column in range(4):
                rate = 0.0
                if beyond < 0 and count > 1:
                    rate = tracks[source + 1, column] - tracks[source, column]
                elif beyond > 0 and count > 1:
                    rate = tracks[source, column] - tracks[source - 1, column]
                samples[first + row, column] = tracks[source, column] + beyond * rate
        # Turn the hips toward the motion; the angle that the chest keeps from them is the twist.
        for row in range(first, first + total):
            x, y, _, _ = _speeds(samples, row, first, first + total, step)
            c, s = cos_sin(samples[row, HEADING])
            samples[row, TWIST] = hip_turn(c * x + s * y, c * y - s * x)
        _smooth(samples, TWIST, first, first + total, scratch)
        for row in range(first, first + total):
            samples[row, HEADING] += samples[row, TWIST]
        # SHARE: stride over the clip's, turning included. AHEAD: the same of movement ahead alone, 0 if it goes back.
        for row in range(first, first + total):
            x, y, turn, rate = _speeds(samples, row, first, first + total, step)
            rate = max(rate, _SLOWEST)
            c, s = cos_sin(samples[row, HEADING])
            turning = _TURN_STRIDE * turn
            stride = math.sqrt(x * x + y * y + turning * turning) / rate
            samples[row, SHARE] = min(stride / model.stride, _LARGEST_SHARE)
            samples[row, AHEAD] = min(max((c * x + s * y) / (rate * model.stride), 0.0), _LARGEST_SHARE)
            # No drop until :func:`plan_drops` computes it.
            samples[row, DROP] = 0.0
        _smooth(samples, SHARE, first, first + total, scratch)
        _smooth(samples, AHEAD, first, first + total, scratch)


@helper
def _lack(x, y, heading, side, apart):
    """Return how far a point (x, y) must move to the ``side`` (1 left, -1 right) of a foot at the origin [m].

    heading: direction that counts as ahead there [rad]. apart: required distance to that side [m], less for a point
    well ahead or behind, down to none. The result is 0 if the point is far enough, and 2 _MOST_ASIDE at most.
    """
    c, s = cos_sin(heading)
    along = abs(c * x + s * y)
    # 1 for feet side by side, 0 for those a long step apart.
    beside = min(max((_LONG - along) / _LONG_BY, 0.0), 1.0)
    # More would be of no use: each of two feet moves by _MOST_ASIDE at most.
    return beside * min(max(apart - side * (c * y - s * x), 0.0), 2.0 * _MOST_ASIDE)


@helper
def _push_apart(steps, first, last, half, bodies, most):
    """Move the prints of rows ``first`` to before ``last`` outward if they are too close to the prints before or after.

    Of two feet, each moves by half of what is missing between them. But a foot that has stood for over _STOOD seconds
    when the next one lands stays: the next step was not known yet as it was put down. The next foot then moves by all
    of it. No foot moves by more than ``most`` [m].

    steps: rows of footsteps; x and y of the prints [m] are read and moved. half: number of the half cycle of row
    ``first``. bodies: (H, 4) heading of the body over each print [rad], half step width [m], scratch, and time at which
    each foot lands [s].
    """
    for row in range(first + 1, last):
        side = 1.0 - 2.0 * ((half + row - first) & 1)
        x = steps[row, PRINT] - steps[row - 1, PRINT]
        y = steps[row, PRINT + 1] - steps[row - 1, PRINT + 1]
        apart = _APART * min(bodies[row - 1, 1], bodies[row, 1])
        # What is missing across the body's heading over either foot; it fades for a foot well ahead. Across the mean of
        # both headings, feet must be apart however far ahead, as legs must not cross.
        lack = max(_lack(x, y, bodies[row - 1, 0], side, apart), _lack(x, y, bodies[row, 0], side, apart))
        c, s = cos_sin(0.5 * (bodies[row - 1, 0] + bodies[row, 0]))
        lack = max(lack, apart - side * (c * y - s * x))
        # If the foot before does not give way, this one makes up for all of the lack.
        share = 1.0 if bodies[row, 3] - bodies[row - 1, 3] > _STOOD else 0.5
        bodies[row, 2] = min(share * lack, most)
    # Each foot moves once, by the larger of two pushes: away from the foot before, and away from the foot after.
    for row in range(first, last):
        side = 1.0 - 2.0 * ((half + row - first) & 1)
        push = bodies[row, 2] if row > first else 0.0
        if row + 1 < last and bodies[row + 1, 3] - bodies[row, 3] <= _STOOD:
            push = max(push, bodies[row + 1, 2])
        c, s = cos_sin(bodies[row, 0])
        steps[row, PRINT] -= side * push * s
        steps[row, PRINT + 1] += side * push * c


@kernel
def plan_prints(model, samples, firsts, counts, step, halves, rows, steps, bodies):
    """Plan the print of each foot, and how far aside it swings on its way to its next print.

    A foot stands beside the point of the track at which the body passes over it. Feet that would stand too close to
    each other are moved apart. Fills PRINT of ``steps``, and ASIDE, but not in a track's last two rows (no next print).

    Parameters
    ----------
    samples, firsts, step: as of `fill_samples`. counts: (A,) int64 samples of each track with its padding.
    halves: (A,) int64 number of the half cycle of each track's first footstep.
    rows: (A + 1,) int64 rows at which tracks begin in ``steps`` (H, STEP_COLUMNS), and H.
    bodies: (H, 4) float64 scratch, as of :func:`_push_apart`.
    """
    for body in range(len(firsts)):
        first = firsts[body]
        count = counts[body]
        span = 1
        # Stand where the body is when it passes over the foot, but look only _LONGEST_LOOK ahead. Times grow from row
        # to row, so each search starts at the span of the one before.
        for row in range(rows[body], rows[body + 1]):
            half = halves[body] + row - rows[body]
            foot = half & 1
            landing, span = time_of_value(samples, PHASE, 0.5 * half, step, first, count, span)
            over, _ = time_of_value(samples, PHASE, 0.5 * half + REFERENCE, step, first, count, span)
            track = track_at(samples, first, count, step, min(over, landing + _LONGEST_LOOK))
            ahead = min(track[AHEAD], 1.0)
            side = 1.0 - 2.0 * foot
            # Blend from feet side by side under a standing body, balls half a foot ahead, to the clip's prints; AHEAD
            # is the share of the latter, 1 for longer strides, too.
            width = (1.0 - ahead) * model.width + ahead * abs(model.prints[foot, 1])
            place = (1.0 - ahead) * 0.5 * model.bones[foot, FOOT_LENGTH] + ahead * model.prints[foot, 0]
            c, s = cos_sin(track[HEADING])
            steps[row, PRINT] = track[X] + c * place - side * s * width
            steps[row, PRINT + 1] = track[Y] + s * place + side * c * width
            steps[row, PRINT + 2] = track[HEADING] + model.prints[foot, 2]
            bodies[row, 0] = track[HEADING]
            bodies[row, 1] = width
            bodies[row, 3] = landing
        # Twice, as a foot that moved may now be too close to its other neighbor; the second time by little.
        _push_apart(steps, rows[body], rows[body + 1], halves[body], bodies, _MOST_ASIDE)
        _push_apart(steps, rows[body], rows[body + 1], halves[body], bodies, 0.3 * _MOST_ASIDE)
        # Swing out if the straight line from a foot's print (row - 1) to its next (row + 1) passes too close to the
        # other foot (row), tested at three shares u of it. The detour is ASIDE times 16 u^2 (1 - u)^2, 1 in the middle.
        for row in range(rows[body] + 1, rows[body + 1] - 1):
            side = 1.0 - 2.0 * ((halves[body] + row + 1 - rows[body]) & 1)
            aside = 0.0
            for k in range(3):
                share = 0.25 + 0.25 * k
                x = (1.0 - share) * steps[row - 1, PRINT] + share * steps[row + 1, PRINT] - steps[row, PRINT]
                y = (
                    (1.0 - share) * steps[row - 1, PRINT + 1]
                    + share * steps[row + 1, PRINT + 1]
                    - steps[row, PRINT + 1]
                )
                lack = _lack(x, y, steps[row, PRINT + 2], side, _PASSING)
                aside = max(aside, lack / (16.0 * share * share * (1.0 - share) * (1.0 - share)))
            steps[row - 1, ASIDE] = min(aside, _MOST_ASIDE)


@helper
def planned_pitch(model, foot, u, ahead):
    """Return the clip's pitch of a foot at the share ``u`` of its cycle, times ``ahead`` (column AHEAD) [rad]."""
    return sampled(model.pitch, foot, u) * ahead


@helper
def stand_ankle(model, foot, print_row, u, track, place, turn, spare):
    """Return the ankle of a standing foot (x, y, z) [m], its pitch and its heading [rad].

    print_row: x, y of the ball [m] and heading of the print [rad]. track: the body's sample at that time, from
    `track_at`. place, turn: position [m] and rotation of the root. A pitch is positive if the toes point up, negative
    if the heel is raised. spare: 0 for the pitch of the clip; if positive, the heel is raised by that angle at least
    [rad], to spare the pelvis; if -1, it is raised as far as its leg needs, but only once the sole is down.
    """
    yaw = standing_yaw(print_row[2], model.prints[foot, 2], track[HEADING], u)
    c, s = cos_sin(yaw)
    pitch = planned_pitch(model, foot, u, track[AHEAD])
    if spare >= 0.0:
        pitch = min(pitch, -spare) if spare > 0.0 else pitch
    # A heel rises for its leg only once the sole is down: before that, the foot still rolls over the heel.
    elif u > SOLE_DOWN:
        hip = hip_of(model, foot, place, turn)
        pitch = reaching_pitch(model.bones, foot, pitch, hip, print_row, c, s)
    ahead, up = ankle_over(model.bones, foot, pitch)
    return (print_row[0] + c * ahead, print_row[1] + s * ahead, up), pitch, yaw


@kernel
def plan_drops(model, samples, firsts, counts, step, halves, rows, steps, scratch):
    """Plan how far the pelvis comes down so that legs reach their feet, by _DEEPEST at most.

    The leg of each stance is tested at eight phases, from the landing of its foot to the lift-off; the heel may rise to
    help late in the stance. The pelvis comes down and up smoothly within half a second of a time at which it must be
    low. Fills DROP of ``samples`` [m] (0 before) from PRINT of ``steps``. Parameters as of :func:`plan_prints`.
    """
    # Phases after landing, closest to each other where a leg is stretched most: as its foot lands, and before it lifts.
    tested = (0.0, 0.05, 0.15, 0.3, 0.4, 0.5, 0.55, 0.6)
    for body in range(len(firsts)):
        first = firsts[body]
        count = counts[body]
        span = 1
        for row in range(rows[body], rows[body + 1]):
            half = halves[body] + row - rows[body]
            foot = half & 1
            prints = (steps[row, PRINT], steps[row, PRINT + 1], steps[row, PRINT + 2])
            near = span
            for k in range(len(tested)):
                u = tested[k]
                time, near = time_of_value(samples, PHASE, 0.5 * half + u, step, first, count, near)
                # The next foot lands after this one, so its search may begin here.
                if k == 0:
                    span = near
                track = track_at(samples, first, count, step, time)
                # Measure without any drop: DROP already contains that of earlier stances.
                track = (track[0], track[1], track[2], track[3], track[4], track[5], 0.0, track[7])
                place, turn = pelvis_of(model, track)
                spare = _HEEL_MOST * min(max((u - _HEEL_FROM) / _HEEL_BY, 0.0), 1.0)
                ankle, _, _ = stand_ankle(model, foot, prints, u, track, place, turn, spare)
                lack = lacking(model.bones, foot, hip_of(model, foot, place, turn), ankle)
                # Set the drop in all samples that count for this time: four of the spline (middle - 1 to middle + 2),
                # and two more on either side for the window that smooths them.
                if lack > 0.0:
                    middle = int(time / step)
                    for sample in range(max(middle - 3, 0), min(middle + 5, count)):
                        samples[first + sample, DROP] = max(samples[first + sample, DROP], min(lack, _DEEPEST))
        _smooth(samples, DROP, first, first + count, scratch)


@kernel
def plan_swings(model, samples, firsts, counts, step, halves, rows, steps):
    """Plan how each foot lands and lifts: ankle, pitch and heading there, and the ankle's speed [m/cycle].

    Fills LIFT and LAND of ``steps`` from its PRINT and DROP of ``samples``. Parameters as of :func:`plan_prints`.
    """
    # Phase between the two poses whose difference gives a speed [cycles].
    little = 0.01
    for body in range(len(firsts)):
        first = firsts[body]
        count = counts[body]
        span = 1
        for row in range(rows[body], rows[body + 1]):
            half = halves[body] + row - rows[body]
            foot = half & 1
            prints = (steps[row, PRINT], steps[row, PRINT + 1], steps[row, PRINT + 2])
            near = span
            for begins in range(2):
                # begins 0: the stance begins (the foot lands); 1: the swing begins (it lifts). Pose the foot then, and
                # ``little`` cycles inside the stance.
                column = LAND if begins == 0 else LIFT
                for k in range(2):
                    u = k * little if begins == 0 else STANCE - (1 - k) * little
                    time, near = time_of_value(samples, PHASE, 0.5 * half + u, step, first, count, near)
                    if begins == 0 and k == 0:
                        span = near
                    track = track_at(samples, first, count, step, time)
                    place, turn = pelvis_of(model, track)
                    ankle, pitch, yaw = stand_ankle(model, foot, prints, u, track, place, turn, -1.0)
                    # k 0: the earlier of the two poses. end 1: the pose in which the foot just lands or lifts.
                    end = k if begins == 1 else 1 - k
                    for axis in range(3):
                        if k == 0:
                            steps[row, column + 5 + axis] = -ankle[axis] / little
                        else:
                            steps[row, column + 5 + axis] += ankle[axis] / little
                        if end == 1:
                            steps[row, column + axis] = ankle[axis]
                    if end == 1:
                        steps[row, column + 3] = pitch
                        steps[row, column + 4] = yaw
