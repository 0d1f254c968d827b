"""Steps that several processes have packed are those that one writes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording import packed_steps
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.packed_steps import column_types, pack_steps, share_out, steps_held
from crowdsim.recording.reader import Recording
from crowdsim.recording.recovery import recover
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header


@pytest.mark.parametrize("agents", [1, 3, 4095, 4097, 20_000, 1_000_003])
@pytest.mark.parametrize("processes", [1, 2, 3, 7, 512])
def test_shares_are_whole_chunks_of_about_the_same_size(agents: int, processes: int) -> None:
    shares = share_out(agents, processes)
    parts = [shares.of(process) for process in range(processes)]
    assert [agent for part in parts for agent in part] == list(range(agents))
    assert all(part.start % shares.width == 0 for part in parts if part)
    assert shares.width <= min(agents, packed_steps.AGENTS_PER_CHUNK)
    assert max(map(len, parts)) <= -(-agents // processes) + shares.chunks
    for process, part in enumerate(parts):
        assert (shares.owners(np.array(part, np.int32)) == process).all()


@pytest.mark.parametrize("processes", [1, 2, 3, 5])
@pytest.mark.parametrize("more", [0, 1, 40])
def test_packed_steps_are_those_of_one_writer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int, more: int
) -> None:
    monkeypatch.setattr(packed_steps, "AGENTS_PER_CHUNK", 1)  # the three agents are in chunks of their own
    header = small_header()
    held = steps_held(header)
    frames = [small_frame(header, step) for step in range(held + more)]
    frames[5].state[1] = AgentState.ABSENT
    hashes = np.arange(len(frames), dtype=np.uint64) * np.uint64(2**58)
    with RecordingWriter(tmp_path / "one.h5", header) as writer:
        for frame, state in zip(frames, hashes, strict=True):
            writer.append(frame, int(state))
        writer.finish({})
    shares = share_out(header.agents.count, processes)
    with RecordingWriter(tmp_path / "joined.h5", header, shares.width) as writer:
        for first in range(0, len(frames), held):
            block = frames[first : first + held]
            chunks = []
            for process in range(processes):
                mine = shares.of(process)
                columns = {
                    name: np.array([getattr(frame, name)[mine.start : mine.stop] for frame in block], dtype)
                    for name, dtype in column_types(header).items()
                }
                for name in {"x", "y", "heading"} & columns.keys():
                    columns[name][columns["state"] == AgentState.ABSENT] = np.nan
                chunks += pack_steps(columns, mine.start, header, shares.width)
            writer.append_packed(hashes[first : first + held], reversed(chunks))
        writer.finish({})
    with Recording.open(tmp_path / "one.h5") as one, Recording.open(tmp_path / "joined.h5") as joined:
        assert joined.steps == len(frames)
        for column in (*RecordedFrame._fields, "state_hash"):
            np.testing.assert_array_equal(getattr(joined, column)[:], getattr(one, column)[:], column)


def test_paths_before_packed_steps_outlast_a_kill(tmp_path: Path) -> None:
    header = small_header()
    columns = {
        name: np.array([getattr(small_frame(header, 0), name)], dtype) for name, dtype in column_types(header).items()
    }
    chunks = pack_steps(columns, 0, header, header.agents.count)
    with RecordingWriter(tmp_path / "a.h5", header, header.agents.count) as writer:
        writer.add_path(1, [[0.0, 0.0], [1.0, 2.0]], [2, 2])
        writer.append_packed(np.zeros(1, np.uint64), chunks)
        # What a kill would leave.
        (tmp_path / "killed.h5.part").write_bytes((tmp_path / "a.h5.part").read_bytes())
        writer.finish({})
    with recover(tmp_path / "killed.h5.part") as recording:
        assert [(path.agent, path.step) for path in recording.paths] == [(1, 0)]


def test_packed_steps_begin_with_a_chunk(tmp_path: Path) -> None:
    header = small_header()
    with RecordingWriter(tmp_path / "a.h5", header) as writer:
        writer.append(small_frame(header, 0), 0)
        with pytest.raises(RecordingError, match="step 1 is in the middle of a chunk"):
            writer.append_packed(np.zeros(1, np.uint64), [])
        writer.finish({})


def test_a_step_of_a_huge_crowd_is_a_chunk_of_its_own() -> None:
    header = small_header()
    crowd = replace(header.agents, groups=("crowd",) * 2_000_000)
    assert steps_held(replace(header, agents=crowd)) == 1
