"""What is shown between two recorded steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.recording.header import AgentState, RecordedFrame

if TYPE_CHECKING:
    from crowdsim.motion.planted.between_kernels import NodeTracks


def frame_between(
    old: RecordedFrame,
    new: RecordedFrame,
    share: float,
    nodes: NodeTracks,
    steps_per_second: int,
    spans: NDArray[np.float64],
) -> RecordedFrame:
    """Return the frame at ``share`` of the time from ``old`` to ``new``.

    Agents that move or wait in ``old``, and are present in ``new``, are interpolated. Their node, previous node and
    behavior are those of ``new`` as soon as the node of ``new`` has begun. All other agents keep the values of ``old``,
    and all agents its states.

    Parameters
    ----------
    old, new : RecordedFrame
        Frames of two consecutive steps.
    share : float
        Elapsed part of the step, in (0, 1).
    nodes : NodeTracks
        Tracks of all nodes, along which captured agents go. Without rows, as in older recordings, agents go straight.
    steps_per_second : int
        Steps per second of the recording.
    spans : (2,) float64
        Lengths of a periodic floor along x and y [m], 0 without ends. Agents that cross the ends go the short way.
    """
    # Frames that a node advances in a step at its natural rate.
    natural = CAPTURE_RATE // steps_per_second
    # Agents without a node have the index NONE (-1), which finds the 0 at the end.
    last = np.append(nodes.frames, 0)[old.node]
    # An agent is in the old node until its last frame, during the first ``part`` of the step, then in the new one.
    same = (new.node == old.node) & (new.frame >= old.frame)
    advance = np.where(same, new.frame - old.frame, last - old.frame + new.frame)
    part, end, begin = _split(old.frame, new.frame, last, advance, natural)
    # Only agents that move or wait, and stay present, are interpolated; the others keep their old pose.
    moving = (old.state == AgentState.MOVING) | (old.state == AgentState.WAITING)
    both = moving & (new.state != AgentState.ABSENT)

    # Captured agents go along the tracks of their nodes, others straight.
    from crowdsim.motion.planted.between_kernels import tracks_between

    pose, goal = (np.stack([each.x, each.y, each.heading], axis=1)[both].astype(np.float64) for each in (old, new))
    tracked = len(nodes.rows) > 0
    played = [np.where(each.steered | (not tracked), NONE, each.node)[both].astype(np.int32) for each in (old, new)]
    at, later = (np.asarray(each.frame[both], np.float64) for each in (old, new))
    track = np.empty_like(pose)
    tracks_between(nodes, float(natural), spans, played[0], at, pose, played[1], later, goal, share, track)
    x, y, heading = (np.array(values, np.float64) for values in (old.x, old.y, old.heading))
    x[both], y[both], heading[both] = track.T
    # An agent that becomes captured in this step keeps its last phase.
    phase = np.where(both & np.isfinite(new.phase), old.phase + share * (new.phase - old.phase), old.phase)

    # Frame of the node that is shown. The divisor of a part that has no length is not used.
    entered = both & ~same & (share > part)
    left = begin + (new.frame - begin) * (share - part) / np.where(entered, 1.0 - part, 1.0)
    reached = old.frame + (end - old.frame) * share / np.where(entered | (part <= 0.0), 1.0, part)
    frame = np.where(same, np.minimum(old.frame + share * advance, new.frame), np.minimum(reached, last))
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


def _split(
    since: NDArray[Any], frame: NDArray[Any], last: NDArray[Any], advance: NDArray[Any], natural: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return how a step is divided between two nodes, each (A,): see `split_step` of between_kernels, for one body.

    Nodes are played at up to 1.15 times their natural rate. An ``advance`` of more than 1.5 times that is taken as one
    of an agent that leaves an idle node and skips the rest of it.
    """
    skips = 2 * advance > 3 * natural
    usual = (last - since) / np.where(advance > 0, advance, 1)
    part = np.where(skips, np.maximum(1.0 - frame / natural, 0.0), np.where(advance > 0, usual, 1.0))
    end = np.where(skips, np.minimum(since + part * natural, last), last)
    return part, end, np.where(skips & (2 * frame > 3 * natural), frame - natural, 0.0)
