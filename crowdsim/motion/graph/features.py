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
    """Detector of the frames of a clip that all show the same pose."""

    name: str
    standing: bool
    """True if the body stands still at the cuts."""

    def cuts(self, clip: Clip) -> Frames:
        """Return the frames of ``clip`` at which it may be cut, ascending."""
        ...


class CrossingDetector:
    """Cut where the right ankle passes forward through the plane of both hips and the left ankle: once a walk cycle.

    The published rule takes every change of sign. Here a side counts only 1 cm or more off the plane and after it has
    held for five frames, otherwise standing is cut to pieces. Frames in which the plane is nearly horizontal (a raised
    leg) do not count. With ``both_ways``, the ankle's way back through the plane cuts as well.
    """

    name = "crossing"
    standing = False
    both_ways = False
    """True if the ankle's way back through the plane (the left ankle's way forward) cuts as well."""
    dead_band = 0.01
    """Distance from the plane up to which the ankle is on neither side [m]."""
    hold_frames = 5
    """Number of frames in a row for which a side must hold to count."""
    steepest = 0.8
    """Largest vertical part of the plane's unit normal in frames that count; 1 would be a horizontal plane."""
    shortest = int(0.3 * CAPTURE_RATE)
    """Least distance between two cuts [frames]; a cut sooner after the one before is left out."""

    def cuts(self, clip: Clip) -> Frames:
        """Return the frames of ``clip`` in which the ankle passes, ascending."""
        distance, valid = self._distances(clip)
        sides = self._sides(distance, valid)
        cuts: list[int] = []
        for change in np.flatnonzero(sides[1:] * sides[:-1] < 0) + 1:
            if sides[change] < 0 and not self.both_ways:
                continue
            # Times the new side, the distance rises from below 0 to above 0, whichever way the ankle passes.
            cut = self._nearest_zero(distance * sides[change], int(change))
            if not cuts or cut - cuts[-1] >= self.shortest:
                cuts.append(cut)
        return np.array(cuts, np.int64)

    def _distances(self, clip: Clip) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the right ankle's signed distance (F,) from the plane [m], positive in front, and which frames count.

        The latter is a mask (F,), False in frames in which the plane is nearly horizontal.
        """
        joints, skeleton = clip.joint_positions, clip.skeleton
        left_hip, right_hip = joints[:, skeleton.joint("left_hip")], joints[:, skeleton.joint("right_hip")]
        left_ankle, right_ankle = joints[:, skeleton.joint("left_ankle")], joints[:, skeleton.joint("right_ankle")]
        normal = np.cross(right_hip - left_hip, left_ankle - left_hip)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        distance = dot(right_ankle - left_hip, normal)
        return distance, np.abs(normal[:, 2]) <= self.steepest

    def _sides(self, distance: Floats, valid: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Return the ankle's side (F,), from the results of ``_distances``: -1 behind, 1 in front, 0 before one holds.

        A side begins in the first of ``hold_frames`` frames in which it holds, and lasts until the other one begins.
        """
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
        """Return the frame in which ``distance`` (F,) [m] is nearest to 0, at its last change of sign up to ``change``.

        In frame ``change``, in which the new side has left the dead band, the distance is positive.
        """
        # Back to the first frame behind the change; the frame before it may be nearer to 0.
        frame = change
        while frame > 0 and distance[frame - 1] > 0.0:
            frame -= 1
        return frame - 1 if frame > 0 and abs(distance[frame - 1]) < abs(distance[frame]) else frame


class HalfCrossingDetector(CrossingDetector):
    """Cut where either ankle passes the other leg: twice a walk cycle, for captures without whole cycles."""

    name = "half_crossing"
    both_ways = True


class StandingDetector:
    """Cut where both ankles rest: in the middle of each stretch, or nearest the movement at a clip's ends.

    A clip that rests throughout is cut at both ends.
    """

    name = "standing"
    standing = True
    speed = 0.15
    """Speed below which an ankle rests [m/s]."""
    hold_frames = 3
    """Least length of a stretch at rest that is cut [frames]."""

    def cuts(self, clip: Clip) -> Frames:
        """Return the frames (k,) int64 of ``clip`` in which it may be cut standing, ascending."""
        still = np.ones(clip.frame_count, bool)
        for role in ("left_ankle", "right_ankle"):
            still &= joint_speeds(clip, clip.skeleton.joint(role)) < self.speed
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
        last_frame = clip.frame_count - 1
        cuts: list[int] = []
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            last = end - 1
            # Too short to be a rest.
            if end - first < self.hold_frames:
                continue
            # The whole clip stands: keep it as one segment.
            if first == 0 and last == last_frame:
                return np.array([0, last_frame], np.int64)
            # At an end of the clip, cut next to the movement; between two movements, in the middle.
            cuts.append(int(last if first == 0 else first if last == last_frame else (first + last) // 2))
        return np.array(cuts, np.int64)


def joint_speeds(clip: Clip, joint: int) -> Floats:
    """Return the speed (F,) of a joint by central differences [m/s]."""
    if clip.frame_count < 2:
        return np.zeros(clip.frame_count)
    speeds: Floats = np.linalg.norm(np.gradient(clip.joint_positions[:, joint], axis=0), axis=1) * CAPTURE_RATE
    return speeds


WALKING_DETECTORS = ("crossing", "standing")
"""Names of the detectors of the 2011 paper; together they cut walking and stepping."""

DETECTORS: dict[str, FeatureDetector] = {
    d.name: d for d in (CrossingDetector(), HalfCrossingDetector(), StandingDetector())
}
"""All detectors by the name that behavior files use."""


def register_detector(detector: FeatureDetector) -> None:
    """Let behavior files use ``detector`` by its name; raise MotionError if another one has that name."""
    if DETECTORS.get(detector.name, detector) is not detector:
        raise MotionError(f"there is a feature detector '{detector.name}' already; give the new one another name")
    DETECTORS[detector.name] = detector


def find_detector(name: str) -> FeatureDetector:
    """Return the detector called ``name``; raise MotionError with the list of names if there is none."""
    try:
        return DETECTORS[name]
    except KeyError:
        raise MotionError(f"no feature detector is called '{name}'; there are {', '.join(sorted(DETECTORS))}") from None
