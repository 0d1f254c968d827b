"""A thousand auto agents on a square: arrivals and times compared with JuPedSim, and smallest gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from shapely import Polygon, box

from crowdsim.bench.crowds.drills import Drill, Group, State, make_agents, scatter
from crowdsim.bench.mixed.gaps import LeastGaps
from crowdsim.bench.mixed.jupedsim_crowd import require_jupedsim, walk_anticipating
from crowdsim.bench.mixed.walks import cast_of, scenario_of, walk_mixed
from crowdsim.bench.registry import Measurement

COUNT = 1000
"""Number of people on the square."""

DENSITIES = (0.1, 0.3, 0.6, 1.0)
"""Densities [1/m2]."""

SEEDS = (1,)

SLOWER = 1.5
"""Largest arrival time of the last agent, as a multiple of JuPedSim's, if all arrive there."""

PIECES = 8
"""Number of goals along each side: JuPedSim heads for the middle of a goal, agents here for its nearest point."""

APART = 0.6
"""Least distance of two at the start [m]."""

OFF_EDGE = 0.35
"""Distance from the edge at the start [m]."""

SLOWEST = 0.5
"""Least speed that is drawn [m/s]."""


@dataclass(frozen=True)
class Square:
    """A square of people who want to its four sides, as a drill with one group per goal."""

    drill: Drill
    state: State

    @property
    def goals(self) -> tuple[Polygon, ...]:
        """Return the goals by group."""
        return tuple(group.goal for group in self.drill.groups)


def draw_square(count: int, density: float, seed: int) -> Square:
    """Return people all over a square at a ``density`` [1/m2], about a quarter of them heading for each side.

    A goal is the part of the side that is straight ahead. No one begins in the strip of its goal side. Rows are in the
    order of their goals.
    """
    rng = np.random.default_rng(seed)
    side = math.sqrt(count / density)
    deep = max(0.05 * side, 1.5)  # of the strips with goals along the sides [m]
    places = scatter(rng, count, (OFF_EDGE, OFF_EDGE, side - OFF_EDGE, side - OFF_EDGE), APART)
    ways = np.arange(count) % 4  # east, west, north, south
    ahead = np.where(ways % 2 == 0, side - places[np.arange(count), ways // 2], places[np.arange(count), ways // 2])
    # `ahead` is the distance to the goal side. An agent in its strip, or within a meter of it, gets the opposite side.
    ways = np.where(ahead < deep + 1.0, ways ^ 1, ways)
    along = np.where(ways < 2, places[:, 1], places[:, 0])
    number = ways * PIECES + np.clip((along / side * PIECES).astype(np.int64), 0, PIECES - 1)
    used, goals = np.unique(number, return_inverse=True)
    order = np.argsort(goals, kind="stable")
    whole = (OFF_EDGE, OFF_EDGE, side - OFF_EDGE, side - OFF_EDGE)
    groups = tuple(
        Group(int((goals == k).sum()), whole, _strip(int(piece), side, deep)) for k, piece in enumerate(used)
    )
    facing = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])[ways]
    state = make_agents(rng, places[order], goals[order], facing[order])
    seconds = 60.0 + 3.0 * side / SLOWEST  # ample: the slowest could cross the square three times
    drill = Drill(f"square of {count} at {density:g} /m2", box(0.0, 0.0, side, side), groups, seconds)
    return Square(drill, state)


def _strip(piece: int, side: float, deep: float) -> Polygon:
    """Return a part of the strip ``deep`` meters deep along a side, 0.1 m off the edge; sides are numbered as ways."""
    way, part = divmod(piece, PIECES)
    low, high = part * side / PIECES, (part + 1) * side / PIECES
    near, far = ((side - deep, side - 0.1), (0.1, deep))[way % 2]
    low, high = max(low, 0.1), min(high, side - 0.1)
    return box(near, low, far, high) if way < 2 else box(low, near, high, far)


def square_row(count: int, density: float, seed: int) -> tuple[dict[str, Any], LeastGaps]:
    """Return the row of a square at a density [1/m2], with arrivals here and in JuPedSim, and the smallest gaps here.

    ``failed`` is 1 if an agent is missing here. It is also 1 if all arrive in JuPedSim, and the last one here takes
    more than SLOWER times as long.
    """
    square = draw_square(count, density, seed)
    scenario = scenario_of(square.drill, seed)
    gaps = LeastGaps()
    result = walk_mixed(scenario, cast_of(scenario, square.state), gaps.watch)
    theirs = walk_anticipating(square.state, square.drill.area, square.goals, square.drill.seconds, seed)
    missing, missing_there = int(np.isnan(result.arrived).sum()), int(np.isnan(theirs).sum())
    last, last_there = _last(result.arrived), _last(theirs)
    failed = missing > 0 or (missing_there == 0 and last > SLOWER * last_there)
    row = {
        "people": count,
        "density": density,
        "seed": seed,
        "failed": int(failed),
        "missing": missing,
        "last_s": round(last, 1),
        "mean_s": round(float(np.nanmean(result.arrived)), 1),
        "jupedsim_missing": missing_there,
        "jupedsim_last_s": round(last_there, 1),
        "jupedsim_mean_s": round(float(np.nanmean(theirs)), 1),
        "captured": round(result.captured, 3),
        "agent_steps": gaps.agent_steps,
        "captured_steps": gaps.captured_steps,
        **{f"{kind}_gap": gap for kind, gap in gaps.gaps.items()},
        "reserved_gap": gaps.reserved,
        "ahead_gap": gaps.ahead,
    }
    return row, gaps


def _last(arrived: Any) -> float:
    """Return when the last one arrived, ignoring those that did not; 0 if none did [s]."""
    return float(np.max(arrived, where=np.isfinite(arrived), initial=0.0))


def measure() -> Measurement:
    """Run all squares with all seeds."""
    require_jupedsim()  # refuse at once, not after the first square
    rows, figures = [], {"agent_steps": 0.0}
    least: dict[str, float] = {}
    for density in DENSITIES:
        for seed in SEEDS:
            row, _ = square_row(COUNT, density, seed)
            rows.append(row)
            figures["agent_steps"] += row["agent_steps"]
            for key, value in row.items():
                if key.endswith("_gap"):
                    least[key] = min(least.get(key, math.inf), value)
                elif key not in ("people", "density", "seed"):
                    figures[f"{density:g}_seed_{seed}_{key}"] = float(value)
    figures |= least
    return Measurement(rows, figures, ("agent_steps", *least))
