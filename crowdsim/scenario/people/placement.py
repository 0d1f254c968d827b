"""Place captured agents: where and when each starts, and where it goes.

``keys`` are the keys of the scenario.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.layers import dropped_solids, polygons_only, room_in
from crowdsim.environment.spots import Spots, draw_spots, meets
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.people.arrivals import start_steps
from crowdsim.scenario.people.destinations import Destinations
from crowdsim.scenario.people.walkers import draw_walkers
from crowdsim.scenario.schema.agents import MAX_COUNT, Goal
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint

NOMINAL_RADIUS = 0.30
"""Free floor around an agent that the check of a scenario requires [m], before the clips and their width are
known."""

STAND_ROOM = 0.4
"""Extra distance between two agents that stay, beyond both radii [m]: room to turn on the spot and to stand off
it."""

_START_STREAM, _GOAL_STREAM = 0, 1
"""Numbers of random streams of a group; each quantity has its own."""


class Placement(NamedTuple):
    """Starts and goals of n agents, in the order of their groups.

    Attributes
    ----------
    starts : (n, 2) float64
        Start positions [m].
    goals : n arrays (k, 2) float64
        Places to go to, in order [m].
    rounds : (n,) int64
        How often the places are visited in turn; NONE for as long as the run lasts.
    waits : (n,) float64
        Time to stand at each place except the last of the last round [s].
    start_steps : (n,) int64
        Simulation step nearest to the start time; NEVER for agents on call.
    stays : (n,) bool
        Whether the agent stays at the last place, instead of leaving.
    headings : n arrays (k,) float64
        Heading to take at each place [rad]; nan for any.
    stand_within : (n,) float64
        Distance from a place within which the agent comes to stand [m].
    groups : tuple of str
        Name of each agent's group.
    speeds : (n,) float64
        Free walking speed [m/s]; nan for the speed of the clips.
    only_goals : (n,) int64
        Index in ``regions`` of the only goal of each agent; NONE if it goes to several in turn, or to one of several
        exits.
    regions : tuple of Polygon
        Regions of all goals [m].
    """

    starts: NDArray[np.float64]
    goals: Sequence[NDArray[np.float64]]
    rounds: NDArray[np.int64]
    waits: NDArray[np.float64]
    start_steps: NDArray[np.int64]
    stays: NDArray[np.bool_]
    headings: Sequence[NDArray[np.float64]]
    stand_within: NDArray[np.float64]
    groups: tuple[str, ...]
    speeds: NDArray[np.float64]
    only_goals: NDArray[np.int64]
    regions: tuple[Polygon, ...]

    def goal(self, agent: int, reached: int) -> NDArray[np.float64]:
        """Return the place (2,) that an agent goes to after it has reached ``reached`` places [m]."""
        goals = self.goals[agent]
        return np.asarray(goals[reached % len(goals)])

    def heading(self, agent: int, reached: int) -> float | None:
        """Return the heading to take at the place after ``reached`` others [rad]; None for any."""
        headings = self.headings[agent]
        heading = float(headings[reached % len(headings)])
        return None if math.isnan(heading) else heading

    def is_last(self, agent: int, reached: int) -> bool:
        """Return whether the place after ``reached`` others is the agent's last; never if its rounds have no end."""
        # Without end, rounds are NONE, which is negative.
        return bool(reached + 1 == self.rounds[agent] * len(self.goals[agent]))

    def stands(self, agent: int, reached: int) -> bool:
        """Return whether the agent stands at the place after ``reached`` others, for a while or for good."""
        return bool(self.stays[agent]) if self.is_last(agent, reached) else bool(self.waits[agent] > 0.0)


def try_placement(keys: ScenarioFields, environment: Environment, radius: float) -> tuple[Placement, list[Complaint]]:
    """Draw start and goals of every agent, with ``radius`` meters of free floor around each.

    Agents that start in the same step, of any group, start at least two radii apart, unless they are on call. The goals
    of agents that stay are STAND_ROOM farther apart; other goals may overlap. Each group draws from its own streams of
    the scenario's seed, so that a change to one group leaves the draws of the others alone.

    Returns
    -------
    placement : Placement
        To be used only without complaints: else starts are missing, and goals without a place are nan.
    complaints : list of Complaint
        Every region that is off the floor, blocked, or too full, and every source with no agent or too many.
    """
    rooms = rooms_around(keys, environment, radius)
    starts_by_step: defaultdict[int, Spots] = defaultdict(lambda: Spots(2.0 * radius))
    stay_spots = Spots(2.0 * radius + STAND_ROOM)
    starts: list[tuple[float, float]] = []
    goals: list[NDArray[np.float64]] = []
    only_goals: list[int] = []
    destinations = Destinations(keys, environment)
    steps: list[int] = []
    counts: list[int] = []
    complaints: list[Complaint] = []
    for number, group in enumerate(keys.agents):
        group_steps = start_steps(keys, number).tolist()
        count = len(group_steps)
        wrong = head_count_complaint(count)
        if wrong is not None:
            complaints.append((("agents", number, "rate"), wrong))
            continue
        regions = keys.regions(number)
        places = np.full((count, len(regions), 2), np.nan)
        start = ("agents", number, "start")
        # Agents on call come one by one, so that their starts may overlap.
        beside = [None if group.on_call else starts_by_step[step] for step in group_steps]
        wanted: list[_Wanted] = [(start, group.start.shape(), (_START_STREAM,), beside)]
        for k, (path, region) in enumerate(regions):
            last = stay_spots if group.on_arrival == "stay" and k == len(regions) - 1 else None
            # The first goal uses the same stream as a single goal, so that adding goals does not move it.
            wanted.append((path, region.shape(), (_GOAL_STREAM, k) if k else (_GOAL_STREAM,), [last] * count))
        for k, (path, shape, stream, crowds) in enumerate(wanted):
            generator = np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=(number, *stream)))
            room = next((room for room in rooms if meets(shape, room)), None)
            if room is None:
                complaint: str | None = unusable(environment, shape, radius)
            else:
                placed = draw_spots(shape, room, crowds, generator)
                complaint = None if len(placed) == count else too_full(path[2:], shape, len(placed), count, radius)
                # The first entry is the start, the others are the goals.
                if k == 0:
                    starts += placed
                else:
                    places[: len(placed), k - 1] = np.array(placed).reshape(-1, 2)
            if complaint is not None:
                complaints.append((path, complaint))
        goals += list(places)
        only_goals += [destinations.itinerary(number).only_goal] * count
        steps += group_steps
        counts.append(count)
    # A group without an agent, or with too many, is left out above; its complaint means that nobody uses the placement.
    groups = [group for group, count in zip(keys.agents, counts, strict=False) for _ in range(count)]
    headings = [
        np.radians([_heading(goal) for _, goal in keys.regions(number)])
        for number, count in enumerate(counts)
        for _ in range(count)
    ]
    placement = Placement(
        starts=np.array(starts, np.float64).reshape(-1, 2),
        goals=tuple(goals),
        rounds=np.array([group.rounds for group in groups], np.int64),
        waits=np.array([group.wait for group in groups], np.float64),
        start_steps=np.array(steps, np.int64),
        stays=np.array([group.on_arrival == "stay" for group in groups], np.bool_),
        headings=tuple(headings),
        stand_within=np.array([group.stand_within for group in groups], np.float64),
        groups=tuple(group.name for group in groups),
        speeds=np.concatenate([np.empty(0), *_speeds(keys, counts)]),
        only_goals=np.array(only_goals, np.int64),
        regions=destinations.goals,
    )
    return placement, complaints


