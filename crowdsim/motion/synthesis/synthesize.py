"""Turn plans of footsteps into clips that meet in the same poses at their hubs."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.synthesis.curves import ease, smoothed
from crowdsim.motion.synthesis.footstep_plan import LEFT, Hub, Plan, footprint
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.poses import STRAIGHTEST, ankle_targets, hip_positions, pose_clip
from crowdsim.motion.synthesis.styles import PLAIN, Gait, Manner
from crowdsim.motion.synthesis.trunk import FOOT_SCALARS, SCALARS, Controls, controls_of

Floats = NDArray[np.float64]

_HELD = 3
"""Frames on either side of a hub that are equal in all motions through it."""
_FADE = 10
"""Frames over which a motion changes from its own pose to that of the hub."""


def _lowered(controls: Controls) -> Controls:
    """Return the controls with the pelvis low enough, smoothly, for both legs to reach their feet."""
    scalars = controls.scalars.copy()
    column = SCALARS.index("height")
    # Smoothing may take away some of what is needed: repeat until both legs reach, four times at most.
    for _ in range(4):
        current = Controls(controls.placed, scalars)
        # excess (F,): by how much a hip is higher over its ankle than the straightest leg reaches [m]; it reaches 0.2 m
        # up at least, also to an ankle that is too far away on the floor.
        excess = np.zeros(len(scalars))
        for side in ("left", "right"):
            way = hip_positions(current, side) - ankle_targets(current, side)
            reach = np.sqrt(np.maximum(STRAIGHTEST * STRAIGHTEST - np.square(way[:, 0]) - np.square(way[:, 1]), 0.04))
            excess = np.maximum(excess, way[:, 2] - reach)
        if excess.max() <= 0.0:
            break
        # Spread each peak over five frames to either side, so that smoothing leaves it its height.
        widest = np.array([excess[max(0, i - 5) : i + 6].max() for i in range(len(excess))])
        scalars[:, column] -= smoothed(widest, 2.2)
    return Controls(controls.placed, scalars)


def _hub_frame(hub: Hub, manner: Manner) -> Floats:
    """Return the planar pose to which a hub's controls are relative: the left foot's, the body's when standing."""
    return hub.body if hub.kind == "stand" else footprint(LEFT, hub.body, manner.gait(hub.kind).half_width)


def _moved(frame: Floats, placed: Floats, inverse: bool) -> Floats:
    """Return rows of three planar poses (R, 9), brought from the frame of the pose ``frame`` to that of the plan.

    If ``inverse``, the other way around. frame: (3,) x, y [m] and heading [rad]. Headings stay unwrapped.
    """
    out = placed.copy()
    c, s = cos(frame[2]), sin(frame[2])
    for k in (0, 3, 6):
        x, y = placed[:, k], placed[:, k + 1]
        if inverse:
            x, y = x - frame[0], y - frame[1]
            out[:, k], out[:, k + 1] = c * x + s * y, -s * x + c * y
            out[:, k + 2] = placed[:, k + 2] - frame[2]
        else:
            out[:, k], out[:, k + 1] = frame[0] + c * x - s * y, frame[1] + s * x + c * y
            out[:, k + 2] = placed[:, k + 2] + frame[2]
    return out


@cache
def _standing(manner: Manner) -> tuple[Floats, Floats]:
    """Return the controls, placed (1, 9) and scalars (1, 23), of the standing pose at the origin."""
    controls = _lowered(controls_of(PlanBuilder("stand", manner=manner).finish()))
    return controls.placed[:1], controls.scalars[:1]


@cache
def _passing(gait: Gait, manner: Manner) -> tuple[Floats, Floats]:
    """Return the controls of a steady walk about its hub, relative to the left foot: placed (n, 9), scalars (n, 23).

    Their frames are _HELD and _FADE on either side of the hub: n = 2 (_HELD + _FADE) + 1.
    """
    # The third passing of five: far from start and stop.
    builder = PlanBuilder(gait.name, manner=manner).start(gait)
    for _ in range(4):
        builder.cycle(gait)
    plan = builder.stop().finish()
    hub = [h for h in plan.hubs if h.kind == gait.name][2]
    controls = _lowered(controls_of(plan))
    rows = slice(hub.frame - _HELD - _FADE, hub.frame + _HELD + _FADE + 1)
    return _moved(_hub_frame(hub, manner), controls.placed[rows], inverse=True), controls.scalars[rows]


