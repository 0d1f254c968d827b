"""The built-in motion sets: their motions, and the behavior folder of each clip.

Numbers in the plans are choices that shape the clips: lengths of steps [m], and frames of swings and pauses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import compose
from crowdsim.motion.clips.arm_edit import edit_arms
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.synthesis.curves import ease
from crowdsim.motion.synthesis.dance import dance_plans
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, Plan, mirrored
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import DANCING, PLAIN, SIDE_STEPPING, Manner
from crowdsim.motion.synthesis.synthesize import synthesize, synthesize_idle

Floats = NDArray[np.float64]

_IDLE_FRAMES = 121
_ARMS_FRAMES = 37
"""Frames of standing (_IDLE_FRAMES), and of moving the arms while standing."""
_SHORT_OF_A_CYCLE = 7
"""Beyond a cut, a clip keeps a cycle of walking less this number of frames, so that it contains no other cut."""

_DATABASE = ("frontal", "lateral")
"""Behaviors whose clips a database of captures would have: none is another behavior's clip with the arms edited."""


def _rad(degrees: float) -> float:
    """Return degrees as radians."""
    return float(np.radians(degrees))


def _excerpt(name: str, clip: Clip, first: int, last: int) -> Clip:
    """Return frames ``first`` to ``last`` of a clip."""
    rows = slice(first, last + 1)
    return Clip(name, clip.skeleton, clip.root_positions[rows], clip.rotations[rows])


def _passing_frames(plan: Plan) -> list[int]:
    """Return the frames of a plan's hubs in the normal gait."""
    return [hub.frame for hub in plan.hubs if hub.kind == plan.manner.normal.name]


def _margin(manner: Manner) -> int:
    """Return the frames of walking that are kept beyond a cut."""
    return manner.normal.cycle - _SHORT_OF_A_CYCLE


def _walk(name: str, manner: Manner) -> Plan:
    """Plan straight walking at three speeds and the changes between them."""
    normal, slow, brisk = manner.normal, manner.slow, manner.brisk
    builder = PlanBuilder(name, manner=manner).start(normal)
    for gait in (normal, normal, slow, slow, normal, brisk, brisk, normal):
        builder.cycle(gait)
    return builder.stop().finish()


def _slow(name: str, manner: Manner) -> Plan:
    """Plan a slow walk with short first and last steps."""
    slow = manner.slow
    return PlanBuilder(name, manner=manner).start(slow, 0.46).cycle(slow).cycle(slow).stop(0.46).finish()


def _long_start(name: str, manner: Manner) -> Plan:
    """Plan a start with the right foot and a long step to the stop."""
    return PlanBuilder(name, manner=manner).start_right(manner.normal).stop(0.68).finish()


def _walking_turn(name: str, degrees: float, manner: Manner) -> Clip:
    """Return one cycle of walking that turns, left if positive, with just the straight walking that its cuts need."""
    # Sharp turns take a shorter cycle [m], and more of the turn is made by the foot that opens outward.
    sharp = abs(degrees) > 30.0
    length = float(np.interp(abs(degrees), [45.0, 90.0], [1.15, 0.86])) if sharp else None
    # In a turn to the right the right foot opens, and takes more of the turn than in one to the left.
    outer = (0.42 if degrees > 0.0 else 0.58) if sharp else 0.5
    normal, margin = manner.normal, _margin(manner)
    builder = PlanBuilder("", manner=manner).start(normal).cycle(normal).cycle(normal, _rad(degrees), outer, length)
    plan = builder.cycle(normal).stop().finish()
    first, last = _passing_frames(plan)[1:3]
    return _excerpt(name, synthesize(plan), first - margin, last + margin)


def _walking_turns(angles: tuple[int, ...], manner: Manner) -> list[Clip]:
    """Return walking turns by each of ``angles`` [degrees] to both sides."""
    return [
        _walking_turn(f"walk_{way}_{angle}", sign * angle, manner)
        for angle in angles
        for way, sign in (("left", 1), ("right", -1))
    ]


def _short_step(name: str, length: float, manner: Manner) -> Plan:
    """Plan one step of ``length`` meters, the left foot closing; longer steps take longer."""
    return (
        PlanBuilder(name, manner=manner)
        .steps([(side, np.array([length, 0.0, 0.0])) for side in (RIGHT, LEFT)], 20.0 + 8.0 * length, 2.0)
        .finish()
    )


def _turn_in_place(name: str, degrees: float, manner: Manner) -> Plan:
    """Plan a turn on the spot, left if positive: pairs of steps, the right foot first, at most 45 degrees a pair.

    In a turn to the right that foot opens, and its heel needs space beside the other one.
    """
    pairs = int(np.ceil(abs(degrees) / 45.0))
    turn = _rad(degrees) / pairs
    room = 0.035 * max(0.0, -turn)
    body = np.zeros(3)
    places: list[tuple[int, Floats]] = []
    for _ in range(pairs):
        body = compose(body, np.array([0.0, -room, turn]))
        places += [(RIGHT, body), (LEFT, body)]
    return PlanBuilder(name, manner=manner).steps(places, 17.0 + 3.0 * abs(turn)).finish()


def _side_steps(name: str, manner: Manner) -> Plan:
    """Plan three full steps to the left."""
    builder = PlanBuilder(name, SIDE_STEPPING, manner)
    return (
        builder.side_step(LEFT, 0.44, 17.0)
        .pause()
        .side_step(LEFT, 0.44, 17.0)
        .pause()
        .side_step(LEFT, 0.44, 17.0)
        .stand()
        .finish()
    )


def _short_side_step(name: str, manner: Manner) -> Plan:
    """Plan one short step to the left."""
    return PlanBuilder(name, SIDE_STEPPING, manner).side_step(LEFT, 0.20, 14.0).stand().finish()


