"""Destinations of the groups: regions in turn, exits to choose from, or an endless way along an axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.constants import NONE
from crowdsim.environment.layers import room_in
from crowdsim.environment.solids import circle_around
from crowdsim.environment.spots import meets
from crowdsim.geometry.polygons import buffered
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.schema.agents import AgentGroup
from crowdsim.scenario.schema.schema import ScenarioFields

POINT_REACHED = 0.25
"""Radius of the disc that stands for a goal given as a point [m]: it is reached inside."""

EXIT_ROOM = 0.25
"""Free floor that a center needs somewhere in an exit for the exit to be reachable [m]. Ways keep 0.23 m off walls in
the layer of the legs, with each of the built-in behaviors: no way leads into an exit with less room."""

EXIT_REACH = 0.25
"""Distance by which an exit is enlarged if no center fits into it [m]."""

END_DEPTH = 0.5
"""Depth of the region at the far end of an endless way [m]. Agents head for it and never arrive."""

Floats = NDArray[np.float64]


class Itinerary(NamedTuple):
    """The k goals of a group, in order.

    Attributes
    ----------
    goals : (k,) int32
        Indices of the goals.
    rounds : int
        How often the goals are visited in turn; NONE for as long as the run lasts.
    wait : float
        Time to stand at each goal except the last of the last round [s].
    stays : bool
        Whether the agents stay at the last goal, instead of leaving.
    headings : (k,) float64
        Heading to take at each goal [rad]; nan for any.
    stand_within : float
        Distance from its place within which an agent comes to stand [m].
    exits : (e,) int32
        Indices, among all goals, of the exits to choose from; the last of ``goals`` is the first of them. Empty if the
        group has no exits.
    choice : str
        How an exit is chosen: ``nearest``, ``quickest`` or ``assigned``; empty without exits.
    """

    goals: NDArray[np.int32]
    rounds: int
    wait: float
    stays: bool
    headings: Floats
    stand_within: float
    exits: NDArray[np.int32]
    choice: str

    @property
    def only_goal(self) -> int:
        """Return the index of the goal if there is only one, to which agents go once; else NONE."""
        return int(self.goals[0]) if len(self.goals) == 1 and self.rounds == 1 and len(self.exits) < 2 else NONE


class Destinations:
    """Numbers the regions that groups go to; equal regions get one number.

    Attributes
    ----------
    goals : tuple of Polygon
        The regions so far.
    exits : dict of str to int
        Goal index of each exit that a group uses, by name.
    """

    def __init__(self, keys: ScenarioFields, environment: Environment) -> None:
        self._keys, self._environment = keys, environment
        self._numbers: dict[tuple[str, bytes], tuple[int, Polygon]] = {}
        self.exits: dict[str, int] = {}

    @property
    def goals(self) -> tuple[Polygon, ...]:
        """Return the regions so far, in the order of their indices."""
        return tuple(region for _, region in self._numbers.values())

    def itinerary(self, number: int) -> Itinerary:
        """Return the itinerary of group ``number``, with the places of its route first.

        Its regions are numbered among :attr:`goals` if they are new, and its exits are entered in :attr:`exits`.
        """
        goals, headings = [], []
        group = self._keys.agents[number]
        for _, goal in self._keys.regions(number):
            region = goal.shape() if goal.along is None else self._end_of(goal.along)
            if isinstance(region, Point):
                region = circle_around((region.x, region.y), POINT_REACHED)
            goals.append(self._number_of(region))
            headings.append(np.nan if goal.heading is None else np.radians(goal.heading))
        exits = [
            self._number_of(self.exit_region(each), self._keys.exits[each].name) for each in self._keys.exits_of(group)
        ]
        for each, goal_number in zip(self._keys.exits_of(group), exits, strict=True):
            self.exits[self._keys.exits[each].name] = goal_number
        if exits:
            goals.append(exits[0])
            headings.append(np.nan)
        return Itinerary(
            np.array(goals, np.int32),
            group.rounds,
            group.wait,
            group.on_arrival == "stay",
            np.array(headings, np.float64),
            group.stand_within,
            np.array(exits, np.int32),
            ("assigned" if isinstance(group.exits, dict) else group.choice) if exits else "",
        )

    def _number_of(self, region: Polygon, exit_name: str = "") -> int:
        """Return the index of a region among the goals; add it if it is new.

        An exit has its name as ``exit_name``, so that it is never merged with another region that is equal.
        """
        key = exit_name, shapely.to_wkb(shapely.normalize(region))
        return self._numbers.setdefault(key, (len(self._numbers), region))[0]

    def _end_of(self, along: str) -> Polygon:
        """Return the far end of an endless way: the last END_DEPTH of a copy of the floor that joins its end.

        ``along`` is the direction of the way: +x, -x, +y or -y.
        """
        xmin, ymin, xmax, ymax = self._keys.floor.bounds
        end = {
            "+x": (2.0 * xmax - xmin - END_DEPTH, ymin, 2.0 * xmax - xmin, ymax),
            "-x": (2.0 * xmin - xmax, ymin, 2.0 * xmin - xmax + END_DEPTH, ymax),
            "+y": (xmin, 2.0 * ymax - ymin - END_DEPTH, xmax, 2.0 * ymax - ymin),
            "-y": (xmin, 2.0 * ymin - ymax, xmax, 2.0 * ymin - ymax + END_DEPTH),
        }
        return shapely.box(*end[along])

    def exit_region(self, number: int) -> Polygon:
        """Return the region of an exit; if it is too shallow for any center to be inside, enlarged by EXIT_REACH."""
        region = self._keys.exits[number].shape()
        assert isinstance(region, Polygon)
        free = self._environment.fixed_layers[0].free
        if meets(region, room_in(free, EXIT_ROOM)):
            return region
        # A polygon grows to one polygon, which the type of ``buffered`` does not say.
        grown = buffered(region, EXIT_REACH)
        return grown if isinstance(grown, Polygon) else region

    def assign(
        self, group: AgentGroup, itinerary: Itinerary, count: int, generator: np.random.Generator
    ) -> NDArray[np.int32]:
        """Return the goal index (count,) of each agent's exit if exits are assigned by shares, else NONE.

        The numbers of parties by exit follow from the shares; which parties these are is random, by ``generator``. All
        members of a party get the same exit. ``itinerary`` is that of the group.
        """
        if not isinstance(group.exits, dict) or not len(itinerary.exits):
            return np.full(count, NONE, np.int32)
        shares = np.array([group.exits[self._keys.exits[number].name] for number in self._keys.exits_of(group)])
        # The number of parties of each exit is its share of all, rounded so that the sum is right.
        parties = -(-count // group.together)
        ends = np.rint(np.cumsum(shares) / shares.sum() * parties).astype(np.int64)
        which = np.searchsorted(ends, np.arange(parties), side="right")
        return itinerary.exits[which[generator.permutation(parties)]].repeat(group.together)[:count]

    def regions_of(self, number: int) -> list[BaseGeometry]:
        """Return the regions that group ``number`` goes to, its route first; if it has exits, their union is last."""
        if self._keys.agents[number].exits is not None:
            return [shape for _, shape in self._keys.destinations(number)]
        goals = [goal for _, goal in self._keys.regions(number)]
        return [goal.shape() if goal.along is None else self._end_of(goal.along) for goal in goals]
