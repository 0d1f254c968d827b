"""Where characters start and go to who may be steered, as arrays: there may be a hundred thousand of them."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.spots import arrange_spots, gathered, meets, scatter_parties, scatter_spots
from crowdsim.errors import ScenarioError
from crowdsim.geometry.elementary import atan2
from crowdsim.scenario.arrivals import first_of_party, start_times
from crowdsim.scenario.destinations import Destinations, Itinerary
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.placement import (
    NOMINAL_RADIUS,
    STAND_ROOM,
    Placement,
    head_count_complaint,
    rooms_around,
    too_full,
    unusable,
)
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.agents import AgentGroup
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.walkers import Walkers, draw_walkers
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.steering import MOST_CELLS
from crowdsim.yamlfile.document import Complaint

BODY_DEPTH = 0.25
"""From chest to back [m]."""

SPARE = 0.02
"""Between two who start in one step, and between them and walls, at least [m]."""

CAPTURED_APART = 0.9
"""Between the centers of two who start in one step, so that both may begin captured, if there is room [m]."""

_START_STREAM, _GOAL_STREAM, _EXIT_STREAM = 0, 1, 7

Floats = NDArray[np.float64]


class CrowdPlacement(NamedTuple):
    """n characters in the order of their groups.

    Attributes
    ----------
    names : of the groups
    group : (n,) int32, number of the group of each
    starts : (n, 2) float64, meters
    headings : (n,) float64, radians faced at the start, nan for along the way
    start_steps, delay_steps : (n,) int64, step in which each comes, and steps that it then stands
    walkers : who they are
    goals : regions to go to, each once
    itineraries : of the groups
    spots : (n, k, 2) float64, where each stands in the region of a goal at which it stands, or walks to in captured
        motion; else nan
    locomotions : of the groups
    paced : of the groups, whether the file says how fast they walk
    first : (n,) int64, the first one of the party that each walks in; who walks alone is its own first
    assigned : (n,) int32, number of the goal that is assigned to each, NONE for no one
    exits : numbers of the goals that exits are, by name; those to which no group goes are missing
    """

    names: tuple[str, ...]
    group: NDArray[np.int32]
    starts: Floats
    headings: Floats
    start_steps: NDArray[np.int64]
    delay_steps: NDArray[np.int64]
    walkers: Walkers
    goals: tuple[Polygon, ...]
    itineraries: tuple[Itinerary, ...]
    spots: Floats
    locomotions: tuple[str, ...]
    paced: tuple[bool, ...]
    first: NDArray[np.int64]
    assigned: NDArray[np.int32]
    exits: dict[str, int]

    @property
    def head_count(self) -> int:
        """How many characters there are."""
        return len(self.group)


def place_crowd(scenario: Scenario) -> CrowdPlacement:
    """Draw who comes when and where.

    Characters that start in one step start beside each other: at random if there is room, parties together, else in
    rows that face their first goal. Each group draws from streams of the scenario's seed of its own.

    Raises
    ------
    ScenarioError
        With every region that is off the floor, blocked, or too full.
    """
    placement, complaints = try_crowd_placement(scenario, scenario.environment)
    if complaints:
        raise ScenarioError(scenario.problem(*complaint) for complaint in complaints)
    return placement


def try_crowd_placement(keys: ScenarioFields, environment: Environment) -> tuple[CrowdPlacement, list[Complaint]]:
    """:func:`place_crowd` with its complaints returned; groups that found no place are missing."""
    left, bottom, right, top = environment.floor.bounds
    drawing = _Drawing(keys, environment)
    if (right - left + CELL) * (top - bottom + CELL) > MOST_CELLS * CELL * CELL:
        message = (
            f"steered characters need a floor within {MOST_CELLS * CELL * CELL:,.0f} m2, as 2 km by 2 km; "
            "this one takes "
            f"{right - left:,.0f} m by {top - bottom:,.0f} m; cut it, or check its units"
        )
        drawing.complaints.append((("floor",), message))
        return drawing.placement(), drawing.complaints
    for number in range(len(keys.agents)):
        drawing.add_group(number)
    return drawing.placement(), drawing.complaints


class _Drawing:
    """Draws group after group."""

    def __init__(self, keys: ScenarioFields, environment: Environment) -> None:
        self.keys, self.environment = keys, environment
        self.complaints: list[Complaint] = []
        self._rooms: dict[float, list[MultiPolygon]] = {}
        self._starting: defaultdict[int, list[Floats]] = defaultdict(list)
        self._standing: list[Floats] = []
        self._destinations = Destinations(keys, environment)
        self._names: list[str] = []
        self._locomotions: list[str] = []
        self._paced: list[bool] = []
        self._itineraries: list[Itinerary] = []
        self._parts: list[tuple[Floats, Floats, NDArray[np.int64], Walkers, Floats]] = []
        self._assigned: list[NDArray[np.int32]] = []
        self._first: list[NDArray[np.int64]] = []

    def add_group(self, number: int) -> None:
        """Draw the characters of a group, unless something is wrong with it."""
        group = self.keys.agents[number]
        steps = np.rint(start_times(self.keys, number) * self.keys.steps_per_second).astype(np.int64)
        wrong = head_count_complaint(len(steps))
        if wrong is not None:
            self.complaints.append((("agents", number, "rate"), wrong))
            return
        walkers = draw_walkers(self.keys, number, len(steps))
        starts, headings = self._draw_starts(number, group, steps, walkers)
        spots = self._draw_spots(number, group, len(steps), walkers)
        if starts is None or spots is None:
            return
        self._names.append(group.name)
        self._locomotions.append(group.level)
        self._paced.append("speed" in group.model_fields_set)
        self._first.append(first_of_party(self.keys, number, len(steps)) + sum(map(len, self._first)))
        itinerary = self._destinations.itinerary(number)
        self._itineraries.append(itinerary)
        self._assigned.append(
            self._destinations.assign(group, itinerary, len(steps), self._generator(number, _EXIT_STREAM))
        )
        self._parts.append((starts, headings, steps, walkers, spots))

    def placement(self) -> CrowdPlacement:
        """All groups drawn so far."""
        counts = [len(part[0]) for part in self._parts]
        most = max((part[4].shape[1] for part in self._parts), default=1)
        spots = np.full((sum(counts), most, 2), np.nan)
        first = 0
        for count, part in zip(counts, self._parts, strict=True):
            spots[first : first + count, : part[4].shape[1]] = part[4]
            first += count
        walkers = Walkers(*(np.concatenate([np.empty(0), *(part[3][k] for part in self._parts)]) for k in range(4)))
        return CrowdPlacement(
            names=tuple(self._names),
            group=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
            starts=np.concatenate([np.empty((0, 2)), *(part[0] for part in self._parts)]),
            headings=np.concatenate([np.empty(0), *(part[1] for part in self._parts)]),
            start_steps=np.concatenate([np.empty(0, np.int64), *(part[2] for part in self._parts)]),
            delay_steps=np.rint(walkers.delays * self.keys.steps_per_second).astype(np.int64),
            walkers=walkers,
            goals=self._destinations.goals,
            itineraries=tuple(self._itineraries),
            spots=spots,
            locomotions=tuple(self._locomotions),
            paced=tuple(self._paced),
            first=np.concatenate([np.zeros(0, np.int64), *self._first]),
            assigned=np.concatenate([np.zeros(0, np.int32), *self._assigned]),
            exits=self._destinations.exits,
        )

    def _draw_starts(
        self, number: int, group: AgentGroup, steps: NDArray[np.int64], walkers: Walkers
    ) -> tuple[Floats | None, Floats]:
        """(n, 2) starts, None if there is no room, and (n,) headings."""
        count = len(steps)
        region = group.start.shape()
        headings = np.full(count, np.nan)
        broadest = float(walkers.breadths.max())
        room = self._room(number, ("agents", number, "start"), region, 0.5 * broadest + SPARE)
        if room is None:
            return None, headings
        generator = self._generator(number, _START_STREAM)
        starts = np.zeros((count, 2))
        for step, rows in _rows_by_step(steps):
            taken = np.concatenate([np.empty((0, 2)), *self._starting[step]])
            spots = np.empty((0, 2))
            if group.level != "steered" and self.keys.floor.periodic is None:
                spots = scatter_spots(region, room, len(rows), CAPTURED_APART, taken, generator)
            if len(spots) < len(rows):
                together = group.together, broadest + SPARE
                spots = scatter_parties(region, room, len(rows), *together, taken, generator)
            if len(spots) < len(rows) and group.rate is not None:
                # Who comes from a source waits until nobody stands in its place.
                more = scatter_spots(region, room, len(rows) - len(spots), 0.0, np.empty((0, 2)), generator)
                spots = np.concatenate([spots, more])
            elif len(spots) < len(rows) and not isinstance(region, Point):
                # Too many to start at random: in rows, which face where they go.
                first = self._destinations.regions_of(number)[0]
                away = shapely.get_coordinates(first.centroid)[0] - shapely.get_coordinates(region.centroid)[0]
                headings[rows] = atan2(away[1], away[0])
                apart = (broadest + SPARE, BODY_DEPTH + SPARE)
                spots = arrange_spots(region, room, len(rows), apart, float(headings[rows[0]]), taken, generator)
                if group.together > 1:
                    spots = gathered(spots, group.together)
            if len(spots) < len(rows):
                message = too_full(("start",), region, len(spots), len(rows), 0.5 * broadest)
                self.complaints.append((("agents", number, "start"), message))
                return None, headings
            starts[rows] = spots
            self._starting[step].append(spots)
        return starts, headings

    def _draw_spots(self, number: int, group: AgentGroup, count: int, walkers: Walkers) -> Floats | None:
        """(n, k, 2) spots to stand at in the regions of goals, nan where nobody stands; None if there is no room."""
        regions = self.keys.regions(number)
        spots = np.full((count, len(regions) + (group.exits is not None), 2), np.nan)
        for exit_number in self.keys.exits_of(group):
            if not meets(self._destinations.exit_region(exit_number), self.environment.fixed_layers[0].free):
                message = "lies off the floor, or inside of an obstacle"
                self.complaints.append((("exits", exit_number), message))
                return None
        radius = 0.5 * float(walkers.breadths.max())
        for k, (path, goal) in enumerate(regions):
            if goal.along is not None:
                continue
            last = k == spots.shape[1] - 1
            region = goal.shape()
            room = self._room(number, path, region, radius)
            if room is None:
                return None
            stays = last and group.on_arrival == "stay"
            stands = stays or (group.wait > 0.0 and (not last or group.rounds != 1))
            if not stands and group.level == "steered":
                continue
            generator = self._generator(number, _GOAL_STREAM, *([k] if k else []))
            if not stays:
                # Who walks on leaves again: spots may lie beside each other.
                spots[:, k] = scatter_spots(region, room, count, 0.0, np.empty((0, 2)), generator)
                continue
            taken = np.concatenate([np.empty((0, 2)), *self._standing])
            apart = 2.0 * radius + STAND_ROOM
            drawn = scatter_parties(region, room, count, group.together, apart, taken, generator)
            if len(drawn) < count:
                self.complaints.append((path, too_full(path[2:], region, len(drawn), count, radius)))
                return None
            self._standing.append(drawn)
            spots[:, k] = drawn
        return spots

    def _room(
        self, number: int, path: tuple[str | int, ...], region: Polygon | Point, radius: float
    ) -> MultiPolygon | None:
        """Floor with that much room around it that the region meets; None, and a complaint, if there is none.

        Captured characters need as much as they are planned with.
        """
        radii = {"steered": [radius], "captured": [max(radius, NOMINAL_RADIUS)], "auto": [NOMINAL_RADIUS, radius]}
        for least in radii[self.keys.agents[number].level]:
            if least not in self._rooms:
                self._rooms[least] = rooms_around(self.keys, self.environment, least)
            room = next((room for room in self._rooms[least] if meets(region, room)), None)
            if room is not None:
                return room
        self.complaints.append((path, unusable(self.environment, region, radius)))
        return None

    def _generator(self, number: int, *stream: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.keys.seed, spawn_key=(number, *stream)))


def _rows_by_step(steps: NDArray[np.int64]) -> list[tuple[int, NDArray[np.int64]]]:
    """Each step in which anybody starts, ascending, with the rows of those who do."""
    order = np.argsort(steps, kind="stable")
    distinct, firsts = np.unique(steps[order], return_index=True)
    return list(zip(distinct.tolist(), np.split(order, firsts[1:]), strict=True))


def captured_placement(cast: CrowdPlacement) -> Placement:
    """The same characters for captured motion: each goes to its own spots in the regions of its goals."""
    # Those who never steer walk as they were captured, unless the file says otherwise.
    own = np.array(cast.paced) | (np.array(cast.locomotions) != "captured")
    itineraries = [cast.itineraries[number] for number in cast.group.tolist()]
    return Placement(
        starts=cast.starts,
        goals=tuple(spots[: len(it.goals)] for spots, it in zip(cast.spots, itineraries, strict=True)),
        rounds=np.array([it.rounds for it in itineraries], np.int64),
        waits=np.array([it.wait for it in itineraries], np.float64),
        start_steps=cast.start_steps,
        stays=np.array([it.stays for it in itineraries], np.bool_),
        headings=tuple(it.headings for it in itineraries),
        stand_within=np.array([it.stand_within for it in itineraries], np.float64),
        groups=tuple(cast.names[number] for number in cast.group.tolist()),
        speeds=np.where(own[cast.group], cast.walkers.speeds, np.nan),
    )
