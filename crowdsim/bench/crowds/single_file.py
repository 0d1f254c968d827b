"""RiMEA 16 (4.1.1): speed against density of people who walk one behind the other, in a corridor without ends.

The bands are from the table of percentiles that comes with the guideline. Such people are measured in rings, as that of
Seyfried et al. (2005): 17.3 m along the middle, a lane of 0.8 m. The corridor here is straight and a little longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowdsim.bench.crowds.drills import State, make_agents
from crowdsim.bench.crowds.endless import EndlessResult, shuffled_speeds, walk_endless
from crowdsim.steering.rules import Rules

LENGTH = 20.0
"""Length of the corridor [m]; all densities are whole numbers of people in it."""

LANE = 0.8
"""Width of the measured lane [m]; two who turn their shoulders fit into it side by side."""

NARROW = 0.6
"""Width in which hardly anybody can be overtaken [m]; the broadest bodies have 0.55 m."""

BANDS = {
    0.3: (0.840, 1.473),
    0.5: (0.708, 1.389),
    0.7: (0.598, 1.305),
    0.9: (0.448, 1.101),
    1.1: (0.316, 0.840),
    1.3: (0.187, 0.608),
    1.5: (0.112, 0.485),
    1.7: (0.071, 0.382),
    1.9: (0.048, 0.314),
    2.1: (0.035, 0.270),
    2.3: (0.027, 0.239),
    2.5: (0.022, 0.220),
}
"""Density [1/m] -> 10 % and 90 % of the speeds [m/s] measured in single file, each for a density 0.0011/m lower."""


@dataclass(frozen=True)
class SingleFileResult:
    """What was measured in the corridor, and how many overtook."""

    walked: EndlessResult
    overtaken: int
    """People whom the next person behind them has passed by the end of the run."""


def run_single_file(density: float, width: float, seed: int, rules: Rules | None = None) -> SingleFileResult:
    """Measure the speed at a density [1/m] in a corridor of ``width`` [m]; the seed draws who walks behind whom."""
    state = draw_file(density, width, seed)
    walked = walk_endless(state, LENGTH, width, rules)
    # The file is closed: ahead of the last one, a corridor farther, is the first one.
    ends = state["x"] + walked.gone
    return SingleFileResult(walked, int((np.diff(np.append(ends, ends[0] + LENGTH)) < 0.0).sum()))


def draw_file(density: float, width: float, seed: int) -> State:
    """People in the order of their rows, as far from each other as fit, each pushed a little."""
    rng = np.random.default_rng(seed)
    count = round(density * LENGTH)
    spacing = LENGTH / count
    x = (np.arange(count) + 0.5) * spacing + rng.uniform(-0.05, 0.05, count)
    y = width / 2.0 + rng.uniform(-0.02, 0.02, count)
    state = make_agents(rng, np.column_stack((x, y)), np.zeros(count, np.int64), np.tile((1.0, 0.0), (count, 1)))
    state["gx"] = 1.0
    state["key"] = 2.0 * LENGTH - x
    state["speed"] = shuffled_speeds(rng, count)
    return state
