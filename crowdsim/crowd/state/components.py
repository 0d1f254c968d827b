"""State of a captured agent in the world: one column per component."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.ecs.world import Column
from crowdsim.recording.header import AgentState

SLOT_FRAMES = CAPTURE_RATE // 5
"""Frames between two samples of a reserved timeline (0.2 s)."""

TIMELINE_SLOTS = 48
"""Number of samples of a reserved timeline: 9.6 s, longer than a few nodes and the stop after them."""

SAMPLE = 13
"""Values per sample [m]: x, y of the track; RADIUS of the body's capsule; half of its CORE as a vector (x, y), 0 for a
disc; and for the motion to the next sample BEND, QUARTERS (6 values) and REST."""

RADIUS = 2
"""Index of the radius in a sample."""

CORE = 3
"""Index of the x component of half the core (from the middle to one end) in a sample; the y component follows."""

BEND = 5
"""Index of the largest distance of the body from its straight motion to the next sample. BEND and all values behind it
follow from the nodes that are played, so the state hash leaves them out."""

QUARTERS = 6
"""Index of the first of six values: x, y of the track's offset from its straight motion to the next sample, after one,
two and three quarters of the time."""

REST = 12
"""Index of the largest distance of the body from the four straight pieces that lead through the places at the quarters
to the next sample."""

WAY_POINTS = 8
"""Number of points of the way ahead in which others do not stop."""

LAST = int(np.iinfo(np.int64).max)
"""Rank of agents that go nowhere, as they have arrived or have no way to their goals. They give way to all others."""

DIGESTED = ("timeline", "timeline_circle", "way", "rank", "turn")
"""Columns that the state hash leaves out: they follow from others, or have a digest in another column."""

HASHED_AS = {"blend_offset": "seam", "next_blend_offset": "next_seam"}
"""Earlier names of columns, under which they enter the state hash so that hashes of earlier runs stay valid."""

COLUMNS = (
    Column("agent", np.int32, (), NONE),  # index of the agent in the run, also its row in the recording
    Column("state", np.int32, (), int(AgentState.WAITING)),
    Column("pose", np.float64, (3,)),  # world track pose: x, y [m], heading [rad]
    Column("behavior", np.int32, (), NONE),
    # The node being played and the one before it, frame of the node, track pose at which it starts (x, y [m], heading
    # [rad]), and the blend offset that fades out along it.
    Column("node", np.int32, (), NONE),
    Column("previous", np.int32, (), NONE),
    Column("frame", np.int32),
    # Rate: part of the frame that is played already [ticks], rate of the last step, rate approached [ticks/step].
    Column("part", np.int32),
    Column("rate", np.int32),
    Column("wanted_rate", np.int32),
    Column("origin", np.float64, (3,)),
    Column("blend_offset", np.float64, (3,)),
    # The next node; NONE until it is chosen at the end of the present one.
    Column("next_node", np.int32, (), NONE),
    Column("next_origin", np.float64, (3,)),
    Column("next_blend_offset", np.float64, (3,)),
    Column("next_cursor", np.int32, (), NONE),
    # Indices in the motion plan: of the present node, and of the last reserved node.
    Column("cursor", np.int32, (), NONE),
    Column("reserved", np.int32, (), NONE),
    Column("plan_digest", np.uint64),  # MotionPlan.digest, 0 without a plan
    Column("awaiting_plan", np.bool_),  # True while a search for it is under way
    # Step since which it is refused, that is, cannot reserve the next node of its plan; set to the present step when it
    # looks for a way around others; NONE if it is not refused.
    Column("blocked_since", np.int64, (), NONE),
    Column("retry_step", np.int64),  # step before which it does not request a plan
    # The reserved timeline: tracks and bodies every SLOT_FRAMES frames from slot ``timeline_start`` on. After the last
    # sample the agent stands there, unless it has left the world in ``gone_slot`` (largest int64: it never leaves).
    Column("timeline", np.float64, (TIMELINE_SLOTS, SAMPLE)),
    Column("timeline_circle", np.float64, (3,)),  # circle that contains all positions: x, y, radius [m]
    Column("timeline_digest", np.uint64),
    Column("timeline_start", np.int64),
    Column("gone_slot", np.int64, (), np.iinfo(np.int64).max),
    Column("body_radius", np.float64),  # radius of a disc that contains the body in any behavior [m]
    # Read by others: the way ahead [m] (nan without one), and the right of way, the lowest rank first; below 0 only
    # if the row comes to rest in a narrow passage.
    Column("way", np.float64, (WAY_POINTS, 2), np.nan),
    Column("rank", np.int64),
    Column("turn", np.int64),  # its own rank, which may be higher than the one it takes over from a leader
    Column("goal", np.float64, (2,)),  # place that it goes to now [m]
    Column("stays", np.bool_),  # True if it does not leave the world at its last goal
)
"""Columns of a captured agent."""
