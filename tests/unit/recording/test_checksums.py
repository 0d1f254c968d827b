"""Damage anywhere in a finished recording is noticed; recordings without checksums are still read."""

import errno
import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from crowdsim.bench.faults.contents import all_values, read_all
from crowdsim.bench.faults.mutations import mutated
from crowdsim.errors import RecordingError
from crowdsim.recording.reader import Recording
from crowdsim.recording.recovery import recover
from crowdsim.recording.storage.checksums import checked_chunks, require_unchanged
from crowdsim.recording.writer import RecordingWriter, part_path
from tests.support.changing_recording import write_changing_recording
from tests.support.older_recording import make_older
from tests.support.small_recording import small_frame, small_header, write_small_recording

WRITES = {"small": write_small_recording, "changing": write_changing_recording}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.h5"


@pytest.fixture(params=WRITES)
def whole(request, path):
    return WRITES[request.param](path, steps=150)


def damaged_chunk(path: Path, name: str) -> int:
    """Flip a bit in the last chunk of a dataset; return the first step of that chunk."""
    with h5py.File(path, "r") as file:
        chunks = []
        file[name].id.chunk_iter(chunks.append)
        last = chunks[-1]
    content = bytearray(path.read_bytes())
    content[last.byte_offset + last.size // 2] ^= 4
    path.write_bytes(bytes(content))
    return last.chunk_offset[0]


def refusal(path: Path) -> str:
    """Read all of a recording; return the message if that is refused, else an empty text."""
    try:
        read_all(path)
    except RecordingError as error:
        return str(error)
    return ""


def test_single_flipped_bits_are_noticed(whole):
    """What can be read is what was written; everything else is an error with the name of the file and a remedy."""
    content, written = whole.read_bytes(), all_values(whole)
    rng = np.random.default_rng(1)
    refused = 0
    for place in rng.integers(len(content), size=200).tolist():
        changed = bytearray(content)
        changed[place] ^= 1 << int(rng.integers(8))
        whole.write_bytes(bytes(changed))
        message = refusal(whole)
        if message:
            assert message.startswith(str(whole))
            assert "run the scenario again" in message
            refused += 1
        else:
            assert all_values(whole) == written, place
    assert refused > 190


def test_files_with_other_faults_are_refused_or_the_same(whole):
    content, written = whole.read_bytes(), all_values(whole)
    for seed in range(200):
        whole.write_bytes(mutated(content, np.random.default_rng(seed)))
        message = refusal(whole)
        assert message.startswith(str(whole)) if message else all_values(whole) == written, seed


def test_a_file_of_others_is_not_taken_for_damaged(path, monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    write_small_recording(path, steps=3)
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(RecordingError, match=r"run\.h5 cannot be read: Permission denied$"):
        Recording.open(path)


def test_damage_of_steps_is_named_and_leaves_the_other_steps(path):
    write_small_recording(path, steps=150)
    first = damaged_chunk(path, "steps/x")
    assert first == 128
    with Recording.open(path) as recording:
        assert recording.x[first - 1].shape == (3,)
        with pytest.raises(RecordingError, match=r"run\.h5 is damaged: steps/x .*run the scenario again"):
            recording.x[first]
        with pytest.raises(RecordingError, match="steps/x"):
            recording.at_step(first)


@pytest.mark.parametrize("name", ["steps/state_hash", "paths/points", "paths/agent"])
def test_damage_of_hashes_and_paths_is_named(path, name):
    damaged_chunk(write_small_recording(path, steps=150), name)
    with Recording.open(path) as recording, pytest.raises(RecordingError, match=rf"damaged.*{name}.*run the scenario"):
        _ = recording.state_hash[:], recording.paths


def test_damage_of_motions_is_named_on_opening(path):
    damaged_chunk(write_small_recording(path), "motion/pool_rotations")
    with pytest.raises(RecordingError, match=r"damaged \(motion/pool_rotations: .*run the scenario again"):
        Recording.open(path)


def test_all_bytes_outside_of_columns_have_a_checksum(whole):
    with h5py.File(whole, "r") as file:
        chunks = checked_chunks(file)
    content = whole.read_bytes()
    assert (chunks[:, 0] < chunks[:, 1]).all()
    assert (chunks[1:, 0] > chunks[:-1, 1]).all()
    assert chunks[-1, 1] <= len(content)
    inside = np.zeros(len(content), bool)
    for first, end in chunks.tolist():
        inside[first:end] = True
    for place in np.flatnonzero(~inside)[::97].tolist():
        changed = bytearray(content)
        changed[place] ^= 16
        whole.write_bytes(bytes(changed))
        with pytest.raises(RecordingError):
            Recording.open(whole)


def test_recordings_without_checksums_are_read(whole):
    written = all_values(whole)
    assert require_unchanged(whole)
    make_older(whole)
    assert not require_unchanged(whole)
    assert all_values(whole) == written
    read_all(whole)


def test_a_note_that_another_program_adds_takes_the_checksums_but_nothing_else(path):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "mine"
    assert not require_unchanged(path)
    read_all(path)


def test_recovered_recordings_have_checksums(path):
    header = small_header()
    with RecordingWriter(path, header) as writer:
        for step in range(70):
            writer.append(small_frame(header, step), step)
        left = part_path(path).read_bytes()
        writer.finish({})
    path.unlink()
    part_path(path).write_bytes(left)
    recover(part_path(path)).close()
    assert require_unchanged(path)
    read_all(path)


def test_a_kill_just_before_the_file_gets_its_name_loses_nothing(path, monkeypatch):
    left = []

    def killed(part, _):
        left.append(part.read_bytes())
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        write_small_recording(path, steps=1)
    monkeypatch.undo()
    part_path(path).write_bytes(left[0])
    with recover(part_path(path)) as recording:
        assert recording.complete
        assert recording.summary == {"arrived": 0, "seconds": 1.5}
        assert recording.state_hash[:].tolist() == [2**63]
    assert require_unchanged(path)
