"""Statistics of a run of captured agents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.crowd.near.neighbors import sorted_places
from crowdsim.crowd.report.foot_statistics import FootStatistics
from crowdsim.crowd.report.measure_kernels import closest_pair, obstacle_margin
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState, RecordedFrame

MARGIN_LIMIT = 1.0
"""Largest distance of bodies to obstacles that is measured [m]."""


def shares_of(behaviors: Sequence[str], way: NDArray[np.float64]) -> dict[str, float]:
    """Return by behavior its share of ``way`` (B,), the lengths walked in each [m]; all shares are 0 if none was."""
    total = way.sum()
    return {name: float(gone / total) if total else 0.0 for name, gone in zip(behaviors, way, strict=True)}


@dataclass
class Statistics:
    """Measures of captured agents, summed up step by step."""

    assets: Assets
    environment: EnvironmentState
    areas: Mapping[str, shapely.Polygon]
    way: NDArray[np.float64] = field(init=False)
    """(areas + 1, B) length walked in each behavior, in total and by named area [m]."""
    closest: float = np.inf
    """Smallest distance between two agents, positions of their tracks [m]; infinite if none was measured."""
    margin: NDArray[np.float64] = field(init=False)
    """(layers,) smallest distance of a body disc of the present behavior to an obstacle [m]; negative if they overlap,
    MARGIN_LIMIT at most."""
    feet: FootStatistics = field(init=False)
    _before: RecordedFrame | None = None

    def __post_init__(self) -> None:
        self.way = np.zeros((len(self.areas) + 1, len(self.assets.behaviors)))
        self.margin = np.full(len(self.environment.meshes), MARGIN_LIMIT)
        self.feet = FootStatistics(self.assets.motion, self.assets.steps_per_second)

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of all agents, in the environment as it is now: margins, ways and feet, but not gaps.

        :meth:`add_gaps` adds the gaps between agents.
        """
        state = np.asarray(frame.state)
        present = np.flatnonzero(state != AgentState.ABSENT)
        pose = np.column_stack([frame.x, frame.y, frame.heading])[present]
        behavior = np.asarray(frame.behavior, np.int32)[present]
        for layer, mesh in enumerate(self.environment.meshes):
            radii = np.ascontiguousarray(self.assets.body_radii[:, layer])
            self.margin[layer] = min(
                self.margin[layer], obstacle_margin(pose, behavior, mesh.arrays, radii, MARGIN_LIMIT)
            )
        before = self._before
        if before is not None:
            both = present[np.asarray(before.state)[present] != AgentState.ABSENT]
            x, y = np.asarray(frame.x)[both], np.asarray(frame.y)[both]
            # The way of an agent since the step before counts for the behavior at its end, and for the areas in which
            # it ends.
            gone = hypot(x - np.asarray(before.x)[both], y - np.asarray(before.y)[both])
            how = np.asarray(frame.behavior)[both]
            np.add.at(self.way[0], how, gone)
            for row, area in enumerate(self.areas.values(), start=1):
                inside = shapely.contains_xy(area, x, y)
                np.add.at(self.way[row], how[inside], gone[inside])
        self.feet.add(frame, present)
        self._before = frame

    def add_gaps(self, frame: RecordedFrame) -> None:
        """Update the smallest distance between two agents (``closest``) by one step."""
        places = np.column_stack([frame.x, frame.y])[np.asarray(frame.state) != AgentState.ABSENT]
        self.closest = min(self.closest, closest_pair(places, *sorted_places(places), self.closest))

    def shares(self, row: int) -> dict[str, float]:
        """Return the share of the way by behavior in row ``row`` of ``way``; all zero if no agent walked."""
        return shares_of([behavior.name for behavior in self.assets.behaviors], self.way[row])

    def summary(self) -> dict[str, Any]:
        """Return the figures under the names that ``crowdsim run --json`` prints."""
        layers = [layer.name for layer in self.assets.layers]
        return {
            "behavior_share": self.shares(0),
            "behavior_share_by_area": {name: self.shares(row) for row, name in enumerate(self.areas, start=1)},
            "closest_pair": float(self.closest) if np.isfinite(self.closest) else None,
            "obstacle_margin": dict(zip(layers, self.margin.tolist(), strict=True)),
            "stance_foot_speed": self.feet.stance_speed,
            "lowest_foot": self.feet.lowest if self.feet.lowest < np.inf else None,
        }
