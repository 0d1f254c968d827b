"""Those who are to stand at one point gather around it: they stand where others keep them from it.

Only one body has room at a point. Others who are to stand there, too, as visitors do at an exhibit, would push each
other off it for as long as they wait.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.crowd.steered.components import standing_at
from crowdsim.geometry.elementary import hypot

ONE_BODY = 0.3
"""Radius of the smallest circle around a region up to which there is room for one body only [m]."""

KEPT_OFF_AFTER = 0.5
"""Time stuck after which an agent stands, if one that stands for the same point keeps it from that [s]."""

BESIDE = 1.0
"""Distance between centers within which one that stands keeps another off [m]: both bodies, and half a meter."""

WITHIN = 0.7
"""Cosine of the angle off the way to the point within which one that stands is in the way of another."""


def is_point(region: Polygon) -> bool:
    """Return whether one body only has room in the region of a goal."""
    return float(shapely.minimum_bounding_radius(region)) <= ONE_BODY


def kept_off(
    rows: NDArray[Any], goals: NDArray[np.int32], spots: NDArray[np.float64], crowds: Sequence[NDArray[Any]]
) -> NDArray[np.bool_]:
    """Return which agents (k,) are kept off their points: one that stands for the same point is just ahead of them.

    Parameters
    ----------
    rows : ROW[k]
        Agents that come to points, or stand near them.
    goals : (k,) int32
        Goals that these points are.
    spots : (k, 2) float64
        Points to stand at [m].
    crowds : sequence of ROW[m]
        All agents, these included; goals of those that stand are as :func:`standing_at` returns them.
    """
    off = np.zeros(len(rows), np.bool_)
    if not len(rows):
        return off
    wanted = np.unique(standing_at(goals))
    standing = np.concatenate([crowd[["x", "y", "goal"]][np.isin(crowd["goal"], wanted)] for crowd in crowds])
    places = np.column_stack((standing["x"], standing["y"]))
    mine = np.column_stack((rows["x"], rows["y"]))
    one, other = shapely.STRtree(shapely.points(places)).query(shapely.points(mine), "dwithin", BESIDE)
    there, ahead = places[other] - mine[one], spots[one] - mine[one]
    before = (there * ahead).sum(axis=1) > WITHIN * hypot(*there.T) * hypot(*ahead.T)
    off[one[before & (standing["goal"][other] == standing_at(goals[one]))]] = True
    return off
