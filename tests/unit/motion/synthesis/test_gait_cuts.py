"""The default clips are cut where they were made to be: in passing and standing poses and nowhere else."""

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.features import joint_speeds
from crowdsim.motion.graph.segmentation import Segment, segment_clip
from tests.unit.motion.synthesis.test_gait_set import default_set


def made(name: str) -> Clip:
    """A clip of the default set, by folder/name."""
    folder, _, clip = name.partition("/")
    return default_set()[f"{folder}/clips/{clip}.bvh"]


def kinds(segments: list[Segment]) -> str:
    """One letter a cut: P passing, S standing."""
    cuts = [segments[0].starts_standing, *(segment.ends_standing for segment in segments)]
    return "".join("S" if standing else "P" for standing in cuts)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("frontal/walk", "SPPPPPPPPPS"),
        ("frontal/walk_slow", "SPPPS"),
        ("frontal/walk_long_start", "SPS"),
        ("frontal/walk_left_10", "PP"),
        ("frontal/walk_right_90", "PP"),
        ("frontal/step_25", "SS"),
        ("frontal/step_75", "SS"),
        ("frontal/turn_right_30", "SS"),
        ("arm_constrained/walk", "SPPPPPPPPPS"),
        ("arm_constrained/arms_in_walking", "PP"),
        ("arm_constrained/arms_out_step", "SS"),
        ("lateral/walk_to_side_left", "PS"),
        ("lateral/walk_to_side_right", "PS"),
        ("lateral/side_to_walk_left", "SP"),
        ("lateral/side_to_walk_right", "SP"),
    ],
)
def test_clips_are_cut_in_their_hubs(name: str, expected: str) -> None:
    assert kinds(segment_clip(made(name), ["crossing", "standing"])) == expected


@pytest.mark.parametrize(
    ("name", "steps", "length"),
    [("side_left", 3, 0.44), ("side_right", 3, -0.44), ("side_left_short", 1, 0.2), ("side_right_turning", 4, -0.4)],
)
def test_side_steps_are_cut_with_the_feet_together(name: str, steps: int, length: float) -> None:
    clip = made(f"lateral/{name}")
    segments = segment_clip(clip, ["standing"])
    assert kinds(segments) == "S" * (steps + 1)
    ankles = [clip.skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
    for segment in segments:
        way = clip.root_positions[segment.last] - clip.root_positions[segment.first]
        assert np.linalg.norm(way[:2]) == pytest.approx(abs(length), abs=0.01)
        for cut in (segment.first, segment.last):
            feet = clip.joint_positions[cut, ankles, :2]
            assert np.linalg.norm(feet[0] - feet[1]) < 0.14
    if steps > 1:
        segment = segments[1]
        assert 0.5 <= abs(length) * CAPTURE_RATE / (segment.last - segment.first) <= 0.6


def test_side_steps_pause_for_four_frames() -> None:
    clip = made("lateral/side_left")
    slow = np.ones(clip.frame_count, bool)
    for side in ("left", "right"):
        slow &= joint_speeds(clip, clip.skeleton.joint(f"{side}_ankle")) < 0.15
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(int)))
    assert all(end - first >= 4 for first, end in zip(edges[::2], edges[1::2], strict=True) if end - first > 2)
