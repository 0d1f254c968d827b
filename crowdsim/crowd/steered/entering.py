"""Entry of steered agents: at their time, once their place is free; after a while at another place nearby."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.ranks.protocol import ONE_RANK, Ranks
from crowdsim.crowd.steered.components import NO_GOAL, Errand
from crowdsim.crowd.steered.entering_kernels import ROOM, admit
from crowdsim.crowd.steered.errands import Errands
from crowdsim.crowd.steered.exits import ExitChoice
from crowdsim.crowd.steered.periodic_boundary import PeriodicBoundary
from crowdsim.crowd.steered.steered_place import SteeredPlace
from crowdsim.ecs.world import World
from crowdsim.geometry.elementary import atan2, cos, sin
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.recording.header import AgentState
from crowdsim.scenario.people.crowd_placement import BODY_DEPTH, BODY_RADIUS, CrowdPlacement
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering
from crowdsim.steering.ways import NOBODY_ELSE, Others, clear_of, listed

AWAITS_SECONDS = 10.0
"""Time after which an agent whose place is still taken tries others around it [s]: the agent there may stay for good.
"""

_RADII = np.repeat([0.5, 1.0, 1.5, 2.0], 8)
_TURNS = np.tile(np.arange(8), 4) * (np.pi / 4.0)
_AROUND = np.column_stack((_RADII * cos(_TURNS), _RADII * sin(_TURNS)))
"""Offsets of these other places from its own, (k, 2) [m]: eight on each of four circles; one is tried in each step."""


class Entering:
    """Let agents enter, those with the earliest time first.

    An agent whose place is taken tries again in the next step. After AWAITS_SECONDS it tries other places in its start
    region, to which a straight line leads from its own; in steps in which there is none, it tries its own. ``regions``
    are the start regions of the groups, by number of the group.
    """

    def __init__(
        self,
        world: World,
        place: SteeredPlace,
        cast: CrowdPlacement,
        exits: ExitChoice,
        errands: Errands,
        boundary: PeriodicBoundary,
        regions: Sequence[BaseGeometry],
        ranks: Ranks = ONE_RANK,
    ) -> None:
        self._ranks = ranks
        self._regions = regions
        self._boundary = boundary
        self._world, self._place, self._cast, self._errands, self._exits = world, place, cast, errands, exits
        self.entered = np.full(cast.head_count, -1, np.int64)
        """(n,) step in which each agent entered the world, -1 before."""
        self.shut_out = np.zeros(0, np.int64)
        """(k,) agents whose time has come and whose place is covered by a movable, as of the last step."""
        # Half breadth of the broadest agent [m].
        self._broadest = 0.5 * float(cast.walkers.breadths.max(initial=0.0))

    def enter(
        self,
        step: int,
        steering: Steering,
        wanted: NDArray[np.bool_] | None = None,
        others: Others = NOBODY_ELSE,
    ) -> None:
        """Spawn the agents that enter in this step; note the step in ``entered``, and their places in the cast.

        They are in the world after its next ``apply_changes``. ``wanted`` (n,) says which agents may enter; all may if
        it is None. No agent enters within ROOM of a reserved segment of ``others``. ``shut_out`` is set, too.
        """
        cast = self._cast
        is_due = (self.entered < 0) & (cast.start_steps <= step)
        due = np.flatnonzero(is_due if wanted is None else is_due & wanted)
        covered = self._place.covers(cast.starts[due])
        self.shut_out = due[covered]
        # No agent enters where a movable waits to appear.
        due = due[~covered & ~self._place.announces(cast.starts[due], self._broadest + ROOM)]
        if not len(due):
            return
        due = due[np.argsort(cast.start_steps[due], kind="stable")]
        places = self._places(due, step)
        coming = self._rows(due, places)
        present = self._ranks.around(self._world.column("row"), places, 2.0 * self._broadest + ROOM)
        sorted_crowd = steering.sort(self._boundary.with_copies(present), self._place.bounds)
        crowd = (sorted_crowd.rows, sorted_crowd.starts, sorted_crowd.frame)
        ways = listed(others, sorted_crowd.frame, self._broadest + ROOM)
        clear = clear_of(ways, sorted_crowd.frame, coming, ROOM)
        coming, due, places = coming[clear], due[clear], places[clear]
        admitted = np.zeros(len(due), np.bool_)
        admit(coming, crowd, self._broadest, steering.walls, admitted)
        agents, rows = due[admitted], coming[admitted]
        self.entered[agents], cast.starts[agents] = step, places[admitted]
        # Those with a delay stand first, without a goal in their row, so that they step aside for any stuck agent.
        go_step = step + cast.delay_steps[agents]
        stands = go_step > step
        goals = rows["goal"].astype(np.int32)
        rows["goal"][stands] = NO_GOAL
        place = np.column_stack((rows["x"], rows["y"], rows["heading"]))
        self._world.spawn_many(
            len(agents),
            self._ranks.holds(cast.starts[agents]),
            agent=agents,
            state=np.where(stands, AgentState.WAITING, AgentState.MOVING),
            behavior=len(self._place.asked) - 1,
            row=rows,
            errand=np.where(stands, Errand.STANDS, Errand.WALKS),
            goal=goals,
            go_step=go_step,
            pace=rows["speed"],
            phase=STAND,
            anchor=place,
        )

    def _places(self, agents: NDArray[np.int64], step: int) -> NDArray[np.float64]:
        """Return where agents (k,) try to enter in this step, (k, 2) [m].

        This is the agent's own place, or another one around it if the agent has waited for AWAITS_SECONDS and that
        place is in its start region and in a straight line from its own.
        """
        cast = self._cast
        places = cast.starts[agents]
        waited = step - cast.start_steps[agents] - round(AWAITS_SECONDS * STEERING_RATE)
        for group in np.unique(cast.group[agents[waited >= 0]]).tolist():
            rows = np.flatnonzero((waited >= 0) & (cast.group[agents] == group))
            others = places[rows] + _AROUND[waited[rows] % len(_AROUND)]
            inside = shapely.contains_xy(self._regions[group], *others.T)
            inside &= self._place.leads_straight(places[rows], others)
            places[rows[inside]] = others[inside]
        return places

    def _rows(self, agents: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[Any]:
        """Return the rows (ROW[k]) of agents (k,) as they enter at ``places`` (k, 2) [m]; they choose exits.

        Exits stay chosen (``self._exits``), also of agents that are not admitted then. Each faces its prescribed
        heading, else the way that guidance leads, else its goal.
        """
        cast = self._cast
        rows = np.zeros(len(agents), ROW)
        rows["x"], rows["y"] = places.T
        rows["radius"] = BODY_RADIUS
        rows["half"] = rows["rest"] = 0.5 * (cast.walkers.breadths[agents] - BODY_DEPTH)
        rows["speed"] = cast.walkers.speeds[agents]
        rows["share"] = cast.walkers.shares[agents]
        self._exits.enter(agents, rows)
        rows["goal"] = self._errands.goal(agents, np.zeros(len(agents), np.int64))
        rows["id"] = agents
        self._place.guidance.write(rows, np.full(len(agents), PLAIN, np.int32))
        # An agent without guidance, and without a prescribed heading (nan), faces its goal.
        toward = self._errands.middles[rows["goal"]] - places
        guided = (rows["gx"] != 0.0) | (rows["gy"] != 0.0)
        away = np.where(guided[:, None], np.column_stack((rows["gx"], rows["gy"])), toward)
        given = cast.headings[agents]
        rows["heading"] = np.where(np.isnan(given), atan2(away[:, 1], away[:, 0]), given)
        rows["hx"], rows["hy"] = cos(rows["heading"]), sin(rows["heading"])
        return rows
