"""Run the scenarios of tests with several seeds, in parallel processes, and judge them."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario
from crowdsim.scenario.scenario import Scenario
from crowdsim.validate.criteria import Finding
from crowdsim.validate.observed import Observed, observe
from crowdsim.validate.pictures import draw_run
from crowdsim.validate.suite import FOLDER, Case, Test

Progress = Callable[[int, int, str], None]
"""Function of the numbers of runs that are done and of all runs, and the names of the run that has just ended."""


class Outcome(NamedTuple):
    """Result of a test.

    Attributes
    ----------
    test : Test
        The test.
    seeds : tuple of int
        Seeds of the runs.
    findings : tuple of tuple of Finding
        For each figure of the criteria, in the order of the test, its findings: one for each seed.
    hashes : dict of str to tuple of str
        Hashes of the final states, by case, one for each seed.
    seconds : float
        Total computing time of its runs [s].
    """

    test: Test
    seeds: tuple[int, ...]
    findings: tuple[tuple[Finding, ...], ...]
    hashes: dict[str, tuple[str, ...]]
    seconds: float

    @property
    def passed(self) -> bool:
        """Return whether every figure of every seed is within its band."""
        return all(finding.passed for row in self.findings for finding in row)

    @property
    def verdict(self) -> str:
        """Return ``passed`` if all figures are in their bands, ``departs`` or ``failed`` if not.

        It is ``departs`` if the test names all figures outside as departing on purpose.
        """
        outside = {finding.what for row in self.findings for finding in row if not finding.passed}
        if not outside:
            return "passed"
        return "departs" if outside <= set(self.test.departs) else "failed"


def run_tests(
    tests: Sequence[Test],
    seeds: Sequence[int],
    locomotion: str,
    *,
    jobs: int = 1,
    pictures: Path | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Run all cases of tests with all seeds, and judge them.

    Parameters
    ----------
    tests : sequence of Test
        Tests to run.
    seeds : sequence of int
        Seeds of the runs.
    locomotion : str
        Level of all groups, ``auto`` or ``steered``.
    jobs : int
        Number of runs at a time.
    pictures : Path or None
        Folder for a picture of each test's first case with the first seed.
    progress : callable or None
        Called after each run as ``progress(done, all, what)``: numbers of runs, and the names of test, case and seed.

    Returns
    -------
    list of Outcome
        A result for each test, in their order.
    """
    tasks = [(test, case, seed) for test in tests for case in test.cases for seed in seeds]
    found: dict[tuple[str, str, int], Observed] = {}
    # Runs in processes of their own do not compete for threads and the interpreter lock. Of each test, the first case
    # with the first seed also draws the picture.
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = {}
        for test, case, seed in tasks:
            picture = None
            if pictures is not None and case is test.cases[0] and seed == seeds[0]:
                picture = pictures / f"{test.name}.png"
            waiting[pool.submit(run_case, case, seed, locomotion, picture)] = (test.name, case.name, seed)
        for done, future in enumerate(as_completed(waiting), start=1):
            name, case_name, seed = waiting[future]
            found[(name, case_name, seed)] = future.result()
            if progress is not None:
                progress(done, len(tasks), f"{name}, {case_name}, seed {seed}")
    return [judge(test, seeds, found) for test in tests]


def judge(test: Test, seeds: Sequence[int], found: dict[tuple[str, str, int], Observed]) -> Outcome:
    """Apply the criteria of a test to its observed runs, which ``found`` holds by names of test and case, and seed."""
    by_seed = []
    for seed in seeds:
        runs = {case.name: found[(test.name, case.name, seed)] for case in test.cases}
        by_seed.append([finding for criterion in test.criteria for finding in criterion(runs)])
    hashes = {
        case.name: tuple(str(found[(test.name, case.name, seed)].summary["state_hash"]) for seed in seeds)
        for case in test.cases
    }
    seconds = sum(found[(test.name, case.name, seed)].seconds for case in test.cases for seed in seeds)
    return Outcome(test, tuple(seeds), tuple(zip(*by_seed, strict=True)), hashes, seconds)


def load_case(case: Case, seed: int, locomotion: str) -> Scenario:
    """Return the scenario of a case with its changes, the seed, and the level ``locomotion`` for all groups."""
    file = FOLDER / f"{case.scenario}.yaml"
    changes = [f"seed={seed}", *case.changes]
    # Loaded a first time to count the groups, each of which needs a change of its own.
    groups = len(load_scenario(file, changes).agents)
    return load_scenario(file, [*changes, *(f"agents.{k}.locomotion={locomotion}" for k in range(groups))])


def run_case(case: Case, seed: int, locomotion: str, picture: Path | None = None) -> Observed:
    """Run a case in this process and return what criteria need; draw the run into ``picture`` if that file is given."""
    scenario = load_case(case, seed, locomotion)
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        with Simulation(scenario, workers=1).run(Path(folder) / "run.h5") as recording:
            seconds = time.perf_counter() - started
            if picture is not None:
                _draw(scenario, recording, picture)
            return observe(scenario, recording, seconds)


def _draw(scenario: Scenario, recording: Recording, picture: Path) -> None:
    """Draw a run into the file ``picture``; make its folder if necessary."""
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw_run(scenario, recording, picture)
