"""Quality figures of bodies posed from a deformed clip: foot drift, knee bend, reach, smoothness of the pelvis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowdsim.motion.clips.kinematics import conjugate, end_positions, forward_kinematics, multiply, rotate
from crowdsim.motion.deformed.body_kernels import HEEL_BACK, PHASE
from crowdsim.motion.deformed.deformed_clip import DeformedClip
from crowdsim.motion.deformed.plan_kernels import PAD
from crowdsim.motion.deformed.step_plan import StepPlan, plan_steps, pose_at

FRAMES = 60
"""Frames per second at which bodies are measured."""
_SOLE_DOWN, _STANCE = 0.125, 0.599


@dataclass(frozen=True)
class Figures:
    """Figures over a whole track.

    Attributes
    ----------
    drift : float
        Largest movement of the heel while it carries the body, or of the ball while it does [m].
    knee : (float, float)
        Least and largest bend [degrees].
    reach : float
        Largest distance from hip to ankle, as a share of the leg's length.
    acceleration : float
        99 % quantile of the root's acceleration [m/s2].
    apart : float
        Least distance between the feet seen from above [m].
    floor : float
        Height of the lowest point of the feet [m].
    """

    drift: float
    knee: tuple[float, float]
    reach: float
    acceleration: float
    apart: float
    floor: float


def figures_of(clip: DeformedClip, track: np.ndarray) -> Figures:
    """Return the figures of a body on a track (N, 4)."""
    plan = plan_steps(clip, [track])
    times = np.arange(0.0, (len(track) - 1) * plan.step, 1.0 / FRAMES)
    roots, rotations = pose_at(clip, plan, np.zeros(len(times), np.int64), times)
    places, world = forward_kinematics(clip.skeleton, roots, rotations)
    model = clip.model
    phase = phases_at(plan, times)
    knees, reach, drift, floor = [], 0.0, 0.0, np.inf
    ends = end_positions(clip.skeleton, places, world)
    for foot in (0, 1):
        hip, knee, ankle, toe = model.legs[foot]
        thigh, shank = places[:, knee] - places[:, hip], places[:, ankle] - places[:, knee]
        cosine = np.sum(thigh * shank, axis=1) / (model.bones[foot, 0] * model.bones[foot, 1])
        knees.append(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        reach = max(reach, float((np.linalg.norm(thigh + shank, axis=1) / model.bones[foot, :2].sum()).max()))
        own = phase - 0.5 * foot
        share = own - np.floor(own)
        stands = (share >= _SOLE_DOWN) & (share < _STANCE)
        for cycle in np.unique(np.floor(own[stands])):
            ball = places[stands & (np.floor(own) == cycle), toe]
            drift = max(drift, float(np.linalg.norm(ball - ball[0], axis=1).max()))
        # The heel carries the body while the toes are still up.
        level = multiply(world[:, ankle], conjugate(model.turns[foot, 3]))
        heel = places[:, ankle] + rotate(level, np.array([-HEEL_BACK, 0.0, -model.bones[foot, 3]]))
        lands = (share < _SOLE_DOWN) & (rotate(level, np.array([1.0, 0.0, 0.0]))[:, 2] > 0.01)
        for cycle in np.unique(np.floor(own[lands])):
            back = heel[lands & (np.floor(own) == cycle)]
            drift = max(drift, float(np.linalg.norm(back - back[0], axis=1).max()))
        floor = min(floor, float(places[:, toe, 2].min()) - model.bones[foot, 4])
    assert np.isfinite(ends).all()
    feet = [places[:, model.legs[foot, 2:], :2] for foot in (0, 1)]
    acceleration = np.linalg.norm(np.diff(roots, 2, axis=0), axis=1) * FRAMES * FRAMES
    return Figures(
        drift=drift,
        knee=(float(np.min(knees)), float(np.max(knees))),
        reach=reach,
        acceleration=float(np.quantile(acceleration, 0.99)) if len(acceleration) else 0.0,
        apart=float(between(*feet).min()),
        floor=floor,
    )


def phases_at(plan: StepPlan, times: np.ndarray) -> np.ndarray:
    """Return the phases of the first track at times, by the weights of its spline."""
    place = times / plan.step + PAD
    row = place.astype(int)
    u = place - row
    weights = np.array([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]) / 6.0
    return sum(weights[k] * plan.samples[row + k - 1, PHASE] for k in range(4))


def between(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return distances (F,) between two feet (F, 2, 2), each from ankle to ball, seen from above [m]."""
    share = np.linspace(-HEEL_BACK / 0.125, 1.0, 9)[None, :, None]
    first = left[:, :1] + share * (left[:, 1:] - left[:, :1])
    second = right[:, :1] + share * (right[:, 1:] - right[:, :1])
    return np.linalg.norm(first[:, :, None] - second[:, None], axis=-1).min(axis=(1, 2))
