"""Sweeps give the same table to the byte, however they are run, and whenever they are killed."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import load_scenario
from crowdsim.sweeps.points import points_of
from crowdsim.sweeps.running import Runner
from crowdsim.sweeps.sweep import sweep

ROOM = """\
crowdsim: 1
name: room
seed: 1
duration: 8
floor: {rectangle: [0, 0, 6, 3]}
agents:
  - {locomotion: steered, name: people, count: 2, start: {rectangle: [0.5, 0.5, 2, 2.5]},
     goal: {rectangle: [4.5, 0.5, 5.5, 2.5]}}
lines:
  - {name: middle, points: [[3, 0], [3, 3]]}
"""
OPTIONS = ("--seeds", "1-5", "--set", "agents.0.count=2,3", "--set", "duration=8,wrong")
"""Twenty points, half of which fail."""


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    file = tmp_path_factory.mktemp("room") / "room.yaml"
    file.write_text(ROOM, encoding="utf-8")
    return file


def arguments(room: Path, folder: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "crowdsim", "sweep", str(room), str(folder), *OPTIONS, *more]


def run(room: Path, folder: Path, environment: dict[str, str], *more: str) -> dict:
    finished = subprocess.run(
        arguments(room, folder, "--json", *more), env=environment, capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr
    return json.loads(finished.stdout)


@pytest.fixture(scope="module")
def table(room, tmp_path_factory, environment):
    folder = tmp_path_factory.mktemp("whole")
    summary = run(room, folder, environment, "--jobs", "1")
    assert (summary["points"], summary["failed"], summary["done_before"]) == (20, 10, 0)
    assert (folder / "sweep.png").stat().st_size > 5000
    return (folder / "sweep.csv").read_bytes()


def test_errors_are_rows(table):
    lines = table.decode().splitlines()
    assert len(lines) == 21
    assert sum("duration: " in line and "the text 'wrong'" in line for line in lines[1:]) == 10


def test_more_processes_give_the_same_table_and_a_finished_sweep_runs_nothing(table, room, tmp_path, environment):
    run(room, tmp_path, environment, "--jobs", "2")
    assert (tmp_path / "sweep.csv").read_bytes() == table
    (tmp_path / "sweep.csv").unlink()
    assert run(room, tmp_path, environment, "--jobs", "2")["done_before"] == 20
    assert (tmp_path / "sweep.csv").read_bytes() == table


def test_killed_sweeps_go_on_to_the_same_table(table, room, tmp_path, environment):
    draw = random.Random(5)
    for _ in range(4):
        process = subprocess.Popen(
            arguments(room, tmp_path, "--jobs", "2"),
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        begin = time.monotonic()
        wanted = len(list(tmp_path.glob("points/*.json"))) + draw.randint(1, 3)
        while process.poll() is None and time.monotonic() - begin < 300.0:
            if len(list(tmp_path.glob("points/*.json"))) >= min(wanted, 20):
                break
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert not (tmp_path / "sweep.csv").exists() or (tmp_path / "sweep.csv").read_bytes() == table
    run(room, tmp_path, environment, "--jobs", "2")
    assert (tmp_path / "sweep.csv").read_bytes() == table
    assert not list(tmp_path.glob("points/.*"))


def test_a_process_that_is_killed_loses_nothing(table, room, tmp_path, environment):
    process = subprocess.Popen(arguments(room, tmp_path, "--jobs", "2"), env=environment, stdout=subprocess.DEVNULL)
    killed = 0
    begin = time.monotonic()
    while process.poll() is None and killed < 2 and time.monotonic() - begin < 300.0:
        if len(list(tmp_path.glob("points/*.json"))) > 3 * killed:
            workers = [child for child in children_of(process.pid) if "spawn_main" in command_of(child)]
            if workers:
                os.kill(workers[-1], signal.SIGKILL)
                killed += 1
        time.sleep(0.05)
    assert process.wait(300) == 0
    assert killed == 2
    assert (tmp_path / "sweep.csv").read_bytes() == table


def children_of(parent: int) -> list[int]:
    found = []
    for task in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = task.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            found.append(int(task.parent.name))
    return found


def command_of(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


def test_dask_gives_the_same_table_though_a_worker_is_killed(table, room, tmp_path, environment):
    pytest.importorskip("distributed")
    process = subprocess.Popen(
        arguments(room, tmp_path, "--jobs", "2", "--dask", "local"),
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    killed = False
    begin = time.monotonic()
    while process.poll() is None and not killed and time.monotonic() - begin < 300.0:
        if list(tmp_path.glob("points/*.json")):
            workers = [child for child in children_of(process.pid) if "spawn_main" in command_of(child)]
            os.kill(workers[-1], signal.SIGKILL)
            killed = True
        time.sleep(0.05)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert killed
    assert (tmp_path / "sweep.csv").read_bytes() == table


@pytest.fixture
def dask_programs(tmp_path, environment):
    """Return the address of a scheduler, and its two workers, all started as a user of a cluster starts them."""
    pytest.importorskip("distributed")
    folder = tmp_path / "dask"
    folder.mkdir()
    told = folder / "scheduler.json"

    def start(*words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *words, "--scheduler-file", str(told), "--no-dashboard"]
        with (folder / "log").open("ab") as log:
            return subprocess.Popen(command, env=environment, cwd=folder, stdout=log, stderr=log)

    programs = [start("scheduler", "--port", "0")]
    try:
        begin = time.monotonic()
        while not told.exists() and time.monotonic() - begin < 60.0:
            time.sleep(0.1)
        programs += [start("worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        yield json.loads(told.read_text(encoding="utf-8"))["address"], programs[1:]
    finally:
        for program in reversed(programs):
            program.kill()
            program.wait()


def test_dask_by_address_gives_the_same_table_though_one_of_two_workers_is_killed(
    table, room, tmp_path, environment, dask_programs
):
    address, workers = dask_programs
    folder = tmp_path / "sweep"
    process = subprocess.Popen(
        arguments(room, folder, "--dask", address),
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    begin = time.monotonic()
    while process.poll() is None and time.monotonic() - begin < 300.0:
        if len(list(folder.glob("points/*.json"))) > 2:
            workers[0].kill()
            break
        time.sleep(0.05)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert workers[0].wait(10) == -signal.SIGKILL
    assert workers[1].poll() is None
    assert (folder / "sweep.csv").read_bytes() == table


def test_a_scheduler_that_is_not_there_is_named(room, tmp_path, crowdsim_here, monkeypatch):
    pytest.importorskip("distributed")
    from crowdsim.sweeps import dask_cluster

    monkeypatch.setattr(dask_cluster, "_PATIENCE", "1s")  # nothing comes at this address, however long one waits
    finished = crowdsim_here("sweep", str(room), str(tmp_path), *OPTIONS, "--dask", "tcp://127.0.0.1:9")
    assert finished.returncode == 2
    assert "there is no scheduler" in finished.stderr


@pytest.mark.usefixtures("own_motion")
def test_runs_that_share_motion_are_those_that_do_not(tmp_path):
    runner = Runner()
    for point in points_of("doorway", "1-2"):
        shared = runner.run(point)
        with Simulation(load_scenario("doorway", point.overrides), workers=2).run(tmp_path / "alone.h5") as alone:
            assert shared.figures["state_hash"] == alone.summary["state_hash"]


@pytest.mark.parametrize(("keep", "count"), [("none", 0), ("recordings", 2), ("failures", 1)])
def test_recordings_stay_as_wanted(room, tmp_path, keep, count):
    runner = Runner(tmp_path, keep)
    points = points_of(str(room), "1", ["duration=8,0.5"])
    outcomes = [runner.run(point) for point in points]
    assert [outcome.figures["arrived"] for outcome in outcomes] == [2, 0]
    assert len(list(tmp_path.iterdir())) == count


def test_points_whose_recordings_were_not_kept_are_run_again(room, tmp_path):
    points = points_of(str(room), "1", ["duration=8,0.5,wrong"])
    notes: list[str] = []

    def sweep_again(keep):
        done_before = sweep(points, tmp_path, keep=keep, note=notes.append).done_before
        return done_before, sorted(file.stem for file in tmp_path.glob("recordings/*.h5"))

    assert sweep_again("none") == (0, [])
    assert sweep_again("failures") == (2, [points[1].name])
    assert sweep_again("recordings") == (2, sorted([points[0].name, points[1].name]))
    assert notes == [f"the recordings of 1 points in {tmp_path} were not kept; they are run again"] * 2
    assert sweep_again("recordings")[0] == sweep_again("none")[0] == 3