def _turning_side_steps(name: str, manner: Manner) -> Plan:
    """Plan steps to the left that turn the body by 5 and 10 degrees either way."""
    builder = PlanBuilder(name, SIDE_STEPPING, manner)
    for degrees in (5.0, -5.0, 10.0):
        builder.side_step(LEFT, 0.40, 17.0, _rad(degrees)).pause()
    return builder.side_step(LEFT, 0.40, 17.0, _rad(-10.0)).stand().finish()


def _walk_to_side(turn: float, manner: Manner) -> Plan:
    """Plan a walk to a stand a quarter turn off, to the left if ``turn`` is positive, else to the right.

    To the left it takes three steps, as the right foot cannot open.
    """
    builder = PlanBuilder("", manner=manner).start(manner.normal).cycle(manner.normal)
    if turn < 0.0:
        return builder.stop(0.44, _rad(-90.0)).finish()
    return builder.stop_turned_left(_rad(90.0)).finish()


def _turned_start(name: str, degrees: float, manner: Manner) -> Clip:
    """Return a start that turns, left if positive, with just the straight walking that its cut needs.

    The foot on the side of the turn goes first.
    """
    builder = PlanBuilder("", manner=manner)
    if degrees > 0.0:
        builder.start_turned_left(manner.normal, _rad(degrees))
    else:
        builder.start_turned_right(manner.normal, _rad(degrees))
    plan = builder.cycle(manner.normal).stop().finish()
    return _excerpt(name, synthesize(plan), 0, _passing_frames(plan)[0] + _margin(manner))


def _quarter_turns(manner: Manner) -> list[Clip]:
    """Return clips between walking and standing a quarter turn off, with just the walking that their cuts need."""
    clips, margin = [], _margin(manner)
    for way, turn in (("left", 1.0), ("right", -1.0)):
        plan = _walk_to_side(turn, manner)
        clip = synthesize(plan)
        clips.append(_excerpt(f"walk_to_side_{way}", clip, _passing_frames(plan)[-1] - margin, clip.frame_count - 1))
        clips.append(_turned_start(f"side_to_walk_{way}", 90.0 * turn, manner))
    return clips


def _arm_transitions(manner: Manner) -> list[Clip]:
    """Return clips that pull in or release the arms: over a walking cycle, over one step, and on the spot."""
    normal, margin = manner.normal, _margin(manner)
    plan = PlanBuilder("", manner=manner).start(normal).cycle(normal).cycle(normal).cycle(normal).stop().finish()
    first, last = _passing_frames(plan)[1:3]
    walking = _excerpt("", synthesize(plan), first - margin, last + margin)
    step = synthesize(_short_step("", 0.25, manner))
    spot = synthesize_idle("", _ARMS_FRAMES, manner)
    clips = []
    for name, rising in (("arms_in", True), ("arms_out", False)):
        for kind, clip, start, end in (
            # Arms move from ``start`` to ``end``, clear of the frames about a cut that are alike in all motions.
            ("walking", walking, margin + 4, margin + last - first - 4),
            ("step", step, 14, step.frame_count - 16),
            ("standing", spot, 0, spot.frame_count - 1),
        ):
            taken_in = ease((np.arange(clip.frame_count) - start) / (end - start))
            edited = edit_arms(clip, taken_in if rising else 1.0 - taken_in)
            clips.append(_excerpt(f"{name}_{kind}", edited, 0, clip.frame_count - 1))
    return clips


def _held(clip: Clip) -> Clip:
    """Return the clip with its arms held."""
    return edit_arms(clip, np.ones(clip.frame_count))


def synthesize_set(manner: Manner = PLAIN) -> list[tuple[str, str, Clip]]:
    """Return behavior folder, file name and clip of a whole motion set, always the same to the last bit."""
    # Motions of walking that there are with and without constrained arms, then those only without, then those sideways.
    plans = [_walk("walk", manner), _slow("walk_slow", manner)]
    plans += [_short_step("step_25", 0.25, manner), _short_step("step_50", 0.50, manner)]
    constrained = [*map(synthesize, plans), *_walking_turns((10, 20), manner)]
    constrained += [_turned_start("start_left_40", 40.0, manner), _turned_start("start_right_40", -40.0, manner)]
    plans = [_long_start("walk_long_start", manner), _short_step("step_75", 0.75, manner)]
    for degrees in (15, 30, 60, 90, 180):
        for way, sign in (("left", 1), ("right", -1)):
            plans.append(_turn_in_place(f"turn_{way}_{degrees}", sign * degrees, manner))
    if manner is DANCING:
        plans += dance_plans()
    frontal = [*constrained, *map(synthesize, plans), *_walking_turns((30, 45, 90), manner)]
    side = [
        _side_steps("side_left", manner),
        _short_side_step("side_left_short", manner),
        _turning_side_steps("side_left_turning", manner),
    ]
    side += [mirrored(plan, plan.name.replace("left", "right")) for plan in side]
    stand = synthesize_idle("stand", _IDLE_FRAMES, manner)
    clips = [("frontal", clip) for clip in [*frontal, stand]]
    clips += [("arm_constrained", clip) for clip in [*map(_held, [*constrained, stand]), *_arm_transitions(manner)]]
    clips += [("lateral", clip) for clip in [*map(synthesize, side), *_quarter_turns(manner), stand]]
    return [(folder, f"{clip.name}.bvh", clip) for folder, clip in clips]


def motion_database(manner: Manner) -> list[Clip]:
    """Return the unedited clips of a motion set, each name once: walks and turns, then side steps."""
    clips = [clip for folder, _, clip in synthesize_set(manner) if folder in _DATABASE]
    return list({clip.name: clip for clip in clips}.values())
