"""Slow, obvious twins of motion graph search: bending a chain, the channel, all branches one by one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays
from tests.reference.follow_maps import pose_after

Floats = NDArray[np.float64]


def turned_about(point: complex, center: complex, angle: float) -> complex:
    """Return ``point`` rotated about ``center``."""
    return center + (point - center) * complex(math.cos(angle), math.sin(angle))


def chain_with(joints: Floats, end: Floats, turns: Floats) -> tuple[Floats, Floats]:
    """Return joints (K, 2) and end (3,) of a chain after its joints were rotated by ``turns``, the base first."""
    points = [complex(*joint) for joint in joints] + [complex(*end[:2])]
    for j, turn in enumerate(turns):
        points[j + 1 :] = [turned_about(point, points[j], turn) for point in points[j + 1 :]]
    moved = np.array([[point.real, point.imag] for point in points])
    return moved[:-1], np.array([*moved[-1], wrap_angle(end[2] + float(np.sum(turns)))])


def slow_bend(joints: Floats, limits: Floats, end: Floats, goal: Floats) -> tuple[Floats, Floats, float]:
    """Return rotations (K,) and end (3,) after one sweep of cyclic coordinate descent; the goal has no heading.

    From the base on, every joint rotates the end into its own line to the goal, within its limits (K, 2); everything
    behind the joint is rotated point by point. The last result is how near a joint came to a half turn, which has no
    sign [rad].
    """
    turns = np.zeros(len(joints))
    widest = 0.0
    for j in range(len(joints)):
        places, tip = chain_with(joints, end, turns)
        at = complex(*places[j])
        wanted = float(np.angle((complex(*goal[:2]) - at) / (complex(*tip[:2]) - at)))
        widest = max(widest, abs(wanted))
        turns[j] = np.clip(turns[j] + wanted, *limits[j])
    return turns, chain_with(joints, end, turns)[1], math.pi - widest


def shortest_motion(
    graph: GraphArrays,
    start_pose: Floats,
    start_node: int,
    goal: Floats,
    tolerance: float,
    most: float,
    free: Callable[[Floats], bool],
) -> tuple[float, list[int]]:
    """Return the least length walked plus distance left of branches that end within ``tolerance`` [m], and its nodes.

    Tries every branch for which that sum is below ``most``, one by one; ``free`` says whether a track (F, 3) is free.
    The result is infinite if there is none.
    """
    best, nodes = math.inf, []

    def grow(branch: list[int], end: Floats, walked: float) -> None:
        nonlocal best, nodes
        gap = float(np.hypot(*(goal[:2] - end[:2])))
        if walked + gap >= min(best, most):
            return
        if gap <= tolerance:
            best, nodes = walked + gap, branch
        for edge in range(graph.edge_start[branch[-1]], graph.edge_start[branch[-1] + 1]):
            target = int(graph.edge_target[edge])
            origin = pose_after(graph, edge, 0.0, end)
            if free(faded_track(graph, target, origin, end)):
                after = compose(origin, graph.node_motion[target])
                blend_offset = float(np.hypot(*(end[:2] - origin[:2])))
                grow([*branch, target], after, walked + blend_offset + float(graph.node_length[target]))

    grow([start_node], compose(start_pose, graph.node_motion[start_node]), float(graph.node_length[start_node]))
    return best, nodes


def faded_track(graph: GraphArrays, node: int, origin: Floats, before: Floats) -> Floats:
    """Return the world track (F, 3) of a node after one that ended at ``before``: every fourth frame and the last."""
    last = int(graph.node_frames[node])
    frames = np.array(sorted({*range(0, last, 4), last}))
    world = compose(origin, graph.tracks[graph.node_track[node] + frames])
    blend_offset = before - origin
    blend_offset[2] = wrap_angle(blend_offset[2])
    u = np.minimum(frames / 12.0, 1.0)
    return world + (1.0 - u * u * (3.0 - 2.0 * u))[:, None] * blend_offset
