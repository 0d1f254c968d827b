"""Places in which crowds must not jam, from evacuation tests and studies of pedestrians.

Counterflow (IMO MSC.1/Circ.1533, test 8), doors, crossings, bottlenecks (Seyfried 2009), and a circle on which all
agents change sides. Endless corridors are in ``endless.py``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, box, union_all
from shapely.geometry.base import BaseGeometry

from crowdsim.behaviors.behavior import list_behaviors
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.bench.crowds.sideways import SidewaysSteps
from crowdsim.constants import STEERING_RATE
from crowdsim.library import library_folder
from crowdsim.planning.query.requirements import Requirements
from crowdsim.recording.measured import flow_of
from crowdsim.steering.guidance.field import asked_of
from crowdsim.steering.guidance.ground import build_ground
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.rules import Rules
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import Walls, build_walls

LEG_RADIUS = 0.125
"""Radius of bodies' capsules, and of the disc around both legs [m]."""

SPEED = 1.34
"""Mean free walking speed of pedestrians [m/s] (Weidmann 1993)."""

CIRCLE_SPACING = 0.775
"""Distance between neighbors on the circle at the start, along it [m]."""

THERE = 0.3
"""Distance from its goal at which an agent of a circle has arrived [m]."""

State = NDArray[Any]
"""Agents, ROW[n]: records of :data:`crowdsim.steering.row_kernels.ROW`."""
Guide: TypeAlias = Callable[[State], None]
"""Function that sets the fields gx, gy and togo of all rows, togo to 0 for agents that have arrived.

It may also set turn and held."""


@cache
def _needs() -> tuple[Requirements, NDArray[np.float64]]:
    """Return what the built-in behaviors require of an environment with one layer, and the bodies that they prescribe.

    The latter are (n, 2), see :func:`~crowdsim.steering.guidance.field.asked_of`.
    """
    behaviors = load_behavior_set(list_behaviors(library_folder("behaviors")), [(0.0, 2.0)]).behaviors
    return Requirements.of(behaviors, 1, 0.0), asked_of(behaviors)


@dataclass(frozen=True)
class Group:
    """Agents that start in a rectangle (x0, y0, x1, y1) and go to a region [m]."""

    count: int
    start: tuple[float, float, float, float]
    goal: BaseGeometry


@dataclass(frozen=True)
class Drill:
    """A place and the agents in it, which walk until all have arrived or ``seconds`` have passed."""

    name: str
    area: Polygon
    groups: tuple[Group, ...]
    seconds: float


@dataclass(frozen=True)
class DrillResult:
    """Arrival time of each agent [s], nan if it did not arrive, and the 95 % quantile of accelerations [m/s2].

    ``sideways`` is the share of steps at speed that agents go sideways (:mod:`crowdsim.bench.crowds.sideways`).
    """

    arrived: NDArray[np.float64]
    acceleration: float
    sideways: float

    def flow(self) -> float:
        """Return the flow of arrivals [1/s], as :func:`~crowdsim.recording.measured.flow_of`; 0 if it gives none."""
        return flow_of(np.sort(self.arrived[np.isfinite(self.arrived)])) or 0.0


def counterflow(against: int) -> Drill:
    """Return 100 people in a corridor of 2 m by 10 m, against ``against`` others (IMO test 8)."""
    area = union_all([box(0, 0, 10, 10), box(10, 4, 20, 6), box(20, 0, 30, 10)])
    groups = [Group(100, (0.4, 0.4, 9.0, 9.6), box(22, 0.3, 29.7, 9.7))]
    if against:
        groups.append(Group(against, (21.0, 0.4, 29.6, 9.6), box(0.3, 0.3, 8, 9.7)))
    return Drill(f"counterflow 100 against {against}", area, tuple(groups), 200.0)


def door(each: int, width: float) -> Drill:
    """Return ``each`` people on either side of a door ``width`` [m] wide, who want to the other side."""
    low, high = 4.0 - width / 2, 4.0 + width / 2
    area = union_all([box(0, 0, 7.9, 8), box(7.9, low, 8.1, high), box(8.1, 0, 16, 8)])
    groups = (
        Group(each, (2.5, 1.5, 6.5, 6.5), box(11, 0.3, 15.7, 7.7)),
        Group(each, (9.5, 1.5, 13.5, 6.5), box(0.3, 0.3, 5, 7.7)),
    )
    return Drill(f"door of {width:g} m, {each} + {each}", area, groups, 90.0)


