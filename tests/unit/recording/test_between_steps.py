"""What is shown between two recorded steps is what the engine went through."""

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import CYCLE, small_header, write_small_recording


@pytest.mark.parametrize("steps_per_second", [10, 15, 20, 30])
def test_a_coarse_recording_shows_the_frames_of_a_fine_one(tmp_path, steps_per_second):
    fine_path = write_small_recording(tmp_path / "fine.h5", steps=181, steps_per_second=60)
    every = 60 // steps_per_second
    coarse_path = write_small_recording(
        tmp_path / "coarse.h5", steps=181 // every + 1, steps_per_second=steps_per_second
    )
    with Recording.open(fine_path) as fine, Recording.open(coarse_path) as coarse:
        for step in range(0, 181):
            expected, found = fine.at_step(step), coarse.at_time(step / 60)
            was_there = coarse.at_step(step // every).state != AgentState.ABSENT
            np.testing.assert_array_equal(found.node[was_there], expected.node[was_there])
            np.testing.assert_allclose(found.x[was_there], expected.x[was_there], atol=1e-5)
            shown, wanted = found.frame[was_there], expected.frame[was_there]
            # The last frame of a cycle and the first of the next are the same moment.
            assert np.all((np.abs(shown - wanted) < 1e-9) | ((shown == CYCLE) & (wanted == 0)))


def test_heading_turns_the_short_way(tmp_path):
    header = small_header(agents=1)
    frame = RecordedFrame([0.0], [0.0], [3.1], [3], [-1], [0], [2], [AgentState.MOVING], [np.nan])
    with RecordingWriter(tmp_path / "run.h5", header) as writer:
        writer.append(frame, 0)
        writer.append(frame._replace(heading=[-3.1], frame=[3]), 0)
        writer.finish({})
    with Recording.open(tmp_path / "run.h5") as recording:
        assert abs(recording.at_time(0.025).heading[0]) == pytest.approx(np.pi, abs=1e-3)
        assert recording.at_time(0.05).heading[0] == pytest.approx(-3.1)


def test_agents_do_not_slide_in_from_where_they_were_absent(tmp_path):
    header = small_header(agents=2)
    there = RecordedFrame([0.0, 5.0], [0.0, 5.0], [0.0, 0.0], [3, 3], [-1, -1], [0, 0], [2, 2], [0, 1], [np.nan] * 2)
    with RecordingWriter(tmp_path / "run.h5", header) as writer:
        writer.append(there, 0)
        writer.append(there._replace(x=[9.0, 0.0], state=[1, 0], frame=[0, 0]), 0)
        writer.finish({})
    with Recording.open(tmp_path / "run.h5") as recording:
        half = recording.at_time(0.025)
        assert half.state.tolist() == [0, 1]
        np.testing.assert_array_equal(half.x, [np.nan, 5.0])


def test_times_outside_are_refused(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "run.h5", steps=21)) as recording:
        assert recording.at_time(1.0).x[0] == recording.at_step(20).x[0]
        for time in (-0.1, 1.1):
            with pytest.raises(RecordingError, match="0 to 1 s"):
                recording.at_time(time)


@pytest.mark.parametrize(("since", "frame"), [(2, 3), (2, 2), (CYCLE - 1, 4), (0, 4), (1, 0)])
def test_a_start_from_a_stand_is_shown_from_its_first_frame_on(tmp_path, since: int, frame: int) -> None:
    """An agent that leaves an idle node skips the rest of it: the first frames of the next node fill the step."""
    header = small_header(agents=1)
    stood = RecordedFrame([0.0], [0.0], [0.0], [0], [-1], [since], [2], [AgentState.WAITING], [np.nan])
    with RecordingWriter(tmp_path / "run.h5", header) as writer:
        writer.append(stood, 0)
        writer.append(stood._replace(x=[0.1], node=[3], previous=[0], frame=[frame], state=[AgentState.MOVING]), 0)
        writer.finish({})
    with Recording.open(tmp_path / "run.h5") as recording:
        natural = 60 / recording.steps_per_second
        assert CYCLE - since + frame > 1.5 * natural
        shown = [recording.at_time(share / recording.steps_per_second) for share in np.linspace(0.0, 1.0, 25)[:-1]]
        # It stands in the idle node, then plays the new one, one frame after the other, from the first one on.
        begins = max(1.0 - frame / natural, 0.0)
        for share, each in zip(np.linspace(0.0, 1.0, 25)[:-1], shown, strict=True):
            if abs(share - begins) < 1e-6:
                continue
            if share < begins:
                assert each.node[0] == 0
                assert since <= each.frame[0] <= min(since + share * natural + 1e-9, CYCLE)
            else:
                assert each.node[0] == 3
                assert each.frame[0] == pytest.approx((share - begins) * max(natural, frame))
