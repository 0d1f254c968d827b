"""On which level characters walk: captured while they have room, steered where they meet others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.mixed.company_kernels import find_company
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST
from crowdsim.geometry.elementary import hypot
from crowdsim.scenario.crowd_placement import CrowdPlacement
from crowdsim.scenario.schema.schema import Neighborhood
from crowdsim.steering.steering import SortedCrowd
from crowdsim.steering.walls import Walls

NEAR = 1.5
"""Distance within which others count for the density [m]."""

CROWDED = 5
"""Others that near from which on an auto character steers: 0.7 to a square meter."""

EASED = 2
"""Others that near up to which it may go back."""

SEEN = 5.0
"""Distance up to which others are seen to come [m]."""

MEETS = 0.65
"""Distance between centers that two come to who meet [m]: more than both bodies are broad."""

PASSES = 0.9
"""The same of two who hardly notice each other [m]."""

MEETS_WITHIN = 2.5
"""Time until a meeting from which on an auto character steers [s]."""

CALM_FOR = 4.0
"""Time until somebody passes from which on it may go back [s]."""

BLOCKED_FOR = 0.3
"""Time that its next step is refused before an auto character steers [s]."""

QUEUES_FOR = 12.0
"""The same where nobody can pass somebody else, and steering would hardly help [s]."""

STAYS_FOR = 2.0
"""Time that a character stays on a level before it goes back [s]."""

FAVORED = 1.0
"""The same where captured motion is favored [s]."""

PACE_OFF = 0.03
"""Share by which a speed that is asked for may differ from those of captured motion."""

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


class Levels:
    """Says who should change its level.

    may_steer, may_capture: (n,) what the groups of the n characters allow. changed: (n,) step of the last change, or of
    entering. near, confined, soon: (n,) company of those in the world, see :func:`find_company`.
    """

    def __init__(self, cast: CrowdPlacement, favored: Neighborhood | None) -> None:
        kinds = np.array(cast.locomotions)[cast.group]
        self.may_steer = kinds != "captured"
        self.may_capture = kinds != "steered"
        self._paced = np.array(cast.paced)[cast.group] & (kinds == "auto")
        self._speeds = cast.walkers.speeds
        self._favored = favored
        count = cast.head_count
        self.changed = np.zeros(count, np.int64)
        self._calm_since = np.zeros(count, np.int64)
        self.near = np.zeros(count, np.int64)
        self.confined, self.soon = np.zeros(count, np.bool_), np.full(count, np.inf)

    def keep_paces(self, natural_speed: float) -> None:
        """Let those steer for good whose file says how fast they walk, if no captured motion is as fast [m/s]."""
        shares = self._speeds / natural_speed
        off = (shares < SLOWEST * (1.0 - PACE_OFF)) | (shares > FASTEST * (1.0 + PACE_OFF))
        self.may_capture &= ~(self._paced & off)

    def look_around(self, crowd: SortedCrowd, walls: Walls, step: int) -> None:
        """Find the company of all who are in the world, sorted by cells, between ``walls``."""
        count = len(crowd.rows)
        near, confined = np.zeros(count, np.int64), np.zeros(count, np.bool_)
        soon, wide = np.empty(count), np.empty(count)
        everybody = (crowd.rows, crowd.starts, crowd.frame, crowd.order)
        find_company(*everybody, walls, (NEAR, SEEN), MEETS, PASSES, near, confined, soon, wide)
        agents = np.empty(count, np.int64)
        agents[crowd.order] = crowd.rows["id"]
        self.near[agents], self.confined[agents], self.soon[agents] = near, confined, soon
        calm = (near <= EASED) & (wide > CALM_FOR)
        self._calm_since[agents[~calm]] = step

    def is_favored(self, places: Floats) -> Bools:
        """Which of places, (k, 2) [m], lie where captured motion is favored."""
        if self._favored is None:
            return np.zeros(len(places), np.bool_)
        x, y = self._favored.point
        return np.asarray(hypot(places[:, 0] - x, places[:, 1] - y) <= self._favored.radius)

    def steer(self, agents: NDArray[np.int64], places: Floats, blocked: Floats) -> Bools:
        """Which of some captured characters should steer; ``blocked``, (k,): time that they have been refused [s]."""
        met = (self.near[agents] >= CROWDED) | (self.soon[agents] < MEETS_WITHIN)
        refused = blocked >= np.where(self.confined[agents], QUEUES_FOR, BLOCKED_FOR)
        return np.asarray(self.may_steer[agents] & (refused | (met & ~self.is_favored(places))))

    def capture(self, agents: NDArray[np.int64], places: Floats, step: int) -> Bools:
        """Which of some steered characters may go back to captured motion."""
        stays = np.where(self.is_favored(places), FAVORED, STAYS_FOR) * STEERING_RATE
        since = np.maximum(self.changed[agents], self._calm_since[agents])
        return np.asarray(self.may_capture[agents] & (step - since >= stays))
