"""Small crowds of steered agents in plain places."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering

State = NDArray[np.void]


def agents(
    places: NDArray[np.float64], headings: NDArray[np.float64], goals: NDArray[np.int64], rng: np.random.Generator
) -> State:
    """Return agents of usual breadth and speed that stand at ``places`` and want to go where they face."""
    count = len(places)
    state = np.zeros(count, ROW)
    state["x"], state["y"] = places.T
    state["heading"] = headings
    state["hx"], state["hy"] = np.cos(headings), np.sin(headings)
    state["radius"] = 0.125
    state["half"] = state["rest"] = np.clip(rng.normal(0.46, 0.03, count), 0.38, 0.55) / 2 - 0.125
    state["speed"] = np.clip(rng.normal(1.34, 0.26, count), 0.5, 2.2)
    state["share"] = rng.random(count)
    state["goal"] = goals
    state["id"] = np.arange(count)
    state["turn"] = state["held"] = -1.0
    state["gx"], state["gy"] = state["hx"], state["hy"]
    state["togo"] = 100.0
    return state


def scatter(
    rng: np.random.Generator, count: int, low: tuple[float, float], high: tuple[float, float]
) -> NDArray[np.float64]:
    """Return random places at least 0.56 m apart in a rectangle."""
    places: list[NDArray[np.float64]] = []
    for _ in range(200 * count):
        place = rng.uniform(low, high)
        if all(np.hypot(*(place - each)) > 0.56 for each in places):
            places.append(place)
        if len(places) == count:
            return np.array(places)
    raise ValueError(f"no room for {count} agents between {low} and {high}")


def toward(state: State, x: NDArray[np.float64] | float, y: NDArray[np.float64] | float) -> None:
    """Guide all agents straight to a point."""
    dx, dy = x - state["x"], y - state["y"]
    state["togo"] = np.hypot(dx, dy)
    state["gx"], state["gy"] = dx / state["togo"], dy / state["togo"]


def walk(
    steering: Steering,
    state: State,
    guide: Callable[[State], None],
    there: Callable[[State], NDArray[np.bool_]],
    seconds: float,
) -> NDArray[np.float64]:
    """Step until all agents are ``there``, where they leave, or the time is up.

    Returns when each arrived [s], nan for those that did not.
    """
    arrived = np.full(len(state), np.nan)
    step = steering.rules.step
    for count in range(round(seconds / step)):
        guide(state)
        steering.step(state)
        done = there(state)
        arrived[state["id"][done]] = (count + 1) * step
        state = state[~done]
        if not len(state):
            break
    return arrived
