"""What the world knows of a steered character: one column a component."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from crowdsim.constants import NONE
from crowdsim.ecs.world import Column
from crowdsim.recording.header import AgentState
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.row_kernels import ROW


class Errand(IntEnum):
    """What a steered character is about."""

    WALKS = 0
    """To the region of its goal."""
    STANDS = 1
    """For a while, before it goes on."""
    TAKES_PLACE = 2
    """Walks through the region of its goal, to its own spot there."""
    STAYS = 3
    """For good."""
    TURNS = 4
    """Where it is to stand, as its heading asks."""


NO_GOAL = -1
"""In ROW: the goal of who stands; it is nobody's, so everyone who is stuck may ask it to step aside."""

COLUMNS = (
    Column("agent", np.int32, (), NONE),  # index of the character in the run, also its row in the recording
    Column("state", np.int32, (), int(AgentState.WAITING)),
    Column("behavior", np.int32, (), NONE),
    Column("row", ROW),  # place, velocity, body and guidance
    Column("errand", np.int8),
    Column("goal", np.int32, (), NONE),  # where it goes, or stands
    Column("reached", np.int64),  # places that it has been to
    Column("go_step", np.int64),  # from which it goes on if it stands; takes its place and turns until then at most
    Column("stand", np.float64, (2,)),  # where it stands, or is to stand [m]
    Column("lost_since", np.int64, (), NONE),  # step since which it has no way, -1 while it has one
    Column("following", np.int32, (), PLAIN),  # number of the field that it follows
    Column("pace", np.float64),  # speed at which it walks alone [m/s]
    Column("phase", np.float64),  # of its gait [cycles]
    Column("anchor", np.float64, (3,)),  # the pose that its rear foot stands for
)
