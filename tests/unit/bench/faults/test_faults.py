"""Random faults, a small part of what `crowdsim bench robustness` counts; CROWDSIM_NIGHTLY=1 runs the long part."""

import os

import numpy as np
import pytest

from crowdsim.bench.faults import cases
from crowdsim.bench.faults.mesh_edits import GROUNDS, edit_at_random
from crowdsim.bench.faults.mutations import mutated
from crowdsim.bench.faults.watched import run_cases
from crowdsim.errors import CrowdSimError
from tests.support.small_recording import write_small_recording

CASES = "crowdsim.bench.faults.cases:"
NIGHTLY = bool(os.environ.get("CROWDSIM_NIGHTLY"))

HUNG = (0, 13, 15, 18, 29, 91, 103, 175, 291)
"""Sequences of edits that went on for ever: a walk around a vertex next to a wall, and windings off by one."""


def test_edits_that_hung_end():
    tally = run_cases(CASES + "edited_mesh", HUNG)
    assert tally.failures == []
    assert sum(tally.outcomes.values()) == len(HUNG)


def test_random_edits_neither_hang_nor_crash():
    count = 100_000 if NIGHTLY else 60
    tally = run_cases(CASES + "edited_mesh", range(1000, 1000 + count))
    assert tally.failures == []
    assert sum(tally.outcomes.values()) == count


def test_edits_are_on_all_grounds_and_do_something():
    assert len(GROUNDS) == 3
    assert edit_at_random(4, steps=6) == 0


@pytest.mark.parametrize(
    ("case", "count"), [("mutated_scenario", 40), ("mutated_clip", 60), ("mutated_recording", 60), ("damaged_map", 20)]
)
def test_faulty_files_are_read_or_refused(case, count, monkeypatch, tmp_path):
    write_small_recording(tmp_path / "small.h5")
    monkeypatch.setenv(cases.RECORDINGS, str(tmp_path))
    tally = run_cases(CASES + case, range(50 * count if NIGHTLY else count))
    assert tally.failures == []
    assert tally.outcomes.get(cases.REFUSED, 0) + tally.outcomes.get(cases.ANEW, 0) > 0


def test_a_folder_without_recordings_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv(cases.RECORDINGS, str(tmp_path))
    with pytest.raises(CrowdSimError, match=f"{cases.RECORDINGS}: there is no recording"):
        cases.mutated_recording(0)


def test_killed_runs_are_recovered_to_the_last_step():
    tally = run_cases(CASES + "killed_run", range(100 if NIGHTLY else 4), seconds=120.0)
    assert tally.failures == []
    assert tally.outcomes == {cases.FINE: 100 if NIGHTLY else 4}


def test_damaged_kernels_are_compiled_anew():
    tally = run_cases(CASES + "damaged_kernel", range(4), seconds=120.0)
    assert tally.failures == []
    assert tally.outcomes.get(cases.ANEW, 0) > 0


@pytest.mark.parametrize(
    ("name", "outcome"), [("_loops", "hung"), ("_prints", "hung"), ("_dies", "crashed"), ("_raises", "untyped")]
)
def test_a_watched_case_that_fails_is_counted(name, outcome, monkeypatch, tmp_path):
    source = tmp_path / "failing_cases.py"
    source.write_text(
        "import os, time\n"
        "def _loops(n):\n    while n % 2: pass\n    return 'fine'\n"
        "def _prints(n):\n    while n % 2: print(n, flush=True); time.sleep(0.1)\n    return 'fine'\n"
        "def _dies(n):\n    if n % 2: os.abort()\n    return 'fine'\n"
        "def _raises(n):\n    if n % 2: raise KeyError(n)\n    return 'fine'\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    tally = run_cases(f"failing_cases:{name}", range(4), seconds=1.0)
    assert tally.outcomes == {"fine": 2, outcome: 2}
    assert [number for number, _ in tally.failures] == [1, 3]
    assert tally.failed == 2


@pytest.mark.parametrize("printed", ["a line\\n", "[ no outcome\\n", "[0, null]\\n", "no end of line"])
def test_what_a_watched_case_prints_is_not_taken_for_its_outcome(printed, monkeypatch, tmp_path):
    source = tmp_path / "printing_cases.py"
    source.write_text(f"def case(n):\n    print('{printed}', end='', flush=True)\n    return 'fine'\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert run_cases("printing_cases:case", range(3), seconds=2.0).outcomes == {"fine": 3}


def test_mutations_are_told_by_their_number():
    content = b"HIERARCHY 1.5 2.5\nname: corridor\n" * 20
    one, other = (mutated(content, np.random.default_rng(seed), text=True) for seed in (1, 1))
    assert one == other != content
