"""Itineraries of captured agents: places one after another, repeated in rounds if the scenario says so."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.state.motion_plan import Departure, Request
from crowdsim.crowd.state.reservation_kernels import ROUNDING
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.geometry.elementary import distance
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.people.placement import Placement

TRIES = 2
"""Largest number of further searches by an agent that has arrived but stands otherwise than its scenario prescribes."""


@dataclass
class Itineraries:
    """How many places each of n agents has reached, how many there are in a round, and where it goes next."""

    cast: Placement
    """The agents, with the goals that they have now."""
    stood: list[tuple[float, float]] = field(default_factory=list)
    """Distance to the place [m] and angle to the prescribed heading [rad] (nan if none) of each stand so far."""
    reached: NDArray[np.int64] = field(init=False)
    """(n,) number of places reached."""
    places: NDArray[np.int64] = field(init=False)
    """(n,) number of places of one round."""

    def __post_init__(self) -> None:
        cast = self.cast
        # Copies, as commands change goals.
        self._goals, self._headings = [*cast.goals], [*cast.headings]
        self.cast = cast._replace(
            goals=self._goals,
            headings=self._headings,
            rounds=cast.rounds.copy(),
            stays=cast.stays.copy(),
            only_goals=cast.only_goals.copy(),
        )
        self.places = np.array([len(goals) for goals in cast.goals], np.int64)
        self.reached = np.zeros(len(self.cast.starts), np.int64)
        self._tries = np.zeros(len(self.cast.starts), np.int64)
        # Aims by agent, with the number of places reached when they were given, NONE without one: arrays do not
        # grow with those who come and leave.
        self._aims = np.zeros((len(self.cast.starts), 2))
        self._aimed_at = np.full(len(self.cast.starts), NONE, np.int64)

    def redirect(self, agent: int, goal: NDArray[np.float64], stays: bool) -> None:
        """Send an agent to ``goal`` (2,) [m] instead of all its places; there it ``stays``, or leaves the world.

        It may face in any direction there. The count of places reached begins anew at 0.
        """
        self._goals[agent], self._headings[agent] = goal[None], np.full(1, np.nan)
        self.cast.rounds[agent], self.cast.stays[agent] = 1, stays
        self.cast.only_goals[agent] = NONE  # no other agent is known to go there
        self.places[agent], self.reached[agent], self._tries[agent] = 1, 0, 0
        self._aimed_at[agent] = NONE

    def aim(self, agent: int, place: NDArray[np.float64]) -> None:
        """Let an agent go to ``place`` (2,) [m] instead of its own spot in the region of its present goal."""
        self._aims[agent], self._aimed_at[agent] = place, self.reached[agent]

    def goal(self, agent: int, ahead: int = 0) -> NDArray[np.float64]:
        """Return the place (2,) that an agent goes to [m], or the one that comes ``ahead`` places later."""
        reached = int(self.reached[agent]) + ahead
        return self._aims[agent].copy() if self._aimed_at[agent] == reached else self.cast.goal(agent, reached)

    def stands(self, agent: int, ahead: int = 0) -> bool:
        """Return True if an agent is to stand at its goal, or ``ahead`` places later, for a time or for good."""
        return self.cast.stands(agent, int(self.reached[agent]) + ahead)

    def request(
        self, agent: int, position: NDArray[np.float64], ahead: int = 0, departure: Departure | None = None
    ) -> Request:
        """Return the request for a motion from ``position`` (2,) [m] to an agent's goal, or ``ahead`` places later.

        ``departure``: the node behind which it begins, and the pose at which that started; None before the agent has
        entered.
        """
        reached = int(self.reached[agent]) + ahead
        return Request(
            position,
            self.goal(agent, ahead),
            self.cast.stands(agent, reached),
            departure,
            heading=self.cast.heading(agent, reached),
            within=float(self.cast.stand_within[agent]),
        )

    def accepts(self, agent: int, pose: NDArray[np.float64]) -> bool:
        """Return True if an agent that arrived with ``pose`` (3,) [m, rad] need not try again.

        If it is to stand there, its distance and angle are noted in ``stood``. Before that, it tries again up to TRIES
        times if it is too far off or faces another direction; each call that returns False counts as one of them.
        """
        if not self.stands(agent):
            return True
        reached = int(self.reached[agent])
        heading = self.cast.heading(agent, reached)
        off = distance(pose[:2], self.cast.goal(agent, reached))
        turned = np.nan if heading is None else abs(float(wrap_angle(pose[2] - heading)))
        # For a place without a heading, ``turned`` is nan, and the comparison False.
        misses = off > self.cast.stand_within[agent] + ROUNDING or turned > FollowOptions.goal_heading_tolerance
        if misses and self._tries[agent] < TRIES:
            self._tries[agent] += 1
            return False
        self.stood.append((off, turned))
        return True

    def is_last(self, agent: int, ahead: int = 0) -> bool:
        """Return True if an agent goes nowhere after the place that it goes to, or the one ``ahead`` places later."""
        return self.cast.is_last(agent, int(self.reached[agent]) + ahead)

    def reach(self, agent: int) -> float:
        """Count the present goal as reached; return the time to stand there [s], 0 at the last place of all."""
        last = self.is_last(agent)
        self._tries[agent] = 0
        self.reached[agent] += 1
        return 0.0 if last else float(self.cast.waits[agent])

    def leave(self, agent: int) -> None:
        """Count the last place as not reached: the agent gave way and left it."""
        self.reached[agent] -= 1

    def how_they_stood(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return distance to the place (k,) [m] and angle to the prescribed heading (k,) [rad] of each stand so far.

        The angle is nan for a stand without a prescribed heading.
        """
        off, turned = np.array(self.stood).reshape(-1, 2).T
        return off, turned

    def laps(self) -> dict[str, int]:
        """Return the number of rounds completed by each group that repeats its round, all its agents together.

        Groups are those with more than one round, or with rounds for as long as the run lasts (``rounds`` is NONE).
        """
        laps: dict[str, int] = {}
        for agent, group in enumerate(self.cast.groups):
            if self.cast.rounds[agent] != 1:
                laps[group] = laps.get(group, 0) + int(self.reached[agent]) // len(self.cast.goals[agent])
        return laps


def stands_summary(off: NDArray[np.float64], turned: NDArray[np.float64]) -> dict[str, float | int | None]:
    """Return the number of stands, 95th percentile and maximum of their distances, and maximum of their angles.

    ``off`` (k,) are distances to the place [m], ``turned`` (k,) angles to the prescribed heading [rad], nan if none.
    Distances are returned in meters, the angle in degrees; None if there is nothing to measure.
    """
    turned = np.degrees(turned[~np.isnan(turned)])
    return {
        "stood": len(off),
        "off_goal_p95": float(np.quantile(off, 0.95)) if len(off) else None,
        "off_goal_most": float(off.max()) if len(off) else None,
        "off_heading_most": float(turned.max()) if len(turned) else None,
    }
