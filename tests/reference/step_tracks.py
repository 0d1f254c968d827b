"""Slow twin of tracks between steps: poses composed in the plane, a body after the other."""

from __future__ import annotations

import numpy as np

from crowdsim.geometry.planar import compose, invert, wrap_angle
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES
from crowdsim.motion.planted.between_kernels import NodeTracks

Step = tuple[int, float, np.ndarray]
"""Node (-1 for none), frame and track pose (3,) of a body in a step."""


def track_between(nodes: NodeTracks, natural: float, old: Step, new: Step, share: float) -> np.ndarray:
    """Return the track pose (3,) at a share of the step from ``old`` to ``new`` on a floor without ends."""
    (old_node, since, start), (new_node, until, goal) = old, new
    same = old_node == new_node and until >= since
    if min(old_node, new_node) < 0 or (same and until == since):
        return start + share * np.append(goal[:2] - start[:2], wrap_angle(goal[2] - start[2]))
    if same:
        return _faded(nodes, new_node, (since, start), (until, goal), since + share * (until - since))
    last = float(nodes.frames[old_node])
    played = last - since + until
    entered = last
    begin = 0.0
    if played > 1.5 * natural:
        # It skips the rest of an idle node: the frames of the new one fill the end of the step, one after the other.
        begin = 0.0 if until <= 1.5 * natural else until - natural
        played = max(natural, until - begin)
        entered = since + played - (until - begin)
    at = share * played
    if at < entered - since:
        return _gone(nodes, old_node, (since, start), min(since + at, last))
    middle = _gone(nodes, old_node, (since, start), min(entered, last))
    return _faded(nodes, new_node, (begin, middle), (until, goal), begin + at - (entered - since))


def _clip(nodes: NodeTracks, node: int, frame: float) -> np.ndarray:
    rows = nodes.rows[nodes.first[node] : nodes.first[node] + nodes.frames[node] + 1]
    turns = np.unwrap(rows[:, 2])
    numbers = np.arange(len(rows))
    return np.array([np.interp(frame, numbers, column) for column in (rows[:, 0], rows[:, 1], turns)])


def _gone(nodes: NodeTracks, node: int, begin: tuple[float, np.ndarray], frame: float) -> np.ndarray:
    """Return the pose of a body that goes on along its node from a frame and pose."""
    return compose(begin[1], compose(invert(_clip(nodes, node, begin[0])), _clip(nodes, node, frame)))


def _faded(
    nodes: NodeTracks, node: int, begin: tuple[float, np.ndarray], end: tuple[float, np.ndarray], frame: float
) -> np.ndarray:
    """Return the pose in a frame between two others: off the node by what is left of both their offsets."""
    left = [1.0 - _smooth(min(each / BLEND_FRAMES, 1.0)) for each in (begin[0], frame, end[0])]
    share, whole = (frame - begin[0]) / (end[0] - begin[0]), 1.0
    if left[0] - left[2] > 1e-9:
        share = (left[0] - left[1]) / (left[0] - left[2])
        whole = min(left[0] / (left[0] - left[2]), 20.0)
    first, last = (pose[2] - _clip(nodes, node, at)[2] for at, pose in (begin, end))
    change = wrap_angle(last - first)
    # Where the turn comes to as the blend offset has vanished: there the node lies as in its clip.
    origin = np.array([0.0, 0.0, first + whole * change])
    offs = [pose[:2] - compose(origin, _clip(nodes, node, at))[:2] for at, pose in (begin, end)]
    clip = _clip(nodes, node, frame)
    place = compose(origin, clip)[:2] + (1.0 - share) * offs[0] + share * offs[1]
    return np.append(place, clip[2] + first + share * change)


def _smooth(u: float) -> float:
    return u * u * (3.0 - 2.0 * u)
