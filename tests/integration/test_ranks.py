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


def on_ranks(count: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(MPIEXEC), "-n", str(count), sys.executable, "-m", "crowdsim", "run", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("street")
    (folder / "street.yaml").write_text(STREET)
    Simulation(load_scenario(str(folder / "street.yaml"))).run(folder / "one.h5").close()
    return folder


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_ranks_give_the_bits_of_one_process(street: Path, count: int) -> None:
    file = street / f"{count}.h5"
    run = on_ranks(count, str(street / "street.yaml"), "-o", str(file), "--json")
    assert run.returncode == 0, run.stderr
    with Recording.open(street / "one.h5") as recording:
        expected = recording.summary
    told = json.loads(run.stdout)
    assert {name: told[name] for name in expected if name != "real_time_factor"} == {
        name: value for name, value in expected.items() if name != "real_time_factor"
    }
    assert figures_of(file) == figures_of(street / "one.h5")


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
