"""Place agents that may be steered, as arrays: there may be a hundred thousand of them.

``number`` is the index of a group in the scenario, ``walkers`` are the properties of its agents.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.spots import arrange_spots, gathered, meets, scatter_parties, scatter_spots
from crowdsim.geometry.elementary import atan2
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.people.arrivals import first_of_party, start_steps
from crowdsim.scenario.people.destinations import Destinations, Itinerary
from crowdsim.scenario.people.placement import (
    NOMINAL_RADIUS,
    STAND_ROOM,
    Placement,
    head_count_complaint,
    rooms_around,
    too_full,
    unusable,
)
from crowdsim.scenario.people.walkers import Walkers, draw_walkers
from crowdsim.scenario.schema.agents import AgentGroup
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.steering import MOST_CELLS
from crowdsim.yamlfile.document import Complaint

BODY_DEPTH = 0.25
"""Depth of a body from chest to back [m]."""

BODY_RADIUS = 0.5 * BODY_DEPTH
"""Radius of the capsule of a steered body, and of the disc that stands for its legs [m]."""

SPARE = 0.02
"""Least gap between two agents that start in one step, and between them and walls [m]."""

CAPTURED_APART = 0.9
"""Distance between the centers of agents that start in one step, if there is room, so that all can begin captured
[m]."""

_START_STREAM, _GOAL_STREAM, _EXIT_STREAM = 0, 1, 7
"""Numbers of random streams of a group; each quantity has its own."""

Floats = NDArray[np.float64]


class CrowdPlacement(NamedTuple):
    """Starts, goals and properties of n agents, in the order of their groups.

    Attributes
    ----------
    names : tuple of str
        Names of the groups.
    group : (n,) int32
        Index of each agent's group.
    starts : (n, 2) float64
        Start positions [m].
    headings : (n,) float64
        Headings at the start [rad]; nan for the direction of the path.
    start_steps, delay_steps : (n,) int64
        Step in which an agent appears (NEVER for those on call), and number of steps for which it then stands.
    walkers : Walkers
        Speeds, breadths and delays.
    goals : tuple of Polygon
        Regions that agents go to, without duplicates.
    itineraries : tuple of Itinerary
        Itineraries of the groups.
    spots : (n, k, 2) float64
        Place of each agent in its k-th goal, if it stands there or walks there in captured motion; else nan [m].
    locomotions : tuple of str
        ``captured``, ``steered`` or ``auto``, by group.
    paced : tuple of bool
        Whether the file gives a walking speed, by group.
    first : (n,) int64
        Index of the first member of each agent's party; its own index if it walks alone.
    assigned : (n,) int32
        Index of the goal (exit) assigned to each agent; NONE if it has none.
    exits : dict of str to int
        Goal index by name of exit; exits that no group uses are missing.
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
        """Return the number of agents."""
        return len(self.group)


def try_crowd_placement(keys: ScenarioFields, environment: Environment) -> tuple[CrowdPlacement, list[Complaint]]:
    """Draw when and where each agent starts, and where it goes.

    Agents that start in the same step get places that do not overlap: at random if there is room, else in rows that
    face their first goal. Random places are CAPTURED_APART from each other if the agents may begin captured and there
    is room for it; else they are only as far apart as bodies need, with parties together. If there is no room, agents
    of a source or on call get no rows, but random places that may overlap, and wait until their place is free. Each
    group draws from its own streams of the scenario's seed.

    Returns
    -------
    placement : CrowdPlacement
        Without the groups that found no place.
    complaints : list of Complaint
        Every region that is off the floor, blocked, or too full; every source with no agent or too many; or that the
        floor is too large for steered agents, in which case nothing is drawn.
    """
    # Steering sorts agents into a grid of at most MOST_CELLS cells.
    left, bottom, right, top = environment.floor.bounds
    drawing = _Drawing(keys, environment)
    if (right - left + CELL) * (top - bottom + CELL) > MOST_CELLS * CELL * CELL:
        message = (
            f"steered agents need a floor within {MOST_CELLS * CELL * CELL:,.0f} m2, as 2 km by 2 km; "
            "this one takes "
            f"{right - left:,.0f} m by {top - bottom:,.0f} m; cut it, or check its units"
        )
        drawing.complaints.append((("floor",), message))
        return drawing.placement(), drawing.complaints
    for number in range(len(keys.agents)):
        drawing.add_group(number)
    return drawing.placement(), drawing.complaints