def _blend(controls: Controls, plan: Plan) -> Controls:
    """Return the controls with pose and motion about each hub of ``plan`` replaced by the hub's own, faded in and out.

    At a stand, only the body is replaced, and in the rest at both ends of the plan it keeps the pose of the stand.
    """
    placed, scalars = controls.placed.copy(), controls.scalars.copy()
    stands = [h.frame for h in plan.hubs if h.kind == "stand"]
    for hub in plan.hubs:
        frame = _hub_frame(hub, plan.manner)
        if hub.kind == "stand":
            # A stand is one pose, a passing of the feet a short motion; frames on both sides to hold and to fade.
            held, fade = 1, round(plan.style.soft)
            hub_placed, hub_scalars = (np.repeat(a, 2 * (held + fade) + 1, 0) for a in _standing(plan.manner))
        else:
            held, fade = _HELD, _FADE
            hub_placed, hub_scalars = _passing(plan.manner.gait(hub.kind), plan.manner)
        rows = np.arange(hub.frame - held - fade, hub.frame + held + fade + 1)
        inside = (rows >= 0) & (rows < len(placed))
        rows = rows[inside]
        # Weight of the hub: 1 while it is held, then eased to 0. Add as many whole turns to its headings as the plan
        # has made.
        away = np.abs(rows - hub.frame)
        weight = 1.0 - ease((away - held) / fade)[:, None]
        turn = 2.0 * np.pi * np.round((placed[rows[len(rows) // 2], 2] - frame[2]) / (2.0 * np.pi))
        target = _moved(frame, hub_placed[inside], inverse=False)
        target[:, [2, 5, 8]] += turn
        # At a stand the feet stay where the plan put them: only the body changes (columns 0 to 2 of ``placed``, and the
        # scalars before those of the feet).
        columns = slice(0, 3) if hub.kind == "stand" else slice(0, 9)
        placed[rows, columns] += weight * (target[:, columns] - placed[rows, columns])
        last = FOOT_SCALARS.start if hub.kind == "stand" else scalars.shape[1]
        scalars[rows, :last] += weight * (hub_scalars[inside, :last] - scalars[rows, :last])
    # A plan begins with two stands, and ends with two. In the rest between them, the body keeps the pose of the inner
    # one.
    for still, source in ((slice(0, stands[1]), stands[1]), (slice(stands[-2], None), stands[-2])):
        placed[still, :3] = placed[source, :3]
        scalars[still, : FOOT_SCALARS.start] = scalars[source, : FOOT_SCALARS.start]
    return Controls(placed, scalars)


def synthesize(plan: Plan) -> Clip:
    """Return the clip of a plan: each step where it is planned, no leg overstretched, each hub in its common pose."""
    return pose_clip(plan.name, _lowered(_blend(_lowered(controls_of(plan)), plan)))


def synthesize_idle(name: str, frames: int, manner: Manner = PLAIN) -> Clip:
    """Return standing for ``frames`` frames: a breath and a little sway that begin and end in the standing pose."""
    placed, scalars = (np.repeat(a, frames, 0) for a in _standing(manner))
    u = np.linspace(0.0, 1.0, frames)
    envelope = np.square(sin(np.pi * u))
    breath, sway = envelope * sin(2.0 * np.pi * u), envelope * sin(2.0 * np.pi * u + 0.7)
    placed[:, 1] += 0.006 * sway
    placed[:, 0] += 0.003 * breath
    # Amplitudes in [rad], those of places (above) and of the height in [m].
    for column, amount in (
        ("trunk_pitch", -0.012 * breath),
        ("trunk_roll", -0.006 * sway),
        ("head_yaw", 0.05 * sway),
        ("left_arm", 0.02 * breath),
        ("right_arm", 0.02 * breath),
        ("pelvis_roll", 0.006 * sway),
        ("height", -0.002 * envelope),
    ):
        scalars[:, SCALARS.index(column)] += amount
    return pose_clip(name, _lowered(Controls(placed, scalars)))
