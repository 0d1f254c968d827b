"""The drift that clips have themselves: exact between frames, and from one node to the next."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.motion.graph.foot_contacts import Feet
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.planted_rows import PlantedRows
from crowdsim.recording.header import Ends
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown import foot_drift
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import write_small_recording
from tests.unit.recording.test_steered_columns import steered_frame, steered_header

FRAMES = np.array([5, 8], np.int32)
"""Two nodes. In the first all points of the feet go 1 cm ahead a frame, in the second 2 cm to the left."""


def two_nodes() -> tuple[PlantedRows, np.ndarray]:
    first = np.array([0, 6], np.int32)
    none = np.empty(0, np.float32)
    table = PoseTable(np.empty(0, np.int32), none, first, FRAMES, none, none)
    rows = int((FRAMES + 1).sum())
    points = np.zeros((rows, 2, 3, 3))
    points[:6, ..., 0] = 0.01 * np.arange(6)[:, None, None]
    points[6:, ..., 1] = 0.02 * np.arange(9)[:, None, None]
    stands, lifted = np.ones((rows, 2, 3), bool), np.zeros((rows, 2, 3), np.int32)
    tracks = np.zeros((rows, 3))
    tracks[6:, 2] = 0.5  # the track of the second clip is turned
    return PlantedRows(table, Feet(points, np.zeros((2, 3)), np.zeros(2)), stands, lifted), tracks


def moment(node: int, at: float, heading: float, place: tuple[float, float] = (0.0, 0.0)) -> foot_drift._Moment:
    points = np.zeros((1, 2, 3, 3))
    points[..., :2] = place
    return foot_drift._Moment(np.array([7]), points, np.array([node], np.int32), np.array([at]), np.array([heading]))


def own(before: foot_drift._Moment, now: foot_drift._Moment) -> np.ndarray:
    moves = foot_drift._moves(*two_nodes(), before, now, None)
    assert set(moves) == {(7, 0), (7, 1)}
    assert np.array_equal(moves[7, 0][1], moves[7, 1][1])
    return moves[7, 0][1]


def test_within_a_node_at_any_fraction_of_a_frame() -> None:
    assert np.allclose(own(moment(0, 1.25, 0.0), moment(0, 3.5, 0.0)), [0.0225, 0.0])
    # Turned by a quarter, ahead is along y.
    assert np.allclose(own(moment(0, 1.25, np.pi / 2), moment(0, 5.0, np.pi / 2)), [0.0, 0.0375])


def test_across_nodes_both_clips_count_each_in_its_direction() -> None:
    # 1.5 frames to the end of the first node, and 2.75 into the second one, which is played at its own heading.
    assert np.allclose(own(moment(0, 3.5, 0.0), moment(1, 2.75, 0.5)), [0.015, 0.055])


def test_a_node_that_is_played_again_counts_from_its_end_to_its_start() -> None:
    assert np.allclose(own(moment(0, 4.0, 0.0), moment(0, 1.5, 0.0)), [0.01 + 0.015, 0.0])


def test_nothing_moves_in_no_time() -> None:
    assert np.array_equal(own(moment(1, 8.0, 0.3), moment(1, 8.0, 0.3)), [0.0, 0.0])


def test_a_foot_at_the_ends_of_a_periodic_floor_moves_across_them() -> None:
    before, now = moment(0, 1.0, 0.0, (1.0, 3.99)), moment(0, 2.0, 0.0, (1.02, -3.98))
    moves = foot_drift._moves(*two_nodes(), before, now, Ends(1, -4.0, 4.0))
    assert np.allclose([shown for shown, _ in moves.values()], [[0.02, 0.03]] * 2)


def test_a_stance_that_lasts_to_the_end_ends_with_the_last_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    rows, tracks = two_nodes()
    header = SimpleNamespace(motion=SimpleNamespace(skeleton=None, pool_tracks=tracks), ends=None)
    recording = SimpleNamespace(header=header, pose_table=None, duration=0.25)
    monkeypatch.setattr(foot_drift, "planted_rows", lambda *_: rows)
    monkeypatch.setattr(foot_drift, "_moment", lambda _recording, _rows, time: moment(0, time, 0.0))
    stances = foot_drift.shown_stances(recording, rate=10)  # type: ignore[arg-type]
    assert stances.begins.tolist() == [0.0, 0.0]
    assert stances.ends.tolist() == [0.2, 0.2]


def write_steered(path: Path) -> Path:
    header = steered_header()
    with RecordingWriter(path, header) as writer:
        for step in range(5):
            writer.append(steered_frame(header, step), step)
        writer.finish({})
    return path


@pytest.mark.parametrize("write", [write_small_recording, write_steered])
def test_without_tracks_of_nodes_nothing_is_measured(tmp_path: Path, write) -> None:
    """Neither in older recordings, nor if all agents are steered."""
    with Recording.open(write(tmp_path / "run.h5")) as recording:
        assert recording.foot_table is None
        with pytest.raises(RecordingError, match="no tracks of nodes"):
            foot_drift.shown_stances(recording)
        with pytest.raises(RecordingError, match="no tracks of nodes"):
            _ = recording.planted_feet
