"""Who was on which level when, and when agents switch."""

import numpy as np
import pytest

from crowdsim.constants import NONE
from crowdsim.recording.header import AgentState
from crowdsim.recording.levels import Level, levels_of
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.switches import Switches
from tests.support.small_recording import write_small_recording
from tests.support.steered_recording import behavior_set
from tests.support.switched_recording import Walk, mixed_header, switched_frames, write_frames

WALKS = [Walk((1.0, 2.0, 0.3, 2.0, 1.0)), Walk((6.0,), seed=1), Walk((0.5, 5.5), seed=2)]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Three walkers; the second one is away for a while, within which the third one switches unseen."""
    frames = switched_frames(behavior_set(), WALKS)
    path = tmp_path_factory.mktemp("levels") / "levels.h5"
    for step in range(4, 7):
        state = np.array([AgentState.MOVING, AgentState.ABSENT, AgentState.ABSENT])
        frames[step] = frames[step]._replace(state=state)
    with Recording.open(write_frames(path, mixed_header(behavior_set(), 3), frames)) as opened:
        yield opened


def test_levels_follow_from_phase_and_node(recording):
    levels = recording.levels
    assert (levels.shape, levels.dtype, len(levels)) == ((recording.steps, 3), np.int8, recording.steps)
    first = [Level.CAPTURED] * 10 + [Level.STEERED] * 20 + [Level.CAPTURED] * 3 + [Level.STEERED] * 20
    assert levels[:53, 0].tolist() == first
    assert levels[3:8, 1].tolist() == [Level.CAPTURED, *[Level.NOBODY] * 3, Level.CAPTURED]
    assert levels[12].tolist() == [Level.STEERED, Level.CAPTURED, Level.STEERED]
    assert levels_of(np.array([1, 1, 0]), np.array([3, NONE, 2]), np.array([0.5, np.nan, 0.1])).tolist() == [1, -1, -1]


def test_switches_are_found_in_order_of_agents_and_time(recording):
    found = recording.switches
    assert found.agents.tolist() == [0, 0, 0, 0]
    assert found.steps.tolist() == [10, 30, 33, 53]
    assert found.steered.tolist() == [True, False, True, False]
    # Shown when both feet stand: earlier, as one if the time between is short, and later.
    assert found.shown.tolist() == [1, 30, 30, 57]
    assert found.at(np.array([0, 0, 1]), np.array([33, 34, 33])).tolist() == [2, NONE, NONE]
    assert [found.steer_in_playback(step).tolist() for step in (0, 1, 9, 10, 29, 30, 32, 33, 53, 56, 57)] == [
        [],
        [0],
        [0],
        [],
        [],
        [0],
        [0],
        [],
        [0],
        [0],
        [],
    ]


def test_the_last_switch_is_the_latest_that_is_shown():
    none = np.zeros(0, np.int64)
    agents, shown = np.array([2, 2, 7]), np.array([5, 5, 100])
    switches = Switches(agents, shown + 1, shown, np.array([True, False, True]))
    assert switches.last(np.array([0, 2, 7, 9]), 5).tolist() == [NONE, 1, NONE, NONE]
    assert switches.last(np.array([2, 7]), np.array([4, 10_000])).tolist() == [NONE, 2]
    assert Switches(none, none, none, none.astype(bool)).last(np.array([0, 3]), 8).tolist() == [NONE, NONE]


def test_recordings_of_one_level_have_no_switches(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "one.h5")) as recording:
        assert len(recording.switches.steps) == 0
        assert set(np.unique(recording.levels[:])) == {Level.NOBODY, Level.CAPTURED}
