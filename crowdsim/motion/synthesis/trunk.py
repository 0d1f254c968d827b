"""The body above the feet of a plan: pelvis, trunk, head and arms, as smooth curves driven by the footsteps.

Widths of the smoothing [frames] and factors without a name are choices that make the clips look natural.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.synthesis.curves import ease, smoothed
from crowdsim.motion.synthesis.feet import FootCurves, foot_curves
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, STANDING_HALF_WIDTH, Plan, footprint

Floats = NDArray[np.float64]

STANDING_HEIGHT = 1.010
"""Height of the root joint of a standing body [m]."""
_DROP, _DROP_APART = 0.008, 0.133
"""How far the pelvis sinks in walking [m], and per square of the distance between the feet [1/m]."""
_LEAN, _SHIFT = 5.0, 9.0
"""Frames before a foot lifts from rest at which the body sets out, and at which its weight begins to shift."""
_LONG_SUPPORT = 12.0
"""Frames on both feet beyond which the body waits between them."""
_OVER_FOOT = 0.055
"""Distance ahead of the ankle at which a foot carries the body [m]."""

SCALARS = tuple(
    (
        "height pelvis_yaw pelvis_roll pelvis_pitch trunk_yaw trunk_roll trunk_pitch head_yaw "
        "left_arm left_elbow right_arm right_elbow "
        "left_out right_out arm_twist head_pitch head_roll "
        "left_ankle_height left_pitch left_toe right_ankle_height right_pitch right_toe"
    ).split()
)
"""Columns of :attr:`Controls.scalars`; the last six belong to the feet."""
FOOT_SCALARS = slice(17, 23)
"""The columns of the feet."""


@dataclass(frozen=True)
class Controls:
    """All numbers that determine a pose; they may be averaged.

    placed: (F, 9) planar poses (x, y [m], heading without jumps [rad]) of pelvis, left foot and right foot.
    scalars: (F, 23) heights [m] and angles [rad], see :data:`SCALARS`.
    """

    placed: Floats
    scalars: Floats


def _between(old: Floats, new: Floats, facing: float, share: float) -> Floats:
    """Return the place halfway between two body poses, with the heading ``share`` of the way from old to new.

    facing: the heading before [rad], from which the new one does not jump by a whole turn.
    """
    first = facing + wrap_angle(old[2] - facing)
    return np.array([*(0.5 * (old[:2] + new[:2])), first + share * wrap_angle(new[2] - old[2])])


def _course(plan: Plan) -> tuple[Floats, Floats]:
    """Return the body's place and heading (F, 3), and the place over which its weight is (F, 2), both with corners.

    Both are given at some frames, the knots ``course`` and ``load``, and interpolated.
    """
    course: list[tuple[float, Floats]] = [(-1.0, plan.start)]
    load: list[tuple[float, Floats]] = [(-1.0, plan.start[:2])]
    bodies = [plan.start, plan.start]
    half_widths = [STANDING_HALF_WIDTH, STANDING_HALF_WIDTH]
    middle = plan.start
    lifts = [step.lift for step in plan.steps] + [float(plan.frame_count)]
    for step, next_lift in zip(plan.steps, lifts[1:], strict=True):
        previous, carrying = load[-1]
        # If the body has been on both feet for over half of _LONG_SUPPORT, from rest or (in most gaits) between two
        # steps, it sets out, and its weight shifts, some frames before the foot lifts.
        if step.lift - previous > 0.5 * _LONG_SUPPORT:
            course.append((max(step.lift - _LEAN, previous), middle))
            load.append((max(step.lift - _SHIFT, previous), carrying))
        # The standing foot carries the body while the other one is in the air.
        stance = footprint(1 - step.side, bodies[1 - step.side], half_widths[1 - step.side])
        under = compose(stance, np.array([_OVER_FOOT, 0.0, 0.0]))[:2]
        load.extend([(step.lift, under), (step.land, under)])
        bodies[step.side], half_widths[step.side] = step.body, step.half_width
        # Between both feet, facing half way between them if the step closes, more towards the new one if it goes on.
        closes = hypot(*(step.body - bodies[1 - step.side])[:2]) < 1e-9
        middle = _between(bodies[1 - step.side], step.body, middle[2], 0.5 if closes else 0.7)
        # Wait on both feet, with the weight between them soon after landing, or pass through the middle.
        if next_lift - step.land > _LONG_SUPPORT:
            course.extend([(step.land + 1.0, middle), (next_lift - _LEAN, middle)])
            load.append((step.land + 5.0, middle[:2]))
        else:
            course.append((0.5 * (step.land + next_lift), middle))
    frames = np.arange(plan.frame_count)

    def through(knots: list[tuple[float, Floats]]) -> Floats:
        """Interpolate (frame, values) linearly, for every frame.

        Frames of knots may go back: in fast walks the body sets out for the next step before the frame in which it is
        in the middle of the last two. From that frame on, the line of the later knot holds. So the body gains a few
        centimeters between two steps, as people do.
        """
        times = np.array([t for t, _ in knots])
        values = np.array([v for _, v in knots])
        line = np.searchsorted(np.maximum.accumulate(times), frames, side="right") - 1
        begin, end = line, np.minimum(line + 1, len(knots) - 1)
        span = np.where(end > begin, times[end] - times[begin], 1.0)
        slopes = (values[end] - values[begin]) / span[:, None]
        return np.asarray(slopes * (frames - times[begin])[:, None] + values[begin])

    return through(course), through(load)


def _supports(plan: Plan) -> tuple[Floats, Floats]:
    """Return the foot (F,) that carries the body (1 left, -1 right, 0 both), and the feet's distance (F,) [m]."""
    frames = np.arange(plan.frame_count, dtype=np.float64)
    side = np.zeros(plan.frame_count)
    bodies = [plan.start, plan.start]
    lifts = [step.lift for step in plan.steps] + [float(plan.frame_count)]
    knots: list[tuple[float, float]] = [(-1.0, 0.0)]
    for step, next_lift in zip(plan.steps, lifts[1:], strict=True):
        # A foot carries from two frames before the other one lifts until two frames after it lands.
        side[(frames >= step.lift - 2.0) & (frames <= step.land + 2.0)] = 1.0 if step.side == RIGHT else -1.0
        # Feet pass each other in the middle of a swing, and are farthest apart soon after the landing.
        knots.append((0.5 * (step.lift + step.land), 0.0))
        bodies[step.side] = step.body
        spread = float(hypot(*(bodies[0] - bodies[1])[:2]))
        knots.append((min(0.5 * (step.land + next_lift), step.land + 5.0), spread))
    apart = np.interp(frames, [t for t, _ in knots], [v for _, v in knots])
    return side, apart