def _speeds(keys: ScenarioFields, counts: list[int]) -> list[NDArray[np.float64]]:
    """Return the walking speeds (n,) of each group [m/s]; nan, for the speed of the clips, if the file gives none.

    ``counts`` are the numbers of agents of the groups.
    """
    return [
        draw_walkers(keys, number, count).speeds if "speed" in group.model_fields_set else np.full(count, np.nan)
        for number, (group, count) in enumerate(zip(keys.agents, counts, strict=False))
    ]


_Wanted = tuple[tuple[str | int, ...], "Polygon | Point", tuple[int, ...], "list[Spots | None]"]
"""Places to draw: path of the key, region, random stream, and for each place the set of places to keep away from."""


def _heading(goal: Goal) -> float:
    """Return the heading to take at a goal [degrees]; nan for any."""
    return math.nan if goal.heading is None else goal.heading


def head_count_complaint(count: int) -> str | None:
    """Return what is wrong with the number of agents in a group; None if nothing is."""
    if 1 <= count <= MAX_COUNT:
        return None
    how_many = "no agent comes" if count == 0 else f"more than {MAX_COUNT} agents come"
    return f"{how_many} at this rate"


def rooms_around(keys: ScenarioFields, environment: Environment, radius: float) -> list[MultiPolygon]:
    """Return the area of places with ``radius`` [m] of free floor around them at all times, and that at some time.

    For the first area, movables take floor away at all places that they ever have; for the second one, they count as
    absent. There is only the first one if no movable is ever in a layer. Callers use the second one only for regions
    that do not meet the first one.
    """
    timetable = environment.timetable
    bands = [layer.band() for layer in keys.bands]
    # Footprints of movables at all places that they ever have, unless all solids lie above or below all layers.
    taken = [
        movable.footprint(placing)
        for movable, placing in [
            *((movable, movable.placing) for movable in timetable.movables),
            *((timetable.movables[event.movable], event.placing) for event in timetable.events),
        ]
        if placing is not None and len(dropped_solids(movable.solids, bands)) < len(movable.solids)
    ]
    if not taken:
        return [environment.layers[0].room(radius)]
    free = environment.fixed_layers[0].free
    return [room_in(polygons_only(free.difference(shapely.union_all(taken))), radius), room_in(free, radius)]


def unusable(environment: Environment, region: Polygon | Point, radius: float) -> str:
    """Return why no agent with ``radius`` [m] of free floor around it can ever stand in ``region``."""
    if not meets(region, environment.floor):
        return "lies off the floor"
    if not meets(region, environment.fixed_layers[0].free):
        inside = [solid.name for solid in environment.timetable.fixed if solid.footprint.intersects(region)]
        return f"lies inside {', '.join(repr(name) for name in inside[:3])}; nobody can stand there"
    return f"no spot with {radius:.2f} m of free floor around it; move it away from walls and obstacles"


def too_full(key: tuple[str | int, ...], region: Polygon | Point, placed: int, count: int, radius: float) -> str:
    """Return the message for a region with places for only ``placed`` of ``count`` agents.

    Parameters
    ----------
    key : tuple
        Key within the group, ``("start",)`` or that of a goal.
    region : Polygon or Point
        The region.
    placed, count : int
        Number of places found, and needed.
    radius : float
        Free floor that each place needs around it [m].
    """
    together = "start at once" if key == ("start",) else "stay"
    remedy = "an 'interval' between the starts" if key == ("start",) else "'on_arrival: leave'"
    if isinstance(region, Point):
        return f"{count} agents cannot {together} at one point; give a larger region, or {remedy}"
    between = "" if key == ("start",) else f" and {STAND_ROOM:g} m between them"
    return (
        f"only {placed} of {count} agents found a place to {together} with {radius:.2f} m around each{between}; "
        f"give a larger region, a smaller 'count', or {remedy}"
    )
