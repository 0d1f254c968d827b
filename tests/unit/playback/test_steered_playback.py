"""Steered crowds are drawn as captured ones are: only who is present, where its body is."""

import numpy as np
import pytest
from PIL import Image

from crowdsim.errors import CrowdSimError
from crowdsim.playback.bodies.sculptor import build_body
from crowdsim.playback.camera import place_camera
from crowdsim.playback.crowd_mesh import CrowdMesh
from crowdsim.playback.film import film
from crowdsim.playback.moments import telling_time
from crowdsim.playback.shot import shot
from crowdsim.recording.reader import Recording
from tests.support.steered_recording import FRONTAL, HELD, steered_header, steered_motion, track_frames, write_frames
from tests.unit.motion.deformed.tracks import moving

COUNT = 8


@pytest.fixture(scope="module")
def steered(tmp_path_factory):
    """Eight who walk side by side; each comes a second later than the one before, and stays for four."""
    track = moving(1.2, seconds=14.0)
    tracks = np.stack([track + [-4.0, k - 3.5, 0.0, 0.0] for k in range(COUNT)], axis=1)
    steps, agents = np.arange(len(track))[:, None], np.arange(COUNT)
    present = (steps >= 10 * agents) & (steps < 10 * agents + 40)
    behaviors = np.where((agents == 3) & (steps > 50), HELD, FRONTAL)
    path = tmp_path_factory.mktemp("steered") / "run.h5"
    with Recording.open(write_frames(path, steered_header(COUNT), track_frames(tracks, behaviors, present))) as opened:
        yield opened


def test_bodies_are_as_many_as_are_present_at_once(steered):
    assert steered.most_present == 4
    crowd = CrowdMesh(steered, "behavior")
    assert len(crowd.points) == len(crowd.shadow_points) == 4
    crowd.update(1.5)
    assert (np.ptp(crowd.points, axis=1).max(axis=1) > 1.0).tolist() == [True, True, False, False]
    crowd.update(6.5)
    assert (np.ptp(crowd.points, axis=1).max(axis=1) > 1.0).all()
    crowd.update(13.0)
    assert not crowd.points.any()


def test_a_body_keeps_its_looks_wherever_it_is_in_the_mesh(steered):
    crowd = CrowdMesh(steered, "agent")
    crowd.update(3.5)
    third = crowd.colors[3].copy()
    crowd.update(5.5)
    assert (steered.at_time(5.5).state != 0).tolist() == [False, False, True, True, True, True, False, False]
    np.testing.assert_array_equal(crowd.colors[1], third)


def test_shadows_lie_under_bodies(steered):
    crowd = CrowdMesh(steered, "behavior")
    crowd.update(4.25)
    body = crowd.points[:, :, :2].mean(axis=1)
    assert np.linalg.norm(crowd.shadow_points[:, 0, :2] - body, axis=1).max() < 0.25
    assert crowd.shadow_points[:, :, 2].max() < 0.02


def test_the_eye_follows_bodies_without_jerks(steered):
    times = np.arange(2.2, 5.8, 1.0 / 60.0)
    eyes = np.array([place_camera(steered, "follow", 1.5, time, 2).eye for time in times])
    roots = np.array([steered.poses_at(time, [2])[0][0, 0] for time in times])
    target = np.array([place_camera(steered, "follow", 1.5, time, 2).target for time in times])
    assert np.abs(target[:, :2] - roots[:, :2]).max() < 0.15
    # Acceleration that would be seen as trembling: steps of 0.1 s made it 400 m/s2.
    assert np.linalg.norm(np.diff(eyes, 2, axis=0), axis=1).max() * 3600.0 < 15.0


def test_who_is_away_is_waited_for(steered):
    late = place_camera(steered, "follow", 1.0, 12.0, 0).target
    np.testing.assert_allclose(late[:2], [steered.x[39, 0], steered.y[39, 0]], atol=1e-6)
    with pytest.raises(CrowdSimError, match="no agent 8"):
        place_camera(steered, "follow", 1.0, 12.0, COUNT)


def test_the_telling_time_shows_behaviors_and_people(steered):
    frame = steered.at_time(telling_time(steered))
    assert set(frame.behavior[frame.steered].tolist()) == {FRONTAL, HELD}
    assert frame.steered.sum() == 4


def test_bodies_of_thousands_are_coarse():
    skeleton = steered_motion().skeleton
    fine, coarse = build_body(skeleton, 6), build_body(skeleton, 5)
    assert coarse.vertex_count < 0.65 * fine.vertex_count
    assert set(coarse.tissue.tolist()) == set(fine.tissue.tolist())


@pytest.mark.usefixtures("can_draw")
def test_a_picture_and_a_film_of_steered_agents(steered, tmp_path):
    pixels = np.asarray(Image.open(shot(steered, tmp_path / "out.png", time=6.5, size=(320, 180)))).astype(int)
    assert (pixels[..., 2] > pixels[..., 0] + 40).sum() > 30
    film(steered, tmp_path / "out.mp4", fps=5, size=(64, 36), start=0.0, end=13.0)
    assert (tmp_path / "out.mp4").stat().st_size > 1000
