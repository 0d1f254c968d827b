"""RiMEA 16 (4.1.1): speed against density of people in single file, in an endless corridor.

The bands are from the table of percentiles of the guideline. The experiments used rings, such as that of Seyfried et
al. (2005): 17.3 m along the middle, a lane of 0.8 m. The corridor here is straight and a little longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowdsim.bench.crowds.drills import State, make_agents
from crowdsim.bench.crowds.endless import EndlessResult, shuffled_speeds, walk_endless
from crowdsim.steering.rules import Rules

LENGTH = 20.0
"""Length of the corridor [m]; all densities give whole numbers of people."""

LANE = 0.8
"""Width of the measured lane [m]; two people with turned shoulders fit side by side."""

NARROW = 0.6
"""Width in which hardly anyone can overtake [m]; the broadest bodies measure 0.55 m."""

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
"""Density [1/m] -> 10 and 90 % quantiles of the speeds measured in single file, at a density 0.0011 /m lower [m/s]."""


@dataclass(frozen=True)
class SingleFileResult:
    """Measurement in the corridor, and the number of overtakings."""

    walked: EndlessResult
    overtaken: int
    """Number of people that the person behind has passed by the end of the run."""


def run_single_file(density: float, width: float, seed: int, rules: Rules | None = None) -> SingleFileResult:
    """Measure the speed at a density [1/m] in a corridor of ``width`` [m]; the seed draws the order of people."""
    state = draw_file(density, width, seed)
    walked = walk_endless(state, LENGTH, width, rules)
    # The file is closed: ahead of the last person is the first one, displaced by the length of the corridor.
    ends = state["x"] + walked.gone
    return SingleFileResult(walked, int((np.diff(np.append(ends, ends[0] + LENGTH)) < 0.0).sum()))


def draw_file(density: float, width: float, seed: int) -> State:
    """Return people at a ``density`` [1/m] in the order of their rows, evenly spaced, each displaced a little."""
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