def bottleneck(width: float) -> Drill:
    """Return 150 people before an opening ``width`` [m] wide and 5 m long."""
    area = union_all([box(-13, -4, 0, 4), box(0, -width / 2, 5, width / 2), box(5, -4, 12, 4)])
    group = Group(150, (-11.5, -3.5, -1.5, 3.5), box(6, -3.7, 11.7, 3.7))
    return Drill(f"bottleneck of {width:g} m", area, (group,), 200.0)


def parting(goals: int, width: float) -> Drill:
    """Return 100 people before a door ``width`` [m] wide, behind which ``goals`` goals lie side by side.

    As many go to each of them, from anywhere before the door.
    """
    low, high = 5.0 - width / 2, 5.0 + width / 2
    area = union_all([box(-11, 0, 0, 10), box(0, low, 0.2, high), box(0.2, 0, 8, 10)])
    edges = np.linspace(0.3, 9.7, goals + 1).tolist()
    groups = [Group(100 // goals, (-10.0, 0.5, -1.0, 9.5), box(6, edges[k], 7.7, edges[k + 1])) for k in range(goals)]
    return Drill(f"door of {width:g} m, 100 to {goals} goals", area, tuple(groups), 120.0)


def crossing(each: int) -> Drill:
    """Return two crossing corridors, 4 m wide, which ``each`` people walk in each of the four directions."""
    area = union_all([box(-14, -2, 14, 2), box(-2, -14, 2, 14)])
    east, west = box(12, -1.7, 13.7, 1.7), box(-13.7, -1.7, -12, 1.7)
    north, south = box(-1.7, 12, 1.7, 13.7), box(-1.7, -13.7, 1.7, -12)
    groups = (
        Group(each, (-13, -1.6, -4, 1.6), east),
        Group(each, (4, -1.6, 13, 1.6), west),
        Group(each, (-1.6, -13, 1.6, -4), north),
        Group(each, (-1.6, 4, 1.6, 13), south),
    )
    return Drill(f"crossing of 4 x {each}", area, groups, 120.0)


def run_drill(drill: Drill, seed: int, *, rules: Rules | None = None, threads: int = 1) -> DrillResult:
    """Run a drill; the seed draws places, breadths and speeds."""
    return run_from(drill, draw_agents(drill, seed), rules=rules, threads=threads)


def run_from(drill: Drill, state: State, *, rules: Rules | None = None, threads: int = 1) -> DrillResult:
    """Run a drill from a state, in which a row's ``goal`` is the index of its group and its ``id`` that of the row.

    ``state`` is changed, see :func:`walk`.
    """
    need, asked = _needs()
    segments = outline_segments(drill.area)
    guidance = Guidance(build_ground([segments], need), [group.goal for group in drill.groups], asked)
    followed = np.full(len(state), PLAIN, np.int32)
    steps = itertools.count()

    def guide(state: State) -> None:
        """Renew the field of one goal if it is its turn, and guide agents along the fields that they follow."""
        following = followed[state["id"]]
        guidance.refresh_in_turn(next(steps), STEERING_RATE, state, following)
        guidance.write(state, following)
        followed[state["id"]] = following

    return walk(state, build_walls(segments), guide, drill.seconds, rules, threads)


def run_circle(count: int, seed: int, *, rules: Rules | None = None, threads: int = 1) -> tuple[DrillResult, float]:
    """Let agents on a circle go to the opposite points, all at SPEED; also return the time of a single agent [s].

    There are no walls, so each agent is guided along the straight line.
    """
    state = circle_state(count, seed)
    places = np.column_stack((state["x"], state["y"]))

    def guide(state: State) -> None:
        """Guide each agent straight to the point opposite its start."""
        ahead = -places[state["id"]] - np.column_stack((state["x"], state["y"]))
        apart = np.hypot(*ahead.T)
        state["togo"] = np.where(apart < THERE, 0.0, apart)
        state["gx"], state["gy"] = (ahead / np.maximum(apart, THERE)[:, None]).T

    free = (CIRCLE_SPACING * count / math.pi - THERE) / SPEED  # across the circle, up to THERE from the goal
    return walk(state, build_walls(np.empty((0, 4))), guide, 10.0 * free, rules, threads), free


def walk(
    state: State,
    walls: Walls,
    guide: Guide,
    seconds: float,
    rules: Rules | None = None,
    threads: int = 1,
) -> DrillResult:
    """Step agents until all have arrived, for at most ``seconds``; an agent that has arrived leaves.

    ``guide`` is called before each step: it sets ``gx``, ``gy`` and ``togo`` of all rows, the latter to 0 for those
    that have arrived. The ``id`` of a row is its index in ``state``. That array is changed in place until the first
    agent leaves; then a copy of the rest goes on.
    """
    arrived = np.full(len(state), np.nan)
    changes = []
    with Steering(walls, walls, leg_radius=LEG_RADIUS, rules=rules, threads=threads) as steering:
        dt = steering.rules.step
        sideways = SidewaysSteps(len(state), dt)
        for step in range(round(seconds / dt)):
            guide(state)
            before = state[["vx", "vy"]].copy()
            steering.step(state)
            changes.append(np.hypot(state["vx"] - before["vx"], state["vy"] - before["vy"]) / dt)
            sideways.add(state)
            there = state["togo"] == 0.0
            arrived[state["id"][there]] = (step + 1) * dt
            state = state[~there]
            if not len(state):
                break
    return DrillResult(arrived, float(np.quantile(np.concatenate(changes), 0.95)), sideways.share())


def circle_state(count: int, seed: int) -> State:
    """Return agents CIRCLE_SPACING apart on a circle around (0, 0), facing the opposite points.

    Each has a goal of its own. The seed moves them along the circle by up to a tenth of the spacing.
    """
    rng = np.random.default_rng(seed)
    radius = CIRCLE_SPACING * count / (2.0 * math.pi)
    angles = 2.0 * math.pi * (np.arange(count) + rng.uniform(-0.1, 0.1, count)) / count
    places = radius * np.column_stack((np.cos(angles), np.sin(angles)))
    state = make_agents(rng, places, np.arange(count), -places)
    state["speed"] = SPEED
    return state


def draw_agents(drill: Drill, seed: int) -> State:
    """Return agents at random places of their groups' rectangles, at least 0.52 m apart.

    Breadths are N(0.46, 0.03) m within [0.38, 0.55], speeds N(1.34, 0.26) m/s within [0.5, 2.2] (Weidmann 1993).
    """
    rng = np.random.default_rng(seed)
    # Groups that start in one rectangle stand side by side in the list, and must not stand on each other.
    starts = itertools.groupby(drill.groups, key=lambda group: group.start)
    places = np.concatenate([scatter(rng, sum(each.count for each in groups), within) for within, groups in starts])
    goals = np.repeat(np.arange(len(drill.groups)), [group.count for group in drill.groups])
    middles = np.array([[group.goal.centroid.x, group.goal.centroid.y] for group in drill.groups])[goals]
    return make_agents(rng, places, goals, middles - places)


def make_agents(
    rng: np.random.Generator, places: NDArray[np.float64], goals: NDArray[np.int64], facing: NDArray[np.float64]
) -> State:
    """Return agents of usual breadth and speed at ``places`` (n, 2) [m], facing along ``facing`` (n, 2), of any length.

    ``goals`` (n,) are numbers of goals. Agents stand, with ids 0 to n - 1; their guidance (``gx``, ``gy``, ``togo``) is
    left to the caller.
    """
    count = len(places)
    state = np.zeros(count, ROW)
    state["x"], state["y"] = places.T
    state["heading"] = np.arctan2(facing[:, 1], facing[:, 0])
    state["hx"], state["hy"] = np.cos(state["heading"]), np.sin(state["heading"])
    state["radius"] = LEG_RADIUS
    state["half"] = state["rest"] = np.clip(rng.normal(0.46, 0.03, count), 0.38, 0.55) / 2.0 - LEG_RADIUS
    state["speed"] = np.clip(rng.normal(1.34, 0.26, count), 0.5, 2.2)
    state["share"] = rng.random(count)
    state["goal"] = goals
    state["id"] = np.arange(count)
    state["turn"] = state["held"] = -1.0
    return state


def scatter(
    rng: np.random.Generator, count: int, within: tuple[float, float, float, float], apart: float = 0.52
) -> NDArray[np.float64]:
    """Return random places (count, 2) in a rectangle (x0, y0, x1, y1), at least ``apart`` from each other [m].

    ``apart`` must be 1 m at most, the width of the cells in which neighbors are looked up. Raise ValueError if 2000
    draws for each place do not give all of them.
    """
    cells: dict[tuple[int, int], list[NDArray[np.float64]]] = {}
    found: list[NDArray[np.float64]] = []
    for _ in range(2000 * count):
        place = rng.uniform(within[:2], within[2:])
        column, row = math.floor(place[0]), math.floor(place[1])
        near = [each for i in (-1, 0, 1) for j in (-1, 0, 1) for each in cells.get((column + i, row + j), ())]
        if all(np.hypot(*(place - each)) > apart for each in near):
            cells.setdefault((column, row), []).append(place)
            found.append(place)
            if len(found) == count:
                return np.array(found)
    raise ValueError(f"{count} agents find no room in {within}")
