"""Motions that a folder of captures lacks, made from one of its walks: stands, steps, turns, side steps.

Each is a track with the phases that a simulation would give it, and the walk deformed to that track. At its own speed a
deformed walk is close to the captured one, so a motion graph joins made and captured motions. Times and rates below are
measured along the tracks. These are played somewhat faster or slower, so that they have the walk's own cadence; side
steps are played as they are.
"""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.deformed.clip_cycle import find_cycle
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip
from crowdsim.motion.deformed.going_over import go_over, smooth_share
from crowdsim.motion.deformed.joined_tracks import STEP
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases
from crowdsim.motion.deformed.step_plan import plan_steps, posed_clip

_WALK_RATIO = 0.39
"""Square of the step length over the speed [m s], as for the phases of tracks."""
_REST = 1.2
"""Standing time before and after a motion that begins or ends standing [s]."""
_RAMP = 1.0
"""Time in which a walk comes up to its speed, and in which it stops [s]."""
_CYCLES = 4.0
"""Cycles between setting off and stopping."""
_BESIDE_TURN = 2.0
"""Cycles of steady walking before and after a turn: cuts are compared and smoothed with what surrounds them."""
_GOES_OVER = 1.5
"""Cycles in which one walk goes over into another."""
_FRINGE = 0.4
"""Time at both ends of a track that is not shown, as footsteps depend on what lies beyond [s]."""
_STEP_SECONDS = 1.0
_SIDE_SECONDS = 1.0
"""Durations of a step of 0.2 m ahead and of a step to the side, from stand to stand [s]."""
_PAUSE = 5
"""Samples of rest between side steps, and between a walk and a turn: feet stand long enough for a cut."""
_SIDE_STEP = 0.40
"""Length of a side step [m]."""
_SPOT_RATE = np.radians(70.0)
"""Mean rate of turning on the spot [rad/s]."""

STEPS = (0.25, 0.5)
"""Lengths of the steps from stand to stand [m]."""
SPOT_TURNS = (30.0, 60.0, 90.0, 180.0)
WALKING_TURNS = (20.0, 45.0, 90.0)
"""Angles of the turns on the spot (SPOT_TURNS), and of those over 1.2 cycles of walking [degrees]."""


