"""Feature detectors: the frames at which a motion may be cut and joined to another.

2011 paper, section 3: walking is cut where one ankle passes the other leg's plane, stepping where both feet stand.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.products import dot
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats

Frames = NDArray[np.int64]


class FeatureDetector(Protocol):
    """Finds the frames of a clip that all show the same pose."""

    name: str
    standing: bool
    """Whether the body stands still at the cuts."""

    def cuts(self, clip: Clip) -> Frames:
        """Ascending frames of ``clip`` at which it may be cut."""
        ...


class CrossingDetector:
    """The right ankle passes forward through the plane of left hip, right hip and left ankle: once a walk cycle.

    The published rule takes every change of sign. Here a side counts from 1 cm off the plane on and once it has held
    for five frames, else people who stand are cut to pieces; frames in which the plane lies nearly flat (a raised leg)
    count for nothing.
    """

    name = "crossing"
    standing = False
    both_ways = False
    """Whether the ankle's way back through the plane, which the left ankle's way forward is, cuts as well."""
    dead_band = 0.01
    hold_frames = 5
    steepest = 0.8
    shortest = int(0.3 * CAPTURE_RATE)

    def cuts(self, clip: Clip) -> Frames:
        distance, valid = self._distances(clip)
        sides = self._sides(distance, valid)
        cuts: list[int] = []
        for change in np.flatnonzero(sides[1:] * sides[:-1] < 0) + 1:
            if sides[change] < 0 and not self.both_ways:
                continue
            cut = self._nearest_zero(distance * sides[change], int(change))
            if not cuts or cut - cuts[-1] >= self.shortest:
                cuts.append(cut)
        return np.array(cuts, np.int64)

    def _distances(self, clip: Clip) -> tuple[Floats, NDArray[np.bool_]]:
        """Signed distance (F,) of the right ankle from the plane, positive in front of it, and where that counts."""
        joints, skeleton = clip.joint_positions, clip.skeleton
        left_hip, right_hip = joints[:, skeleton.joint("left_hip")], joints[:, skeleton.joint("right_hip")]
        left_ankle, right_ankle = joints[:, skeleton.joint("left_ankle")], joints[:, skeleton.joint("right_ankle")]
        normal = np.cross(right_hip - left_hip, left_ankle - left_hip)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        distance = dot(right_ankle - left_hip, normal)
        return distance, np.abs(normal[:, 2]) <= self.steepest

    def _sides(self, distance: Floats, valid: NDArray[np.bool_]) -> NDArray[np.int8]:
        """-1 behind, +1 in front; the side before persists in the dead band and until the other side has held."""
        raw = np.where(valid & (np.abs(distance) > self.dead_band), np.sign(distance), 0).astype(np.int8)
        sides = np.zeros(len(raw), np.int8)
        side, frame = 0, 0
        while frame < len(raw):
            if raw[frame] != 0 and raw[frame] != side:
                held = raw[frame : frame + self.hold_frames]
                if len(held) == self.hold_frames and (held == raw[frame]).all():
                    side = int(raw[frame])
            sides[frame] = side
            frame += 1
        return sides

    @staticmethod
    def _nearest_zero(distance: Floats, change: int) -> int:
        """The frame nearest to the sign change itself, which lies before the dead band was left."""
        frame = change
        while frame > 0 and distance[frame - 1] > 0.0:
            frame -= 1
        return frame - 1 if frame > 0 and abs(distance[frame - 1]) < abs(distance[frame]) else frame


class HalfCrossingDetector(CrossingDetector):
    """Either ankle passes the other leg: twice a walk cycle, for captures too short to hold whole ones."""

    name = "half_crossing"
    both_ways = True


class StandingDetector:
    """Both ankles rest: the middle of each such stretch, or its end nearest the movement at the ends of the clip."""

    name = "standing"
    standing = True
    speed = 0.15
    hold_frames = 3

    def cuts(self, clip: Clip) -> Frames:
        still = np.ones(clip.frame_count, bool)
        for role in ("left_ankle", "right_ankle"):
            still &= joint_speeds(clip, clip.skeleton.joint(role)) < self.speed
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
        last_frame = clip.frame_count - 1
        cuts: list[int] = []
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            last = end - 1
            if end - first < self.hold_frames:
                continue
            if first == 0 and last == last_frame:
                return np.array([0, last_frame], np.int64)
            cuts.append(int(last if first == 0 else first if last == last_frame else (first + last) // 2))
        return np.array(cuts, np.int64)


def joint_speeds(clip: Clip, joint: int) -> Floats:
    """Speed (F,) of a joint in m/s, by central differences."""
    if clip.frame_count < 2:
        return np.zeros(clip.frame_count)
    speeds: Floats = np.linalg.norm(np.gradient(clip.joint_positions[:, joint], axis=0), axis=1) * CAPTURE_RATE
    return speeds


WALKING_DETECTORS = ("crossing", "standing")
"""Names of the detectors of the 2011 paper, which between them cut walking and stepping."""

DETECTORS: dict[str, FeatureDetector] = {
    d.name: d for d in (CrossingDetector(), HalfCrossingDetector(), StandingDetector())
}
"""All detectors by the name that behavior files use."""


def register_detector(detector: FeatureDetector) -> None:
    """Let behavior files use ``detector`` by its name; MotionError where another one has that name."""
    if DETECTORS.get(detector.name, detector) is not detector:
        raise MotionError(f"there is a feature detector '{detector.name}' already; give the new one another name")
    DETECTORS[detector.name] = detector


def find_detector(name: str) -> FeatureDetector:
    """The detector called ``name``; MotionError lists what there is."""
    try:
        return DETECTORS[name]
    except KeyError:
        raise MotionError(f"no feature detector is called '{name}'; there are {', '.join(sorted(DETECTORS))}") from None
