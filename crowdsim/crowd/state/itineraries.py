"""Where everyone goes: places one after another, round and round where asked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.motion_plan import Departure, Request
from crowdsim.crowd.state.reservation_kernels import ROUNDING
from crowdsim.following.follower.path_follower import FollowOptions
from crowdsim.geometry.elementary import distance
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.placement import Placement

TRIES = 2
"""How often an agent that came to stand otherwise than asked for searches again from there."""


@dataclass
class Itineraries:
    """How many places each character has been to, and what that means for where it goes next.

    stood: meters off the place, and radians off the heading asked for (or nan), of each who came to stand at one.
    """

    cast: Placement
    stood: list[tuple[float, float]] = field(default_factory=list)
    reached: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.reached = np.zeros(len(self.cast.starts), np.int64)
        self._tries = np.zeros(len(self.cast.starts), np.int64)

    def goal(self, agent: int, ahead: int = 0) -> NDArray[np.float64]:
        """The place (2,) that an agent goes to, or ``ahead`` places after that."""
        return self.cast.goal(agent, int(self.reached[agent]) + ahead)

    def stands(self, agent: int, ahead: int = 0) -> bool:
        """Whether it stands at that place, for a while or for good."""
        return self.cast.stands(agent, int(self.reached[agent]) + ahead)

    def request(
        self, agent: int, position: NDArray[np.float64], ahead: int = 0, departure: Departure | None = None
    ) -> Request:
        """What an agent asks a search for that goes to that place from ``position``."""
        reached = int(self.reached[agent]) + ahead
        return Request(
            position,
            self.cast.goal(agent, reached),
            self.cast.stands(agent, reached),
            departure,
            heading=self.cast.heading(agent, reached),
            within=float(self.cast.stand_within[agent]),
        )

    def accepts(self, agent: int, pose: NDArray[np.float64]) -> bool:
        """Whether an agent that has come to its place with ``pose`` (3,) may stay so, which is noted.

        Who is to stand there but farther off or turned otherwise than asked for tries again a few times.
        """
        if not self.stands(agent):
            return True
        reached = int(self.reached[agent])
        heading = self.cast.heading(agent, reached)
        off = distance(pose[:2], self.cast.goal(agent, reached))
        turned = np.nan if heading is None else abs(float(wrap_angle(pose[2] - heading)))
        misses = off > self.cast.stand_within[agent] + ROUNDING or turned > FollowOptions.goal_heading_tolerance
        if misses and self._tries[agent] < TRIES:
            self._tries[agent] += 1
            return False
        self.stood.append((off, turned))
        return True

    def is_last(self, agent: int, ahead: int = 0) -> bool:
        """Whether it goes nowhere after that place."""
        return self.cast.is_last(agent, int(self.reached[agent]) + ahead)

    def reach(self, agent: int) -> float:
        """Count the place as reached; returns the seconds to stand there, 0 to go on at once."""
        last = self.is_last(agent)
        self._tries[agent] = 0
        self.reached[agent] += 1
        return 0.0 if last else float(self.cast.waits[agent])

    def leave(self, agent: int) -> None:
        """Count the place that was reached last as not reached: it was left to give way."""
        self.reached[agent] -= 1

    def how_they_stood(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How far off its place [m], and the heading asked for [rad] or nan, each was who came to stand at one."""
        off, turned = np.array(self.stood).reshape(-1, 2).T
        return off, turned

    def laps(self) -> dict[str, int]:
        """Rounds that the characters of each group completed together, for the groups that go round."""
        laps: dict[str, int] = {}
        for agent, group in enumerate(self.cast.groups):
            if self.cast.rounds[agent] != 1:
                laps[group] = laps.get(group, 0) + int(self.reached[agent]) // len(self.cast.goals[agent])
        return laps


def stands_summary(off: NDArray[np.float64], turned: NDArray[np.float64]) -> dict[str, float | int | None]:
    """How many stood at a place, and how far off it [m] and the heading asked for [rad, nan for any] they were."""
    turned = np.degrees(turned[~np.isnan(turned)])
    return {
        "stood": len(off),
        "off_goal_p95": float(np.quantile(off, 0.95)) if len(off) else None,
        "off_goal_most": float(off.max()) if len(off) else None,
        "off_heading_most": float(turned.max()) if len(turned) else None,
    }
