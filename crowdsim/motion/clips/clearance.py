"""How much room a motion needs beside its track, by height band (2018 paper, section 3.1).

The paper measures diameters that enclose the body orthogonally to its motion; the engine keeps radii about the track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, end_positions, forward_kinematics
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.clips.tracks import track_of

_HEEL = 0.06
"""Meters from the ankle joint back to the end of the heel, which no joint marks."""

_CURVE = 0.5
"""Radians a meter above which a body turns rather than goes on (a curve of 2 m radius); such frames say nothing about
a passage."""

_MOVING = 0.1
"""Meters a second below which it stands: neither do those."""

_FACING = 0.2
"""Radians within which a body counts as facing some way."""

_SPACING = 0.04
"""Meters between the points that stand for a bone."""

_FLESH = 0.06
"""Meters from a bone to the skin, where no role says better."""

_FLESH_BY_ROLE: Mapping[str, float] = {
    "hips": 0.12,
    "chest": 0.12,
    "neck": 0.06,
    "head": 0.09,
    **{
        f"{side}_{part}": flesh
        for side in ("left", "right")
        for part, flesh in (
            ("shoulder", 0.06),
            ("elbow", 0.05),
            ("wrist", 0.045),
            ("hip", 0.08),
            ("knee", 0.06),
            ("ankle", 0.045),
            ("toe", 0.045),
        )
    },
}
"""Meters of flesh about the joint that plays the role; a bone tapers from joint to joint."""


def measure_clearances(clip: Clip, bands: Sequence[tuple[float, float]], facing: float = 0.0) -> Floats:
    """(bands,) meters, largest reach of the body to either side of its track within each height band.

    ``bands`` holds (low, high) heights. ``facing`` is the angle from the direction of motion to the heading
    (`Behavior.facing`): 0 for a body that walks ahead, pi/2 for one that side-steps, whose depth then counts. Frames
    in a curve tighter than 2 m or hardly moving are left out: there is no side to a sharp turn or to a stand. Where
    nothing of the body is in a band, or no frame goes on, the clearance is 0.
    """
    found = _beside_track(clip, facing)
    if found is None:
        return np.zeros(len(bands))
    return _reaches(*found, bands)


def _reaches(offset: Floats, height: Floats, flesh: Floats, bands: Sequence[tuple[float, float]]) -> Floats:
    """(bands,) the most that points to the side (F, P), at heights (F, P), reach with the flesh (P,) about them."""
    reach = np.abs(offset) + flesh
    result = []
    for low, high in bands:
        inside = (height + flesh >= low) & (height - flesh <= high)
        result.append(float(np.max(np.where(inside, reach, 0.0), initial=0.0)))
    return np.array(result)


def measure_turning(clip: Clip, bands: Sequence[tuple[float, float]], back: bool) -> Floats:
    """(bands,) meters, largest reach of the body to either side of its way while it turns off it, or ``back`` onto it.

    The way leads where the body faces in the first frame, or in the last where it turns back; frames in which it faces
    nearly as in either do not count. Bands as in :func:`measure_clearances`.
    """
    track = track_of(clip)
    heading = np.unwrap(track[:, 2])
    way = float(heading[-1] if back else heading[0])
    turning = np.minimum(np.abs(heading - heading[0]), np.abs(heading - heading[-1])) > _FACING
    points, flesh = _body_points(clip)
    x, y = np.moveaxis(points[turning, :, :2] - track[turning, None, :2], -1, 0)
    offset = y * cos(way) - x * sin(way)
    return _reaches(offset, points[turning, :, 2], flesh, bands)


def clearance_profile(clip: Clip, heights: Floats, facing: float = 0.0) -> Floats:
    """(F, heights) meters, smallest diameter that encloses the body across its motion, in planes at ``heights``.

    One row for each frame that goes on (see :func:`measure_clearances`), 0 where nothing of the body is in the plane.
    Unlike a clearance, which is measured about the track, a diameter does not ask where the body is (2018 paper,
    section 3.1 and figure 2).
    """
    found = _beside_track(clip, facing)
    if found is None:
        return np.zeros((0, len(heights)))
    offset, height, flesh = found
    profile = np.zeros((len(offset), len(heights)))
    for k, plane in enumerate(heights):
        # What a plane cuts from the ball of flesh about a point.
        cut = np.sqrt(np.maximum(np.square(flesh) - np.square(height - plane), 0.0))
        inside = cut > 0.0
        left = np.max(np.where(inside, offset + cut, -np.inf), axis=1)
        right = np.min(np.where(inside, offset - cut, np.inf), axis=1)
        profile[:, k] = np.where(inside.any(axis=1), left - right, 0.0)
    return profile


def _beside_track(clip: Clip, facing: float) -> tuple[Floats, Floats, Floats] | None:
    """Points of the body to the left of the track (F, P), their heights (F, P) and the flesh (P,) about them.

    Of the frames that go on; None if none does.
    """
    track = track_of(clip)
    if len(track) < 2:
        return None
    velocity = np.gradient(track, axis=0) * CAPTURE_RATE
    speed = np.linalg.norm(velocity[:, :2], axis=1)
    goes_on = (np.abs(velocity[:, 2]) <= _CURVE * speed) & (speed >= _MOVING)
    if not goes_on.any():
        return None
    points, flesh = _body_points(clip)
    points, motion, track = points[goes_on], track[goes_on, 2] - facing, track[goes_on]
    x, y = np.moveaxis(points[..., :2] - track[:, None, :2], -1, 0)
    return y * cos(motion)[:, None] - x * sin(motion)[:, None], points[..., 2], flesh


def _body_points(clip: Clip) -> tuple[Floats, Floats]:
    """Points (F, P, 3) along the bones out to the end sites and heels, and the flesh (P,) about each."""
    skeleton = clip.skeleton
    positions, world = forward_kinematics(skeleton, clip.root_positions, clip.rotations)
    around = joint_flesh(skeleton)
    points, flesh = [positions], [around]
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            _add_bone(points, flesh, positions[:, parent], positions[:, joint], around[parent], around[joint])
    ends = end_positions(skeleton, positions, world)
    for k, parent in enumerate(skeleton.end_parents):
        # An end site lies on the skin: the flesh about it must not reach beyond.
        _add_bone(points, flesh, positions[:, parent], ends[:, k], around[parent], 0.02)
    for side in ("left", "right"):
        if f"{side}_ankle" in skeleton.roles and f"{side}_toe" in skeleton.roles:
            ankle, toe = positions[:, skeleton.joint(f"{side}_ankle")], positions[:, skeleton.joint(f"{side}_toe")]
            along = toe - ankle
            along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
            points.append((ankle - (_HEEL - 0.02) * along)[:, None])
            flesh.append(np.array([0.02]))
    return np.concatenate(points, axis=1), np.concatenate(flesh)


def joint_flesh(skeleton: Skeleton) -> Floats:
    """(J,) meters: by role, and joints without one as their nearest ancestor with one."""
    flesh = np.full(skeleton.joint_count, _FLESH)
    by_joint = {joint: _FLESH_BY_ROLE[role] for role, joint in skeleton.roles.items()}
    for joint, parent in enumerate(skeleton.parents):
        flesh[joint] = by_joint.get(joint, flesh[parent] if parent >= 0 else _FLESH)
    return flesh


def _add_bone(
    points: list[Floats], flesh: list[NDArray[np.float64]], start: Floats, end: Floats, thick: float, thin: float
) -> None:
    length = float(np.max(np.linalg.norm(end - start, axis=1)))
    count = int(np.ceil(length / _SPACING))
    if count < 1:
        return
    share = np.arange(1, count + 1) / count
    points.append(start[:, None] + share[None, :, None] * (end - start)[:, None])
    flesh.append(thick + share * (thin - thick))
