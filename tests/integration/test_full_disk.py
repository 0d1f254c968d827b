"""A full disk: every command that writes says which file cannot be written and what to do, and leaves nothing."""

import resource
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from contextlib import suppress

import pytest

from crowdsim.export.formats import FORMATS
from crowdsim.recording.recovery import recover
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header
from tests.support.walking_recording import random_walkers, write_tracks

ROOM = 4096
"""Longest file that the tests can write [bytes]; stands for what is left on a disk."""


def limited(room: int) -> Callable[[], None]:
    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as Python does: writing then fails with an error
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    return limit


@pytest.fixture
def environment(environment):
    """Processes that can write short files alone keep no compiled modules: Python would keep them cut short."""
    return {**environment, "PYTHONDONTWRITEBYTECODE": "1"}


@pytest.fixture
def walks(tmp_path):
    write_tracks(tmp_path / "run.h5", *random_walkers(6, 200)).close()
    return tmp_path


def test_every_export_names_its_file_and_what_to_do(walks, environment):
    """All formats in one process, as importing them takes longest."""
    program = """
        import resource
        from pathlib import Path
        from crowdsim.errors import CrowdSimError
        from crowdsim.export.formats import FORMATS, export
        from crowdsim.recording.reader import Recording
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        with Recording.open("run.h5") as recording:
            for name in FORMATS:
                target = f"people.{name}" if name != "bvh" else "one.bvh"
                agents = "0" if name == "bvh" else None
                try:
                    export(recording, Path(target), agents=agents)
                except CrowdSimError as error:
                    print(error)
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(command, cwd=walks, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(FORMATS), done.stdout
    for line, name in zip(lines, FORMATS, strict=True):
        assert f"cannot write {'one.bvh' if name == 'bvh' else 'people.' + name} (" in line
        assert "make room on its disk, or choose another place" in line
    assert [file.name for file in walks.iterdir()] == ["run.h5"]


@pytest.mark.parametrize(
    ("arguments", "file"),
    [(["play", "run.h5", "--shot", "a.png", "--time", "1"], "a.png"), (["analyze", "run.h5", "-o", "found"], "found/")],
)
def test_commands_say_it(walks, crowdsim, arguments, file):
    done = crowdsim(*arguments, preexec_fn=limited(ROOM))
    assert done.returncode == 2, done.stderr
    assert f"error: cannot write {file}" in done.stderr
    assert "make room on its disk" in done.stderr


def test_a_recording_that_cannot_be_recovered_for_want_of_room_is_kept(tmp_path, environment):
    header, part = small_header(), b""
    with suppress(ZeroDivisionError), RecordingWriter(tmp_path / "run.h5", header) as writer:
        for step in range(300):
            writer.append(small_frame(header, step), step)
        part = (tmp_path / "run.h5.part").read_bytes()
        raise ZeroDivisionError
    (tmp_path / "run.h5.part").write_bytes(part)
    program = """
        import resource
        from crowdsim.errors import CrowdSimError
        from crowdsim.recording.recovery import recover
        resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
        try:
            recover("run.h5.part")
        except CrowdSimError as error:
            print(error)
    """
    for room in (ROOM, len(part) // 2):
        command = [sys.executable, "-c", textwrap.dedent(program).format(room=room)]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        assert "cannot write run.h5 (" in done.stdout
        assert "make room on its disk" in done.stdout
        assert [file.name for file in tmp_path.iterdir()] == ["run.h5.part"]
    with recover(tmp_path / "run.h5.part") as recording:
        assert recording.steps == 300


def test_kernels_that_cannot_be_stored_are_used_all_the_same(tmp_path, environment):
    program = """
        import resource, warnings
        import numpy as np
        from crowdsim.jit import kernel
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

        @kernel
        def total(values):
            sum_ = 0.0
            for value in values:
                sum_ += value
            return sum_

        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            print(total(np.ones(3)), *{str(each.message) for each in told})
    """
    (tmp_path / "sums.py").write_text(textwrap.dedent(program))
    command, own_cache = [sys.executable, "sums.py"], {**environment, "CROWDSIM_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(command, cwd=tmp_path, env=own_cache, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("3.0 compiled kernels are not stored in ")
    assert "make room on its disk" in done.stdout
