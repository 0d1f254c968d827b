"""Places in the regions of goals to which agents go that switch to captured motion, if they are not to stand there."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from crowdsim.crowd.steered.errands import Errands
from crowdsim.environment.spots import meets
from crowdsim.scenario.people.placement import NOMINAL_RADIUS, rooms_around
from crowdsim.scenario.scenario import Scenario
from crowdsim.steering.guidance.guidance import Guidance

Floats = NDArray[np.float64]


class Aims:
    """Find the place at which the way of a steered agent enters the region of its goal.

    A steered agent has reached a region as soon as it is inside, a captured one when it is at its spot there. If an
    agent that switches to captured motion just before a broad region kept its spot, it might have to walk many times
    as far.
    """

    def __init__(self, scenario: Scenario, errands: Errands, guidance: Guidance) -> None:
        self._errands, self._guidance = errands, guidance
        # Floor with room for a captured body: first where that is always free, then where it is while no movable is.
        self._rooms = rooms_around(scenario, scenario.environment, NOMINAL_RADIUS)
        self._usable: dict[int, tuple[Polygon, MultiPolygon | None]] = {}

    def place(self, goal: int, following: int, at: Floats) -> Floats | None:
        """Return the place (2,) [m] with room in a goal's region, nearest to where the path from ``at`` enters it.

        ``at`` (2,) is where the agent is [m]; ``following`` is the number of the field whose path leads to ``goal``.
        Return None if there is no path, or no room in the region.
        """
        end = self._guidance.end(goal, following, at)
        usable = self._usable_part(goal)
        if usable is None or not np.isfinite(end).all():
            return None
        nearest = shapely.shortest_line(usable, Point(*end))
        return np.asarray(shapely.get_coordinates(nearest)[0])

    def _usable_part(self, goal: int) -> MultiPolygon | None:
        """Return the part of the region of a goal that captured agents can walk to; None if there is none."""
        region = self._errands.region(goal)
        known = self._usable.get(goal)
        # Compare the region: the number of a commanded goal may stand for another region later.
        if known is None or known[0] is not region:
            # Floor that is always free comes first in ``_rooms``.
            room = next((room for room in self._rooms if meets(region, room)), None)
            usable = None if room is None else room.intersection(region)
            if usable is not None:
                shapely.prepare(usable)
            known = self._usable[goal] = region, usable
        return known[1]
