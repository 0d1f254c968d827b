"""Statistics of a run of steered agents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.ranks.protocol import Ranks
from crowdsim.crowd.report.gap_kernels import closest_bodies, closest_wall
from crowdsim.crowd.report.statistics import shares_of
from crowdsim.crowd.report.steered_feet import SteeredFeet
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.motion.clips.clip import Clip
from crowdsim.steering.steering import Steering

GAP_LIMIT = 0.5
"""Largest gap to walls that is measured [m]: as far as the lists of walls reach."""

CENTER_LIMIT = 1.0
"""Largest distance between centers, and largest gap between bodies, that is measured [m]."""


WAY_UNIT = 2.0**-32
"""Unit in which ways are summed up [m], as whole numbers: so several processes get the same sums as one."""


class SteeredStatistics:
    """Measures of steered agents, summed up step by step.

    ``gait`` is the clip from which walking bodies are posed, to measure their feet.
    """

    def __init__(
        self, behaviors: Sequence[Behavior], layers: Sequence[str], areas: Mapping[str, shapely.Polygon], gait: Clip
    ) -> None:
        self._behaviors, self._layers, self._areas = behaviors, layers, areas
        self.feet = SteeredFeet(gait)
        self._ways = np.zeros((len(areas) + 1, len(behaviors)), np.int64)
        # Least gap between two bodies, and least distance between two centers [m]; inf if never measured.
        self.gap = self.centers = np.inf
        # Least gaps of legs and of torsos to walls [m].
        self._margins = [GAP_LIMIT, GAP_LIMIT]

    @property
    def way(self) -> NDArray[np.float64]:
        """Return (areas + 1, B) the length walked in each behavior, in total and by named area [m]."""
        return np.asarray(self._ways * WAY_UNIT, np.float64)

    def add(self, view: View, steering: Steering) -> None:
        """Add one step of the rows of ``view``, the columns of a steered crowd: their ways, feet, and gaps to walls.

        The way of a step counts for the behavior and the areas at its end. ``steering`` has the walls.
        """
        rows = view.row
        self.feet.add(view)
        if not len(rows):
            return
        # Whole numbers add up to the same in any order.
        gone = np.rint(hypot(rows["vx"], rows["vy"]) / (STEERING_RATE * WAY_UNIT))
        kinds = len(self._behaviors)
        self._ways[0] += np.bincount(view.behavior, gone, kinds).astype(np.int64)
        for row, area in enumerate(self._areas.values(), start=1):
            inside = shapely.contains_xy(area, rows["x"], rows["y"])
            self._ways[row] += np.bincount(view.behavior[inside], gone[inside], kinds).astype(np.int64)
        # Legs are discs, torsos are capsules.
        legs, torso, leg_radius = steering.walls
        for layer, (walls, whole) in enumerate(((legs, False), (torso, True))):
            self._margins[layer] = min(self._margins[layer], closest_wall(rows, walls, whole, leg_radius, GAP_LIMIT))

    def add_gaps(self, everybody: NDArray[Any], steering: Steering, numbers: NDArray[np.int64] | None = None) -> None:
        """Add the gaps between bodies (ROW[n]) after a step; ``numbers`` (n,) are as in :meth:`Steering.sort`."""
        if not len(everybody):
            return
        crowd = steering.sort(everybody, numbers=numbers)
        sorted_rows = (crowd.rows, crowd.places, crowd.starts, crowd.frame)
        gap, centers = closest_bodies(sorted_rows, crowd.broadest, CENTER_LIMIT)
        self.gap, self.centers = min(self.gap, gap), min(self.centers, centers)

    def join(self, ranks: Ranks) -> None:
        """Take in what other processes have measured; call it once, after the run."""
        self._ways = ranks.sum(self._ways)
        # The least of all is the largest of the negative values, negated.
        least = -ranks.most(-np.array([self.gap, self.centers, *self._margins]))
        self.gap, self.centers = float(least[0]), float(least[1])
        self._margins = least[2:].tolist()
        self.feet.join(ranks)

    def summary(self) -> dict[str, Any]:
        """Return the figures under the names that ``crowdsim run --json`` prints.

        ``closest_pair`` and ``closest_bodies`` are None from CENTER_LIMIT on, up to which they are measured.
        """
        names = [behavior.name for behavior in self._behaviors]
        areas = enumerate(self._areas, start=1)
        stance_speed, lowest = self.feet.measure()
        return {
            "behavior_share": shares_of(names, self.way[0]),
            "behavior_share_by_area": {area: shares_of(names, self.way[row]) for row, area in areas},
            "closest_pair": float(self.centers) if self.centers < CENTER_LIMIT else None,
            "closest_bodies": float(self.gap) if self.gap < CENTER_LIMIT else None,
            "obstacle_margin": self.margins_of_layers(),
            "stance_foot_speed": stance_speed,
            "lowest_foot": lowest,
        }

    def margins_of_layers(self) -> dict[str, float]:
        """Return the least gap to walls by layer [m]: that of legs for the lowest one, that of torsos for all others.

        If there is only one layer, its gap is the smaller of both.
        """
        if len(self._layers) == 1:
            return {self._layers[0]: min(self._margins)}
        return {name: self._margins[min(k, 1)] for k, name in enumerate(self._layers)}
