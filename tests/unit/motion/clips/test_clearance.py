"""Room that motions need."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clearance import clearance_profile, measure_clearances, measure_turning
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.clips.tracks import track_of
from tests.unit.motion.walker import walk

LEGS, TORSO = (0.0, 0.5), (0.8, 1.5)


def test_walking_torso_is_half_the_shoulders_and_legs_are_narrower() -> None:
    legs, torso = measure_clearances(walk(sway=0.0, yaw_sway=0.0), [LEGS, TORSO])
    assert torso == pytest.approx(0.2 + 0.06, abs=0.01)
    assert 0.12 < legs < 0.2


def test_side_stepping_counts_depth_and_both_ends_of_the_feet() -> None:
    clip = walk(steps=4, step_length=0.35, facing=np.pi / 2, sway=0.0, yaw_sway=0.0)
    feet, torso = measure_clearances(clip, [(0.0, 0.1), (0.8, 1.5)], facing=np.pi / 2)
    assert feet == pytest.approx((0.06 + 0.13 + 0.06) / 2 + 0.02, abs=0.015)
    assert torso < 0.22


def test_sway_needs_room() -> None:
    still, swaying = (measure_clearances(walk(sway=s), [TORSO])[0] for s in (0.0, 0.04))
    assert still + 0.015 < swaying < still + 0.05


def test_clearance_does_not_depend_on_where_the_clip_is() -> None:
    clip = walk(steps=4, turn=0.5)
    moved = Clip("moved", clip.skeleton, clip.root_positions + [10.0, -20.0, 0.0], clip.rotations)
    bands = [LEGS, TORSO]
    assert np.allclose(measure_clearances(clip, bands), measure_clearances(moved, bands), atol=1e-9)


def test_a_turn_on_the_spot_says_nothing_about_a_passage() -> None:
    clip = walk(steps=8, step_length=0.05, turn=2.0 * np.pi, stand=0)
    middle = Clip("turn", clip.skeleton, clip.root_positions[60:-60], clip.rotations[60:-60])
    assert measure_clearances(middle, [LEGS, TORSO]).tolist() == [0.0, 0.0]


def test_gentle_turns_count() -> None:
    gentle = measure_clearances(walk(steps=8, turn=0.8), [TORSO])[0]
    assert gentle == pytest.approx(measure_clearances(walk(steps=8), [TORSO])[0], abs=0.03)


def test_a_profile_is_as_wide_as_the_body_in_each_plane() -> None:
    clip = walk(steps=4, sway=0.0, yaw_sway=0.0)
    heights = np.array([0.3, 1.3, 1.4, 3.0])
    profile = clearance_profile(clip, heights)
    legs, _, shoulders, above = profile.max(axis=0)
    assert shoulders == pytest.approx(2 * (0.2 + 0.06), abs=0.02)
    assert 0.15 < legs < 0.4
    assert above == 0.0
    # No wider than twice the reach about the track, and no narrower than the reach beyond the far side of the track.
    reach = measure_clearances(clip, [(h, h) for h in heights])
    assert (profile.max(axis=0) <= 2.0 * reach + 1e-9).all()


def test_a_profile_does_not_ask_where_the_body_is() -> None:
    still, swaying = (clearance_profile(walk(steps=4, sway=s, yaw_sway=0.0), np.array([1.4])) for s in (0.0, 0.05))
    assert still.max() == pytest.approx(swaying.max(), abs=0.01)


def test_an_empty_band_has_no_clearance() -> None:
    assert measure_clearances(walk(steps=4), [(5.0, 6.0)])[0] == 0.0


def test_captured_straight_walks_need_what_the_facts_say(shared: Path) -> None:
    legs, torso = measure_clearances(read_clip(shared / "mocap" / "16_47_walk_straight_normal_a.bvh"), [LEGS, TORSO])
    assert 0.13 < legs < 0.22
    assert 0.30 < torso < 0.42


def test_a_turning_body_reaches_as_far_as_the_farthest_of_its_points() -> None:
    folder = Path(__file__).parents[4] / "behaviors" / "lateral" / "clips"
    bands = [(0.1, 0.6), (0.65, 1.9)]
    for name, back in (("walk_to_side_left", False), ("side_to_walk_left", True)):
        clip = read_clip(folder / f"{name}.bvh")
        track = track_of(clip)
        positions, _ = forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations)
        way = track[-1 if back else 0, 2]
        turned = [np.cos(np.radians(12.0)) > np.cos(track[:, 2] - end) for end in (track[0, 2], track[-1, 2])]
        frames = np.flatnonzero(turned[0] & turned[1])
        legs, torso = measure_turning(clip, bands, back)
        joints = 0.0  # the joints alone, which the flesh is about
        for frame in frames:
            for x, y, z in positions[frame]:
                if 0.65 <= z <= 1.9:
                    aside = -np.sin(way) * (x - track[frame, 0]) + np.cos(way) * (y - track[frame, 1])
                    joints = max(joints, abs(aside))
        assert joints < torso < joints + 0.15
        assert 0.15 < legs < torso
    assert torso > 0.35  # hands swing out on the turn back


def test_who_does_not_turn_has_no_turn() -> None:
    assert measure_turning(walk(steps=4), [LEGS, TORSO], back=False).tolist() == [0.0, 0.0]
