"""What a recording is asked wrongly: a closed one says that it is closed; numbers of agents and steps are checked."""

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.reader import Recording
from tests.support.small_recording import write_small_recording


@pytest.fixture
def closed(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5")) as recording:
        pass
    return recording


@pytest.mark.parametrize(
    "read",
    [
        lambda recording: recording.x[3],
        lambda recording: recording.x[3:9],
        lambda recording: recording.state[-1],
        lambda recording: recording.state_hash[:],
        lambda recording: recording.poses_at(1.0),
        lambda recording: recording.paths,
        lambda recording: recording.changes,
        lambda recording: recording.movables_at(1.0),
        lambda recording: recording.commands,
    ],
)
def test_what_is_not_in_memory_is_refused(closed, read):
    with pytest.raises(RecordingError, match=r"run\.h5 is closed; read it before close\(\)"):
        read(closed)


def test_header_and_summary_stay_and_it_may_be_closed_again(closed):
    closed.close()
    assert closed.steps == 90
    assert closed.header.agents.count == 3
    assert closed.summary is not None


@pytest.mark.parametrize("agents", [[3], [-1], [0.5], [True, False, False], ["a"], [[0, 1]], 1, [np.nan]])
def test_bodies_of_agents_that_are_none_are_refused(tmp_path, agents):
    with Recording.open(write_small_recording(tmp_path / "run.h5")) as recording:
        with pytest.raises(RecordingError, match=r"agents are given as a list of whole numbers from 0 to 2, not"):
            recording.poses_at(1.0, agents)
        assert recording.poses_at(1.0, [])[0].shape[0] == 0
        assert recording.poses_at(1.0, np.array([2, 0], np.uint8))[0].shape[0] == 2


def test_a_time_is_no_step(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5")) as recording:
        with pytest.raises(RecordingError, match=r"a step is a whole number, not 1\.5; poses_at takes a time"):
            recording.poses(1.5)
        np.testing.assert_array_equal(recording.poses(np.int64(3))[0], recording.poses(3)[0])
