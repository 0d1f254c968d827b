"""Endless corridors, in which speed is measured against density (RiMEA 3.0, test 4).

An agent that leaves at one end comes in at the other. The kernels do not wrap around: before each step, agents within
AHEAD of an end are copied beyond the other end; after the step the copies are deleted. Agents read only the rows from
before the step, so those in the corridor move as if it had no ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from crowdsim.bench.crowds.drills import LEG_RADIUS, SPEED, make_agents
from crowdsim.bench.crowds.sideways import SidewaysSteps
from crowdsim.steering.rules import Rules
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls

LENGTH = 26.0
WIDTH = 2.0
"""Length and width of the corridor [m]."""

AHEAD = 4.0
"""Length at either end that is copied [m], more than agents see."""

SETTLING = 10.0
"""Time before the measurement [s], as in RiMEA's test 4."""

MEASURED = 60.0
"""Duration of the measurement [s]."""

ONE_WAY = {
    0.5: (1.168, 1.594),
    1.0: (0.938, 1.469),
    1.5: (0.844, 1.298),
    2.0: (0.486, 1.019),
    2.5: (0.347, 0.675),
    3.0: (0.291, 0.490),
}
"""Density [1/m2] -> 5 and 95 % quantiles of the speeds in unidirectional corridor flow [m/s].

From the HERMES experiments (Zhang, Klingsch, Schadschneider and Seyfried 2011), 17 runs uo-*, by the classic method C
of PedPy 1.5.1.
"""

BOTH_WAYS = {1.0: 1.0, 2.0: 0.65}
"""Density [1/m2] -> least mean speed if half of the people walk against the other half [m/s]."""


@dataclass(frozen=True)
class EndlessResult:
    """Mean speed along the corridor [m/s], 95 % quantile of the accelerations [m/s2], and distance of each agent."""

    speed: float
    acceleration: float
    gone: NDArray[np.float64]
    """Distance of each agent along +x over the whole run [m]."""
    sideways: float
    """Share of steps at speed that agents go sideways (:mod:`crowdsim.bench.crowds.sideways`)."""


def run_endless(density: float, seed: int, *, both_ways: bool = False, rules: Rules | None = None) -> EndlessResult:
    """Measure the speed at a density [1/m2]; the seed draws places, breadths and the order of speeds."""
    return walk_endless(draw_endless(density, seed, both_ways), LENGTH, WIDTH, rules)


def walk_endless(state: NDArray[Any], length: float, width: float, rules: Rules | None = None) -> EndlessResult:
    """Step agents in an endless corridor, ``length`` long and ``width`` wide [m].

    Speeds and accelerations are measured after SETTLING, distances over the whole run. ``state`` is ROW[n], with ``gx``
    1 or -1 for those who walk along +x or -x; it is left as it is.
    """
    # Two walls along x, longer than the copies reach.
    walls = build_walls(np.array([[-9.0, 0.0, length + 9.0, 0.0], [-9.0, width, length + 9.0, width]]))
    speeds, changes = [], []
    gone = np.zeros(len(state))
    with Steering(walls, walls, leg_radius=LEG_RADIUS, rules=rules) as steering:
        dt = steering.rules.step
        sideways = SidewaysSteps(len(state), dt)
        for step in range(round((SETTLING + MEASURED) / dt)):
            all_of_them = with_copies(state, length)
            steering.step(all_of_them)
            stepped = all_of_them[: len(state)]
            gone += stepped["vx"] * dt
            if step * dt >= SETTLING:
                sideways.add(stepped)
                speeds.append(float(np.mean(stepped["vx"] * stepped["gx"])))
                changes.append(np.hypot(stepped["vx"] - state["vx"], stepped["vy"] - state["vy"]) / dt)
            state = stepped.copy()
            shift(state, -length * np.floor(state["x"] / length))
    acceleration = float(np.quantile(np.concatenate(changes), 0.95))
    return EndlessResult(float(np.mean(speeds)), acceleration, gone, sideways.share())


def with_copies(state: NDArray[Any], length: float = LENGTH) -> NDArray[Any]:
    """Return all agents, then copies of those within AHEAD of an end, placed beyond the other end.

    ``state`` is ROW[n] and left as it is, ``length`` that of the corridor [m]. Ids number the rows returned; ``togo``
    is the distance to a goal far ahead, which none reaches.
    """
    right, left = state[state["x"] < AHEAD], state[state["x"] >= length - AHEAD]
    shift(right, length)
    shift(left, -length)
    found = np.concatenate([state, right, left])
    found["id"] = np.arange(len(found))
    found["togo"] = 2.0 * length - found["gx"] * found["x"]
    return found


def shift(state: NDArray[Any], by: float | NDArray[np.float64]) -> None:
    """Move agents (ROW[n]) in place along +x, by a number or by (n,) [m].

    Their ``key`` is the way left: it changes with the place, so that those farther along keep their priority.
    """
    state["x"] += by
    state["key"] -= state["gx"] * by


def draw_endless(density: float, seed: int, both_ways: bool) -> NDArray[Any]:
    """Return people at a ``density`` [1/m2], at different places of three rows, each displaced a little.

    Their speeds are quantiles of the usual distribution in random order, so that the mean free speed is the same for
    all seeds: that of 26 random draws, as many as at 0.5/m2, would vary by 0.05 m/s (one standard deviation).
    """
    rng = np.random.default_rng(seed)
    # Places half a meter apart along the corridor, in three rows.
    count = round(density * LENGTH * WIDTH)
    columns = round(LENGTH / 0.5)
    slots = rng.permutation(3 * columns)[:count]
    x = 0.25 + 0.5 * (slots // 3) + rng.uniform(-0.1, 0.1, count)
    y = np.array([0.36, 1.0, 1.64])[slots % 3] + rng.uniform(-0.04, 0.04, count)
    goals = np.arange(count) % 2 if both_ways else np.zeros(count, np.int64)
    way = np.where(goals == 0, 1.0, -1.0)
    state = make_agents(rng, np.column_stack((x, y)), goals, np.column_stack((way, np.zeros(count))))
    state["gx"] = way
    # Among agents of one goal the lower key goes first [m]: those farther along. `with_copies` sets togo.
    state["key"] = 2.0 * LENGTH - way * x
    state["speed"] = shuffled_speeds(rng, count)
    return state


def shuffled_speeds(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return free speeds [m/s]: the same quantiles of the usual distribution for all seeds, in random order."""
    speeds: NDArray[np.float64] = np.clip(SPEED + 0.26 * ndtri((np.arange(count) + 0.5) / count), 0.5, 2.2)
    return rng.permutation(speeds)
