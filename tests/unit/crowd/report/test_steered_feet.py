"""Feet of steered agents stand where they stand and stay over the floor, as the summary of a run says."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.report.steered_feet import LONGEST, SHORTEST, SteeredFeet
from crowdsim.crowd.simulation import Simulation
from crowdsim.ecs.world import View
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.scenario.loader import parse_scenario
from crowdsim.steering.row_kernels import ROW
from tests.support.two_rooms import two_rooms

WALKERS = """\
locomotion: steered, name: visitors, count: 16, start: {rectangle: [0.5, 0.5, 4, 5.5]},
     goal: {rectangle: [10, 0.5, 11.5, 5.5]}"""


def test_a_run_says_how_feet_stand(tmp_path: Path) -> None:
    with Simulation(parse_scenario(two_rooms(WALKERS))).run(tmp_path / "run.h5") as recording:
        assert 0.0 <= recording.summary["stance_foot_speed"] < 0.05
        assert recording.summary["lowest_foot"] >= -0.01


def walk() -> SteeredFeet:
    return SteeredFeet(read_clip(library_folder("behaviors") / "frontal" / "clips" / "walk.bvh"))


NAMES = ("agent", "id", "row", "phase")
"""The columns of :func:`seen`."""


def seen(x: float, phase: float, agent: int = 0, number: int | None = None) -> View:
    row = np.zeros(1, ROW)
    row["x"] = x
    ids = np.array([agent if number is None else number])
    return View({"agent": np.array([agent], np.int32), "id": ids, "row": row, "phase": np.array([phase])})


def test_who_was_in_another_process_meanwhile_may_be_far_off() -> None:
    """Its track has a hole, which the other process fills; such a step would be the end of a periodic floor."""
    feet, others = walk(), walk()
    for step in range(4 * SHORTEST):
        gone = SHORTEST <= step < 2 * SHORTEST
        here, there = (others, feet) if gone else (feet, others)
        here.add(seen(0.13 * step, 0.06))
        there.add(seen(0.0, 0.0, agent=10_000))

    class TwoRanks:
        """Stands for two processes: the rows of the other one come with those of this one."""

        def __init__(self) -> None:
            self.rows: list[NDArray[Any]] = []

        def together(self, rows: NDArray[Any]) -> tuple[NDArray[Any], slice]:
            self.rows.append(rows)
            return np.concatenate(self.rows), slice(None)

    ranks: Any = TwoRanks()
    others.join(ranks)
    feet.join(ranks)
    speed, lowest = feet.measure()
    assert speed is not None
    assert lowest is not None


def test_the_lowest_point_is_told_of_a_body_that_sinks() -> None:
    """Its pelvis is drawn after a body that runs away from its feet; they still stand on the floor."""
    feet = walk()
    for step in range(4 * SHORTEST):
        feet.add(seen(0.01 * step, 0.06))
    speed, lowest = feet.measure()
    assert speed is not None
    assert speed < 0.01
    assert lowest is not None
    assert lowest > -0.01


def test_nobody_says_nothing() -> None:
    feet = walk()
    assert feet.measure() == (None, None)
    for step in range(SHORTEST - 1):
        feet.add(seen(0.0, 0.06 + 0.0 * step))
    assert feet.measure() == (None, None)
    for _ in range(2 * SHORTEST):
        feet.add(seen(0.0, 0.06, agent=10_000))
    assert feet.measure() == (None, None)


def test_what_is_kept_of_a_long_run_does_not_grow() -> None:
    """On a periodic floor, where tracks end again and again, and for who is steered again and again."""
    feet = walk()
    sizes = []
    for step in range(4 * LONGEST):
        if step in (LONGEST, 4 * LONGEST - 1):
            sizes.append(len(pickle.dumps(feet)))
        one, other = seen(0.1 * (step % 50), 0.06), seen(0.1 * step, 0.06, 1, number=1 + step // 30)
        feet.add(View({name: np.concatenate([getattr(each, name) for each in (one, other)]) for name in NAMES}))
    assert sizes[0] == sizes[1]
    speed, lowest = feet.measure()
    assert speed is not None
    assert lowest is not None
