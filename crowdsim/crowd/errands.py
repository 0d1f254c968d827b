"""Where everyone goes: places one after another, round and round where asked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.scenario.placement import Placement


@dataclass
class Errands:
    """How many places each character has been to, and what that means for where it goes next."""

    cast: Placement
    reached: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.reached = np.zeros(len(self.cast.starts), np.int64)

    def goal(self, agent: int, ahead: int = 0) -> NDArray[np.float64]:
        """The place (2,) that an agent goes to, or ``ahead`` places after that."""
        return self.cast.goal(agent, int(self.reached[agent]) + ahead)

    def stands(self, agent: int, ahead: int = 0) -> bool:
        """Whether it stands at that place, for a while or for good."""
        return self.cast.stands(agent, int(self.reached[agent]) + ahead)

    def is_last(self, agent: int, ahead: int = 0) -> bool:
        """Whether it goes nowhere after that place."""
        return self.cast.is_last(agent, int(self.reached[agent]) + ahead)

    def reach(self, agent: int) -> float:
        """Count the place as reached; returns the seconds to stand there, 0 to go on at once."""
        last = self.is_last(agent)
        self.reached[agent] += 1
        return 0.0 if last else float(self.cast.waits[agent])

    def laps(self) -> dict[str, int]:
        """Rounds that the characters of each group completed together, for the groups that go round."""
        laps: dict[str, int] = {}
        for agent, group in enumerate(self.cast.groups):
            if self.cast.rounds[agent] != 1:
                laps[group] = laps.get(group, 0) + int(self.reached[agent]) // len(self.cast.goals[agent])
        return laps
