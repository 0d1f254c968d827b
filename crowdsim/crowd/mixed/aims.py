"""Places in the regions of goals to which captured agents go instead of their own spots.

They do so if they are not to stand there, and either switch to captured motion, or cannot get to their spots.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.errands import Errands
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.crowd.systems.replan import AT_GOAL
from crowdsim.environment.spots import meets
from crowdsim.geometry.polygons import buffered
from crowdsim.recording.header import AgentState
from crowdsim.scenario.people.placement import NOMINAL_RADIUS, rooms_around
from crowdsim.scenario.scenario import Scenario
from crowdsim.steering.guidance.guidance import Guidance

STOOD_FOR = 8
"""Time for which a captured agent has stood, and not gone on, after which it gives up its spot [s]. Each time that this
has passed again, it looks for another one."""

JUST_BEFORE = 2.5
"""Distance to the region of its goal within which it does so [m]."""

BESIDE = 0.9
"""Distance that the other spot keeps from all that stay [m]: bodies that come to rest, and room to turn."""

Floats = NDArray[np.float64]
"""Array of float64."""


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
        return None if usable is None or not np.isfinite(end).all() else _nearest(usable, end)

    def go_beside(self, captured: CapturedCrowd, steered: SteeredCrowd, stood: NDArray[np.int64]) -> None:
        """Send captured agents elsewhere in the regions of their goals that have long stood in or just before these.

        Others stand on their spots, or in front of these: captured ones give way, but steered ones step aside and come
        back. Agents that are to stand in the region keep their spots; others that are in it have reached it. ``stood``
        (n,) is the number of steps for which each agent has stood and not gone on.
        """
        view, itineraries = captured.world.view(), captured.itineraries
        agents = view.agent.astype(np.int64)
        long = (stood[agents] > 0) & (stood[agents] % (STOOD_FOR * STEERING_RATE) == 0)
        waits = np.flatnonzero(long & (view.state == AgentState.WAITING))
        if not len(waits):
            return
        rows, stands = steered.world.column("row"), steered.world.column("errand") != Errand.WALKS
        bodies = np.column_stack((rows["x"], rows["y"]))[stands]
        bodies = np.concatenate((bodies, view.pose[view.state == AgentState.ARRIVED, :2]))
        goals = self._errands.goal(agents[waits], itineraries.reached[agents[waits]])
        # By goal: the part of its region off all bodies. Those that leave change the rows of those behind them: places
        # come first.
        left: dict[int, BaseGeometry] = {}
        places = view.pose[waits, :2].copy()
        for at, agent, goal in zip(places, agents[waits].tolist(), goals.tolist(), strict=True):
            usable = self._usable_part(goal)
            if usable is None or itineraries.stands(agent):
                continue
            off = shapely.distance(usable, Point(*at))
            if off > JUST_BEFORE:
                continue
            # No motion may lead over the last centimeters.
            if off < AT_GOAL:
                captured.reach(agent)
                continue
            if goal not in left:
                left[goal] = _off(usable, bodies)
            if not left[goal].is_empty:
                place = _nearest(left[goal], at)
                captured.go_elsewhere(agent, place)
                left[goal] = _off(left[goal], place[None])

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


def _off(area: BaseGeometry, bodies: Floats) -> BaseGeometry:
    """Return the part of an area that is BESIDE or farther off the positions ``bodies`` (k, 2) [m]."""
    near = bodies[shapely.dwithin(area, shapely.points(bodies), BESIDE)]
    return area.difference(buffered(shapely.MultiPoint(near), BESIDE)) if len(near) else area


def _nearest(area: BaseGeometry, at: Floats) -> Floats:
    """Return the point (2,) of an area that is nearest to ``at`` (2,) [m]."""
    return np.asarray(shapely.get_coordinates(shapely.shortest_line(area, Point(*at)))[0])
