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
from shapely import MultiPolygon, Polygon

from crowdsim.crowd.steered.components import standing_at
from crowdsim.geometry.elementary import hypot

Floats = NDArray[np.float64]
"""Array of float64."""

ONE_BODY = 0.3
"""Radius of the smallest circle around a region up to which there is room for one body only [m]."""

KEPT_OFF_AFTER = 0.5
"""Time stuck after which an agent stands, if one that stands for the same point keeps it from that [s]."""

BESIDE = 1.0
"""Distance between centers within which one that stands keeps another off [m]: both bodies, and half a meter."""

WITHIN = 0.7
"""Cosine of the angle off the way to the point within which one that stands is in the way of another."""


class Gathering:
    """Find who is kept off the point where it is to stand.

    Parameters
    ----------
    regions : sequence of Polygon
        Regions of the goals by number.
    free : MultiPolygon
        Floor that is always free.
    """

    def __init__(self, regions: Sequence[Polygon], free: MultiPolygon) -> None:
        # By goal: the middle of a region with room for one body only, nan for others.
        self._points = np.array([_point_of(region) for region in regions]).reshape(-1, 2)
        self._free = free
        shapely.prepare(free)

    def put(self, number: int, region: Polygon) -> None:
        """Set the region of goal ``number``, a new one or one that no agent goes to any more."""
        point = _point_of(region)
        self._points = np.concatenate((self._points[:number], point[None], self._points[number + 1 :]))

    def at_points(self, goals: NDArray[np.int32], spots: Floats) -> NDArray[np.bool_]:
        """Return which agents (k,) are to stand at points: their spots (k, 2) [m] are where their goals (k,) are.

        Agents that one command sends to a point have spots around it.
        """
        return np.asarray(hypot(*(spots - self._points[goals]).T) <= ONE_BODY)

    def in_sight(self, begins: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Return whether nothing stands between two positions each, (k, 2) [m]."""
        return np.asarray(shapely.covers(self._free, shapely.linestrings(np.stack((begins, ends), axis=1))))

    def kept_off(
        self, rows: NDArray[Any], goals: NDArray[np.int32], spots: Floats, crowds: Sequence[NDArray[Any]]
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
        before &= standing["goal"][other] == standing_at(goals[one])
        one, other = one[before], other[before]
        off[one[self.in_sight(mine[one], places[other])]] = True
        return off


def _point_of(region: Polygon) -> Floats:
    """Return the middle (2,) [m] of a region in which one body only has room; nan for any other."""
    if shapely.minimum_bounding_radius(region) > ONE_BODY:
        return np.full(2, np.nan)
    return np.asarray(shapely.get_coordinates(region.centroid)[0])
