"""A steered run on several processes gives the bits of one; what does not run so is refused, a killed rank ends it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario
from tests.support.golden import figures_of
from tests.support.steered_scenes import steered_scene

MPIEXEC = Path(sys.executable).parent / "mpiexec"
STREET = steered_scene(
    "name: east, count: 60, start: {rectangle: [1, 1, 11, 7]}, goal: {rectangle: [36, 1, 39, 7]}",
    "name: west, count: 60, start: {rectangle: [29, 1, 39, 7]}, goal: {rectangle: [1, 1, 4, 7]}",
    floor="{rectangle: [0, 0, 40, 8]}",
    duration=30.0,
)


PLAZA = """\
crowdsim: 1
name: plaza
seed: 4
duration: 25
floor: {rectangle: [0, 0, 36, 20]}
obstacles:
  - {name: wall, box: {center: [18, 6], size: [0.4, 12]}, top: 2.5}
  - {name: kiosk, box: {center: [9, 10], size: [2, 2]}, top: 2.5}
doors:
  - {name: gate, initially: open, box: {center: [18, 14], size: [0.4, 4]}, top: 2.2}
exits:
  - {name: north, rectangle: [30, 18.5, 35, 19.8]}
  - {name: south, rectangle: [30, 0.2, 35, 1.5]}
events:
  - {at: 8, close: gate}
  - {at: 18, open: gate}
agents:
  - {name: src, locomotion: steered, count: 60, start: {rectangle: [0.5, 1, 3, 19]}, rate: 3,
     exits: [north, south], choice: quickest}
  - {name: tour, locomotion: steered, count: 15, start: {rectangle: [4, 1, 17, 18]},
     goals: [{rectangle: [20, 16, 24, 19]}, {rectangle: [2, 2, 6, 6]}], wait: 3, on_arrival: stay}
  - {name: back, locomotion: steered, count: 40, start: {rectangle: [20, 1, 35, 18]}, goal: {rectangle: [1, 1, 3, 19]},
     delay: {uniform: [0, 3]}}
"""
"""A door that waits for people, a source, exits by choice, goals in turn with waits, a stay, and delays."""


def on_ranks(count: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(MPIEXEC), "-n", str(count), sys.executable, "-m", "crowdsim", "run", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with both scenarios and their runs in one process."""
    folder = tmp_path_factory.mktemp("alone")
    for name, text in (("street", STREET), ("plaza", PLAZA)):
        (folder / f"{name}.yaml").write_text(text)
        Simulation(load_scenario(str(folder / f"{name}.yaml"))).run(folder / f"{name}.h5").close()
    return folder


@pytest.mark.parametrize(("name", "count"), [("street", 1), ("street", 2), ("street", 4), ("plaza", 2), ("plaza", 3)])
def test_ranks_give_the_bits_of_one_process(alone: Path, name: str, count: int) -> None:
    file = alone / f"{name}-{count}.h5"
    run = on_ranks(count, str(alone / f"{name}.yaml"), "-o", str(file), "--json", "--workers", "1")
    assert run.returncode == 0, run.stderr
    with Recording.open(alone / f"{name}.h5") as recording:
        expected = recording.summary
    told = json.loads(run.stdout)
    assert {key: told[key] for key in expected if key != "real_time_factor"} == {
        key: value for key, value in expected.items() if key != "real_time_factor"
    }
    assert figures_of(file) == figures_of(alone / f"{name}.h5")


def test_captured_groups_are_refused(tmp_path: Path) -> None:
    run = on_ranks(2, "corridor", "-o", str(tmp_path / "a.h5"))
    assert run.returncode == 2
    assert run.stderr.count("locomotion: steered") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_killed_rank_ends_the_run(tmp_path: Path) -> None:
    long = steered_scene(
        "name: round, count: 60, start: {rectangle: [1, 1, 39, 7]}, repeat: forever, "
        "goals: [{rectangle: [36, 1, 39, 7]}, {rectangle: [1, 1, 4, 7]}]",
        floor="{rectangle: [0, 0, 40, 8]}",
        duration=3000.0,
    )
    (tmp_path / "long.yaml").write_text(long)
    file = tmp_path / "long.h5"
    command = [str(MPIEXEC), "-n", "2", sys.executable, "-m", "crowdsim", "run", str(tmp_path / "long.yaml")]
    with subprocess.Popen(
        [*command, "-o", str(file)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as run:
        part = file.with_name("long.h5.part")
        until = time.monotonic() + 120.0
        while not part.exists() and run.poll() is None and time.monotonic() < until:
            time.sleep(0.2)
        assert part.exists()
        victims = [
            int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit() and _is_rank(entry, str(file))
        ]
        os.kill(max(victims), signal.SIGKILL)
        told, _ = run.communicate(timeout=60)
    assert run.returncode != 0
    assert told.strip()
    assert not file.exists()


def _is_rank(entry: Path, file: str) -> bool:
    """Whether a process is one of the run's ranks, not mpiexec or its proxy."""
    try:
        words = (entry / "cmdline").read_bytes().decode().split("\0")
    except OSError:
        return False
    return words[1:4] == ["-m", "crowdsim", "run"] and file in words
