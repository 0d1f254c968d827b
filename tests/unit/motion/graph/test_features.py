"""Where motions are cut."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import DETECTORS, find_detector, joint_speeds, register_detector
from crowdsim.motion.graph.segmentation import Segment, require_locomotion, segment_clip
from tests.unit.motion.walker import STEP_FRAMES, walk


def window(clip: Clip, first: int, last: int) -> Clip:
    return Clip(clip.name, clip.skeleton, clip.root_positions[first : last + 1], clip.rotations[first : last + 1])


def test_crossings_are_one_cycle_apart_with_the_left_foot_planted() -> None:
    clip = walk(steps=12, stand=0)
    cuts = DETECTORS["crossing"].cuts(clip)
    middle = cuts[1:-1]
    assert np.abs(np.diff(middle) - 2 * STEP_FRAMES).max() <= 3
    left, right = (joint_speeds(clip, clip.skeleton.joint(f"{side}_ankle")) for side in ("left", "right"))
    assert (left[middle] < 0.05).all()
    assert (right[middle] > 1.0).all()
    passed = clip.joint_positions[:, clip.skeleton.joint("right_ankle"), 0]
    stood = clip.joint_positions[:, clip.skeleton.joint("left_ankle"), 0]
    assert (passed[middle - 8] < stood[middle - 8]).all()
    assert (passed[middle + 8] > stood[middle + 8]).all()


def test_crossing_does_not_depend_on_where_the_walk_goes() -> None:
    east = DETECTORS["crossing"].cuts(walk(steps=8))
    clip = walk(steps=8)
    turned = Clip("north", clip.skeleton, clip.root_positions[:, [1, 0, 2]] * [-1, 1, 1], clip.rotations.copy())
    half = np.sqrt(0.5)
    w, x, y, z = clip.rotations[:, 0].T
    turned.rotations[:, 0] = half * np.stack([w - z, x - y, y + x, z + w], axis=1)
    assert (DETECTORS["crossing"].cuts(turned) == east).all()


def test_standing_still_gives_no_crossing() -> None:
    clip = walk(steps=4, stand=60)
    rng = np.random.default_rng(0)
    noisy = Clip("noisy", clip.skeleton, clip.root_positions[:60], clip.rotations[:60].copy())
    noisy.rotations[:, clip.skeleton.joint("right_hip"), 2] += rng.normal(0, 0.002, 60)
    assert len(DETECTORS["crossing"].cuts(noisy)) == 0


def test_standing_cuts_trim_rests_at_the_ends_and_halve_those_between() -> None:
    there = walk(steps=4, stand=40)
    back = Clip("twice", there.skeleton,
                np.concatenate([there.root_positions, there.root_positions + there.root_positions[-1] * [1, 1, 0]]),
                np.concatenate([there.rotations, there.rotations]))  # fmt: skip
    cuts = DETECTORS["standing"].cuts(back)
    assert len(cuts) == 3
    assert 40 <= cuts[0] < 60
    assert abs(cuts[1] - there.frame_count) <= 2
    assert back.frame_count - 60 < cuts[2] <= back.frame_count - 40


def test_a_clip_that_only_stands_is_cut_at_its_ends() -> None:
    clip = window(walk(stand=50), 0, 40)
    assert DETECTORS["standing"].cuts(clip).tolist() == [0, 40]


def test_segments_chain_and_know_where_they_stand() -> None:
    segments = segment_clip(walk(steps=9), ("crossing", "standing"))
    assert all(a.last == b.first for a, b in pairwise(segments))
    assert [s.starts_standing for s in segments] == [True] + [False] * (len(segments) - 1)
    assert [s.ends_standing for s in segments] == [False] * (len(segments) - 1) + [True]


def test_partial_ends_are_dropped() -> None:
    clip = walk(steps=12, stand=0)
    cuts = DETECTORS["crossing"].cuts(clip)
    assert segment_clip(clip, ("crossing",)) == [Segment(int(a), int(b), False, False) for a, b in pairwise(cuts)]


@pytest.mark.parametrize(("moving", "kept"), [(77, False), (85, False), (103, False), (60, True), (120, True)])
def test_a_cut_in_movement_gives_way_to_a_near_one_that_stands(
    monkeypatch: pytest.MonkeyPatch, moving: int, kept: bool
) -> None:
    class Fixed:
        def __init__(self, name: str, frames: list[int], standing: bool) -> None:
            self.name, self.frames, self.standing = name, frames, standing

        def cuts(self, clip: Clip) -> np.ndarray:
            return np.array(self.frames, np.int64)

    monkeypatch.setitem(DETECTORS, "a", Fixed("a", [0, moving, 300], False))
    monkeypatch.setitem(DETECTORS, "b", Fixed("b", [90], True))
    inner = {s.last for s in segment_clip(walk(), ("a", "b"))} - {300}
    assert inner == ({90, moving} if kept else {90})


def test_unknown_detector_lists_the_known_ones() -> None:
    with pytest.raises(MotionError, match="crossing, standing"):
        find_detector("hopping")


def test_standing_is_no_locomotion_but_turning_on_the_spot_is() -> None:
    clip = window(walk(stand=50), 0, 40)
    with pytest.raises(MotionError, match="mark it idle"):
        require_locomotion(clip, track_of(clip))
    require_locomotion(clip, np.stack([np.zeros(41), np.zeros(41), np.linspace(0, 1, 41)], axis=1))


def test_walks_of_subject_16_have_the_cycles_of_the_manifest(shared: Path) -> None:
    entries = json.loads((shared / "mocap" / "manifest.json").read_text())
    walks = [e for e in entries if e["subject"] == 16 and e["category"] == "walk"]
    assert len(walks) >= 10
    missed = 0
    for entry in walks:
        clip = read_clip(shared / "mocap" / entry["file"])
        track = track_of(clip)
        segments = segment_clip(clip, ("crossing",))
        listed = entry["cycle_frames60_and_m"]
        assert len(segments) <= len(listed)
        missed += len(listed) - len(segments)
        for segment, (frames, meters) in zip(segments, listed[: len(segments)], strict=True):
            walked = np.linalg.norm(np.diff(track[segment.first : segment.last + 1, :2], axis=0), axis=1).sum()
            assert abs(segment.last - segment.first - frames) <= 3
            assert walked == pytest.approx(meters, rel=0.15)
        assert len(DETECTORS["standing"].cuts(clip)) <= 1
    assert missed <= 2


def test_half_cycles_are_cut_where_either_ankle_passes() -> None:
    clip = walk(steps=9)
    whole, half = (find_detector(name).cuts(clip) for name in ("crossing", "half_crossing"))
    assert set(whole.tolist()) <= set(half.tolist())
    assert len(half) >= 2 * len(whole) - 1
    between = np.diff(half)
    assert between.max() < 0.75 * np.diff(whole).max()


def test_a_detector_of_the_users_own(monkeypatch: pytest.MonkeyPatch) -> None:
    class Middle:
        name = "middle"
        standing = False

        def cuts(self, clip: Clip) -> np.ndarray:
            return np.array([10, clip.frame_count // 2, clip.frame_count - 10])

    monkeypatch.setattr("crowdsim.motion.graph.features.DETECTORS", dict(DETECTORS))
    own = Middle()
    register_detector(own)
    register_detector(own)
    assert len(segment_clip(walk(steps=9), ("middle",))) == 2
    with pytest.raises(MotionError, match="'middle' already"):
        register_detector(Middle())
