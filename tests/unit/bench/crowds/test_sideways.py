"""Steps in which agents walk sideways at speed, counted beside a slow twin."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np
import pytest

from crowdsim.bench.crowds.sideways import ASKEW, FAST, SidewaysSteps
from crowdsim.steering.row_kernels import ROW


def _walked(rng: np.random.Generator, agents: int, steps: int) -> np.ndarray:
    """Random steps of agents whose turns against their way last for some time, (steps, agents)."""
    found = np.zeros((steps, agents), ROW)
    found["id"] = np.arange(agents)
    turn = np.repeat(rng.choice([0.0, 0.5, 1.2, -1.3], (steps // 3 + 1, agents)), 3, axis=0)[:steps]
    way = rng.uniform(-math.pi, math.pi, (steps, agents))
    speed = rng.choice([0.3, 1.0], (steps, agents), p=[0.1, 0.9])
    found["vx"], found["vy"] = speed * np.cos(way), speed * np.sin(way)
    found["hx"], found["hy"] = np.cos(way + turn), np.sin(way + turn)
    return found


@pytest.mark.parametrize("seed", range(10))
def test_sideways_steps_are_those_of_the_slow_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walked = _walked(rng, 7, 60)
    counted = SidewaysSteps(7, 0.1)
    for number, state in enumerate(walked):
        counted.add(state[: 7 if number < 40 else 4])  # some leave
    fast = sideways = 0
    for agent in range(7):
        steps = walked[: 60 if agent < 4 else 40, agent]
        speed = np.hypot(steps["vx"], steps["vy"])
        apart = np.arccos(np.clip((steps["hx"] * steps["vx"] + steps["hy"] * steps["vy"]) / speed, -1.0, 1.0))
        fast += int((speed >= FAST).sum())
        rows = [len(list(row)) for askew, row in groupby((speed >= FAST) & (apart > ASKEW)) if askew]
        sideways += sum(row for row in rows if row >= 5)
    assert sideways > 0
    assert counted.share() == pytest.approx(sideways / fast)


def test_who_stands_has_no_share() -> None:
    counted = SidewaysSteps(2, 0.1)
    counted.add(np.zeros(2, ROW))
    assert counted.share() == 0.0
