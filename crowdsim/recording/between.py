"""Interpolate between two recorded steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.planar import wrap_angle
from crowdsim.recording.header import AgentState, Ends, RecordedFrame


def frame_between(
    old: RecordedFrame,
    new: RecordedFrame,
    share: float,
    node_frames: NDArray[np.int32],
    steps_per_second: int,
    ends: Ends | None = None,
) -> RecordedFrame:
    """Return the frame at ``share``, in (0, 1), of the way from ``old`` to ``new``; states are those of ``old``.

    Parameters
    ----------
    old, new : RecordedFrame
        Frames of two consecutive steps.
    share : float
        Elapsed part of the step.
    node_frames : (nodes,) int32
        Last frame of each node; the first one is 0.
    steps_per_second : int
        Steps per second of the recording.
    ends : Ends or None
        Ends of a periodic floor; agents that cross them are interpolated across.
    """
    # Frames that a step takes at the natural rate.
    natural = CAPTURE_RATE // steps_per_second
    # Agents without a node have the index NONE (-1), which finds the 0 at the end.
    last = np.append(node_frames, 0)[old.node]
    # Frames played during the step, at whatever rate the node is played: at most 1.15 times the natural one. An agent
    # that leaves an idle node skips the rest of it: if the sum is then beyond 1.5 times, the natural rate is used.
    same = (new.node == old.node) & (new.frame >= old.frame)
    advance = np.where(same, new.frame - old.frame, last - old.frame + new.frame)
    advance = np.where(same | (2 * advance <= 3 * natural), advance, natural)
    shown = share * advance
    # Only these are interpolated; absent and arrived agents keep their old pose.
    moving = (old.state == AgentState.MOVING) | (old.state == AgentState.WAITING)
    both = moving & (new.state != AgentState.ABSENT)

    turn = wrap_angle(new.heading - old.heading)
    ways = [new.x - old.x, new.y - old.y]
    if ends is not None:
        ways[ends.axis] = ends.shorter(ways[ends.axis])
    x = np.where(both, old.x + share * ways[0], old.x)
    y = np.where(both, old.y + share * ways[1], old.y)
    heading = np.where(both, old.heading + share * turn, old.heading)
    phase = np.where(both & np.isfinite(new.phase), old.phase + share * (new.phase - old.phase), old.phase)

    # Either still in the old node, or already in the new one: count back from its frame at the end of the step.
    reached = old.frame + shown
    left = new.frame - (advance - shown)
    entered = both & ~same & (reached > last) & (left >= 0)
    frame = np.where(same, np.minimum(reached, new.frame), np.minimum(reached, last))
    frame = np.where(both, frame, old.frame)
    return RecordedFrame(
        x=x,
        y=y,
        heading=heading,
        node=np.where(entered, new.node, old.node),
        previous=np.where(entered, new.previous, old.previous),
        frame=np.where(entered, left, frame),
        behavior=np.where(entered, new.behavior, old.behavior),
        state=old.state,
        phase=phase,
    )
