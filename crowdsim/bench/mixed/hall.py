"""Smallest gaps of a steered crowd in a full hall: between bodies, and to the walls of both layers, within steps too.

Agents walk in sixteen directions between pillars, low benches and boards that only the torso meets; those who come near
the outer walls turn back to the middle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.bench.crowds.drills import LEG_RADIUS, State, make_agents
from crowdsim.bench.crowds.step_times import turn_back
from crowdsim.bench.mixed.gaps import FAR, TIMES, between, core_gaps, cores, near_pairs
from crowdsim.bench.registry import Measurement
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls

DENSITIES = (1.0, 3.0)
"""Agents per area [1/m2]."""

AGENT_STEPS = 1_000_000
"""Steps of agents at each density."""

SIDE = 20.0
"""Side of the hall [m]."""

_PILLARS = [shapely.Point(x, y).buffer(0.3, quad_segs=2) for x in (5.0, 15.0) for y in (5.0, 15.0)]
_BENCHES = [shapely.box(8.0, 9.8, 12.0, 10.2), shapely.box(2.0, 9.9, 3.5, 10.1)]
_BOARDS = [shapely.box(9.9, 3.0, 10.1, 5.0), shapely.box(9.5, 15.9, 10.5, 16.1)]
_TURN_BACK = 1.0  # distance from the outer walls at which agents turn back [m]
_ROOM = 0.32  # distance from obstacles within which nobody begins [m]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class HallGaps(NamedTuple):
    """Smallest gaps [m]: of two bodies, of a body and a wall of the torso's layer, of legs and a wall of theirs."""

    people: float
    torso: float
    legs: float


def hall_gaps(density: float, agent_steps: int, seed: int = 1) -> HallGaps:
    """Let a crowd of a density [1/m2] walk for at least ``agent_steps``; return the smallest gaps [m], at most FAR."""
    torso, legs = (_outlines(_PILLARS + more) for more in (_BOARDS, _BENCHES))
    state = _draw_hall(density, seed, shapely.union_all(_PILLARS + _BOARDS + _BENCHES))
    least = HallGaps(FAR, FAR, FAR)
    with Steering(build_walls(legs), build_walls(torso), leg_radius=LEG_RADIUS) as steering:
        for _ in range(math.ceil(agent_steps / len(state))):
            before = state.copy()
            steering.step(state)
            for part in TIMES:
                found = _gaps(between(before, state, part), torso, legs)
                least = HallGaps(*map(min, least, found))
            turn_back(state, SIDE, _TURN_BACK)
    return least


def measure() -> Measurement:
    """Return the smallest gaps of a crowd at each density."""
    found = {density: hall_gaps(density, AGENT_STEPS) for density in DENSITIES}
    rows = [{"density": density, **gaps._asdict()} for density, gaps in found.items()]
    figures = {f"{density:g}_{name}_m": gap for density, gaps in found.items() for name, gap in gaps._asdict().items()}
    return Measurement(rows, figures)


def _outlines(obstacles: list[Polygon]) -> Floats:
    """Return the walls (n, 4) of the hall and of obstacles [m]."""
    hall = shapely.box(0.0, 0.0, SIDE, SIDE)
    return outline_segments(shapely.difference(hall, shapely.union_all(obstacles)))


def _draw_hall(density: float, seed: int, taken: BaseGeometry) -> State:
    """Return agents in rows all over the hall, facing along x, but none within _ROOM of what is ``taken``."""
    rng = np.random.default_rng(seed)
    across = math.ceil((SIDE - 2.0 * _ROOM) * math.sqrt(density))
    row, column = np.divmod(np.arange(across * across), across)
    places = _ROOM + (np.column_stack((column, row)) + 0.5) * (SIDE - 2.0 * _ROOM) / across
    free = shapely.distance(taken, shapely.points(places)) > _ROOM
    sixteenth = rng.integers(0, 16, int(free.sum()))
    way = np.column_stack((np.cos(sixteenth * math.pi / 8), np.sin(sixteenth * math.pi / 8)))
    state = make_agents(rng, places[free], sixteenth, np.tile([1.0, 0.0], (len(way), 1)))
    state["gx"], state["gy"] = way.T
    state["togo"] = 100.0
    return state


def _gaps(rows: State, torso: Floats, legs: Floats) -> HallGaps:
    """Return the smallest gaps at one time [m] between bodies, and to the walls (k, 4) of both layers.

    Legs are discs of LEG_RADIUS around the center, a torso is the body's capsule.
    """
    places = np.column_stack((rows["x"], rows["y"]))
    begin, end = cores(rows)
    first, second = near_pairs(places).T
    radii = rows["radius"]
    people = core_gaps(begin[first], end[first], begin[second], end[second]) - radii[first] - radii[second]
    body, wall = _beside(len(rows), torso)
    beside = core_gaps(begin[body], end[body], torso[wall, :2], torso[wall, 2:]) - radii[body]
    body, wall = _beside(len(rows), legs)
    below = core_gaps(places[body], places[body], legs[wall, :2], legs[wall, 2:]) - LEG_RADIUS
    return HallGaps(float(people.min(initial=FAR)), float(beside.min()), float(below.min()))


def _beside(bodies: int, walls: Floats) -> tuple[Ints, Ints]:
    """Return all pairs of a body and a wall, as numbers of both, each (bodies * walls,)."""
    body, wall = np.divmod(np.arange(bodies * len(walls)), len(walls))
    return body, wall
