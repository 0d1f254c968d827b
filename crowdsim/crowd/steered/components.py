"""State of a steered agent in the world: one column per component."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.ecs.world import Column
from crowdsim.recording.header import AgentState
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.row_kernels import ROW


class Errand(IntEnum):
    """What a steered agent is doing."""

    WALKS = 0
    """Walks to the region of its goal."""
    STANDS = 1
    """Stands for a while before it goes on."""
    TAKES_PLACE = 2
    """Walks to its own spot in the region of its goal."""
    STAYS = 3
    """Stands for good."""
    TURNS = 4
    """Turns on its spot to the prescribed heading."""


NO_GOAL = -1
"""Goal in ROW of an agent that stands where it entered. It differs from all goals, so the agent steps aside for any
stuck one; so do those of :func:`standing_at`."""


def standing_at(goal: NDArray[Any]) -> NDArray[Any]:
    """Return the goal in ROW of agents that stand at goals (k,), turn there, or walk to their spots: -2 and less.

    The function is its own inverse: it also returns the goals at which they stand.
    """
    return -2 - goal


COLUMNS = (
    Column("agent", np.int32, (), NONE),  # index of the agent in the run, also its row in the recording
    Column("state", np.int32, (), int(AgentState.WAITING)),
    Column("behavior", np.int32, (), NONE),  # number of the behavior that guidance prescribes, else the preferred one
    Column("row", ROW),  # position, velocity, body and guidance
    Column("errand", np.int8),
    Column("goal", np.int32, (), NONE),  # number of the goal to which it goes, or at which it stands
    Column("reached", np.int64),  # number of places reached
    Column("go_step", np.int64),  # step in which it goes on if it stands; last step of taking its place or turning
    Column("stand", np.float64, (2,)),  # its spot [m]
    Column("lost_since", np.int64, (), NONE),  # step since which it has no path, -1 while it has one
    Column("following", np.int32, (), PLAIN),  # number of the field that it follows
    Column("pace", np.float64),  # free walking speed [m/s]
    Column("phase", np.float64),  # phase of its gait [cycles]
    Column("anchor", np.float64, (3,)),  # pose [m], [rad] at which its rear foot, which lifts next, was under the body
)
"""Columns of a steered agent."""
