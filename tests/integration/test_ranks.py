"""A steered run on several processes gives the bits of one; what does not run so is refused, a killed rank ends it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import RecordingError
from crowdsim.recording.header import RecordedFrame
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
areas:
  - {name: before, rectangle: [10, 4, 17, 19]}
  - {name: late, circle: {center: [24, 10], radius: 4}, start_time: 12}
lines:
  - {name: gap, points: [[18, 12], [18, 16], [18, 19]]}
agents:
  - {name: src, locomotion: steered, count: 60, start: {rectangle: [0.5, 1, 3, 19]}, rate: 3,
     exits: [north, south], choice: quickest, attributes: {luggage: {words: {none: 3, bag: 2}}}}
  - {name: tour, locomotion: steered, count: 15, start: {rectangle: [4, 1, 17, 18]},
     goals: [{point: [18.6, 17.5]}, {rectangle: [2, 2, 6, 6]}], wait: 3, on_arrival: stay}
  - {name: back, locomotion: steered, count: 40, start: {rectangle: [20, 1, 35, 18]}, goal: {rectangle: [1, 1, 3, 19]},
     delay: {uniform: [0, 3]}}
"""
"""A door that waits for people, a source, exits by choice, goals in turn with waits, a stay, and delays; measured in
areas, at a line of two pieces, and by an attribute."""

FEW = """\
crowdsim: 1
name: few
seed: 1
duration: 20
floor: {rectangle: [0, 0, 40, 8]}
areas:
  - {name: middle, rectangle: [15, 0, 25, 8]}
agents:
  - {name: one, locomotion: steered, count: 1, start: {rectangle: [1, 1, 11, 7]},
     goal: {rectangle: [30, 1, 39, 7]}}
  - {name: other, locomotion: steered, count: 1, start: {rectangle: [30, 1, 39, 7]},
     goal: {rectangle: [1, 1, 11, 7]}}
"""
"""Fewer agents than processes."""

OWN = """\
crowdsim: 1
name: own
seed: 2
duration: 25
floor: {rectangle: [0, 0, 36, 12]}
obstacles:
  - {name: wall, box: {center: [18, 3], size: [0.4, 6]}, top: 2.5}
  - {name: kiosk, box: {center: [9, 8], size: [2, 2]}, top: 2.5}
doors:
  - {name: gate, initially: open, box: {center: [18, 10.5], size: [0.4, 3]}, top: 2.2}
events:
  - {at: 8, close: gate}
agents:
  - {name: back, locomotion: steered, count: 40, start: {rectangle: [20, 1, 35, 11]}, goal: {rectangle: [1, 1, 3, 11]}}
""" + "".join(
    f"  - {{name: g{k}, locomotion: steered, count: 2, start: {{rectangle: [1, 1, 12, 11]}}, "
    f"goals: [{{point: [{22.5 + k % 9}, 5]}}, {{point: [{11.5 + k}, {1 + k % 4}]}}]}}\n"
    for k in range(18)
)
"""Many goals, each of two agents, who get ways of their own, through others and a door that closes."""


def on_ranks(count: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(MPIEXEC), "-n", str(count), sys.executable, "-m", "crowdsim", "run", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the scenarios and their runs in one process."""
    folder = tmp_path_factory.mktemp("alone")
    for name, text in (("street", STREET), ("plaza", PLAZA), ("few", FEW), ("own", OWN)):
        (folder / f"{name}.yaml").write_text(text)
        Simulation(load_scenario(str(folder / f"{name}.yaml"))).run(folder / f"{name}.h5").close()
    return folder


@pytest.mark.parametrize(
    ("name", "count"), [("few", 1), ("street", 4), ("plaza", 2), ("plaza", 3), ("few", 3), ("own", 3)]
)
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
    with Recording.open(file) as joined, Recording.open(alone / f"{name}.h5") as whole:
        for column in (*RecordedFrame._fields, "state_hash"):
            np.testing.assert_array_equal(getattr(joined, column)[:], getattr(whole, column)[:], column)
        assert joined.scenario_yaml() == whole.scenario_yaml()
        assert joined.changes == whole.changes
    assert [left.name for left in alone.iterdir() if left.suffix not in (".h5", ".yaml")] == []


def test_captured_groups_are_refused(tmp_path: Path) -> None:
    run = on_ranks(2, "corridor", "-o", str(tmp_path / "a.h5"))
    assert run.returncode == 2
    assert run.stderr.count("locomotion: steered") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("which", [0, -1], ids=["first", "last"])
def test_a_killed_rank_ends_the_run(tmp_path: Path, which: int) -> None:
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
        time.sleep(2.0)  # into the steps, so that chunks of them have been written
        victims = [
            int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit() and _is_rank(entry, str(file))
        ]
        assert len(victims) == 2
        os.kill(sorted(victims)[which], signal.SIGKILL)
        told, _ = run.communicate(timeout=60)
    assert run.returncode != 0
    assert "KILLED" in told.upper()  # mpiexec says which of its processes was killed
    left = sorted(entry.name for entry in tmp_path.iterdir())
    assert set(left) <= {"long.yaml", "long.h5.part"}
    with pytest.raises(RecordingError, match="unfinished"):
        Recording.open(part)


def test_the_mpiexec_of_another_library_is_named(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "crowdsim", "run", "corridor", "-o", str(tmp_path / "a.h5")]
    foreign = {**os.environ, "OMPI_COMM_WORLD_SIZE": "2"}  # what Open MPI's mpiexec tells; MPICH does not look at it
    run = subprocess.run(command, env=foreign, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 2
    assert "has started 2 processes" in run.stderr
    assert "use the mpiexec of that library" in run.stderr
    assert list(tmp_path.iterdir()) == []


def _is_rank(entry: Path, file: str) -> bool:
    """Whether a process is one of the run's ranks, not mpiexec or its proxy."""
    try:
        words = (entry / "cmdline").read_bytes().decode().split("\0")
    except OSError:
        return False
    return words[1:4] == ["-m", "crowdsim", "run"] and file in words