class MotionMaker:
    """Maker of motions from the walk ``clip``; raises MotionError if that cannot be deformed.

    stride: length of the walk's cycle [m]. speed: of the walk [m/s]. side_speed: mean speed of side steps [m/s].
    """

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        self._deformed: DeformedClip = deform_clip(clip)
        cycle = find_cycle(clip)
        self.stride = cycle.stride
        self.speed = cycle.stride / cycle.seconds
        # Cadence follows from the speed of a track (walk ratio W = step^2 / speed, a stride has two steps), so tracks
        # have the speed that gives this stride. They are played _hurry times as fast, at the clip's own cadence.
        self._track_speed = 0.25 * self.stride * self.stride / _WALK_RATIO
        self._hurry = self.speed / self._track_speed
        self.side_speed = _SIDE_STEP / (_SIDE_SECONDS + _PAUSE * STEP)

    def halts(self) -> Clip:
        """Make a walk from standing, and to a stop again."""
        return self._walk("halts", 0.0, stands_before=True, stands_after=True)

    def step(self, length: float) -> Clip:
        """Make a step of ``length`` meters from standing to standing; longer ones take longer."""
        rise = _bell(_STEP_SECONDS * (0.8 + length))
        return self._made(f"step_{round(100.0 * length)}", _rested(np.outer(rise, [length, 0.0, 0.0])))

    def turn_on_the_spot(self, degrees: float) -> Clip:
        """Make a turn on the spot, left if positive, from standing to standing; on the track it takes 0.8 s or more."""
        angle = float(np.radians(degrees))
        rise = _bell(max(abs(angle) / _SPOT_RATE, 0.8))
        return self._made(_named("turn", degrees), _rested(np.outer(rise, [0.0, 0.0, angle])))

    def walking_turn(self, degrees: float) -> Clip:
        """Make a turn over 1.2 cycles of steady walking, left if positive."""
        return self._walk(_named("walk", degrees), degrees)

    def side_steps(self, left: bool) -> Clip:
        """Make three steps to one side, at rest between them."""
        rise = np.concatenate([_bell(_SIDE_SECONDS), np.zeros(_PAUSE)])
        moves = np.outer(np.tile(rise, 3), [0.0, _SIDE_STEP if left else -_SIDE_STEP, 0.0])
        return self._made(f"side_{'left' if left else 'right'}", _rested(moves), 1.0)

    def walk_to_stand(self, degrees: float) -> Clip:
        """Make a walk that stops, and a turn on the spot there, left if positive."""
        return self._quarter("walk_to_side", degrees, before=True)

    def stand_to_walk(self, degrees: float) -> Clip:
        """Make a turn on the spot, left if positive, and a walk from there."""
        return self._quarter("side_to_walk", degrees, before=False)

    def lead_over(self, other: MotionMaker, name: str) -> Clip:
        """Make a walk that goes over into that of ``other``, on the same skeleton.

        Cadence and speed go over from one to the other, and bodies as :func:`go_over` says, so that planted feet stand.
        """
        # Seconds of two cycles before, of the change, and of two cycles after it; a cycle takes stride / speed.
        lead = 2.0 * self.stride / self._track_speed
        after = 2.0 * other.stride / other._track_speed
        over = _GOES_OVER * 0.5 * (self.stride / self._track_speed + other.stride / other._track_speed)
        times = (np.arange(round((lead + over + after) / STEP)) + 0.5) * STEP
        weight = smooth_share(np.asarray((times - lead) / over, np.float64))
        moves = np.zeros((len(times), 3))
        moves[:, 0] = STEP * (self._track_speed + weight * (other._track_speed - self._track_speed))
        track = _with_phases(_poses(moves))
        begin, end = np.interp([lead, lead + over], np.arange(len(track)) * STEP, track[:, 3])
        # Times on the track of the frames shown: as far apart as the clips' own cadences make them (_hurry).
        shown = [_FRINGE]
        while shown[-1] < (len(track) - 1) * STEP - _FRINGE:
            share = float(smooth_share(np.array([(shown[-1] - lead) / over]))[0])
            shown.append(shown[-1] + (self._hurry + share * (other._hurry - self._hurry)) / CAPTURE_RATE)
        return go_over(self._deformed, other._deformed, track, (float(begin), float(end)), np.array(shown[:-1]), name)

    def _quarter(self, name: str, degrees: float, before: bool) -> Clip:
        """Make a walk joined to a turn on the spot by ``degrees``, left if positive.

        before: True if the walk comes before the turn.
        """
        angle = float(np.radians(degrees))
        turn = np.outer(_bell(abs(angle) / _SPOT_RATE), [0.0, 0.0, angle])
        walk = self._steady(0.0, stands_before=not before, stands_after=before)
        rest, pause = np.zeros((round(_REST / STEP), 3)), np.zeros((_PAUSE, 3))
        moves = np.concatenate([walk, pause, turn, rest] if before else [rest, turn, pause, walk])
        return self._made(f"{name}_{'left' if degrees > 0.0 else 'right'}", moves)

    def _walk(self, name: str, degrees: float, stands_before: bool = False, stands_after: bool = False) -> Clip:
        """Make a steady walk with a turn by ``degrees``, left if positive, 0 for none.

        stands_before, stands_after: True if the body stands before the walk, and after it.
        """
        moves = self._steady(degrees, stands_before, stands_after)
        count = round(_REST / STEP)
        return self._made(name, np.pad(moves, ((count * stands_before, count * stands_after), (0, 0))))

    def _steady(self, degrees: float, stands_before: bool, stands_after: bool) -> Floats:
        """Return moves (n, 3), ahead, left [m] and around [rad] in each time step, of steady walking.

        It has a turn by ``degrees`` over 1.2 cycles in the middle; 0 for none. stands_before, stands_after: True if the
        speed rises from 0 at the beginning, and falls to 0 at the end, within _RAMP seconds.
        """
        period = self.stride / self._track_speed
        seconds = (2.0 * _BESIDE_TURN + 1.2 if degrees else _CYCLES) * period
        times = (np.arange(round(seconds / STEP)) + 0.5) * STEP
        share = np.ones(len(times))
        if stands_before:
            share = np.minimum(share, times / _RAMP)
        if stands_after:
            share = np.minimum(share, (seconds - times) / _RAMP)
        moves = np.zeros((len(times), 3))
        moves[:, 0] = self._track_speed * STEP * np.clip(share, 0.0, 1.0)
        if degrees:
            rise = _bell(1.2 * period)
            first = (len(times) - len(rise)) // 2
            moves[first : first + len(rise), 2] = np.radians(degrees) * rise
        return moves

    def _made(self, name: str, moves: Floats, hurry: float | None = None) -> Clip:
        """Deform the walk to the track of ``moves`` (n, 3), ahead, left [m] and around [rad] in each time step.

        The clip is called ``made_`` and ``name``. hurry: how many times as fast the track is played; None for the
        cadence of the walk.
        """
        track = _with_phases(_poses(moves))
        plan = plan_steps(self._deformed, [track])
        pace = self._hurry if hurry is None else hurry
        times = np.arange(_FRINGE, (len(track) - 1) * STEP - _FRINGE, pace / CAPTURE_RATE)
        return posed_clip(self._deformed, plan, 0, times, f"made_{name}")


