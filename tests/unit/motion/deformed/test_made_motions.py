"""Movements that are made of a walk go where they say, begin and end as they say, and keep planted feet."""

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.planar import wrap_angle
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.made_motions import SPOT_TURNS, STEPS, WALKING_TURNS, MotionMaker


@pytest.fixture(scope="module")
def maker() -> MotionMaker:
    return MotionMaker(read_clip(library_folder("behaviors") / "frontal" / "clips" / "walk.bvh"))


def way(clip: Clip) -> np.ndarray:
    """Meters ahead and to the left, as the body faced at first, and radians turned, from first to last frame."""
    track = track_of(clip)
    (dx, dy), heading = track[-1, :2] - track[0, :2], track[0, 2]
    ahead, left = dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)
    return np.array([ahead, left, float(wrap_angle(track[-1, 2] - heading))])


def speed_at(clip: Clip, frame: int) -> float:
    """Meters a second over a tenth of a second about a frame."""
    places = track_of(clip)[:, :2]
    return float(np.hypot(*(places[frame + 3] - places[frame - 3]))) * CAPTURE_RATE / 6.0


@pytest.mark.parametrize("length", STEPS)
def test_a_step_leads_as_far_as_it_says(maker: MotionMaker, length: float) -> None:
    np.testing.assert_allclose(way(maker.step(length)), [length, 0.0, 0.0], atol=0.03)


@pytest.mark.parametrize("degrees", [sign * each for each in SPOT_TURNS for sign in (1.0, -1.0)])
def test_a_turn_on_the_spot_turns_and_stays(maker: MotionMaker, degrees: float) -> None:
    ahead, left, turned = way(maker.turn_on_the_spot(degrees))
    assert np.hypot(ahead, left) < 0.15
    assert abs(float(wrap_angle(turned - np.radians(degrees)))) < np.radians(4.0)


@pytest.mark.parametrize("degrees", [sign * each for each in WALKING_TURNS for sign in (1.0, -1.0)])
def test_a_walking_turn_goes_on_at_the_speed_of_the_walk(maker: MotionMaker, degrees: float) -> None:
    clip = maker.walking_turn(degrees)
    assert abs(way(clip)[2] - np.radians(degrees)) < np.radians(6.0)
    assert speed_at(clip, 10) == pytest.approx(maker.speed, rel=0.15)
    assert speed_at(clip, clip.frame_count - 10) == pytest.approx(maker.speed, rel=0.15)


@pytest.mark.parametrize("left", [True, False])
def test_side_steps_lead_to_their_side(maker: MotionMaker, left: bool) -> None:
    ahead, to_the_left, turned = way(maker.side_steps(left))
    assert to_the_left == pytest.approx(1.2 if left else -1.2, abs=0.05)
    assert abs(ahead) < 0.05
    assert abs(turned) < np.radians(4.0)


def test_halts_begin_and_end_standing_and_walk_between(maker: MotionMaker) -> None:
    clip = maker.halts()
    assert speed_at(clip, 5) < 0.05
    assert speed_at(clip, clip.frame_count - 5) < 0.05
    assert max(speed_at(clip, frame) for frame in range(10, clip.frame_count - 10)) > 0.9 * maker.speed


def test_feet_that_are_planted_do_not_slide(maker: MotionMaker) -> None:
    for clip in (maker.halts(), maker.step(0.5), maker.side_steps(True), maker.walking_turn(45.0)):
        ankles = clip.joint_positions[:, [clip.skeleton.joint("left_ankle"), clip.skeleton.joint("right_ankle")]]
        lowest = ankles[..., 2].min()
        speeds = np.hypot(*np.moveaxis(np.diff(ankles[..., :2], axis=0), -1, 0)) * CAPTURE_RATE
        low = (ankles[1:, :, 2] < lowest + 0.01) & (ankles[:-1, :, 2] < lowest + 0.01)
        assert np.median(speeds[low]) < 0.1, clip.name
