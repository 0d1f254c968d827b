"""What is written is read back; what is not a finished recording is refused."""

import os
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.header import (
    FORMAT_VERSION,
    AgentState,
    BehaviorRecord,
    MeshRecord,
    RecordedFrame,
    SolidRecord,
)
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header, write_small_recording
from tests.support.walking_recording import random_walkers, write_tracks

ROOT = Path(__file__).parents[3]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.h5"


@pytest.mark.parametrize("steps", [1, 63, 64, 65, 130])
def test_steps_come_back(path, steps):
    header = small_header()
    with Recording.open(write_small_recording(path, steps=steps)) as recording:
        assert recording.steps == steps
        assert recording.duration == (steps - 1) / 20
        assert recording.state_hash[:].tolist() == [2**63 + step for step in range(steps)]
        for step in {0, steps // 2, steps - 1}:
            expected, found = small_frame(header, step), recording.at_step(step)
            for name in RecordedFrame._fields:
                wanted = np.asarray(getattr(expected, name)).astype(getattr(found, name).dtype)
                np.testing.assert_array_equal(getattr(found, name), wanted)
        np.testing.assert_array_equal(recording.x[:, 1], [recording.at_step(s).x[1] for s in range(steps)])


def test_absent_agents_are_nowhere(path):
    with Recording.open(write_small_recording(path, steps=40)) as recording:
        absent = recording.state[:] == AgentState.ABSENT
        assert absent[:19, 2].all()
        assert not absent[20:].any()
        for column in (recording.x, recording.y, recording.heading):
            np.testing.assert_array_equal(np.isnan(column[:]), absent)
        between = recording.at_time(0.975)
        assert np.isnan(between.x).tolist() == [False, False, True]
        assert np.isnan(recording.poses_at(0.5)[0]).any(axis=(1, 2)).tolist() == [False, False, True]


def test_header_comes_back(path):
    header = small_header()
    with Recording.open(write_small_recording(path)) as recording:
        found = recording.header
        for name in ("scenario_name", "scenario_text", "seed", "steps_per_second", "floor"):
            assert getattr(found, name) == getattr(header, name)
        assert tuple(found.behaviors) == tuple(header.behaviors)
        assert tuple(found.layers) == tuple(header.layers)
        assert tuple(found.solids) == tuple(header.solids)
        assert tuple(found.agents.groups) == tuple(header.agents.groups)
        for name in ("start_times", "starts", "goals", "radii"):
            np.testing.assert_array_equal(getattr(found.agents, name), getattr(header.agents, name))
        assert found.motion.skeleton.names == header.motion.skeleton.names
        assert found.motion.skeleton.roles == header.motion.skeleton.roles
        for name in ("parents", "offsets", "end_parents", "end_offsets"):
            np.testing.assert_array_equal(getattr(found.motion.skeleton, name), getattr(header.motion.skeleton, name))
        assert tuple(found.motion.node_names) == tuple(header.motion.node_names)
        for name in ("node_behavior", "node_first", "node_frames", "pool_root", "pool_rotations"):
            back = getattr(found.motion, name)
            np.testing.assert_array_equal(back, getattr(header.motion, name))
            assert back.dtype == getattr(header.motion, name).dtype
        assert recording.summary == {"arrived": 0, "seconds": 1.5}
        assert recording.versions["numpy"] == np.__version__
        assert set(recording.versions) == {"crowdsim", "numba", "numpy", "python"}


def test_meshes_come_back_each_with_its_own_points(path):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]], np.float32)
    meshes = (
        MeshRecord("lid", square, np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
        MeshRecord("flap", square[:3] + 5, np.array([[0, 1, 2]], np.int32)),
    )
    with RecordingWriter(path, replace(small_header(), meshes=meshes)) as writer:
        writer.finish({})
    with Recording.open(path) as recording:
        assert [mesh.name for mesh in recording.header.meshes] == ["lid", "flap"]
        for found, mesh in zip(recording.header.meshes, meshes, strict=True):
            np.testing.assert_array_equal(found.points, mesh.points)
            np.testing.assert_array_equal(found.triangles, mesh.triangles)
            assert (found.points.dtype, found.triangles.dtype) == (np.float32, np.int32)


def test_nothing_to_list_is_a_header_too(path):
    header = replace(small_header(), solids=())
    with RecordingWriter(path, header) as writer:
        writer.finish({})
    with Recording.open(path) as recording:
        assert recording.header.solids == ()
        assert (recording.steps, recording.duration, recording.paths) == (0, 0.0, ())
        with pytest.raises(RecordingError, match="no step 0"):
            recording.at_step(0)


def test_paths_come_back_with_the_step_they_hold_from(path):
    header = small_header()
    with RecordingWriter(path, header) as writer:
        writer.add_path(1, [[0.0, 0.0], [1.0, 0.0]], [2, 2])
        writer.append(small_frame(header, 0), 0)
        writer.add_path(0, [[0.0, 1.0], [1.0, 1.0], [2.0, 1.5]], [2, 0, 0])
        writer.append(small_frame(header, 1), 1)
        writer.add_path(1, [[0.5, 0.0], [1.0, 2.0]], [1, 1])
        writer.append(small_frame(header, 2), 2)
        writer.finish({})
    with Recording.open(path) as recording:
        assert [(p.agent, p.step, len(p.points)) for p in recording.paths] == [(1, 0, 2), (0, 1, 3), (1, 2, 2)]
        assert recording.paths[1].points.tolist() == [[0.0, 1.0], [1.0, 1.0], [2.0, 1.5]]
        assert recording.paths[1].behaviors.tolist() == [2, 0, 0]
        assert [(p.agent, p.step) for p in recording.paths_at(0.0)] == [(1, 0)]
        assert [(p.agent, p.step) for p in recording.paths_at(0.1)] == [(0, 1), (1, 2)]


def test_same_run_same_bytes(tmp_path):
    first = write_small_recording(tmp_path / "a.h5")
    second = write_small_recording(tmp_path / "b.h5")
    assert first.read_bytes() == second.read_bytes()


def test_file_has_its_name_only_when_finished(path):
    header = small_header()
    with RecordingWriter(path, header) as writer:
        writer.append(small_frame(header, 0), 0)
        assert [p.name for p in path.parent.iterdir()] == ["run.h5.part"]
        writer.finish({})
        assert [p.name for p in path.parent.iterdir()] == ["run.h5"]
        with pytest.raises(RecordingError, match="before finish"):
            writer.append(small_frame(header, 1), 0)


def test_an_exception_leaves_nothing(path):
    with pytest.raises(ZeroDivisionError), RecordingWriter(path, small_header()):
        raise ZeroDivisionError
    assert not list(path.parent.iterdir())


def test_an_exception_leaves_the_recording_of_before(path):
    before = write_small_recording(path).read_bytes()
    with pytest.raises(KeyboardInterrupt), RecordingWriter(path, small_header()):
        raise KeyboardInterrupt
    assert path.read_bytes() == before


def test_forgetting_to_finish_is_an_error(path):
    with pytest.raises(RecordingError, match="without finish"), RecordingWriter(path, small_header()):
        pass
    assert not list(path.parent.iterdir())


def test_a_killed_run_leaves_only_a_part_that_readers_refuse(path):
    program = f"""
        import os, signal
        from crowdsim.recording.writer import RecordingWriter
        from tests.support.small_recording import small_frame, small_header
        header = small_header()
        with RecordingWriter({str(path)!r}, header) as writer:
            for step in range(100):
                writer.append(small_frame(header, step), step)
            os.kill(os.getpid(), signal.SIGKILL)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False
    )
    assert done.returncode != 0
    part = path.with_name("run.h5.part")
    assert [p.name for p in path.parent.iterdir()] == [part.name]
    with pytest.raises(RecordingError, match="unfinished"):
        Recording.open(part)
    part.rename(path)
    with pytest.raises(RecordingError, match=r"cut short|unfinished"):
        Recording.open(path)


def test_missing_file_names_the_remedy(path):
    with pytest.raises(RecordingError, match="crowdsim run"):
        Recording.open(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89HDF\r\n\x1a\n" + b"\0" * 200])
def test_other_files_are_refused(path, content):
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="not a crowdsim recording"):
        Recording.open(path)


def test_a_cut_file_is_refused(path):
    whole = write_small_recording(path).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RecordingError, match="run the scenario again"):
        Recording.open(path)


def test_hdf5_of_another_program_is_refused(path):
    with h5py.File(path, "w") as file:
        file["data"] = [1, 2]
    with pytest.raises(RecordingError, match="another program"):
        Recording.open(path)


def test_a_newer_version_is_refused(path):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = FORMAT_VERSION + 1
    with pytest.raises(RecordingError, match="update crowdsim"):
        Recording.open(path)


def test_an_unfinished_mark_is_refused(path):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        file.attrs["finished"] = False
    with pytest.raises(RecordingError, match="unfinished"):
        Recording.open(path)


@pytest.mark.parametrize("part", ["steps/x", "motion/pool_root", "agents", "summary", "scenario/text", "layers/low"])
def test_a_damaged_file_is_refused(path, part):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        del file[part]
    with pytest.raises(RecordingError, match="damaged"):
        Recording.open(path)


@pytest.mark.parametrize(
    "change", [lambda behaviors: behaviors[:-1], lambda behaviors: behaviors + 9, lambda behaviors: behaviors - 9]
)
def test_paths_whose_behaviors_do_not_fit_are_refused(path, change):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        changed = change(file["paths/behaviors"][:])
        del file["paths/behaviors"]
        file["paths/behaviors"] = changed
    with Recording.open(path) as recording, pytest.raises(RecordingError, match=r"damaged \(paths/behaviors"):
        _ = recording.paths


def test_unusable_places_are_refused(tmp_path):
    for path, word in (
        (tmp_path / "absent" / "run.h5", "cannot write"),
        (tmp_path / "run.part", "unfinished"),
        (tmp_path, "is a folder"),
    ):
        with pytest.raises(RecordingError, match=word), RecordingWriter(path, small_header()):
            pass


def test_bad_steps_and_paths_are_refused(path):
    header = small_header()
    frame = small_frame(header, 30)
    with RecordingWriter(path, header) as writer:
        with pytest.raises(RecordingError, match="shape"):
            writer.append(frame._replace(x=np.zeros(1)), 0)
        with pytest.raises(RecordingError, match="'y' of agent 1"):
            writer.append(frame._replace(y=np.array([0.0, np.nan, 0.0])), 0)
        writer.append(frame._replace(y=np.array([0.0, np.nan, 0.0]), state=np.array([1, 0, 1])), 0)
        for agent, points, behaviors in ((3, [[0, 0]], [0]), (0, [[0, 0]], [0, 1]), (0, [0, 0], [0, 1])):
            with pytest.raises(RecordingError, match="path"):
                writer.add_path(agent, points, behaviors)
        writer.finish({})
    with Recording.open(path) as recording:
        assert recording.steps == 1
        assert recording.paths == ()


def test_bad_headers_are_refused(path):
    header = small_header()
    bad = [
        replace(header, agents=replace(header.agents, groups=())),
        replace(header, agents=replace(header.agents, goals=np.zeros((3, 3)))),
        replace(header, behaviors=(BehaviorRecord("frontal", "#ffffff", (0.3,)),)),
        replace(header, motion=replace(header.motion, node_first=np.zeros(1, np.int32))),
        replace(header, motion=replace(header.motion, node_frames=header.motion.node_frames + 1)),
        replace(header, motion=replace(header.motion, pool_rotations=header.motion.pool_rotations[:, :2])),
    ]
    for wrong in bad:
        with pytest.raises(RecordingError):
            RecordingWriter(path, wrong)


DOOR = "POLYGON ((2 -0.6, 2.15 -0.6, 2.15 0.6, 2 0.6, 2 -0.6))"
AJAR = "POLYGON ((2 -0.6, 2.15 -0.6, 2.15 0.3, 2 0.3, 2 -0.6))"


def write_with_door(path):
    """A door that is there at first, moves at step 4, is gone from step 8 and there again from step 12 on."""
    header = replace(small_header(), movables=(SolidRecord("door", DOOR, 0.0, 2.1), SolidRecord("box", AJAR, 0.0, 1.0)))
    with RecordingWriter(path, header) as writer:
        for step in range(20):
            if step in (0, 4, 8, 12):
                writer.add_change(0, {0: DOOR, 4: AJAR, 8: None, 12: DOOR}[step])
            writer.append(small_frame(header, step), step)
        writer.finish({})
    return path


def test_what_moves_is_where_it_was_at_each_time(path):
    with Recording.open(write_with_door(path)) as recording:
        assert [solid.name for solid in recording.header.movables] == ["door", "box"]
        assert [(change.movable, change.step) for change in recording.changes] == [(0, 0), (0, 4), (0, 8), (0, 12)]
        for time, footprint in ((0.0, DOOR), (0.19, DOOR), (0.2, AJAR), (0.39, AJAR), (0.6, DOOR), (0.9, DOOR)):
            assert recording.movables_at(time) == (SolidRecord("door", footprint, 0.0, 2.1),), time
        assert recording.movables_at(0.4) == recording.movables_at(0.59) == ()


def test_things_that_come_during_a_run_are_listed_after_those_of_the_header(path):
    header = replace(small_header(), movables=(SolidRecord("door", DOOR, 0.0, 2.1),))
    crate = SolidRecord("crate", AJAR, 0.0, 0.8)
    with RecordingWriter(path, header) as writer:
        for step in range(4):
            if step == 2:
                assert writer.add_movable(crate) == 1
                writer.add_change(1, DOOR)
            writer.append(small_frame(header, step), step)
        writer.finish({})
    with Recording.open(path) as recording:
        assert recording.header.movables == (*header.movables, crate)
        assert recording.movables_at(0.05) == ()
        assert recording.movables_at(0.1) == (SolidRecord("crate", DOOR, 0.0, 0.8),)


def test_a_recording_of_before_things_could_move_still_opens(path):
    write_small_recording(path)
    with h5py.File(path, "r+") as file:
        del file["changes"]
        for name in ("names", "footprints", "bottoms", "tops"):
            del file[f"place/movable_{name}"]
    with Recording.open(path) as recording:
        assert recording.header.movables == recording.changes == recording.movables_at(1.0) == ()
        assert len(recording.header.solids) == 4


def test_a_change_of_what_the_header_does_not_list_is_refused(path):
    with RecordingWriter(path, small_header()) as writer:
        with pytest.raises(RecordingError, match="movable 0, but the recording lists 0"):
            writer.add_change(0, None)
        writer.finish({})


@pytest.mark.parametrize(("column", "message"), [("x", "agent 0 is present, but has no position"), ("frame", "beyond")])
def test_numbers_that_are_none_are_damage(path, column, message):
    write_small_recording(path, steps=10)
    with h5py.File(path, "r+") as file:
        file[f"steps/{column}"][5, 0] = np.nan
    with Recording.open(path) as recording:
        recording.at_step(4)
        with pytest.raises(RecordingError, match=message):
            recording.at_step(5)


def test_a_file_that_hdf5_opens_anew_holds_the_same(tmp_path, monkeypatch):
    tracks = random_walkers(6, 400)
    usual = write_tracks(tmp_path / "usual.h5", *tracks)
    monkeypatch.setattr("crowdsim.recording.writer._FRESH", 1)
    plain, opened = h5py.File, []

    def noting(file, mode, *arguments, **options):
        opened.append(mode)
        return plain(file, mode, *arguments, **options)

    monkeypatch.setattr("crowdsim.recording.writer.h5py.File", noting)
    anew = write_tracks(tmp_path / "anew.h5", *tracks)
    assert opened.count("r+") > 1
    for name in ("x", "y", "heading", "state", "behavior"):
        np.testing.assert_array_equal(getattr(anew, name)[:], getattr(usual, name)[:])
    usual.close()
    anew.close()
