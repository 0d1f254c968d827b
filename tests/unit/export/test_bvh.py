"""BVH, read back by pybvh through the engine's own reader of captures."""

import numpy as np
import pytest

from crowdsim.errors import CrowdSimError
from crowdsim.export.formats import export
from crowdsim.motion.captures.bvh import parse_bvh
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.recording.reader import Recording
from tests.support.odd_recording import write_recording
from tests.support.small_recording import small_header, write_small_recording
from tests.support.walked_recordings import write_ring, write_steered


def joints_of(file):
    """Names, frames a second and places (F, J, 3) of the joints of a file, z up."""
    motion = parse_bvh(file)
    places, _ = forward_kinematics(motion, motion.root_positions, motion.rotations)
    return list(motion.names), motion.rate, places[..., [2, 0, 1]] / 100.0


@pytest.mark.parametrize("writer", [write_small_recording, write_steered])
def test_joints_are_where_the_recording_shows_them(tmp_path, writer):
    with Recording.open(writer(tmp_path / "run.h5")) as recording:
        folder = export(recording, tmp_path / "people", kind="bvh")
        files = sorted(folder.iterdir())
        assert [file.name for file in files] == [f"character-{n}.bvh" for n in range(recording.agent_count)]
        for agent, file in enumerate(files):
            names, rate, places = joints_of(file)
            first, last = recording.stay(agent)
            assert rate == pytest.approx(recording.steps_per_second, rel=1e-6)
            assert len(places) == last - first + 1
            order = [names.index(name) for name in recording.header.motion.skeleton.names]
            for frame in range(0, len(places), 5):
                shown, _ = recording.poses(first + frame, [agent])
                assert np.abs(places[frame, order] - shown[0]).max() <= 1e-4


def test_who_walks_around_a_periodic_floor_goes_on_beyond_its_ends(tmp_path):
    with Recording.open(write_ring(tmp_path / "ring.h5")) as ring:
        _, _, places = joints_of(export(ring, tmp_path / "one.bvh", agents="0"))
        shown = np.array([ring.poses(step, [0])[0][0, 0, 0] for step in range(ring.steps)])
    steps = np.diff(places[:, 0, 0])
    assert np.abs(steps).max() < 0.3
    turns = (places[:, 0, 0] - shown) / 8.0
    assert np.abs(turns - np.round(turns)).max() < 1e-5
    assert turns.max() >= 2.0


def test_a_file_holds_one_character_who_is_there(tmp_path):
    with Recording.open(write_recording(tmp_path / "run.h5", small_header(2), 5)) as recording:
        assert export(recording, tmp_path / "one.bvh", agents="0").is_file()
        for chosen in ("0,1", "1"):  # the second one comes later
            with pytest.raises(CrowdSimError, match="-o FOLDER --format bvh"):
                export(recording, tmp_path / "two.bvh", agents=chosen)
        assert [file.name for file in export(recording, tmp_path / "all", kind="bvh").iterdir()] == ["character-0.bvh"]
        with pytest.raises(CrowdSimError, match="cannot write the folder"):
            export(recording, tmp_path / "nowhere" / "all", kind="bvh")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["all", "one.bvh", "run.h5"]