def controls_of(plan: Plan) -> Controls:
    """Return the controls of a plan as its steps give them: at hubs, they are not yet those that motions share."""
    manner = plan.manner
    # Where the body goes, which foot carries it, and how far apart the feet are, for each frame; all smoothed over some
    # frames, so that the pelvis follows without jerks.
    course, load = _course(plan)
    side, apart = _supports(plan)
    feet = foot_curves(plan, LEFT), foot_curves(plan, RIGHT)
    body = smoothed(course, 6.0)
    heading = smoothed(course[:, 2], 5.0)
    # The pelvis sways across its heading, toward the foot that carries.
    sway = smoothed(load - course[:, :2], 5.5)
    c, s = cos(heading), sin(heading)
    across = manner.sway * plan.style.sway * (-s * sway[:, 0] + c * sway[:, 1])
    pelvis = np.stack([body[:, 0] - s * across, body[:, 1] + c * across, heading], axis=-1)

    def ahead(foot: FootCurves) -> Floats:
        """Return how far a foot is ahead of the body (F,) [m]."""
        way: Floats = c * (foot.ankle[:, 0] - body[:, 0]) + s * (foot.ankle[:, 1] - body[:, 1])
        return way

    # How far the right foot is ahead of the left one drives the turns of pelvis and trunk and the swing of the arms.
    spread = smoothed(ahead(feet[RIGHT]) - ahead(feet[LEFT]), 2.5)
    swing = smoothed(spread, 3.0)
    support = smoothed(side, 4.0)
    speed = np.gradient(smoothed(course[:, :2], 9.0), axis=0) * CAPTURE_RATE
    forward = np.clip(c * speed[:, 0] + s * speed[:, 1], 0.0, 2.0)
    # The head looks where the body heads 14 frames later.
    look = smoothed(np.concatenate([course[14:, 2], np.repeat(course[-1:, 2], 14)]), 9.0)
    # 0 for a body that stands, 1 from 0.8 m/s on.
    walking = ease(forward / 0.8)
    # The hips sink with speed, and once more in each double support, when the feet are far apart.
    height = (
        STANDING_HEIGHT
        - manner.crouch
        - _DROP * walking
        - manner.bounce * smoothed(_DROP_APART * np.square(apart), 4.0)
    )
    # Angles [rad] beyond those of a manner: arms hang a little farther back, and elbows are bent more, in walking.
    columns = {
        "height": height,
        "pelvis_yaw": manner.pelvis_yaw * spread,
        "pelvis_roll": manner.pelvis_roll * support,
        "pelvis_pitch": np.full_like(height, np.radians(4.0)),
        "trunk_yaw": -manner.trunk_yaw * swing,
        "trunk_roll": -manner.trunk_roll * support,
        "trunk_pitch": manner.lean * forward,
        "head_yaw": 0.6 * (look - heading),
        "left_arm": -0.05 * walking + manner.arm_swing * swing,
        "left_elbow": manner.elbow + 0.16 * walking + manner.elbow_swing * swing,
        "right_arm": -0.05 * walking - manner.arm_swing * swing,
        "right_elbow": manner.elbow + 0.16 * walking - manner.elbow_swing * swing,
        "left_out": manner.arm_out + manner.wave * support,
        "right_out": manner.arm_out - manner.wave * support,
        "arm_twist": np.full_like(height, manner.arm_twist),
        "head_pitch": np.full_like(height, manner.head_pitch),
        "head_roll": manner.head_roll * support,
    }
    for side_name, foot in zip(("left", "right"), feet, strict=True):
        columns[f"{side_name}_ankle_height"] = foot.ankle[:, 2]
        columns[f"{side_name}_pitch"], columns[f"{side_name}_toe"] = foot.pitch, foot.toe
    scalars = np.stack([columns[name] for name in SCALARS], axis=-1)
    placed = np.concatenate([pelvis, *(np.column_stack([f.ankle[:, :2], f.yaw]) for f in feet)], axis=-1)
    return Controls(placed, scalars)
