"""Where the characters of a group go: regions in turn, exits to choose among, ways without end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.constants import NONE
from crowdsim.environment.solids import circle_around
from crowdsim.environment.spots import meets, room_in
from crowdsim.geometry.polygons import buffered
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.schema.agents import AgentGroup
from crowdsim.scenario.schema.schema import ScenarioFields

POINT_REACHED = 0.25
"""Distance from a point to go to within which it is reached [m]."""

EXIT_ROOM = 0.15
"""Room that a center needs in an exit that is reached by being in it [m]: a little more than half a body's depth."""

EXIT_REACH = 0.25
"""Distance within which an exit that has no such room is reached [m]."""

END_DEPTH = 0.5
"""Of the region that those go to who walk along an axis without end [m]; they never come there."""

Floats = NDArray[np.float64]


class Itinerary(NamedTuple):
    """Where the characters of a group go: k places in turn.

    Attributes
    ----------
    goals : (k,) int32, numbers of goals
    rounds : how many times over; NONE for as long as the run lasts
    wait : seconds they stand at each place but the last
    stays : whether they stay at the last one
    headings : (k,) radians to face there, nan where any will do
    stand_within : meters from their spot within which they come to stand
    exits : (e,) int32, numbers of the goals that the last one stands for, if they choose among them
    choice : how they do: ``nearest``, ``quickest`` or ``assigned``; else empty
    """

    goals: NDArray[np.int32]
    rounds: int
    wait: float
    stays: bool
    headings: Floats
    stand_within: float
    exits: NDArray[np.int32]
    choice: str


class Destinations:
    """Numbers the regions that groups go to, each once.

    goals : the regions so far
    exits : numbers of the exits that groups go to, by name
    """

    def __init__(self, keys: ScenarioFields, environment: Environment) -> None:
        self._keys, self._environment = keys, environment
        self._numbers: dict[tuple[str, bytes], tuple[int, Polygon]] = {}
        self.exits: dict[str, int] = {}

    @property
    def goals(self) -> tuple[Polygon, ...]:
        return tuple(region for _, region in self._numbers.values())

    def itinerary(self, number: int) -> Itinerary:
        """The itinerary of group ``number``, by way of its route."""
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
        """Number of a region among the goals, of which each is there once; exits count apart, wherever they are."""
        key = exit_name, shapely.to_wkb(shapely.normalize(region))
        return self._numbers.setdefault(key, (len(self._numbers), region))[0]

    def _end_of(self, along: str) -> Polygon:
        """End of the floor as it goes on once more beyond its end along an axis."""
        xmin, ymin, xmax, ymax = self._keys.floor.bounds
        end = {
            "+x": (2.0 * xmax - xmin - END_DEPTH, ymin, 2.0 * xmax - xmin, ymax),
            "-x": (2.0 * xmin - xmax, ymin, 2.0 * xmin - xmax + END_DEPTH, ymax),
            "+y": (xmin, 2.0 * ymax - ymin - END_DEPTH, xmax, 2.0 * ymax - ymin),
            "-y": (xmin, 2.0 * ymin - ymax, xmax, 2.0 * ymin - ymax + END_DEPTH),
        }
        return shapely.box(*end[along])

    def exit_region(self, number: int) -> Polygon:
        """The region of an exit; of one that is so shallow that no body has its center in it, what is just before."""
        region = self._keys.exits[number].shape()
        assert isinstance(region, Polygon)
        free = self._environment.fixed_layers[0].free
        if meets(region, room_in(free, EXIT_ROOM)):
            return region
        grown = buffered(region, EXIT_REACH)
        return grown if isinstance(grown, Polygon) else region

    def assign(
        self, group: AgentGroup, itinerary: Itinerary, count: int, generator: np.random.Generator
    ) -> NDArray[np.int32]:
        """Goals of those whose exits are assigned by shares, in random order, one for a party; NONE for the others."""
        if not isinstance(group.exits, dict) or not len(itinerary.exits):
            return np.full(count, NONE, np.int32)
        shares = np.array([group.exits[self._keys.exits[number].name] for number in self._keys.exits_of(group)])
        # As many to each as its share says, to the next whole number.
        parties = -(-count // group.together)
        ends = np.rint(np.cumsum(shares) / shares.sum() * parties).astype(np.int64)
        which = np.searchsorted(ends, np.arange(parties), side="right")
        return itinerary.exits[which[generator.permutation(parties)]].repeat(group.together)[:count]

    def regions_of(self, number: int) -> list[BaseGeometry]:
        """Regions that group ``number`` goes to, those of its exits as one."""
        if self._keys.agents[number].exits is not None:
            return [shape for _, shape in self._keys.destinations(number)]
        goals = [goal for _, goal in self._keys.regions(number)]
        return [goal.shape() if goal.along is None else self._end_of(goal.along) for goal in goals]