def _named(kind: str, degrees: float) -> str:
    """Return the name of a turn, such as ``turn_left_90`` for the kind ``turn`` and 90 degrees (positive: left)."""
    return f"{kind}_{'left' if degrees > 0.0 else 'right'}_{round(abs(degrees))}"


def _bell(seconds: float) -> Floats:
    """Return the share (n,) of a motion of ``seconds`` that each time step makes: slow, fast, slow, in sum 1.

    A motion has three time steps at least.
    """
    count = max(round(seconds / STEP), 3)
    edges = np.arange(count + 1) / count
    shares: Floats = np.diff(edges - sin(2.0 * np.pi * edges) / (2.0 * np.pi))
    return shares


def _rested(moves: Floats) -> Floats:
    """Return the moves (n, 3) with _REST seconds of rest before and after."""
    rest = np.zeros((round(_REST / STEP), 3))
    return np.concatenate([rest, moves, rest])


def _poses(moves: Floats) -> Floats:
    """Return the poses (n + 1, 3), x, y [m] and heading [rad], before and after each of ``moves``, from the origin.

    moves: (n, 3) ahead, left [m] and around [rad].
    """
    # Each move goes along the heading that is halfway in its turn.
    heading = np.concatenate([[0.0], np.cumsum(moves[:, 2])])
    middle = heading[:-1] + 0.5 * moves[:, 2]
    x = np.cumsum(moves[:, 0] * cos(middle) - moves[:, 1] * sin(middle))
    y = np.cumsum(moves[:, 0] * sin(middle) + moves[:, 1] * cos(middle))
    return np.column_stack([np.concatenate([[0.0], x]), np.concatenate([[0.0], y]), heading])


def _with_phases(poses: Floats) -> Floats:
    """Return the poses (n, 3) of a track with the phases of a body on it, (n, 4).

    The body stands in the first pose.
    """
    phases, anchors = np.array([STAND]), poses[:1].copy()
    track = np.column_stack([poses, np.full(len(poses), STAND)])
    for row in range(1, len(poses)):
        place, moved = poses[row : row + 1].copy(), (poses[row] - poses[row - 1]) / STEP
        advance_phases(place, moved[None, :2].copy(), moved[2:].copy(), STEP, phases, anchors)
        track[row, 3] = phases[0]
    return track
