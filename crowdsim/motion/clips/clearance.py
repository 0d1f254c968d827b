"""Clearance that a motion needs beside its track, by height band (2018 paper, section 3.1).

The paper measures diameters that enclose the body orthogonally to its motion; the engine keeps radii about the track.
A frame *goes on* if the body moves in it and hardly turns: only then has its way a side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, end_positions
from crowdsim.motion.clips.skeleton import Skeleton, below_hips
from crowdsim.motion.clips.tracks import track_of

_HEEL = 0.06
"""Distance from the ankle joint back to the end of the heel, which no joint marks [m]."""

_CURVE = 0.5
"""Curvature above which a body turns rather than goes on [rad/m]; such frames say nothing about a straight passage."""

_MOVING = 0.1
"""Speed below which a body stands [m/s]; such frames do not count either."""

_FACING = 0.2
"""Angle within which a body counts as facing a direction [rad]."""

_SPACING = 0.04
"""Distance between the sample points of a bone [m]."""

_FLESH = 0.06
"""Distance from a bone to the skin for joints without a role and without an ancestor that has one [m]."""

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
"""Distance from the joint in a role to the skin [m]; a bone tapers from joint to joint."""


def measure_clearances(clip: Clip, bands: Sequence[tuple[float, float]], facing: float = 0.0) -> Floats:
    """Return the largest reach of the body to either side of its track within each height band, (bands,) [m].

    Frames in a curve tighter than 2 m or almost at rest are left out: a sharp turn or a stand has no side. The
    clearance is 0 if no part of the body is in a band, or no frame goes on.

    Parameters
    ----------
    bands: (low, high) heights [m], both included.
    facing: angle from the direction of motion to the heading (`Behavior.facing`) [rad]: 0 for a body that walks ahead,
    pi/2 for one that side-steps, whose depth then counts.
    """
    found = _beside_track(clip, facing)
    if found is None:
        return np.zeros(len(bands))
    return _reaches(found.offset, found.height, found.flesh, bands)


def _reaches(offset: Floats, height: Floats, flesh: Floats, bands: Sequence[tuple[float, float]]) -> Floats:
    """Return the largest reach (bands,) of points to either side of the track within each band, 0 for none [m].

    offset, height: (F, P) distance to the left of the track, and above the floor. flesh: (P,) about each point [m].
    """
    reach = np.abs(offset) + flesh
    result = []
    for low, high in bands:
        inside = (height + flesh >= low) & (height - flesh <= high)
        result.append(float(np.max(np.where(inside, reach, 0.0), initial=0.0)))
    return np.array(result)


def frame_reaches(
    clip: Clip, bands: Sequence[tuple[float, float]], facing: float = 0.0
) -> tuple[NDArray[np.int64], Floats]:
    """Return the frames (n,) that go on, and the larger reach (n, bands) of the body to the sides of its track [m].

    As :func:`measure_clearances`, but the first of several bands, the lowest, measures only the legs: low hands, or
    those of a ducked body, belong to the next band.
    """
    found = _beside_track(clip, facing)
    if found is None:
        return np.zeros(0, np.int64), np.zeros((0, len(bands)))
    offset, height, flesh, owner = found.offset, found.height, found.flesh, found.owner
    reach = np.abs(offset) + flesh
    result = np.zeros((len(reach), len(bands)))
    legs = below_hips(clip.skeleton)[owner]
    for k, (low, high) in enumerate(bands):
        inside = (height + flesh >= low) & (height - flesh <= high)
        if k == 0 and len(bands) > 1:
            inside &= legs
        result[:, k] = np.max(np.where(inside, reach, 0.0), axis=1)
    return found.frames, result


def frame_spreads(clip: Clip) -> Floats:
    """Return the distance (F,) from the track to the farthest point of the body, seen from above [m]."""
    points, flesh, _ = _body_points(clip)
    away = points[..., :2] - track_of(clip)[:, None, :2]
    # To the skin: flesh is added to each point's distance.
    spreads: Floats = np.max(hypot(away[..., 0], away[..., 1]) + flesh, axis=1)
    return spreads


def measure_turning(clip: Clip, bands: Sequence[tuple[float, float]], back: bool) -> Floats:
    """Return the largest reach (bands,) of the body to either side while it turns off its way, or ``back`` onto it [m].

    The direction of the way is the heading in the first frame, or in the last one if the body turns back. Only frames
    count in which it faces neither nearly as in the first nor nearly as in the last frame: in the others it already has
    one of the two behaviors. 0 if no frame counts. Bands as in :func:`measure_clearances`.
    """
    track = track_of(clip)
    heading = np.unwrap(track[:, 2])
    way = float(heading[-1] if back else heading[0])
    turning = np.minimum(np.abs(heading - heading[0]), np.abs(heading - heading[-1])) > _FACING
    points, flesh, _ = _body_points(clip)
    x, y = np.moveaxis(points[turning, :, :2] - track[turning, None, :2], -1, 0)
    offset = y * cos(way) - x * sin(way)
    return _reaches(offset, points[turning, :, 2], flesh, bands)


def clearance_profile(clip: Clip, heights: Floats, facing: float = 0.0) -> Floats:
    """Return the least diameter that encloses the body across its motion, in planes at ``heights``, (n, heights) [m].

    One row for each of the n frames that go on, 0 if no part of the body is in the plane. facing: as of
    :func:`measure_clearances` [rad]. Unlike a clearance, a diameter does not depend on where the track is (2018 paper,
    section 3.1 and figure 2).
    """
    found = _beside_track(clip, facing)
    if found is None:
        return np.zeros((0, len(heights)))
    offset, height, flesh = found.offset, found.height, found.flesh
    profile = np.zeros((len(offset), len(heights)))
    for k, plane in enumerate(heights):
        # Half width of the plane's cut through the ball of flesh about a point.
        cut = np.sqrt(np.maximum(np.square(flesh) - np.square(height - plane), 0.0))
        inside = cut > 0.0
        left = np.max(np.where(inside, offset + cut, -np.inf), axis=1)
        right = np.min(np.where(inside, offset - cut, np.inf), axis=1)
        profile[:, k] = np.where(inside.any(axis=1), left - right, 0.0)
    return profile


class _Beside(NamedTuple):
    """Points of the body in the n frames that go on.

    frames: (n,) their numbers. offset, height: (n, P) distance to the left of the track, and above the floor [m].
    flesh, owner: (P,) flesh about each point [m], and the joint that it belongs to.
    """

    frames: NDArray[np.int64]
    offset: Floats
    height: Floats
    flesh: Floats
    owner: NDArray[np.int64]


def _beside_track(clip: Clip, facing: float) -> _Beside | None:
    """Return the body's points beside the track in the frames that go on; None if there are no such frames.

    facing: as of :func:`measure_clearances` [rad].
    """
    track = track_of(clip)
    # A single frame has no velocity.
    if len(track) < 2:
        return None
    velocity = np.gradient(track, axis=0) * CAPTURE_RATE
    speed = np.linalg.norm(velocity[:, :2], axis=1)
    goes_on = (np.abs(velocity[:, 2]) <= _CURVE * speed) & (speed >= _MOVING)
    if not goes_on.any():
        return None
    points, flesh, owner = _body_points(clip)
    # ``motion`` is the direction of motion [rad].
    points, motion, track = points[goes_on], track[goes_on, 2] - facing, track[goes_on]
    x, y = np.moveaxis(points[..., :2] - track[:, None, :2], -1, 0)
    offset = y * cos(motion)[:, None] - x * sin(motion)[:, None]
    return _Beside(np.flatnonzero(goes_on), offset, points[..., 2], flesh, owner)


def _body_points(clip: Clip) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Return points (F, P, 3) [m] along bones, end sites and heels; the flesh (P,) [m] about each; its joint (P,)."""
    skeleton = clip.skeleton
    positions, world = clip.posed
    around = joint_flesh(skeleton)
    points, flesh, owner = [positions], [around], [np.arange(skeleton.joint_count)]

    def add_bone(start: Floats, end: Floats, thick: float, thin: float, joint: int) -> None:
        """Add points along a bone of ``joint`` with ends (F, 3) [m], _SPACING apart or less, without its start.

        Flesh about them goes from ``thick`` to ``thin`` [m].
        """
        length = float(np.max(np.linalg.norm(end - start, axis=1)))
        count = int(np.ceil(length / _SPACING))
        # The ends of a bone of no length are joints, which are points already.
        if count < 1:
            return
        share = np.arange(1, count + 1) / count
        points.append(start[:, None] + share[None, :, None] * (end - start)[:, None])
        flesh.append(thick + share * (thin - thick))
        owner.append(np.full(count, joint))

    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            add_bone(positions[:, parent], positions[:, joint], around[parent], around[joint], joint)
    ends = end_positions(skeleton, positions, world)
    for k, parent in enumerate(skeleton.end_parents):
        # An end site lies on the skin, so the flesh about it is thin.
        add_bone(positions[:, parent], ends[:, k], around[parent], 0.02, int(parent))
    for side in ("left", "right"):
        if f"{side}_ankle" in skeleton.roles and f"{side}_toe" in skeleton.roles:
            # The heel: a point with 2 cm of flesh that ends _HEEL behind the ankle.
            ankle, toe = positions[:, skeleton.joint(f"{side}_ankle")], positions[:, skeleton.joint(f"{side}_toe")]
            along = toe - ankle
            along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
            points.append((ankle - (_HEEL - 0.02) * along)[:, None])
            flesh.append(np.array([0.02]))
            owner.append(np.array([skeleton.joint(f"{side}_ankle")]))
    return np.concatenate(points, axis=1), np.concatenate(flesh), np.concatenate(owner)


def joint_flesh(skeleton: Skeleton) -> Floats:
    """Return the distance (J,) from each joint to the skin, by its role [m].

    Joints without a role have that of their nearest ancestor with one; _FLESH if there is none.
    """
    flesh = np.full(skeleton.joint_count, _FLESH)
    by_joint = {joint: _FLESH_BY_ROLE[role] for role, joint in skeleton.roles.items()}
    for joint, parent in enumerate(skeleton.parents):
        flesh[joint] = by_joint.get(joint, flesh[parent] if parent >= 0 else _FLESH)
    return flesh
