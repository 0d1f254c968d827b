"""How commands end that are told to, or that have nobody to move."""

import os
import signal
import subprocess
import sys
from pkgutil import resolve_name

import pytest
from typer.testing import CliRunner

from crowdsim.cli.app import app
from crowdsim.cli.errors_shown import TERMINATED, Terminated, describe
from crowdsim.cli.progress import Interruption, RunProgress
from crowdsim.cli.summary import nobody_arrived
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError
from crowdsim.whole_files import whole_file
from tests.support.small_recording import write_small_recording
from tests.support.steered_scenes import steered_scene

SUMMARY = {
    **{"characters": 3, "removed": 0, "not_added": 0, "arrived": 0, "waiting": 0, "unreachable": {}, "laps": {}},
    **{"lowest_foot": 0.0, "steps": 20},
}


def test_termination_has_its_own_code_and_is_an_interruption():
    assert describe(Terminated()) == ("terminated", TERMINATED)
    assert TERMINATED == 128 + signal.SIGTERM
    assert issubclass(Terminated, KeyboardInterrupt)


def test_a_run_that_is_terminated_ends_after_its_step():
    usual = signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    try:
        with RunProgress("run") as progress:
            progress.begin_steps()
            progress.step(1, 10, None)
            os.kill(os.getpid(), signal.SIGTERM)
            with pytest.raises(Terminated):
                progress.step(2, 10, None)
        assert progress.steps_done == 2
    finally:
        signal.signal(signal.SIGTERM, usual)


@pytest.mark.parametrize(("number", "raised"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_who_makes_a_film_heeds_interruptions_between_pictures(number, raised):
    before = signal.getsignal(number)
    with Interruption() as interruption:
        interruption.heed()
        os.kill(os.getpid(), number)
        with pytest.raises(raised) as caught:
            interruption.heed()
        assert caught.type is raised
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)  # a second time
    assert signal.getsignal(number) is before


@pytest.fixture
def short_run(tmp_path, monkeypatch):
    """The arguments of a run of a second in an empty folder."""
    monkeypatch.chdir(tmp_path)
    group = "name: a, count: 1, start: {point: [1, 1]}, goal: {point: [9, 1]}"
    text = steered_scene(group, floor="{rectangle: [0, 0, 10, 4]}", duration=1)
    (tmp_path / "run.yaml").write_text(text)
    return ["run", "run.yaml", "-o", "run.h5"]


@pytest.mark.parametrize(
    ("during", "options", "told"),
    [
        ("crowdsim.recording.writer.RecordingWriter.finish", [], "run.h5 was written"),
        ("crowdsim.recording.writer.RecordingWriter.finish", ["--page"], "run.h5 was written, run.html was not"),
        ("crowdsim.export.page.page.write_page", ["--page"], "run.h5 was written, run.html was not"),
    ],
)
def test_a_run_that_is_terminated_after_its_steps_tells_what_is_written(
    short_run, monkeypatch, tmp_path, during, options, told
):
    usual, call = signal.getsignal(signal.SIGTERM), resolve_name(during)

    def terminated(*arguments):
        os.kill(os.getpid(), signal.SIGTERM)
        return call(*arguments)

    monkeypatch.setattr(during, terminated)
    try:
        result = CliRunner().invoke(app, [*short_run, *options])
    finally:
        signal.signal(signal.SIGTERM, usual)
    assert result.exit_code == TERMINATED
    assert f"terminated at step 10; {told}\n" in result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "run.yaml"]


class _OneRun:
    """A run of all agents in one process, as the share of one rank."""

    def __init__(self, scenario, comm, workers):
        self.scenario = scenario

    def run(self, file, progress):
        with Simulation(self.scenario).run(file, progress) as recording:
            return dict(recording.summary)


class _OneRank:
    """The communicator of a run on one process."""

    Get_rank = staticmethod(lambda: 0)
    Get_size = staticmethod(lambda: 1)
    allgather = staticmethod(lambda value: [value])
    Abort = staticmethod(sys.exit)


def test_a_page_that_fails_on_ranks_does_not_hide_the_recording(short_run, monkeypatch, tmp_path):
    def fail(*_):
        raise CrowdSimError("no page")

    monkeypatch.setattr("crowdsim.crowd.ranks.launch.launched_ranks", lambda: 2)
    monkeypatch.setattr("crowdsim.crowd.ranks.mpi_ranks.world_of_ranks", _OneRank)
    monkeypatch.setattr("crowdsim.crowd.ranked_run.RankedRun", _OneRun)
    monkeypatch.setattr("crowdsim.export.page.page.write_page", fail)
    result = CliRunner().invoke(app, [*short_run, "--page"])
    assert result.exit_code == 2
    assert "error: no page (rank 0 of 1; run.h5 was written, run.html was not)" in result.output
    assert (tmp_path / "run.h5").exists()
    (tmp_path / "run.h5").unlink()
    (tmp_path / "run.html").mkdir()
    result = CliRunner().invoke(app, [*short_run, "--page"])
    assert result.exit_code == 2
    assert "cannot write run.html: it is a folder" in result.output
    assert not (tmp_path / "run.h5").exists()


def test_a_film_that_is_terminated_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_small_recording(tmp_path / "run.h5")

    def film(recording, path, progress, **camera):
        with whole_file(path, (".mp4",), "films") as written:
            written.write_bytes(b"half")
            os.kill(os.getpid(), signal.SIGTERM)
            progress(1, 2)
            raise AssertionError("the film went on")

    monkeypatch.setattr("crowdsim.playback.film.film", film)
    usual = signal.getsignal(signal.SIGTERM)
    try:
        result = CliRunner().invoke(app, ["play", "run.h5", "--film", "film.mp4"])
    finally:
        signal.signal(signal.SIGTERM, usual)
    assert result.exit_code == TERMINATED
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_terminals_that_know_few_letters_get_their_messages(tmp_path):
    (tmp_path / "p.yaml").write_text("crowdsim: 1\nname: площадь é\n")
    done = subprocess.run(
        [sys.executable, "-m", "crowdsim", "check", "p.yaml"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert b"p.yaml" in done.stderr
    assert b"internal" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["p.yaml"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"unreachable": {0: "no passage", 1: "no passage", 2: "no passage"}}, "no way for 3 of 3"),
        ({"unreachable": {0: "no passage"}, "waiting": 2}, "no way for 1 of 3 agents, 2 still waited"),
        ({"lowest_foot": None}, "no agent appeared within 20 steps"),
    ],
)
def test_where_nobody_could_arrive_it_is_said_why(change, reason):
    assert reason in str(nobody_arrived(SUMMARY | change))
    assert nobody_arrived(SUMMARY | change | {"arrived": 1}) is None


def test_who_is_on_the_way_is_no_failure():
    assert nobody_arrived(SUMMARY) is None
    assert nobody_arrived(SUMMARY | {"lowest_foot": None, "laps": {"round": 2}}) is None
