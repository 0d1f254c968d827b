"""Motion of the agents of a recording, one agent after another, for animation files."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.choice import Choice
from crowdsim.motion.clips.kinematics import conjugate, multiply, unit
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.recording.header import Ends
from crowdsim.recording.reader import Recording

MANY = 50
"""Number of agents above which animation files have at most MANY_RATE frames per second by default."""
MANY_RATE = 15


class BodyMotion(NamedTuple):
    """Motion of one agent in the k frames in which it is present.

    Attributes
    ----------
    agent : int
        The agent.
    frames : (k,) int64
        Frames, ascending, counted from the first frame of the choice.
    roots : (k, 3) float32
        Positions of the root joint [m].
    rotations : (k, J, 4) float32
        Quaternions (w, x, y, z), each joint relative to its parent, the root to the world. Signs are chosen so that
        consecutive frames differ least.
    """

    agent: int
    frames: NDArray[np.int64]
    roots: NDArray[np.float32]
    rotations: NDArray[np.float32]

    def shown(self, count: int) -> tuple[int, ...]:
        """Return the frames at which the agent appears and disappears, in turn.

        An agent that is present in the last of all ``count`` frames does not disappear.
        """
        shown = [int(self.frames[0])]
        for row in np.flatnonzero(np.diff(self.frames) > 1).tolist():
            shown += [int(self.frames[row]) + 1, int(self.frames[row + 1])]
        if self.frames[-1] + 1 < count:
            shown.append(int(self.frames[-1]) + 1)
        return tuple(shown)


def default_rate(recording: Recording, agents: int) -> int:
    """Return the default frame rate of animation files of ``agents`` agents [1/s].

    It is the rate of the steps, or for more than MANY agents its largest divisor up to MANY_RATE.
    """
    recorded = recording.steps_per_second
    most = recorded if agents <= MANY else MANY_RATE
    return next(rate for rate in range(min(most, recorded), 0, -1) if recorded % rate == 0)


def body_motions(recording: Recording, choice: Choice) -> Iterator[BodyMotion]:
    """Yield the motion of each chosen agent that is ever present, as :meth:`Recording.poses` shows it."""
    agents: list[NDArray[np.int64]] = []
    frames: list[NDArray[np.int64]] = []
    roots: list[NDArray[np.float32]] = []
    rotations: list[NDArray[np.float32]] = []
    for number, step in enumerate(choice.steps.tolist()):
        places, turns = recording.poses(step, choice.agents)
        present = np.flatnonzero(np.isfinite(places[:, 0, 0]))
        agents.append(choice.agents[present])
        frames.append(np.full(len(present), number))
        roots.append(places[present, 0])
        rotations.append(turns[present])
    if not agents:
        return
    # Sort the rows by agent; those of one agent stay in order of time.
    agent = np.concatenate(agents)
    order = np.argsort(agent, kind="stable")
    ends = np.flatnonzero(np.diff(agent[order], append=-1)) + 1
    frame, root, turned = np.concatenate(frames), np.concatenate(roots), np.concatenate(rotations)
    rotations.clear()
    skeleton = recording.header.motion.skeleton
    begin = 0
    for end in ends.tolist():
        rows = order[begin:end]
        yield BodyMotion(int(agent[rows[0]]), frame[rows], root[rows], _local(skeleton, turned[rows]))
        begin = end


def _local(skeleton: Skeleton, world: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rotations (k, J, 4) relative to the parents of joints, from those in the world.

    Signs do not flip from frame to frame.
    """
    exact = unit(world.astype(np.float64))
    parents = np.asarray(skeleton.parents)
    local = exact.copy()
    local[:, 1:] = multiply(conjugate(exact[:, parents[1:]]), exact[:, 1:])
    # A quaternion and its negative are one rotation. If a frame is nearer to the negative of the one before, signs are
    # flipped from there on.
    flips = np.sum(local[1:] * local[:-1], axis=-1) < 0.0
    signs = np.where(np.logical_xor.accumulate(flips, axis=0), -1.0, 1.0)
    local[1:] *= signs[..., None]
    return local.astype(np.float32)


class Jump(NamedTuple):
    """A crossing of the ends of a periodic floor: row of the first frame after it, and its position without wrapping.

    The position ``beyond`` (3,) lies outside of the floor [m].
    """

    row: int
    beyond: NDArray[np.float32]


def jumps(recording: Recording, roots: NDArray[np.float32]) -> list[Jump]:
    """Return the crossings of the ends of a periodic floor by an agent with positions ``roots`` (k, 3) [m]."""
    beyond, crosses = unwrapped(recording.header.ends, roots[:-1], roots[1:])
    return [Jump(row + 1, beyond[row]) for row in np.flatnonzero(crosses).tolist()]


def unwrapped(
    ends: Ends | None, before: NDArray[np.float32], after: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return positions ``after`` (k, 2 or 3) [m] without wrapping since ``before``, and (k,) which have wrapped.

    A position has wrapped at the ends of a periodic floor if it moved by more than half of the floor.
    """
    beyond = after.copy()
    if ends is None:
        return beyond, np.zeros(len(after), np.bool_)
    span = ends.high - ends.low
    ways = after[:, ends.axis].astype(np.float64) - before[:, ends.axis]
    crosses = 2.0 * np.abs(ways) > span
    beyond[crosses, ends.axis] += np.where(ways[crosses] < 0.0, span, -span).astype(np.float32)
    return beyond, crosses
