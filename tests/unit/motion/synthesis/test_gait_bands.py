"""The default set beside captured walks: every band of the reference facts, and joints within human limits."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import forward_kinematics as pose
from crowdsim.motion.clips.kinematics import rotate
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import CrossingDetector
from crowdsim.motion.synthesis.styles import BRISK, NORMAL, SLOW, Gait
from tests.support.gait_figures import LIMITS, angles, body_angles, gait_figures

BANDS = {
    "speed_m_s": (1.2, 1.3), "cadence_steps_min": (106.0, 109.0), "stride_m": (1.31, 1.46),
    "knee_swing_deg": (69.0, 78.0), "ankle_range_deg": (30.0, 46.0), "pelvis_yaw_deg": (7.0, 17.0),
    "pelvis_obliquity_deg": (7.0, 15.0), "vertical_cm": (3.8, 5.6), "lateral_cm": (3.5, 7.9),
    "step_width_cm": (5.0, 12.5),
}  # fmt: skip
"""Measured on captured straight walks (FACTS.md, section 1)."""

CLIPS = sorted(library_folder("behaviors").glob("*/clips/*.bvh"))


def band_of(figure: str) -> tuple[float, float]:
    return BANDS[figure.removeprefix("left_").removeprefix("right_")]


PACES = {
    "slow": ((0.9, 1.1), (0.67, 1.31)), "normal": ((1.2, 1.3), (1.31, 1.46)), "brisk": ((1.45, 1.7), (1.15, 1.66)),
}  # fmt: skip
"""Meters a second and meters a stride of captured walks (FACTS.md, section 1)."""


def steady_cycles(gait: Gait) -> dict[str, list[dict[str, float]]]:
    """Figures of the straight cycles at one pace, by the clip of the default set that they are in."""
    found: dict[str, list[dict[str, float]]] = {}
    for path in CLIPS:
        clip = read_clip(path)
        for a, b in pairwise(CrossingDetector().cuts(clip).tolist()):
            figures = gait_figures(clip, a, b)
            heading = track_of(clip)[[a, b], 2]
            if b - a == gait.cycle and abs(figures["stride_m"] - gait.stride) < 0.01 and np.ptp(heading) < 0.02:
                found.setdefault(f"{path.parent.parent.name}/{path.stem}", []).append(figures)
    return found


def test_normal_straight_walks_meet_every_band_in_every_clip() -> None:
    clips = steady_cycles(NORMAL)
    assert {"frontal/walk", "arm_constrained/walk"} <= clips.keys()
    assert {"arm_constrained/arms_in_walking", "arm_constrained/arms_out_walking"} <= clips.keys()
    assert len(clips["frontal/walk"]) >= 2
    for name, cycles in clips.items():
        for cycle in cycles:
            outside = {key: value for key, value in cycle.items() if not band_of(key)[0] <= value <= band_of(key)[1]}
            assert not outside, name


@pytest.mark.parametrize("gait", [SLOW, NORMAL, BRISK], ids=lambda gait: gait.name)
def test_every_pace_is_that_of_captured_walks(gait: Gait) -> None:
    (slowest, fastest), (shortest, longest) = PACES[gait.name]
    cycles = [cycle for clip in steady_cycles(gait).values() for cycle in clip]
    assert len(cycles) >= 2
    for cycle in cycles:
        assert slowest <= cycle["speed_m_s"] <= fastest
        assert shortest <= cycle["stride_m"] <= longest


def test_the_figures_of_captured_walks_are_near_the_bands(shared: Path) -> None:
    """The same measures on captures give what the bands were taken from, up to how angles are defined."""
    for trial in ("16_47_walk_straight_normal_a", "16_58_walk_straight_normal_b"):
        clip = read_clip(shared / "mocap" / f"{trial}.bvh")
        for a, b in pairwise(CrossingDetector().cuts(clip).tolist()):
            for name, value in gait_figures(clip, a, b).items():
                low, high = band_of(name)
                assert 0.85 * low <= value <= 1.15 * high, name


def hinge(clip: Clip, side: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Degrees (F,) that the hip flexes, the knee bends and the ankle lifts the foot, about the body's left axis."""
    positions, world = pose(clip.skeleton, clip.root_positions, clip.rotations)
    hip, knee, ankle, toe = (
        positions[:, clip.skeleton.joint(f"{side}_{part}")] for part in ("hip", "knee", "ankle", "toe")
    )
    pelvis = world[:, 0]
    up, ahead = (rotate(pelvis, np.array(axis)) for axis in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    thigh, shank, foot = knee - hip, ankle - knee, toe - ankle
    flexion = np.degrees(np.arctan2(np.sum(thigh * ahead, axis=1), -np.sum(thigh * up, axis=1)))
    flat = clip.skeleton.offsets[clip.skeleton.joint(f"{side}_toe")]
    neutral = angles(np.array([[0.0, 0.0, -1.0]]), flat[None])[0]
    return flexion, angles(thigh, shank), angles(shank, foot) - neutral


@pytest.mark.parametrize("path", CLIPS, ids=lambda path: f"{path.parent.parent.name}/{path.stem}")
def test_joints_stay_within_human_limits_and_legs_never_over_reach(path: Path) -> None:
    """Hip -25 to 120 degrees, knee 0 to 140, ankle 35 up (under weight) and 50 down, elbow 0 to 150: healthy adults."""
    clip = read_clip(path)
    for side in ("left", "right"):
        flexion, bend, lift = hinge(clip, side)
        assert -25.0 <= flexion.min() <= flexion.max() <= 120.0
        assert 5.0 <= bend.min() <= bend.max() <= 140.0  # a leg at 0 is at the end of its reach
        assert -50.0 <= lift.min() <= lift.max() <= 35.0
        arm = [
            clip.joint_positions[:, clip.skeleton.joint(f"{side}_{part}")] for part in ("shoulder", "elbow", "wrist")
        ]
        assert angles(arm[1] - arm[0], arm[2] - arm[1]).max() <= 150.0
    for name, degrees in body_angles(clip).items():
        assert LIMITS[name][0] <= degrees.min() <= degrees.max() <= LIMITS[name][1], name
