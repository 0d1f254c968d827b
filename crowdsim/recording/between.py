"""What is to be seen between two recorded steps."""

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
    """The frame ``share`` (0, 1) of a step from ``old`` to ``new``; ``ends`` of a periodic floor are walked across."""
    natural = CAPTURE_RATE // steps_per_second
    last = np.append(node_frames, 0)[old.node]
    # Nodes may be played slower or faster. Who leaves an idle node skips what is left of it.
    same = (new.node == old.node) & (new.frame >= old.frame)
    advance = np.where(same, new.frame - old.frame, last - old.frame + new.frame)
    advance = np.where(same | (2 * advance <= 3 * natural), advance, natural)
    shown = share * advance
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

    # Still in the old node, or in the new one already, where what is left of the step is subtracted.
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
