"""The default motion set: which movements it holds, and in which behavior's folder each clip stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import compose
from crowdsim.motion.arm_edit import edit_arms
from crowdsim.motion.clip import Clip
from crowdsim.motion.gait_builder import BRISK, NORMAL, SLOW, PlanBuilder
from crowdsim.motion.gait_curves import ease
from crowdsim.motion.gait_plan import LEFT, RIGHT, SIDE_STEPPING, Plan, mirrored
from crowdsim.motion.gait_synthesis import synthesize, synthesize_idle

Floats = NDArray[np.float64]

_IDLE_FRAMES = 121
_ARMS_FRAMES = 37
_MARGIN = 60
"""Frames of walking kept beyond a cut, less than a cycle so that no other cut is among them."""


def _rad(degrees: float) -> float:
    return float(np.radians(degrees))


def _excerpt(name: str, clip: Clip, first: int, last: int) -> Clip:
    """Frames ``first`` to ``last`` of a clip."""
    rows = slice(first, last + 1)
    return Clip(name, clip.skeleton, clip.root_positions[rows], clip.rotations[rows])


def _passing_frames(plan: Plan) -> list[int]:
    return [hub.frame for hub in plan.hubs if hub.kind == NORMAL.name]


def _walk(name: str) -> Plan:
    """Straight walking at three speeds and the changes between them."""
    builder = PlanBuilder(name).start(NORMAL)
    for gait in (NORMAL, NORMAL, SLOW, SLOW, NORMAL, BRISK, BRISK, NORMAL):
        builder.cycle(gait)
    return builder.stop().finish()


def _slow(name: str) -> Plan:
    return PlanBuilder(name).start(SLOW, 0.46).cycle(SLOW).cycle(SLOW).stop(0.46).finish()


def _long_start(name: str) -> Plan:
    return PlanBuilder(name).start_right(NORMAL).stop(0.68).finish()


def _walking_turn(name: str, degrees: float) -> Clip:
    """One cycle of walking that turns, with just the straight walking that its cuts need about it."""
    sharp = abs(degrees) > 30.0
    length = float(np.interp(abs(degrees), [45.0, 90.0], [1.15, 0.86])) if sharp else None
    # The right foot opens in a turn to the right, and then takes more of it than in one to the left.
    outer = (0.42 if degrees > 0.0 else 0.58) if sharp else 0.5
    builder = PlanBuilder("").start(NORMAL).cycle(NORMAL).cycle(NORMAL, _rad(degrees), outer, length)
    plan = builder.cycle(NORMAL).stop().finish()
    first, last = _passing_frames(plan)[1:3]
    return _excerpt(name, synthesize(plan), first - _MARGIN, last + _MARGIN)


def _walking_turns(angles: tuple[int, ...]) -> list[Clip]:
    return [
        _walking_turn(f"walk_{way}_{angle}", sign * angle)
        for angle in angles
        for way, sign in (("left", 1), ("right", -1))
    ]


def _short_step(name: str, length: float) -> Plan:
    return (
        PlanBuilder(name)
        .steps([(side, np.array([length, 0.0, 0.0])) for side in (RIGHT, LEFT)], 20.0 + 8.0 * length, 2.0)
        .finish()
    )


def _turn_in_place(name: str, degrees: float) -> Plan:
    """Pairs of steps, the right foot first, no more than 45 degrees a pair.

    Turning right, that foot opens, and its heel needs room beside the other one.
    """
    pairs = int(np.ceil(abs(degrees) / 45.0))
    turn = _rad(degrees) / pairs
    room = 0.035 * max(0.0, -turn)
    body = np.zeros(3)
    places: list[tuple[int, Floats]] = []
    for _ in range(pairs):
        body = compose(body, np.array([0.0, -room, turn]))
        places += [(RIGHT, body), (LEFT, body)]
    return PlanBuilder(name).steps(places, 17.0 + 3.0 * abs(turn)).finish()


def _side_steps(name: str) -> Plan:
    """Three full steps to the left."""
    builder = PlanBuilder(name, SIDE_STEPPING)
    return builder.side_step(LEFT, 0.44, 17.0).pause().side_step(LEFT, 0.44, 17.0).pause().side_step(
        LEFT, 0.44, 17.0
    ).stand().finish()  # fmt: skip


def _short_side_step(name: str) -> Plan:
    return PlanBuilder(name, SIDE_STEPPING).side_step(LEFT, 0.20, 14.0).stand().finish()


def _turning_side_steps(name: str) -> Plan:
    """Steps to the left that turn the body by 5 and 10 degrees either way."""
    builder = PlanBuilder(name, SIDE_STEPPING)
    for degrees in (5.0, -5.0, 10.0):
        builder.side_step(LEFT, 0.40, 17.0, _rad(degrees)).pause()
    return builder.side_step(LEFT, 0.40, 17.0, _rad(-10.0)).stand().finish()


def _walk_to_side(turn: float) -> Plan:
    """From walking to standing a quarter turn off; in three steps to the left, where the right foot cannot open."""
    builder = PlanBuilder("").start(NORMAL).cycle(NORMAL)
    if turn < 0.0:
        return builder.stop(0.44, _rad(-90.0)).finish()
    return builder.stop_turned_left(_rad(90.0)).finish()


def _side_to_walk(turn: float) -> Plan:
    """From standing a quarter turn off the way into walking, the foot on that side first."""
    builder = PlanBuilder("")
    if turn > 0.0:
        builder.start_turned_left(NORMAL, _rad(90.0))
    else:
        builder.start_turned_right(NORMAL, _rad(-90.0))
    return builder.cycle(NORMAL).stop().finish()


def _quarter_turns() -> list[Clip]:
    """Between walking and standing a quarter turn off, with just the walking that its cut needs about it."""
    clips = []
    for way, turn in (("left", 1.0), ("right", -1.0)):
        plan = _walk_to_side(turn)
        clip = synthesize(plan)
        clips.append(_excerpt(f"walk_to_side_{way}", clip, _passing_frames(plan)[-1] - _MARGIN, clip.frame_count - 1))
        plan = _side_to_walk(turn)
        clips.append(_excerpt(f"side_to_walk_{way}", synthesize(plan), 0, _passing_frames(plan)[0] + _MARGIN))
    return clips


def _arm_transitions() -> list[Clip]:
    """Arms taken in and let go: over one cycle of walking, over one step from standing to standing, and on the spot."""
    plan = PlanBuilder("").start(NORMAL).cycle(NORMAL).cycle(NORMAL).cycle(NORMAL).stop().finish()
    first, last = _passing_frames(plan)[1:3]
    walking = _excerpt("", synthesize(plan), first - _MARGIN, last + _MARGIN)
    step = synthesize(_short_step("", 0.25))
    spot = synthesize_idle("", _ARMS_FRAMES)
    clips = []
    for name, rising in (("arms_in", True), ("arms_out", False)):
        for kind, clip, start, end in (
            ("walking", walking, _MARGIN + 4, _MARGIN + last - first - 4),
            ("step", step, 14, step.frame_count - 16),
            ("standing", spot, 0, spot.frame_count - 1),
        ):
            taken_in = ease((np.arange(clip.frame_count) - start) / (end - start))
            edited = edit_arms(clip, taken_in if rising else 1.0 - taken_in)
            clips.append(_excerpt(f"{name}_{kind}", edited, 0, clip.frame_count - 1))
    return clips


def _held(clip: Clip) -> Clip:
    return edit_arms(clip, np.ones(clip.frame_count))


def synthesize_default_set() -> list[tuple[str, str, Clip]]:
    """Behavior folder, file name and clip of the whole default set, always the same to the last bit."""
    plans = [_walk("walk"), _slow("walk_slow"), _short_step("step_25", 0.25), _short_step("step_50", 0.50)]
    constrained = [*map(synthesize, plans), *_walking_turns((10, 20))]
    plans = [_long_start("walk_long_start"), _short_step("step_75", 0.75)]
    for degrees in (15, 30, 60, 90, 180):
        plans += [_turn_in_place(f"turn_left_{degrees}", degrees), _turn_in_place(f"turn_right_{degrees}", -degrees)]
    frontal = [*constrained, *map(synthesize, plans), *_walking_turns((45, 90))]
    side = [_side_steps("side_left"), _short_side_step("side_left_short"), _turning_side_steps("side_left_turning")]
    side += [mirrored(plan, plan.name.replace("left", "right")) for plan in side]
    stand = synthesize_idle("stand", _IDLE_FRAMES)
    clips = [("frontal", clip) for clip in [*frontal, stand]]
    clips += [("arm_constrained", clip) for clip in [*map(_held, [*constrained, stand]), *_arm_transitions()]]
    clips += [("lateral", clip) for clip in [*map(synthesize, side), *_quarter_turns(), stand]]
    return [(folder, f"{clip.name}.bvh", clip) for folder, clip in clips]
