"""Choice of the level: agents are captured while they have room, and steer among others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.mixed.company_kernels import find_company
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST
from crowdsim.geometry.elementary import hypot
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.scenario.schema.schema import Neighborhood
from crowdsim.steering.steering import SortedCrowd
from crowdsim.steering.walls import Walls

NEAR = 1.5
"""Distance within which others count for the density [m]."""

CROWDED = 5
"""Number of others within NEAR from which on an auto agent steers: 0.7 to a square meter."""

EASED = 2
"""Largest number of others within NEAR with which a steered auto agent counts as calm."""

SEEN = 5.0
"""Distance of others up to which their approach is predicted [m]."""

MEETS = 0.65
"""Distance between centers at closest approach below which two agents meet [m]: more than both bodies are broad."""

PASSES = 0.9
"""Distance between centers at closest approach below which one passes the other close by [m]."""

MEETS_WITHIN = 2.5
"""Time until a meeting below which an auto agent steers [s]."""

CALM_FOR = 4.0
"""Time until another agent passes close by (PASSES) above which a steered auto agent counts as calm [s]."""

BLOCKED_FOR = 0.3
"""Time for which a captured auto agent is refused before it steers [s]."""

QUEUES_FOR = 3.0
"""Time for which a captured auto agent without room to pass others is refused before it steers [s]. Steering hardly
helps it before a long narrow place, but among furniture it does. If longer, fewer steer, and rooms take longer."""

LANE = (0.9, 4.0)
"""Width and length [m]: an agent is in a lane if walls are closer together than the width, less LANE_SPARE of
:mod:`crowdsim.steering.wall_kernels`, and have been so behind it for the length."""

SLOW = 0.5
"""Share of its own speed below which an agent in a lane counts as slow."""

SLOW_OVER = 3.0
"""Time constant of the moving average of an agent's speed, by which it is found slow [s]."""

STAYS_FOR = 2.0
"""Time that must have passed before a steered agent goes back to captured motion [s]: since it began to steer, since
it was last not calm, and since the end of a lane in which it was slow."""

FAVORED = 1.0
"""The time that replaces STAYS_FOR in the area in which the scenario favors captured motion [s]; after a lane,
STAYS_FOR holds there, too."""

PACE_OFF = 0.03
"""Share by which a prescribed speed may lie outside of the speeds of captured motion for its agent to be captured."""

Bools = NDArray[np.bool_]
"""Array of bool."""
Floats = NDArray[np.float64]
"""Array of float64."""


