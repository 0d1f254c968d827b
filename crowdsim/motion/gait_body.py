"""The body above the feet of a plan: pelvis, trunk, head and arms, as smooth curves driven by the footfall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.gait_curves import ease, smoothed
from crowdsim.motion.gait_feet import FootCurves, foot_curves
from crowdsim.motion.gait_plan import LEFT, RIGHT, Plan, footprint

Floats = NDArray[np.float64]

_DROP, _DROP_APART = 0.008, 0.133
STANDING_HEIGHT = 1.010
"""Meters from the floor to the root joint of a standing body."""

PLACED = ("pelvis", "left_foot", "right_foot")
"""Columns 0:3, 3:6, 6:9 of :attr:`Controls.placed`."""
SCALARS = (
    "height", "pelvis_yaw", "pelvis_roll", "pelvis_pitch", "trunk_yaw", "trunk_roll", "trunk_pitch", "head_yaw",
    "left_arm", "left_elbow", "right_arm", "right_elbow",
    "left_ankle_height", "left_pitch", "left_toe", "right_ankle_height", "right_pitch", "right_toe",
)  # fmt: skip
"""Columns of :attr:`Controls.scalars`; the last six belong to the feet."""
FOOT_SCALARS = slice(12, 18)


@dataclass(frozen=True)
class Controls:
    """Everything that fixes a pose, in numbers that may be averaged.

    placed: (F, 9) planar poses (x, y, heading, unwrapped) of pelvis, left foot, right foot.
    scalars: (F, 18) see :data:`SCALARS`.
    """

    placed: Floats
    scalars: Floats


def _mean_pose(old: Floats, new: Floats, share: float) -> Floats:
    """Between two body poses; heading goes further toward the new one than the place does."""
    turn = np.angle(np.exp(1j * (new[2] - old[2])))
    return np.array([*(0.5 * (old[:2] + new[:2])), old[2] + share * turn])


def _course(plan: Plan) -> tuple[Floats, Floats]:
    """(F, 3) where the body goes and faces, and (F, 2) the place that carries it, both still with corners."""
    course: list[tuple[float, Floats]] = [(-1.0, plan.start)]
    load: list[tuple[float, Floats]] = [(-1.0, plan.start[:2])]
    bodies = [plan.start.copy(), plan.start.copy()]
    middle = plan.start.copy()
    lifts = [step.lift for step in plan.steps] + [float(plan.frame_count)]
    for step, next_lift in zip(plan.steps, lifts[1:], strict=True):
        previous = load[-1][0]
        if step.lift - previous > 6.0:
            course.append((max(step.lift - 5.0, previous), middle))
            load.append((max(step.lift - 9.0, previous), load[-1][1]))
        stance = footprint(1 - step.side, bodies[1 - step.side], 0.075 if len(load) == 1 else step.half_width)[:2]
        stance = stance + 0.055 * np.array([np.cos(bodies[1 - step.side][2]), np.sin(bodies[1 - step.side][2])])
        load.extend([(step.lift, stance), (step.land, stance)])
        bodies[step.side] = np.array([*step.body[:2], middle[2] + np.angle(np.exp(1j * (step.body[2] - middle[2])))])
        other = bodies[1 - step.side]
        share = 0.5 if np.hypot(*(step.body - other)[:2]) < 1e-9 else 0.7
        middle = _mean_pose(other, bodies[step.side], share)
        if next_lift - step.land > 12.0:
            course.extend([(step.land + 1.0, middle), (next_lift - 5.0, middle)])
            load.append((step.land + 5.0, middle[:2]))
        else:
            course.append((0.5 * (step.land + next_lift), middle))
    frames = np.arange(plan.frame_count)

    def through(knots: list[tuple[float, Floats]]) -> Floats:
        times = np.array([t for t, _ in knots])
        values = np.array([v for _, v in knots])
        return np.stack([np.interp(frames, times, column) for column in values.T], axis=-1)

    return through(course), through(load)


def _supports(plan: Plan) -> tuple[Floats, Floats]:
    """(F,) which foot carries the body (1 left, -1 right, 0 both) and (F,) how far apart the feet are in step."""
    frames = np.arange(plan.frame_count, dtype=np.float64)
    side, apart = np.zeros(plan.frame_count), np.zeros(plan.frame_count)
    bodies = [plan.start, plan.start]
    lifts = [step.lift for step in plan.steps] + [float(plan.frame_count)]
    knots: list[tuple[float, float]] = [(-1.0, 0.0)]
    for step, next_lift in zip(plan.steps, lifts[1:], strict=True):
        side[(frames >= step.lift - 2.0) & (frames <= step.land + 2.0)] = 1.0 if step.side == RIGHT else -1.0
        knots.append((0.5 * (step.lift + step.land), 0.0))
        bodies[step.side] = step.body
        spread = float(np.hypot(*(bodies[0] - bodies[1])[:2]))
        knots.append((min(0.5 * (step.land + next_lift), step.land + 5.0), spread))
    knots.append((knots[-1][0] + 8.0, knots[-1][1]))
    apart = np.interp(frames, [t for t, _ in knots], [v for _, v in knots])
    return side, apart


def controls_of(plan: Plan) -> Controls:
    """The controls of a plan before its hubs are made to agree."""
    course, load = _course(plan)
    side, apart = _supports(plan)
    feet = foot_curves(plan, LEFT), foot_curves(plan, RIGHT)
    body = smoothed(course, 6.0)
    heading = smoothed(course[:, 2], 5.0)
    sway = smoothed(load - course[:, :2], 5.5)
    c, s = np.cos(heading), np.sin(heading)
    across = plan.style.sway * (-s * sway[:, 0] + c * sway[:, 1])
    pelvis = np.stack([body[:, 0] - s * across, body[:, 1] + c * across, heading], axis=-1)

    def ahead(foot: FootCurves) -> Floats:
        return c * (foot.ankle[:, 0] - body[:, 0]) + s * (foot.ankle[:, 1] - body[:, 1])

    spread = smoothed(ahead(feet[RIGHT]) - ahead(feet[LEFT]), 2.5)
    swing = smoothed(spread, 3.0)
    support = smoothed(side, 4.0)
    speed = np.gradient(smoothed(course[:, :2], 9.0), axis=0) * 60.0
    forward = np.clip(c * speed[:, 0] + s * speed[:, 1], 0.0, 2.0)
    look = smoothed(np.concatenate([course[14:, 2], np.repeat(course[-1:, 2], 14)]), 9.0)
    walking = ease(forward / 0.8)
    height = STANDING_HEIGHT - _DROP * walking - smoothed(_DROP_APART * apart**2, 4.0)
    scalars = np.stack(
        [
            height,
            0.125 * spread,
            0.075 * support,
            np.radians(4.0) + 0.0 * forward,
            -0.14 * swing,
            -0.02 * support,
            0.022 * forward,
            0.6 * (look - heading),
            -0.05 * walking + 0.50 * swing,
            0.22 + 0.16 * walking + 0.22 * swing,
            -0.05 * walking - 0.50 * swing,
            0.22 + 0.16 * walking - 0.22 * swing,
            *(column for f in feet for column in (f.ankle[:, 2], f.pitch, f.toe)),
        ],
        axis=-1,
    )
    placed = np.concatenate([pelvis, *(np.column_stack([f.ankle[:, :2], f.yaw]) for f in feet)], axis=-1)
    return Controls(placed, scalars)
