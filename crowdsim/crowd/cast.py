"""Who takes part in a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.crowd.setting import Setting
from crowdsim.scenario.placement import place_agents
from crowdsim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Cast:
    """The M characters of a run before they enter.

    starts, goals: (M, 2) meters. start_steps: (M,) int64. stays: (M,) bool, whether they stay where they arrive.
    groups: name of the group of each.
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    start_steps: NDArray[np.int64]
    stays: NDArray[np.bool_]
    groups: tuple[str, ...]

    @property
    def count(self) -> int:
        return len(self.starts)


def gather_cast(scenario: Scenario, setting: Setting) -> Cast:
    """Draw everyone's start and goal, with room for the widest behavior; ScenarioError where there is none."""
    placed = place_agents(scenario, setting.personal_radius + TRACKING_MARGIN)
    groups = [scenario.agents[group] for group in placed.groups]
    return Cast(
        starts=placed.starts,
        goals=placed.goals,
        start_steps=np.ceil(placed.start_times * setting.steps_per_second - 1e-9).astype(np.int64),
        stays=np.array([group.on_arrival == "stay" for group in groups], np.bool_),
        groups=tuple(group.name for group in groups),
    )
