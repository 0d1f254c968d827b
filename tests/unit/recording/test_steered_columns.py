"""Steered agents in the file: a phase, and gaits in the header; what no agent needs is not stored."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.header import COLUMN_TYPES, GaitRecord
from crowdsim.recording.packed_steps import MOST_BYTES_HELD
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import CYCLE, small_frame, small_header, write_small_recording


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.h5"


def steered_header(agents=3, captured=False):
    """The small header with a gait for each behavior, and nodes only if captured agents may occur."""
    header = small_header(agents)
    motion = header.motion
    rows = slice(0, CYCLE + 1)
    gaits = tuple(GaitRecord(b.name, motion.pool_root[rows], motion.pool_rotations[rows]) for b in header.behaviors)
    if not captured:
        none = np.zeros(0, np.int32)
        motion = replace(motion, node_names=(), node_behavior=none, node_first=none, node_frames=none)
        motion = replace(motion, pool_root=motion.pool_root[:0], pool_rotations=motion.pool_rotations[:0])
    phases = np.linspace(0.0, 3.0, len(motion.pool_root), dtype=np.float32) % 1.0
    return replace(header, motion=replace(motion, gaits=gaits, pool_phases=phases))


def steered_frame(header, step):
    nobody = np.full(header.agents.count, -1)
    phase = 0.06 + 0.09 * step + np.arange(header.agents.count)
    return small_frame(header, step)._replace(node=nobody, previous=nobody, frame=nobody + 1, phase=phase)


def test_steered_agents_take_18_bytes_in_a_step_and_come_back(path):
    header = steered_header()
    with RecordingWriter(path, header) as writer:
        for step in range(70):
            writer.append(steered_frame(header, step), step)
        writer.finish({})
    with h5py.File(path) as file:
        columns = [file["steps"][name] for name in file["steps"] if name != "state_hash"]
        assert sum(column.dtype.itemsize for column in columns) == 18
    with Recording.open(path) as recording:
        assert recording.header.motion.node_names == ()
        for found, gait in zip(recording.header.motion.gaits, header.motion.gaits, strict=True):
            assert found.name == gait.name
            np.testing.assert_array_equal(found.root, gait.root)
            np.testing.assert_array_equal(found.rotations, gait.rotations)
            assert found.root.dtype == found.rotations.dtype == np.float32
        assert recording.phase[69, 2] == np.float32(2.06 + 0.09 * 69)
        assert recording.at_step(5).steered.tolist() == [True, True, False]
        assert recording.at_step(69).steered.all()
        phases = [0.06 + 0.09 * 2.5, 1.06 + 0.09 * 2.5, np.nan]
        assert recording.at_time(0.125).phase == pytest.approx(phases, nan_ok=True)


def test_what_is_not_stored_reads_as_nothing_under_any_slice(path):
    header = steered_header()
    with RecordingWriter(path, header) as writer:
        for step in range(6):
            writer.append(steered_frame(header, step), step)
        writer.finish({})
    with Recording.open(path) as recording:
        for name, value in (("node", -1), ("previous", -1), ("frame", 0)):
            column = getattr(recording, name)
            assert column.dtype == COLUMN_TYPES[name]
            assert (column.shape, len(column)) == ((6, 3), 6)
            assert column[2].tolist() == [value] * 3
            assert column[1:3, 2].tolist() == [value] * 2
            assert column[:].shape == (6, 3)
            assert column[4, 1] == value
    with Recording.open(write_small_recording(path, steps=6)) as recording:
        assert np.isnan(recording.phase[2:4]).all()
        assert not recording.at_step(5).steered.any()


def test_both_levels_in_one_file(path):
    header = steered_header(captured=True)
    frame = small_frame(header, 30)._replace(phase=np.array([np.nan, 7.5, np.nan]))
    with RecordingWriter(path, header) as writer:
        writer.append(frame, 0)
        writer.finish({})
    with Recording.open(path) as recording:
        assert recording.at_step(0).steered.tolist() == [False, True, False]
        assert recording.node[0].tolist() == frame.node.tolist()


def test_agents_without_motion_are_refused(path):
    for header, frame in (
        (steered_header(), small_frame(small_header(), 1)),
        (small_header(), steered_frame(small_header(), 1)),
    ):
        with RecordingWriter(path, header) as writer:
            with pytest.raises(RecordingError, match=r"agent 0 is (captured|steered), but the header has no"):
                writer.append(frame, 0)
            writer.append(frame._replace(state=np.zeros(3)), 0)
            writer.finish({})


def test_gaits_that_fit_nothing_are_refused(path):
    header = steered_header()
    gaits = header.motion.gaits
    for wrong in (gaits[:2], (*gaits[:2], replace(gaits[2], root=gaits[2].root[:5]))):
        with pytest.raises(RecordingError, match="gait"):
            RecordingWriter(path, replace(header, motion=replace(header.motion, gaits=wrong)))


def test_a_recording_of_version_1_still_opens(path):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = 1
        assert not any(name.startswith("gait") for name in file["motion"])
    with Recording.open(path) as recording:
        assert recording.header.motion.gaits == ()
        assert np.isnan(recording.phase[:]).all()
        assert recording.poses(40)[0].shape == (3, 19, 3)


def test_large_crowds_hold_few_steps_in_memory(path):
    writer = RecordingWriter(path, steered_header(agents=200_000))
    held = sum(values.nbytes for values in writer._buffer.values())
    assert held <= MOST_BYTES_HELD