class _Drawing:
    """Draws the agents group by group."""

    def __init__(self, keys: ScenarioFields, environment: Environment) -> None:
        self.keys, self.environment = keys, environment
        self.complaints: list[Complaint] = []
        # Rooms by the free floor around [m]; places (k, 2) [m] taken so far by the agents that start, by step, and by
        # the agents that stay at a goal.
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
        """Draw the agents of a group; record a complaint instead if they find no place."""
        group = self.keys.agents[number]
        steps = start_steps(self.keys, number)
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
        """Return the placement of all groups drawn so far."""
        # A part is what add_group has drawn: starts, headings, start steps, walkers and spots of a group.
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
        """Return start positions (n, 2) [m] and headings (n,) [rad], nan for the direction of the path.

        ``steps`` (n,) are the steps in which the n agents of the group, which has the index ``number``, start; agents
        on call all have the step NEVER. If the start region is unusable or too full, record a complaint and return None
        for the positions.
        """
        count = len(steps)
        region = group.start.shape()
        headings = np.full(count, np.nan)
        broadest = float(walkers.breadths.max())
        found = self._room(number, ("agents", number, "start"), region, 0.5 * broadest + SPARE)
        if found is None:
            return None, headings
        room, free = found
        generator = self._generator(number, _START_STREAM)
        starts = np.zeros((count, 2))
        for step, rows in _rows_by_step(steps):
            taken = np.concatenate([np.empty((0, 2)), *self._starting[step]])
            spots = np.empty((0, 2))
            # First far enough apart to begin captured, if they may (on a periodic floor none may); then only as far
            # apart as bodies need.
            if group.level != "steered" and self.keys.floor.periodic is None:
                spots = scatter_spots(region, room, len(rows), CAPTURED_APART, taken, generator)
            if len(spots) < len(rows):
                together = group.together, broadest + SPARE
                spots = scatter_parties(region, room, len(rows), *together, taken, generator)
            if len(spots) < len(rows) and (group.rate is not None or group.on_call):
                # Places may overlap: an agent from a source, or on call, waits until its place is free.
                more = scatter_spots(region, room, len(rows) - len(spots), 0.0, np.empty((0, 2)), generator)
                spots = np.concatenate([spots, more])
            elif len(spots) < len(rows) and not isinstance(region, Point):
                # Too dense for random places: arrange rows that face the first goal.
                first = self._destinations.regions_of(number)[0]
                away = shapely.get_coordinates(first.centroid)[0] - shapely.get_coordinates(region.centroid)[0]
                headings[rows] = atan2(away[1], away[0])
                apart = (broadest + SPARE, BODY_DEPTH + SPARE)
                spots = arrange_spots(region, room, len(rows), apart, float(headings[rows[0]]), taken, generator)
                if group.together > 1:
                    spots = gathered(spots, group.together)
            if len(spots) < len(rows):
                message = too_full(("start",), region, len(spots), len(rows), free)
                self.complaints.append((("agents", number, "start"), message))
                return None, headings
            starts[rows] = spots
            self._starting[step].append(spots)
        return starts, headings

    def _draw_spots(self, number: int, group: AgentGroup, count: int, walkers: Walkers) -> Floats | None:
        """Return places (n, k, 2) in the k goals [m], nan if an agent needs none.

        ``number`` is the index of the group, n = ``count`` its number of agents. If a goal or an exit is unusable, or a
        goal to stay at is too full, record a complaint and return None. All exits of a group count as one goal, the
        last, in which no agent needs a place.
        """
        regions = self.keys.regions(number)
        spots = np.full((count, len(regions) + (group.exits is not None), 2), np.nan)
        # Each exit has to be open to some agent; it needs no room for a body, see ``Destinations.exit_region``.
        for exit_number in self.keys.exits_of(group):
            if not meets(self._destinations.exit_region(exit_number), self.environment.fixed_layers[0].free):
                message = "lies off the floor, or inside of an obstacle"
                self.complaints.append((("exits", exit_number), message))
                return None
        radius = 0.5 * float(walkers.breadths.max())
        for k, (path, goal) in enumerate(regions):
            if goal.along is not None:  # an endless way has no place to come to
                continue
            last = k == spots.shape[1] - 1
            region = goal.shape()
            found = self._room(number, path, region, radius)
            if found is None:
                return None
            room, free = found
            stays = last and group.on_arrival == "stay"
            # Agents wait at the last goal too if another round may follow.
            stands = stays or (group.wait > 0.0 and (not last or group.rounds != 1))
            # Steered agents that only pass need no place of their own; captured motion always leads to one.
            if not stands and group.level == "steered":
                continue
            # The first goal uses the same stream as a single goal, so that adding goals does not move it.
            generator = self._generator(number, _GOAL_STREAM, *([k] if k else []))
            if not stays:
                # Nobody stays here: the places need no distance from each other.
                spots[:, k] = scatter_spots(region, room, count, 0.0, np.empty((0, 2)), generator)
                continue
            taken = np.concatenate([np.empty((0, 2)), *self._standing])
            apart = 2.0 * radius + STAND_ROOM
            drawn = scatter_parties(region, room, count, group.together, apart, taken, generator)
            if len(drawn) < count:
                self.complaints.append((path, too_full(path[2:], region, len(drawn), count, free)))
                return None
            self._standing.append(drawn)
            spots[:, k] = drawn
        return spots

    def _room(
        self, number: int, path: tuple[str | int, ...], region: Polygon | Point, radius: float
    ) -> tuple[MultiPolygon, float] | None:
        """Return the places with enough free floor around them, and how much that is [m].

        Steered agents of group ``number`` need ``radius`` [m]. Captured ones need NOMINAL_RADIUS at least; ``auto``
        ones get it if ``region`` has such a place, else ``radius``. If ``region`` has no place, record a complaint with
        its key ``path``, and return None.
        """
        radii = {"steered": [radius], "captured": [max(radius, NOMINAL_RADIUS)], "auto": [NOMINAL_RADIUS, radius]}
        for least in radii[self.keys.agents[number].level]:
            if least not in self._rooms:
                self._rooms[least] = rooms_around(self.keys, self.environment, least)
            room = next((room for room in self._rooms[least] if meets(region, room)), None)
            if room is not None:
                return room, least
        self.complaints.append((path, unusable(self.environment, region, least)))
        return None

    def _generator(self, number: int, *stream: int) -> np.random.Generator:
        """Return a generator of group ``number`` that depends on the scenario's seed and on ``stream`` alone."""
        return np.random.default_rng(np.random.SeedSequence(self.keys.seed, spawn_key=(number, *stream)))


def _rows_by_step(steps: NDArray[np.int64]) -> list[tuple[int, NDArray[np.int64]]]:
    """Return each of the ``steps`` (n,) in which agents start, ascending, with the rows (k,) of its agents."""
    order = np.argsort(steps, kind="stable")
    distinct, firsts = np.unique(steps[order], return_index=True)
    return list(zip(distinct.tolist(), np.split(order, firsts[1:]), strict=True))


def captured_placement(cast: CrowdPlacement) -> Placement:
    """Return the placement of the same agents for captured motion; each goes to its own places in its goals.

    It shares the arrays ``starts`` and ``start_steps`` with ``cast``: if an agent comes elsewhere or later, or a
    command adds or removes it, the change counts on both levels.
    """
    # Groups that are never steered walk at the speed of their clips, unless the file gives a speed.
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
        only_goals=np.array([it.only_goal for it in itineraries], np.int64),
        regions=cast.goals,
    )