class Levels:
    """Decide which agents should change their level; n is the number of agents of the run.

    An agent is calm if there are EASED others near it at most, and none passes close by within CALM_FOR. A *paced*
    agent has a prescribed speed.

    Parameters
    ----------
    cast : CrowdPlacement
        The agents, with the level that each group may have.
    favored : Neighborhood or None
        Disc in which the scenario favors captured motion.
    """

    def __init__(self, cast: CrowdPlacement, favored: Neighborhood | None) -> None:
        kinds = np.array(cast.locomotions)[cast.group]
        self.may_steer = kinds != "captured"
        """(n,) True if the group of an agent may steer."""
        self.may_capture = kinds != "steered"
        """(n,) True if an agent may be captured: its group may, and if the agent is paced, captured motion has its
        speed."""
        self._auto = kinds == "auto"
        self._paced = np.array(cast.paced)[cast.group] & self._auto
        self._speeds = cast.walkers.speeds
        self._favored = favored
        count = cast.head_count
        self.changed = np.zeros(count, np.int64)
        """(n,) step of the last change of level, or of the entry."""
        # (n,) last step in which each agent was not calm.
        self._calm_since = np.zeros(count, np.int64)
        self.near = np.zeros(count, np.int64)
        """(n,) number of others within NEAR, for agents in the world; see :func:`find_company`, also for ``confined``
        and ``soon`` (n,)."""
        self.confined, self.soon = np.zeros(count, np.bool_), np.full(count, np.inf)
        # (n,) True for agents in a lane, and last step of each in a lane; True for agents that count as slow; mean
        # speed of each [m/s].
        self._in_lane, self._lane_step = np.zeros(count, np.bool_), np.zeros(count, np.int64)
        self._slow = np.zeros(count, np.bool_)
        self._mean_speeds = self._speeds.copy()

    def keep_paces(self, natural_speed: float) -> None:
        """Let no paced auto agent be captured if no captured motion has its speed: it always steers then.

        All other paced auto agents may be captured. ``natural_speed`` is the speed of captured motion in the preferred
        behavior, played as captured [m/s]; it can be played at SLOWEST to FASTEST of that.
        """
        shares = self._speeds / natural_speed
        off = (shares < SLOWEST * (1.0 - PACE_OFF)) | (shares > FASTEST * (1.0 + PACE_OFF))
        self.may_capture = np.where(self._paced, ~off, self.may_capture)

    def set_speed(self, agents: NDArray[np.int64], natural_speed: float) -> None:
        """Note that a command gave speeds to agents (k,), so that auto ones are paced from now on.

        The speeds are in the cast already. ``natural_speed`` is that of :meth:`keep_paces`.
        """
        self._paced[agents] = self._auto[agents]
        # How it walked at another speed does not make it slow at this one.
        self._mean_speeds[agents] = self._speeds[agents]
        self.keep_paces(natural_speed)

    def look_around(self, crowd: SortedCrowd, walls: tuple[Walls, Walls], step: int) -> None:
        """Find the company of all agents in the world, sorted by cells, between the walls for legs and torso.

        Keep what :func:`find_company` finds, and since when each agent is calm. An agent that was slow in a lane counts
        as slow until STAYS_FOR after the end of the lane.
        """
        count = len(crowd.rows)
        near, soon, wide = np.zeros(count, np.int64), np.empty(count), np.empty(count)
        confined, in_lane = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        present = (crowd.rows, crowd.starts, crowd.frame, crowd.order)
        find_company(*present, walls, LANE, (NEAR, SEEN), (MEETS, PASSES), near, confined, in_lane, soon, wide)
        # Outputs are in the order before sorting: find the agent number of each.
        agents = np.empty(count, np.int64)
        agents[crowd.order] = crowd.rows["id"]
        self.near[agents], self.confined[agents], self.soon[agents] = near, confined, soon
        self._in_lane[agents], self._lane_step[agents[in_lane]] = in_lane, step
        self._slow[agents] &= step - self._lane_step[agents] < STAYS_FOR * STEERING_RATE
        calm = (near <= EASED) & (wide > CALM_FOR)
        self._calm_since[agents[~calm]] = step

    def follow_speeds(self, agents: NDArray[np.int64], speeds: Floats, ahead: Bools) -> None:
        """Average the ``speeds`` (k,) [m/s] of captured agents (k,), and note which are slow in a lane.

        They are to steer then, as captured motion stops in tight bends, and steering does not. The note lasts until
        STAYS_FOR after the end of the lane (`look_around`). ``ahead`` (k,) is True for agents that face ahead; sideways
        they are always slow, which does not count.
        """
        means = self._mean_speeds[agents]
        means += (speeds - means) / (SLOW_OVER * STEERING_RATE)
        slow = self._in_lane[agents] & ahead & (means < SLOW * self._speeds[agents])
        self._slow[agents[slow]] = True
        # A slow agent begins a new average, at its own speed, for when it is captured again.
        self._mean_speeds[agents] = np.where(slow, self._speeds[agents], means)

    def is_favored(self, places: Floats) -> Bools:
        """Return which positions (k, 2) [m] are in the area in which the scenario favors captured motion."""
        if self._favored is None:
            return np.zeros(len(places), np.bool_)
        x, y = self._favored.point
        return np.asarray(hypot(places[:, 0] - x, places[:, 1] - y) <= self._favored.radius)

    def steer(self, agents: NDArray[np.int64], places: Floats, blocked: Floats) -> Bools:
        """Return which of some captured agents (k,), at ``places`` (k, 2) [m], should steer.

        ``blocked`` (k,) is the time for which each was refused, or the time beyond one second for which it has stood
        though it wants to walk, whichever is longer [s]. Only agents whose group may steer are returned, if they are
        blocked, slow in a lane, in company (outside of the favored area), or cannot be captured at their speed.
        """
        # In the favored area, company is no reason to steer.
        met = (self.near[agents] >= CROWDED) | (self.soon[agents] < MEETS_WITHIN)
        refused = blocked >= np.where(self.confined[agents], QUEUES_FOR, BLOCKED_FOR)
        # Its group may be captured, but no captured motion has the speed that it was given.
        off_pace = ~self.may_capture[agents]
        anywhere = off_pace | refused | self._slow[agents]
        return np.asarray(self.may_steer[agents] & (anywhere | (met & ~self.is_favored(places))))

    def capture(self, agents: NDArray[np.int64], places: Floats, step: int) -> Bools:
        """Return which of some steered agents (k,), at ``places`` (k, 2) [m], may go back to captured motion.

        They have steered and been calm for long enough, and do not count as slow in a lane.
        """
        stays = np.where(self.is_favored(places), FAVORED, STAYS_FOR) * STEERING_RATE
        since = np.maximum(self.changed[agents], self._calm_since[agents])
        return np.asarray(self.may_capture[agents] & (step - since >= stays) & ~self._slow[agents])
