"""Regions that commands name while a scenario runs: what is wrong with them, and where agents stand there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point, Polygon

from crowdsim.environment.solids import circle_around
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.people.destinations import POINT_REACHED
from crowdsim.scenario.people.placement import NOMINAL_RADIUS, STAND_ROOM, unusable
from crowdsim.scenario.schema.commands import NewGoal
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.schema.values import Region

SPACING = 2.0 * NOMINAL_RADIUS + STAND_ROOM
"""Distance between neighboring places to stand [m]."""

MOST_ROWS = 400
"""Largest number of lattice rows on either side of the middle of a goal."""


class GoalPlaces(NamedTuple):
    """A new goal's region, and places to stand.

    Attributes
    ----------
    region : Polygon
        Region that counts as the goal; a disc if the goal is a point.
    places : (p, 2) float64
        Places to stand [m], nearest to the middle first; around the point if the goal is a point.
    """

    region: Polygon
    places: NDArray[np.float64]


def places_in(environment: Environment, region: Region, count: int) -> GoalPlaces:
    """Return the polygon of a region, and ``count`` places to stand at in it, or as many as have room.

    The places are points of a square lattice around the middle of the goal. Each has free floor around it, and a free
    straight line to the middle. The region must have a place to stand (:func:`region_complaint`). If it is a point, the
    places lie around it.
    """
    shape = region.shape()
    room = environment.fixed_layers[0].room(NOMINAL_RADIUS)
    inside = room if isinstance(shape, Point) else room.intersection(shape)
    middle = shapely.get_coordinates(shape if isinstance(shape, Point) else inside.representative_point())[0]
    # The lattice covers the bounds of the room (+ 1 rounds up), but is limited: of many places, it holds about 16 times
    # as many as are needed.
    left, bottom, right, top = inside.bounds
    reach = max(right - left, top - bottom) / SPACING
    rows = int(min(reach, 2.0 * np.sqrt(count) + 8.0, MOST_ROWS)) + 1
    steps = np.arange(-rows, rows + 1, dtype=np.float64) * SPACING
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    offsets = offsets[np.lexsort((offsets[:, 1], offsets[:, 0], (offsets * offsets).sum(axis=1)))]
    places = middle + offsets
    polygon = circle_around((shape.x, shape.y), POINT_REACHED) if isinstance(shape, Point) else shape
    # The nearest ones are enough as a rule: then the others need not be tested.
    for tried in (places[:count], places):
        lines = shapely.linestrings(np.stack((np.broadcast_to(middle, tried.shape), tried), axis=1))
        usable = tried[shapely.intersects_xy(inside, tried) & shapely.covers(room, lines)]
        if len(usable) >= count:
            break
    return GoalPlaces(polygon, usable[:count])


def region_complaint(environment: Environment, region: Region) -> str | None:
    """Return why no agent with NOMINAL_RADIUS of free floor around it can stand in a region; None if one can."""
    shape = region.shape()
    if environment.fixed_layers[0].room(NOMINAL_RADIUS).intersects(shape):
        return None
    return unusable(environment, shape, NOMINAL_RADIUS)


def new_goal_complaint(keys: ScenarioFields, environment: Environment, asked: NewGoal) -> str | None:
    """Return what is wrong with a new goal, or None: it is unusable, or has no place for each agent that stays."""
    if keys.floor.periodic is not None:
        return "on a periodic floor goals cannot change during the run"
    wrong = region_complaint(environment, asked.goal)
    if wrong is not None or asked.on_arrival == "leave":
        return wrong
    # Agents that stay need a place each.
    wanted = len(set(asked.agents))
    found = len(places_in(environment, asked.goal, wanted).places)
    if found < wanted:
        return f"only {found} of {wanted} agents find a place to stay at; give a larger goal, or several"
    return None
