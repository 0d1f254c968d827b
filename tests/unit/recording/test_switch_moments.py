"""Moments at which playback changes from one level to the other."""

import numpy as np
import pytest

from crowdsim.recording.header import AgentState
from crowdsim.recording.levels import Level, find_switches
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.steered_stretches import played_phases
from tests.support.steered_recording import behavior_set, write_frames
from tests.support.switched_recording import Walk, mixed_header, switched_frames, write_switched

WALKS = [Walk((2.0 + 0.1 * k, 2.0, 2.5, 2.2, 2.0), turn=0.1 * k, phase_off=0.03, seed=k) for k in range(8)]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("moments") / "moments.h5"
    with Recording.open(write_switched(path, behavior_set(), WALKS)) as opened:
        yield opened


def test_both_feet_stand_when_a_switch_is_shown(recording):
    found, recorded = recording.switches, find_switches(recording, recording.levels)
    assert len(found.steps) > 24
    assert (found.steps == recorded.steps).all()
    since = (found.shown - recorded.shown) / recording.steps_per_second
    assert ((since <= -0.4) & (since >= -1.0))[found.steered].all()
    assert ((since >= 0.0) & (since <= 0.6))[~found.steered].all()
    played = played_phases(recording, recording.levels[:], recording.node[:], recording.frame[:])

    def off(rows):
        return np.abs((played[rows, found.agents] - 0.05 + 0.25) % 0.5 - 0.25)

    # As near to the middle of double support as steps are apart; they were anywhere.
    assert off(found.shown).max() < 0.06
    assert off(recorded.shown).max() > 0.2


def test_bodies_are_shown_as_steered_between_the_moment_and_the_step(recording):
    found = recording.switches
    for agent, step, shown, steered in zip(found.agents, found.steps, found.shown, found.steered, strict=True):
        for row in range(min(step, shown), max(step, shown)):
            assert recording.levels[row][agent] == Level.CAPTURED
            assert agent in found.steer_in_playback(row)
            assert recording.shown_levels(row)[agent] == Level.STEERED
        assert recording.shown_levels(shown)[agent] == (Level.STEERED if steered else Level.CAPTURED)
        assert recording.shown_levels(shown - 1)[agent] == (Level.CAPTURED if steered else Level.STEERED)


def test_a_short_captured_time_is_shown_as_steered(tmp_path):
    walks = [Walk((2.0, 2.0, 0.4, 2.0, 0.3), seed=seed) for seed in range(3)]
    with Recording.open(write_switched(tmp_path / "short.h5", behavior_set(), walks)) as recording:
        found = recording.switches
        for agent in range(3):
            steps, shown = found.steps[found.agents == agent], found.shown[found.agents == agent]
            assert steps[2] - steps[1] < 18
            assert steps[1] <= shown[1] == shown[2] < steps[2]
            assert all(recording.shown_levels(row)[agent] == Level.STEERED for row in range(steps[0], steps[3]))
            # The bodies of both steered times stand on nearly the same places.
            old, new = (recording.poses_at(shown[1] / 10.0 + late, [agent])[0][0] for late in (-1e-5, 0.0))
            assert np.linalg.norm(new - old, axis=-1).max() < 1e-3


def test_switches_beside_a_short_steered_time_are_shown_when_they_are(tmp_path):
    walks = [Walk((2.0, 0.8, 2.0), seed=seed) for seed in range(3)]
    with Recording.open(write_switched(tmp_path / "brief.h5", behavior_set(), walks)) as recording:
        found = recording.switches
        assert len(found.steps) == 6
        assert (found.shown == found.steps - found.steered).all()


def test_nothing_is_shown_before_somebody_came_back(tmp_path):
    frames = switched_frames(behavior_set(), [Walk((2.0, 4.0), seed=1)])
    step = next(row for row, frame in enumerate(frames) if np.isfinite(frame.phase[0]))
    away = slice(step - 7, step - 5)
    frames[away] = [frame._replace(state=np.array([AgentState.ABSENT])) for frame in frames[away]]
    with Recording.open(write_frames(tmp_path / "gone.h5", mixed_header(behavior_set(), 1), frames)) as recording:
        assert recording.switches.steps.tolist() == [step]
        assert step - 5 <= recording.switches.shown[0] < step
        assert np.isfinite(recording.poses_at(recording.switches.shown[0] / 10.0)[0]).all()
