"""One field: the cheapest path from everywhere in a place to one goal."""

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
from crowdsim.steering.guidance.field_kernels import PARTS, UNKNOWN
from crowdsim.steering.guidance.ground import NOBODY, Crowding, Ground
from crowdsim.steering.guidance.ground_kernels import BOX, PIN_UNIT
from crowdsim.steering.guidance.solve_kernels import solve
from crowdsim.steering.guidance.way_kernels import end_of_way, sample, ways_at

SIDEWAYS = math.pi / 2.0
"""Angle between heading and path that a turned behavior prescribes [rad]."""

SPACING = 0.1
"""Spacing of the points of a goal that is too small to contain pins [m]."""

FEW = 16
"""Number of pins in a goal below which points of its outline are goals, too."""


BOX_ROW = np.dtype(
    [("cost", np.float32), ("length", np.float32), ("anchor", np.int32), ("slots", np.int32), ("asks", np.int8)],
    align=True,
)
"""Values of a field for one box. They are adjacent in memory, as an agent reads all of them."""


class Field(NamedTuple):
    """Paths of the boxes of a :class:`~crowdsim.steering.guidance.ground.Ground`; kernels take it as it is.

    Columns have a row for each box of the ground, in their order, or for each of ``known``. Anchors and targets are
    numbered by the boxes of the ground in both cases.
    """

    cost: NDArray[np.float32]
    """float32[boxes]: cost to the goal, in the unit of ``Ground.costs`` times meters; infinite without a path."""
    length: NDArray[np.float32]
    """float32[boxes]: length of the path [m]."""
    anchor: NDArray[np.int32]
    """int32[boxes]: box at whose pin the path from the pin of the box bends next; a number n >= boxes is point
    n - boxes of the goal. A box whose pin is in the goal is its own anchor; -1 without a path."""
    asks: NDArray[np.int8]
    """int8[boxes]: narrowest behavior needed on the next 0.7 m of the path, -1 without a path."""
    slots: NDArray[np.int32]
    """int32[boxes]: row of ``heads`` and ``costs`` (if these have any); -1 if all agents in the box may head straight
    for its anchor."""
    heads: NDArray[np.int32]
    """int32[j, 16]: target of each part of a box with a slot, numbered like anchors; -1 if no line is free, UNKNOWN
    until the first agent is there. Of no rows, if targets are not remembered."""
    costs: NDArray[np.float32]
    """float32[j, 16]: cost from the middle of the part to the goal over that target; infinite if it has none."""
    points: NDArray[np.float64]
    """float64[k, 2]: points of the goal that are anchors, in addition to the pins in it [m]."""
    known: NDArray[np.int32]
    """int32[k]: the boxes that have a row, ascending; empty if all have one."""


class Lead(NamedTuple):
    """For whom a field is solved; kernels take it as it is."""

    box: int
    """Box of the agent for whom the field is; -1 if it is for all agents, wherever they are."""
    aside: float
    """How far aside of a straight path boxes are solved, in its middle, if it is not too short or too long for that
    [m]."""


class Work(NamedTuple):
    """Scratch of a search; kernels take it as it is."""

    state: NDArray[np.uint8]
    """uint8[boxes]: states of the boxes, NEW before the search."""
    seed_cost: NDArray[np.float32]
    """float32[boxes]: cost of a box that is in the goal, or from which a line to a point of it was tested; else
    infinite."""
    seed_anchor: NDArray[np.int32]
    """int32[boxes]: its anchor then."""
    seed_state: NDArray[np.uint8]
    """uint8[boxes]: its state then."""
    closed: NDArray[np.int32]
    """int32[boxes]: gets the boxes that become final, in this order; empty if these are not needed."""

    @staticmethod
    def of(boxes: int, *, listed: bool) -> Work:
        """Return the scratch of a search among a number of boxes, that lists those that become final, or not."""
        return Work(
            np.zeros(boxes, np.uint8),
            np.full(boxes, np.inf, np.float32),
            np.empty(boxes, np.int32),
            np.empty(boxes, np.uint8),
            np.empty(boxes if listed else 0, np.int32),
        )


FOR_ALL = Lead(-1, 0.0)
"""The field is for all agents."""

ALL_BOXES = np.empty(0, np.int32)
"""The boxes that a field knows if it knows all."""


class Ways(NamedTuple):
    """Paths from k positions, as a field gives them."""

    direction: NDArray[np.float64]
    """float64[k, 2]: unit vectors; (0, 0) in the goal, exactly at the point that the path heads for, and without a
    path."""
    cost: NDArray[np.float64]
    """float64[k]: cost to the goal, in the unit of ``Ground.costs`` times meters; infinite without a path."""
    length: NDArray[np.float64]
    """float64[k]: length of the path [m], infinite without one."""
    behavior: NDArray[np.int64]
    """int64[k]: behavior needed next; the widest in the goal, and without a path."""


def solve_field(ground: Ground, goal: BaseGeometry | ArrayLike, crowding: Crowding = NOBODY) -> Field:
    """Solve the field to one goal.

    Parameters
    ----------
    ground : Ground
        The place.
    goal : BaseGeometry or (k, 2) or (2,) float64
        A region, reached anywhere in it, or points [m]. A goal that no path leads to, or outside of the place, gives a
        field without paths.
    crowding : Crowding
        Factor of the crowd on costs; no crowd by default.

    Returns
    -------
    Field

    Raises
    ------
    GeometryError
        If the goal has coordinates that are not finite.
    """
    points, inside = goal_of(ground, goal)
    boxes = ground.columns * ground.rows
    of_box = no_paths(boxes)
    field, work = field_of(of_box, points), Work.of(boxes, listed=False)
    solve(ground, crowding, points, inside, FOR_ALL, field, work)
    count = set_behaviors(ground, field, work.state, ALL_BOXES, of_box)
    heads = np.full((count, PARTS * PARTS), UNKNOWN, np.int32)
    return field._replace(heads=heads, costs=np.full((count, PARTS * PARTS), np.inf, np.float32))


