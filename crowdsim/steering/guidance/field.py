"""One field: the cheapest way from everywhere in a place to one goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.behaviors.behavior import Behavior
from crowdsim.errors import GeometryError
from crowdsim.steering.guidance.ask_kernels import ask
from crowdsim.steering.guidance.field_kernels import PARTS, UNKNOWN, solve
from crowdsim.steering.guidance.ground import NOBODY, Crowding, Ground
from crowdsim.steering.guidance.ground_kernels import BOX, PIN_UNIT
from crowdsim.steering.guidance.sample_kernels import sample, ways_at

SIDEWAYS = math.pi / 2.0

SPACING = 0.1
"""Of the points of a goal that is too small to hold a pin [m]."""

FEW = 16
"""Pins in a goal below which points of its outline are goals too."""


BOX_ROW = np.dtype(
    [("cost", np.float32), ("length", np.float32), ("anchor", np.int32), ("slots", np.int32), ("asks", np.int8)],
    align=True,
)
"""What a field knows of a box lies side by side: an agent reads all of it."""


class Field(NamedTuple):
    """The way of every box of a :class:`~crowdsim.steering.guidance.ground.Ground`, as kernels take it."""

    cost: NDArray[np.float32]
    """float32[boxes]: what is still to pay, in meters of the preferred behavior; infinite where there is no way."""
    length: NDArray[np.float32]
    """float32[boxes]: length of the way [m]."""
    anchor: NDArray[np.int32]
    """int32[boxes]: the box at whose pin the way bends next; those behind the last box are points of the goal."""
    asks: NDArray[np.int8]
    """int8[boxes]: behavior that the next 0.7 m of the way ask for, -1 where there is no way."""
    slots: NDArray[np.int32]
    """int32[boxes]: row of ``heads`` and ``costs``, -1 if everybody in the box may go straight to its anchor."""
    heads: NDArray[np.int32]
    """int32[j, 16]: what each part of a box heads for, found when somebody is there: a box or a point of the goal."""
    costs: NDArray[np.float32]
    """float32[j, 16]: what that costs from the middle of the part."""
    points: NDArray[np.float64]
    """float64[k, 2]: points of the goal beside the pins in it [m]."""


class Ways(NamedTuple):
    """What a field says at k places."""

    direction: NDArray[np.float64]
    """float64[k, 2]: unit vectors, 0, 0 in the goal and where there is no way."""
    cost: NDArray[np.float64]
    """float64[k]: what is still to pay, infinite where there is no way."""
    length: NDArray[np.float64]
    """float64[k]: length of the way [m]."""
    behavior: NDArray[np.int64]
    """int64[k]: what the way asks for."""


def solve_field(ground: Ground, goal: BaseGeometry | ArrayLike, crowding: Crowding = NOBODY) -> Field:
    """The field to a goal: a region, reached anywhere in it, or points, float64[k, 2] or one of them [m].

    A goal that no way leads to, or outside of the place, gives a field without ways.

    Raises
    ------
    GeometryError: if the goal is neither, or has coordinates that are not finite.
    """
    points, inside = _goal_of(ground, goal)
    boxes = ground.columns * ground.rows
    of_box = np.empty(boxes, BOX_ROW)
    of_box["cost"] = of_box["length"] = np.inf
    of_box["anchor"] = -1
    field = Field(
        of_box["cost"],
        of_box["length"],
        of_box["anchor"],
        of_box["asks"],
        of_box["slots"],
        np.empty((0, PARTS * PARTS), np.int32),
        np.empty((0, PARTS * PARTS), np.float32),
        points,
    )
    state = np.zeros(boxes, np.uint8)
    solve(ground, crowding, points, inside, field, state)
    count = ask(ground, points, field, state, field.asks, field.slots)
    heads = np.full((count, PARTS * PARTS), UNKNOWN, np.int32)
    field = field._replace(heads=heads, costs=np.full((count, PARTS * PARTS), np.inf, np.float32))
    return field


def ways(ground: Ground, field: Field, places: ArrayLike) -> Ways:
    """What a field says at places, float64[k, 2] [m]."""
    at = np.ascontiguousarray(places, np.float64).reshape(-1, 2)
    out = np.empty((len(at), 5))
    ways_at(ground, NOBODY, field, at, out)
    return Ways(out[:, :2], out[:, 2], out[:, 3], out[:, 4].astype(np.int64))


def asked_of(behaviors: Sequence[Behavior], radius: float = 0.125) -> NDArray[np.float64]:
    """What each behavior asks of a body, float64[n, 2]: turn [rad] and half length of the core with arms held in [m].

    -1 for nothing. ``radius``: of the capsule [m]. A turned behavior holds the arms as the narrowest upright one does.
    """
    upright = [float(each.radii[-1]) for each in behaviors if not each.turned]
    arms_in = max((min(upright) if upright else 0.0) - radius, 0.0)
    rows = []
    for number, behavior in enumerate(behaviors):
        free = number == len(behaviors) - 1
        rows.append((SIDEWAYS if behavior.turned else -1.0, -1.0 if free else arms_in))
    return np.array(rows, np.float64).reshape(-1, 2)


def guide(
    ground: Ground, field: Field, asked: NDArray[np.float64], agents: NDArray[np.int64], state: NDArray[Any]
) -> int:
    """Write what a field says to the rows ``agents`` of ``state``, records of ROW; returns how many have no way."""
    return int(sample(ground, NOBODY, field, asked, agents, state))


def _goal_of(ground: Ground, goal: BaseGeometry | ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (k, 2) of a goal, and the boxes whose pins are in it."""
    none = np.zeros(0, np.int64)
    if not isinstance(goal, BaseGeometry):
        points = np.ascontiguousarray(goal, np.float64).reshape(-1, 2)
        if not np.isfinite(points).all():
            raise GeometryError("a goal needs finite coordinates")
        return points, none
    if goal.is_empty:
        return np.empty((0, 2)), none
    if not np.isfinite(goal.bounds).all():
        raise GeometryError("a goal needs finite coordinates")
    inside = _pins_within(ground, goal)
    points = np.empty((0, 2))
    if (ground.widest[inside] >= 0).sum() < FEW:
        outline = goal.boundary if goal.area > 0.0 else goal
        points = shapely.get_coordinates(shapely.segmentize(outline, SPACING))
        middle = shapely.get_coordinates(goal.representative_point())
        points = np.unique(np.concatenate([points, middle]), axis=0)
    return points, inside


def _pins_within(ground: Ground, goal: BaseGeometry) -> NDArray[np.int64]:
    """Boxes whose pins are in a region, ascending."""
    x0, y0, x1, y1 = goal.bounds
    columns = np.arange(
        max(math.floor((x0 - ground.left) / BOX) - 1, 0), min(math.ceil((x1 - ground.left) / BOX) + 1, ground.columns)
    )
    rows = np.arange(
        max(math.floor((y0 - ground.bottom) / BOX) - 1, 0), min(math.ceil((y1 - ground.bottom) / BOX) + 1, ground.rows)
    )
    if not len(columns) or not len(rows):
        return np.zeros(0, np.int64)
    boxes = (rows[:, None] * ground.columns + columns).ravel().astype(np.int64)
    x = ground.left + (boxes % ground.columns + 0.5) * BOX + PIN_UNIT * ground.pins[boxes, 0]
    y = ground.bottom + (boxes // ground.columns + 0.5) * BOX + PIN_UNIT * ground.pins[boxes, 1]
    within: NDArray[np.bool_] = shapely.contains_xy(goal, x, y)
    return boxes[np.flatnonzero(within)]
