"""When walking steered agents have reached their goals: in the region, or near it in a throng."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

REACHED = 0.05
"""Length to go below which a goal is reached, even outside of its region: walls may keep bodies out of it [m]."""

PASSED_WITHIN = 0.75
"""Length to go below which an agent that walks through a region passes it if it is held up [m]. So a point, whose
region is a disc of 0.25 m, is passed from within a meter, as by captured agents."""

HELD_UP = 1.0
"""Time stuck from which on an agent counts as held up [s]."""


def is_near(rows: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which agents, rows ROW[k], are so near to the end of their way that they may have reached it."""
    return np.asarray(rows["togo"] < PASSED_WITHIN)


def are_within(rows: NDArray[Any], goals: NDArray[np.int32], regions: Sequence[Polygon]) -> NDArray[np.bool_]:
    """Return which agents, rows ROW[k], are in the region of their goal (k,), or as near to it as ways lead."""
    within: NDArray[np.bool_] = rows["togo"] <= REACHED
    for goal in np.unique(goals).tolist():
        asked = np.flatnonzero(goals == goal)
        within[asked] |= shapely.contains_xy(regions[goal], rows["x"][asked], rows["y"][asked])
    return within


def are_held_up(rows: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which agents, rows ROW[k], near the regions that they walk through, are held up there by a throng."""
    return np.asarray((rows["togo"] < PASSED_WITHIN) & (rows["stuck"] > HELD_UP))