def field_to_boxes(ground: Ground, boxes: NDArray[np.int64], length: float) -> Field:
    """Return a field to the nearest pin of some boxes (k,), from which ways of ``length`` [m] count to lead on."""
    of_box = no_paths(ground.columns * ground.rows)
    # All boxes look for a line to a pin; as no targets are remembered, it does not matter which slots they have.
    of_box["asks"], of_box["slots"] = -1, 0
    of_box["cost"][boxes], of_box["length"][boxes], of_box["anchor"][boxes] = length, length, boxes
    of_box["asks"][boxes] = len(ground.costs) - 1
    return field_of(of_box, np.empty((0, 2)))


def no_paths(boxes: int) -> NDArray[Any]:
    """Return the values BOX_ROW[boxes] of boxes without a path."""
    of_box = np.empty(boxes, BOX_ROW)
    of_box["cost"] = of_box["length"] = np.inf
    of_box["anchor"] = -1
    return of_box


def field_of(of_box: NDArray[Any], points: NDArray[np.float64], known: NDArray[np.int32] = ALL_BOXES) -> Field:
    """Return a field to ``points`` (k, 2) [m] with the values BOX_ROW of its boxes, without slots yet."""
    none = np.empty((0, PARTS * PARTS), np.int32)
    columns = (of_box["cost"], of_box["length"], of_box["anchor"], of_box["asks"], of_box["slots"])
    return Field(*columns, none, none.astype(np.float32), points, known)


def set_behaviors(
    ground: Ground, field: Field, state: NDArray[np.uint8], known: NDArray[np.int32], of_box: NDArray[Any]
) -> int:
    """Set behaviors and slots of the boxes ``known`` (k,), or of all if there are none, in their values BOX_ROW.

    ``field`` has rows for all boxes; ``state`` (boxes,) are their states after the search. Return the number of slots.
    """
    # Ways are found with the clearances that bodies need, behaviors prescribed by those of plans, which may be larger.
    asking = ground._replace(radii=ground.prescribed)
    return int(ask(asking, field.points, field, state, known, of_box["asks"], of_box["slots"]))


def ways(ground: Ground, field: Field, places: ArrayLike) -> Ways:
    """Return the paths from positions, float64[k, 2] [m], as a field gives them."""
    at = np.ascontiguousarray(places, np.float64).reshape(-1, 2)
    out = np.empty((len(at), 5))
    ways_at(ground, NOBODY, field, at, out)
    return Ways(out[:, :2], out[:, 2], out[:, 3], out[:, 4].astype(np.int64))


def way_end(ground: Ground, field: Field, place: ArrayLike) -> NDArray[np.float64]:
    """Return where the way from ``place`` (2,) [m] enters the goal, (2,) [m]; nan if there is no way."""
    x, y = np.asarray(place, np.float64).tolist()
    return np.array(end_of_way(ground, NOBODY, field, x, y))


def asked_of(behaviors: Sequence[Behavior], radius: float = 0.125) -> NDArray[np.float64]:
    """Return the body that each behavior prescribes.

    Parameters
    ----------
    behaviors : sequence of Behavior
        The behaviors, the narrowest and least preferred first.
    radius : float
        Radius of the capsule [m].

    Returns
    -------
    (n, 2) float64
        Angle between heading and path [rad], and half length of the core with the arms held in [m]; -1 if not
        prescribed. All behaviors but the last one hold the arms in, as far as the narrowest upright (not turned)
        behavior does; the last one leaves them free.
    """
    # The last radius is that on the uppermost layer, which the arms meet. If no behavior is upright, or the body is no
    # broader than the capsule, the core has length 0.
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
    """Write guidance, as a field gives it, to the rows ``agents`` (k,) of ``state`` (ROW[n]).

    That is gx, gy, togo, the course (cx, cy, ahead, onx, ony), turn and held. ROW is that of
    :mod:`crowdsim.steering.row_kernels`; ``asked`` is the array that :func:`asked_of` returns. Return the number of
    these agents that have no path.
    """
    return int(sample(ground, NOBODY, field, asked, agents, state))


def goal_of(ground: Ground, goal: BaseGeometry | ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the points (k, 2) of a goal [m], and the boxes whose pins are in it.

    A region has points only if it contains less than FEW pins; a goal of points contains no pins.
    """
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
    # A region with few pins: points of its outline, and one inside, make its shape count. Lines and points, which have
    # no area, are taken as they are.
    if (ground.widest[inside] >= 0).sum() < FEW:
        outline = goal.boundary if goal.area > 0.0 else goal
        points = shapely.get_coordinates(shapely.segmentize(outline, SPACING))
        middle = shapely.get_coordinates(goal.representative_point())
        points = np.unique(np.concatenate([points, middle]), axis=0)
    return points, inside


def _pins_within(ground: Ground, goal: BaseGeometry) -> NDArray[np.int64]:
    """Return the boxes whose pins are in a region, ascending."""
    x0, y0, x1, y1 = goal.bounds
    # Boxes that meet the bounds, and one more on each side; then test their pins.
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
