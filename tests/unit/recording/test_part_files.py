"""What is left of runs that are killed, of disks that are full, and of names that are taken."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.packed_steps import MOST_STEPS_HELD
from crowdsim.recording.reader import Recording
from crowdsim.recording.recovery import recover
from crowdsim.recording.storage.part_file import PartFile
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header, write_small_recording

ROOT = Path(__file__).parents[3]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.h5"


def write_and_die(path: Path, steps: int, last_words: str = "os.kill(os.getpid(), signal.SIGKILL)") -> int:
    """Append so many steps, a path in each tenth, and die."""
    program = f"""
        import os, signal
        from crowdsim.recording.writer import RecordingWriter
        from tests.support.small_recording import small_frame, small_header
        header = small_header()
        with RecordingWriter({str(path)!r}, header) as writer:
            for step in range({steps}):
                if step % 10 == 0:
                    writer.add_path(step % 3, [[0.0, 0.0], [1.0, step]], [2, 2])
                writer.append(small_frame(header, step), 2**63 + step)
            {last_words}
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], env=environment, check=False)
    return done.returncode


@pytest.mark.parametrize("steps", [1, MOST_STEPS_HELD - 1, MOST_STEPS_HELD, 3 * MOST_STEPS_HELD + 7])
def test_every_step_before_a_kill_can_be_recovered(path, steps):
    assert write_and_die(path, steps) == -signal.SIGKILL
    part = path.with_name("run.h5.part")
    assert [p.name for p in path.parent.iterdir()] == [part.name]
    header = small_header()
    with recover(part) as recording:
        assert recording.path == path
        assert not recording.complete
        assert recording.steps == recording.summary["steps"] == steps
        assert recording.state_hash[:].tolist() == [2**63 + step for step in range(steps)]
        for step in {0, steps // 2, steps - 1}:
            expected = small_frame(header, step)
            for name, values in recording.at_step(step)._asdict().items():
                np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-6)
        assert [p.step for p in recording.paths] == list(range(0, steps, 10))
        assert recording.paths[-1].points[1].tolist() == [1.0, 10.0 * ((steps - 1) // 10)]
    assert [p.name for p in path.parent.iterdir()] == ["run.h5"]


def test_commands_before_a_kill_are_recovered(path):
    words = """
            for committed, at in ((True, 0.5), (False, 0.6)):
                writer.add_command({"at": at, "open": "gate"})
                writer._flush() if committed else None
            writer.append(small_frame(header, 5), 5)
            os.kill(os.getpid(), signal.SIGKILL)"""
    assert write_and_die(path, 5, words.strip()) == -signal.SIGKILL
    with recover(path.with_name("run.h5.part")) as recording:
        assert recording.commands == ({"at": 0.5, "open": "gate"}, {"at": 0.6, "open": "gate"})
        # The small recording is like those from before overrides were kept.
        with pytest.raises(RecordingError, match="before overrides and commands were kept"):
            recording.scenario_yaml()


def test_obstacles_that_came_before_a_kill_are_recovered(path):
    words = """
            from crowdsim.recording.header import SolidRecord
            wall = SolidRecord("wall", "POLYGON ((0 0, 1 0, 1 1, 0 0))", 0.0, 2.5)
            for committed in (True, False):
                writer.add_change(writer.add_movable(wall), wall.footprint)
                writer._flush() if committed else None
            writer.append(small_frame(header, 5), 5)
            os.kill(os.getpid(), signal.SIGKILL)"""
    assert write_and_die(path, 5, words.strip()) == -signal.SIGKILL
    with recover(path.with_name("run.h5.part")) as recording:
        assert [movable.name for movable in recording.header.movables] == ["wall", "wall"]
        assert [(change.movable, change.step) for change in recording.changes] == [(0, 5), (1, 5)]
        assert len(recording.movables_at(recording.duration)) == 2


def test_a_kill_amid_a_commit_loses_nothing(path):
    """Whatever of a commit's frame, of its blocks, and of the cut behind them has reached the disk."""
    header = small_header()
    states: list[bytes] = []
    part = path.with_name("run.h5.part")
    import crowdsim.recording.storage.part_file as part_file

    write, cut = part_file._write, os.ftruncate

    def recorded_write(handle, place, content):
        half = len(content) // 2
        write(handle, place, content[:half])
        states.append(part.read_bytes())
        count = half + write(handle, place + half, content[half:])
        states.append(part.read_bytes())
        return count

    with pytest.MonkeyPatch.context() as patch, RecordingWriter(path, header) as writer:
        for step in range(MOST_STEPS_HELD - 1):
            writer.append(small_frame(header, step), step)
        patch.setattr(part_file, "_write", recorded_write)
        patch.setattr(os, "ftruncate", lambda handle, size: (states.append(part.read_bytes()), cut(handle, size))[1])
        writer.append(small_frame(header, MOST_STEPS_HELD - 1), 0)
        states.append(part.read_bytes())
        patch.undo()
        writer.finish({})
    assert len(states) > 10
    path.unlink()
    for state in states:
        part.write_bytes(state)
        with recover(part) as recording:
            assert recording.steps >= MOST_STEPS_HELD - 1
            np.testing.assert_allclose(recording.x[5], small_frame(header, 5).x, rtol=1e-6)
        path.unlink()


@pytest.mark.parametrize(("size", "kept"), [(0, b""), (4096, b"a" * 4096), (5000, b"a" * 5000)])
def test_bytes_behind_a_cut_are_zeros_if_the_file_grows_again(path, size, kept):
    with PartFile(path) as file:
        file.write(b"a" * 8192)
        file.truncate(size)
        file.seek(8192)
        file.write(b"b")
        expected = kept.ljust(8192, b"\0") + b"b"
        file.seek(0)
        assert file.read(8193) == expected
        file.commit()
    assert path.read_bytes() == expected


def test_what_cannot_be_recovered_is_refused(path, tmp_path):
    part = path.with_name("run.h5.part")
    with pytest.raises(RecordingError, match=r"there is no file .*run\.h5\.part"):
        recover(part)
    with pytest.raises(RecordingError, match="not a file of a killed run"):
        recover(tmp_path)
    part.write_bytes(b"nothing of a recording")
    with pytest.raises(RecordingError, match=r"cannot be read .*; run the scenario again"):
        recover(part)
    write_and_die(tmp_path / "none.h5", 0)
    with pytest.raises(RecordingError, match="holds no step"):
        recover(tmp_path / "none.h5.part")
    write_small_recording(tmp_path / "other.h5")
    with pytest.raises(RecordingError, match="is there already"):
        recover(tmp_path / "none.h5.part", tmp_path / "other.h5")
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_what_a_killed_run_left_is_not_overwritten(path):
    write_and_die(path, 3)
    with pytest.raises(RecordingError, match="crowdsim recover"), RecordingWriter(path, small_header()):
        pass
    with recover(path.with_name("run.h5.part")) as recording:
        assert recording.steps == 3


def test_a_second_run_of_the_same_name_leaves_the_first_alone(path):
    before = write_small_recording(path).read_bytes()
    header = small_header()
    with RecordingWriter(path, header) as first:
        first.append(small_frame(header, 0), 0)
        part = path.with_name("run.h5.part")
        written = part.read_bytes()
        with pytest.raises(RecordingError, match="another run"), RecordingWriter(path, header):
            pass
        with pytest.raises(RecordingError, match="being written"):
            recover(part)
        assert part.read_bytes() == written
        assert path.read_bytes() == before
        first.finish({"whole": True})
    with Recording.open(path) as recording:
        assert recording.steps == 1
        assert recording.complete


@pytest.mark.parametrize("kind", ["fifo", "device"])
def test_only_regular_files_are_written_and_read(tmp_path, kind):
    path = Path("/dev/null") if kind == "device" else tmp_path / "pipe.h5"
    if kind == "fifo":
        os.mkfifo(path)
    with pytest.raises(RecordingError, match="no regular file"), RecordingWriter(path, small_header()):
        pass
    with pytest.raises(RecordingError, match="no regular file"):
        Recording.open(path)
    assert not path.is_file()


@pytest.mark.parametrize("room", [10_000, 200_000, 300_000])
def test_a_full_disk_is_an_error_that_says_what_to_do(tmp_path, room):
    program = f"""
        import resource
        import numpy as np
        from crowdsim.errors import RecordingError
        from crowdsim.recording.writer import RecordingWriter
        from tests.support.small_recording import small_frame, small_header
        header = small_header()
        frame = small_frame(header, 0)
        rng = np.random.default_rng(0)
        resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
        try:
            with RecordingWriter("run.h5", header) as writer:
                for step in range(20_000):
                    writer.append(frame._replace(x=rng.random(3)), step)
                writer.finish({{}})
        except RecordingError as error:
            print(error)
    """
    # Python would keep compiled modules that are cut short, too.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "File too large" in done.stdout
    assert "make room" in done.stdout
    assert not list(tmp_path.iterdir())


def test_damaged_columns_are_refused_where_they_are_read(path):
    import h5py

    for name, value in (("node", 10_000), ("frame", 30_000), ("behavior", 99), ("state", 77), ("previous", -5)):
        write_small_recording(path)
        with h5py.File(path, "r+") as file:
            file[f"steps/{name}"][3, 0] = value
        with Recording.open(path) as recording:
            recording.at_step(2)
            with pytest.raises(RecordingError, match=rf"steps/{name}|its node does not have"):
                recording.poses(3)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("motion/node_first", lambda values: values[:2]),
        ("motion/node_first", lambda values: values + 10_000),
        ("motion/node_frames", lambda values: values * 0 - 3),
        ("motion/parents", lambda values: values + 5),
        ("motion/parents", lambda values: values.astype(np.float64)),
        ("motion/pool_rotations", lambda values: values[:, :3]),
        ("motion/node_behavior", lambda values: values + 100),
        ("motion/role_joints", lambda values: values + 1000),
        ("steps/node", lambda values: values.astype(np.float64)),
        ("steps/x", lambda values: values[:-1]),
    ],
)
def test_tables_that_do_not_fit_are_refused_on_opening(path, name, change):
    import h5py

    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        changed = change(file[name][:])
        del file[name]
        file[name] = changed
    with pytest.raises(RecordingError, match=r"damaged|has shape"):
        Recording.open(path)


def test_a_dataset_without_data_that_claims_terabytes_is_refused(path):
    import h5py

    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        del file["motion/pool_root"]
        file.create_dataset("motion/pool_root", (2**40, 3), "float32", chunks=(1024, 3))
    with pytest.raises(RecordingError, match="claims"):
        Recording.open(path)
