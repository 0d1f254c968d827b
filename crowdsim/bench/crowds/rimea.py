"""Tests of the RiMEA guideline (3.0 and 4.1.1) for one floor that are no drills: 1, 6 and 12."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from shapely import box, contains_xy, union_all

from crowdsim.bench.crowds.drills import Drill, DrillResult, Group, State, make_agents, run_drill, run_from
from crowdsim.steering.rules import Rules

TRANSIT = (26.0, 34.0)
"""Seconds that 40 m at 1.33 m/s may take (test 1): a walking speed of 1.33 m/s less or more 5 %, rounded outwards."""

CORNER_SECONDS = 60.0
"""Time after which all have to be around the corner (test 6) [s]."""

QUEUE_SIDE = 3.0
"""Across, of the areas before both necks in which those who wait are counted (test 12) [m]."""

QUEUE_DEPTH = 2.0
"""Along, of these areas [m]."""

TOP = 10
"""Largest counts of the areas whose mean is compared (test 12)."""


@dataclass(frozen=True)
class QueueResult:
    """Who waited before the first and the second of two necks of one width (test 12)."""

    drill: DrillResult
    peaks: tuple[int, int]
    """Most people in the area before each."""
    means: tuple[float, float]
    """Mean of the TOP largest counts, one a step."""
    flows: tuple[float, float]
    """People a second through each, between the first and the last tenth of them."""

    def queues_first(self) -> bool:
        """Whether people wait before the first neck only: the second lets through all that come."""
        return (
            self.peaks[0] > self.peaks[1] and self.means[0] > self.means[1] and self.flows[0] - self.flows[1] >= -0.05
        )


def transit_time(seed: int, rules: Rules | None = None) -> float:
    """Test 1: time that one person of 1.33 m/s takes for 40 m of a corridor of 2 m [s]."""
    drill, state, watch = transit(seed)
    run_from(drill, state, rules=rules, watch=watch.watch)
    return watch.time


@dataclass
class TransitWatch:
    """Takes the time in which the first person gets from one line to another one."""

    passed: dict[float, float] = field(default_factory=dict)

    def watch(self, time: float, now: State) -> None:
        """Take in one step."""
        for line in (0.0, 40.0):
            if line not in self.passed and now["x"][0] >= line:
                # Between two steps it walks evenly.
                self.passed[line] = time - float((now["x"][0] - line) / now["vx"][0])

    @property
    def time(self) -> float:
        """Between both lines [s]."""
        return self.passed[40.0] - self.passed[0.0]


def transit(seed: int) -> tuple[Drill, State, TransitWatch]:
    """Test 1: the corridor, the one person, and who takes its time."""
    area = box(-2.0, 0.0, 44.0, 2.0)
    drill = Drill("corridor of 40 m", area, (Group(1, (-1.6, 0.6, -0.8, 1.4), box(42.0, 0.0, 44.0, 2.0)),), 60.0)
    place = np.random.default_rng(seed).uniform((-1.6, 0.6), (-0.8, 1.4), (1, 2))
    state = make_agents(np.random.default_rng(seed), place, np.zeros(1, np.int64), np.array([[1.0, 0.0]]))
    state["speed"] = 1.33
    return drill, state, TransitWatch()


CORNER = Drill(
    "corner",
    union_all([box(0, 0, 12, 2), box(10, 0, 12, 12)]),
    (Group(20, (0.3, 0.3, 5.7, 1.7), box(10, 11, 12, 12)),),
    2.0 * CORNER_SECONDS,
)
"""Test 6: 20 people around a corner between corridors of 2 m."""


def run_corner(seed: int, rules: Rules | None = None) -> tuple[DrillResult, int]:
    """Test 6, and how often somebody was in a wall."""
    outside = 0

    def watch(_: float, now: State) -> None:
        nonlocal outside
        outside += int((~contains_xy(CORNER.area, now["x"], now["y"])).sum())

    return run_drill(CORNER, seed, rules=rules, watch=watch), outside


NECKS = Drill(
    "two necks",
    union_all([box(0, 0, 10, 10), box(10, 4.5, 15, 5.5), box(15, 0, 25, 10), box(25, 4.5, 28, 5.5)]),
    (Group(150, (0.3, 0.3, 7.7, 9.7), box(27, 4.5, 28, 5.5)),),
    300.0,
)
"""Test 12: 150 people through two necks of 1 m, one behind the other."""

_MOUTHS = (10.0, 25.0)  # meters along


class QueueWatch:
    """Counts who waits before each neck, and when they go through."""

    def __init__(self) -> None:
        self._waiting: tuple[list[int], list[int]] = ([], [])
        self._passed = np.full((2, 150), np.nan)

    def watch(self, time: float, now: State) -> None:
        """Take in one step."""
        for k, x in enumerate(_MOUTHS):
            near = (now["x"] > x - QUEUE_DEPTH) & (now["x"] < x) & (np.abs(now["y"] - 5.0) < QUEUE_SIDE / 2.0)
            self._waiting[k].append(int(near.sum()))
            through = now["id"][now["x"] >= x]
            self._passed[k, through] = np.fmin(self._passed[k, through], time)

    def result(self, drill: DrillResult) -> QueueResult:
        """What came of it."""
        largest = [np.sort(counts)[::-1][:TOP] for counts in self._waiting]
        first, second = (DrillResult(times, 0.0).flow() for times in self._passed)
        return QueueResult(
            drill,
            (int(largest[0][0]), int(largest[1][0])),
            (float(largest[0].mean()), float(largest[1].mean())),
            (first, second),
        )


def run_queue(seed: int, rules: Rules | None = None) -> QueueResult:
    """Test 12, and who waits before each neck."""
    queue = QueueWatch()
    return queue.result(run_drill(NECKS, seed, rules=rules, watch=queue.watch))
