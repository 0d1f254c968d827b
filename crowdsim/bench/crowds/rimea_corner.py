"""RiMEA 15: a large crowd around a corner, compared with straight corridors as long as its inner and its outer wall.

The text of the guideline was not available. As in JuPedSim's test (from RiMEA 3.0), corridors are 20 m wide, with 500
people in the first 6 m, 40 m before the corner and 10 m after it; the straight ones are 50 m and 81.4 m long; and the
corner must take a time between those of both. 81.4 m is 40 m, a quarter of a circle with radius 20 m, and 10 m, so the
outer wall is taken to be that arc, in ARC_PARTS chords; JuPedSim has one oblique wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon, box, intersection, union_all

from crowdsim.bench.crowds.drills import Drill, DrillResult, Group, State, make_agents, run_from
from crowdsim.steering.rules import Rules

COUNT = 500
"""Number of people in each corridor."""

WIDTH = 20.0
"""Width of the corridors, and radius of the outer wall around the inner corner [m]."""

START = 6.0
"""Length of the start region of a corridor [m]: 4.2 people per square meter."""

BEFORE = 40.0
"""Length of the inner wall before the corner, including the start region [m]."""

AFTER = 10.0
"""Length of the walls after the corner [m]."""

INNER = BEFORE + AFTER
"""Length of the inner wall, and of the short straight corridor [m]."""

OUTER = INNER + math.pi / 2.0 * WIDTH
"""Length of the outer wall, and of the long straight corridor [m]."""

ARC_PARTS = 8
"""Number of chords of the outer wall; together they are 0.05 m shorter than the arc."""

GOAL = 3.0
"""Length of the goal region behind the end of a corridor [m]."""

SECONDS = 400.0
"""Time after which a run ends [s]. At 0.5 m/s, the lowest speed drawn, the long corridor takes 163 s."""

SLOTS_ACROSS = 35
"""People side by side at the start: 0.57 m for each, more than any body's breadth."""

SLOTS_ALONG = 15
"""Rows of people at the start, 0.4 m apart."""


@dataclass(frozen=True)
class AroundResult:
    """The same people in the short corridor, around the corner, and in the long corridor."""

    short: DrillResult
    corner: DrillResult
    long: DrillResult

    def lasts(self) -> tuple[float, float, float]:
        """Return the arrival time of the last person in each corridor [s]; nan if not all arrive."""
        return float(self.short.arrived.max()), float(self.corner.arrived.max()), float(self.long.arrived.max())

    def means(self) -> tuple[float, float, float]:
        """Return the mean arrival time in each corridor [s]; nan if not all arrive."""
        return float(self.short.arrived.mean()), float(self.corner.arrived.mean()), float(self.long.arrived.mean())

    def lies_between(self) -> bool:
        """Return whether all arrive, and the corner is between the short and the long corridor.

        This must hold for the last arrival and for the mean arrival time.
        """
        return all(short < corner < long for short, corner, long in (self.lasts(), self.means()))


def run_around(seed: int, count: int = COUNT, rules: Rules | None = None) -> AroundResult:
    """Run test 15 with the same ``count`` people in three corridors; the seed draws people and places."""
    state = draw_crowd(seed, count)
    drills = [straight(INNER), around_corner(), straight(OUTER)]
    return AroundResult(*(run_from(drill, state.copy(), rules=rules) for drill in drills))


def straight(length: float) -> Drill:
    """Return a straight corridor of ``length`` [m], with the goal region, GOAL deep, behind its end."""
    return _drill(f"straight, {length:.1f} m", [box(0, 0, length + GOAL, WIDTH)], box(length, 0, length + GOAL, WIDTH))


def around_corner() -> Drill:
    """Return a corridor that turns left by a right angle around (BEFORE, WIDTH) [m], with the goal behind its end."""
    far = BEFORE + WIDTH
    disc = Point(BEFORE, WIDTH).buffer(WIDTH, quad_segs=ARC_PARTS)
    turn = intersection(disc, box(BEFORE, 0, far, WIDTH))
    after = box(BEFORE, WIDTH, far, WIDTH + AFTER + GOAL)
    end = box(BEFORE, WIDTH + AFTER, far, WIDTH + AFTER + GOAL)
    return _drill("around a corner", [box(0, 0, BEFORE, WIDTH), turn, after], end)


def _drill(name: str, parts: list[Polygon], goal: Polygon) -> Drill:
    """Return a drill in the union of ``parts``, whose people start in the first START meters and go to ``goal``."""
    return Drill(name, union_all(parts), (Group(COUNT, (0.0, 0.0, START, WIDTH), goal),), SECONDS)


def draw_crowd(seed: int, count: int) -> State:
    """Return ``count`` people in random slots of the start region, each displaced a little, facing along the corridor.

    A slot is one of SLOTS_ACROSS times SLOTS_ALONG places of equal size; there must be at least ``count`` of them.
    """
    rng = np.random.default_rng(seed)
    slots = rng.permutation(SLOTS_ACROSS * SLOTS_ALONG)[:count]
    places: NDArray[np.float64] = np.column_stack(
        (
            (slots // SLOTS_ACROSS + 0.5) * START / SLOTS_ALONG + rng.uniform(-0.06, 0.06, count),
            (slots % SLOTS_ACROSS + 0.5) * WIDTH / SLOTS_ACROSS + rng.uniform(-0.008, 0.008, count),
        )
    )
    return make_agents(rng, places, np.zeros(count, np.int64), np.tile((1.0, 0.0), (count, 1)))
