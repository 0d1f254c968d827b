"""What the world knows of a character: one column a component."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.ecs.world import Column
from crowdsim.recording.header import AgentState

SLOT_FRAMES = CAPTURE_RATE // 5
"""Frames between two samples of a reserved timeline (0.2 s)."""

TIMELINE_SLOTS = 48
"""Samples of a reserved timeline: 9.6 s, longer than any few nodes and the stop after them."""

SAMPLE = 5
"""Values of each: x and y of the track; the body there as a capsule, its radius and half its core (x, y) [m]."""

RADIUS = 2
"""Place of the radius in a sample."""

CORE = 3
"""Place of the x of half the core, from the middle to one end; its y is behind it."""

WAY_POINTS = 8
"""Points of the way ahead that a character would like others not to stop in."""

DIGESTED = ("timeline", "timeline_circle", "way", "rank", "turn")
"""Columns of which the state hash takes a digest in another column: they are long and seldom change, or follow."""

HASHED_AS = {"blend_offset": "seam", "next_blend_offset": "next_seam"}
"""Earlier names of columns, which the state hash takes, so that hashes of earlier runs stay."""

COLUMNS = (
    Column("agent", np.int32, (), NONE),  # index of the character in the run, also its row in the recording
    Column("state", np.int32, (), int(AgentState.WAITING)),
    Column("pose", np.float64, (3,)),  # world track pose: x, y, heading
    Column("behavior", np.int32, (), NONE),
    # The node being played: frame of it, the world pose it starts at, and the blend offset that fades behind it.
    Column("node", np.int32, (), NONE),
    Column("previous", np.int32, (), NONE),
    Column("frame", np.int32),
    # How fast: ticks of a frame that are played already, ticks in the last step, and ticks a step to go over to.
    Column("part", np.int32),
    Column("rate", np.int32),
    Column("wanted_rate", np.int32),
    Column("origin", np.float64, (3,)),
    Column("blend_offset", np.float64, (3,)),
    # The node that follows; NONE until it is chosen at the end of the present one.
    Column("next_node", np.int32, (), NONE),
    Column("next_origin", np.float64, (3,)),
    Column("next_blend_offset", np.float64, (3,)),
    Column("next_cursor", np.int32, (), NONE),
    # Place in the motion plan: index of the present node, and of the last node that is reserved.
    Column("cursor", np.int32, (), NONE),
    Column("reserved", np.int32, (), NONE),
    Column("plan_digest", np.uint64),
    Column("awaiting_plan", np.bool_),
    Column("blocked_since", np.int64, (), NONE),  # step of the first refusal in a row, -1 while nothing is refused
    Column("retry_step", np.int64),
    # The reserved timeline: tracks and bodies every SLOT_FRAMES frames from a slot on, then parked or gone.
    Column("timeline", np.float64, (TIMELINE_SLOTS, SAMPLE)),
    Column("timeline_circle", np.float64, (3,)),  # x, y, radius: holds all of it
    Column("timeline_digest", np.uint64),
    Column("timeline_start", np.int64),
    Column("gone_slot", np.int64, (), np.iinfo(np.int64).max),
    Column("body_radius", np.float64),  # of a disc that holds the body whatever it does
    # What others are told: the way ahead (nan where there is none), and who goes first, the lowest of all.
    Column("way", np.float64, (WAY_POINTS, 2), np.nan),
    Column("rank", np.int64),
    Column("turn", np.int64),  # the rank that it has of its own
    Column("goal", np.float64, (2,)),
    Column("stays", np.bool_),
)
