"""Statistics of a run on both levels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.report.gap_kernels import closest_bodies
from crowdsim.crowd.report.statistics import shares_of
from crowdsim.crowd.report.steered_statistics import CENTER_LIMIT
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd

LEVELS = ("captured", "steered")
"""Names of the levels in a summary."""


class MixedStatistics:
    """Measures of both levels, summed up step by step."""

    def __init__(self, captured: CapturedCrowd, steered: SteeredCrowd) -> None:
        self._captured, self._steered = captured, steered
        # Least gap of two bodies, and least distance of two centers so far [m].
        self._gap = self._centers = np.inf

    def add(self, present: NDArray[Any]) -> None:
        """Add one step; ``present``, ROW[m] of `crowdsim.steering.row_kernels`, are all agents in the world."""
        captured, steered = self._captured, self._steered
        captured.statistics.add(captured.frame())
        steered.statistics.add(steered.world.view(), steered.steering)
        # The least gap of all agents covers both levels.
        crowd = steered.steering.sort(present, steered.place.bounds)
        rows = (crowd.rows, crowd.places, crowd.starts, crowd.frame)
        gap, centers = closest_bodies(rows, crowd.broadest, CENTER_LIMIT)
        self._gap, self._centers = min(self._gap, gap), min(self._centers, centers)

    def summary(self) -> dict[str, Any]:
        """Return the figures under the names that ``crowdsim run --json`` prints.

        ``closest_pair`` and ``closest_bodies`` [m] are measured up to CENTER_LIMIT, and None from there on.
        """
        captured, steered = self._captured.statistics, self._steered.statistics
        names = [behavior.name for behavior in captured.assets.behaviors]
        # Length of the way walked in each behavior [m]: row 0 everywhere, then one row for each area.
        way = captured.way + steered.way
        theirs = steered.margins_of_layers()
        margins = captured.summary()["obstacle_margin"]
        feet = [each.summary() for each in (captured, steered)]
        speeds = [each["stance_foot_speed"] for each in feet if each["stance_foot_speed"] is not None]
        lowest = [each["lowest_foot"] for each in feet if each["lowest_foot"] is not None]
        return {
            "behavior_share": shares_of(names, way[0]),
            "behavior_share_by_area": {
                area: shares_of(names, way[row]) for row, area in enumerate(captured.areas, start=1)
            },
            "level_share": shares_of(LEVELS, np.array([captured.way[0].sum(), steered.way[0].sum()])),
            "closest_pair": float(self._centers) if self._centers < CENTER_LIMIT else None,
            "closest_bodies": float(self._gap) if self._gap < CENTER_LIMIT else None,
            "obstacle_margin": {name: min(margin, theirs[name]) for name, margin in margins.items()},
            # The worse of both levels.
            "stance_foot_speed": max(speeds, default=None),
            "lowest_foot": min(lowest, default=None),
        }
