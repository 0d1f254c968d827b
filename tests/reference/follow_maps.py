"""Slow, obvious twins of following paths: motion maps node by node, the track of a result frame by frame."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.follower.path_follower import FollowResult
from crowdsim.geometry.planar import compose, invert, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]


def pose_after(graph: GraphArrays, edge: int, twist: float, end: Floats) -> Floats:
    """Return where the target of ``edge`` starts, from ``end``: its stored pose turned about the planted foot."""
    pivot = np.array([*graph.edge_pivot[edge], 0.0])
    about = compose(compose(pivot, np.array([0.0, 0.0, twist])), invert(pivot))
    return compose(end, compose(about, graph.edge_transform[edge]))


def slow_map(
    graph: GraphArrays, root: int, depth: int, reach: float
) -> list[tuple[tuple[int, int, int], int, int, tuple[int, ...]]]:
    """Run algorithm 1 of the 2012 paper with a queue of single nodes.

    Returns (cell, node, level, edges) in search order. Costs as in the kernel: track length, 0.3 m per radian, 0.1 m
    per node.
    """
    found: list[tuple[tuple[int, int, int], int, int, tuple[int, ...]]] = []
    frontier = set()
    queue: list[tuple[float, int, int, tuple[int, ...], tuple[float, ...]]] = [(0.0, 0, root, (), (0.0, 0.0, 0.0))]
    ticket = 0
    while queue:
        cost, _, node, edges, pose = heapq.heappop(queue)
        cell = (math.floor(pose[0] / 0.1 + 0.5), math.floor(pose[1] / 0.1 + 0.5))
        place = (*cell, math.floor(pose[2] / (math.pi / 6) + 0.5) % 12)
        if len(edges) > 1 and (place, node) in frontier:
            continue
        frontier.add((place, node))
        found.append((place, node, len(edges), edges))
        after = cost + float(graph.node_length[node]) + 0.3 * abs(float(graph.node_motion[node, 2])) + 0.1
        if len(edges) == depth or (edges and after > reach):
            continue
        end = compose(np.array(pose), graph.node_motion[node])
        for edge in range(graph.edge_start[node], graph.edge_start[node + 1]):
            target = int(graph.edge_target[edge])
            if not graph.node_idle[target]:
                ticket += 1
                start = pose_after(graph, edge, 0.0, end).astype(np.float32).astype(np.float64)
                heapq.heappush(queue, (after, ticket, target, (*edges, edge), tuple(start)))
    return found


def track_of(graph: GraphArrays, result: FollowResult) -> tuple[Floats, NDArray[np.int32]]:
    """Return world pose and behavior of every frame of a result; blend offsets fade over 12 frames by a smooth step."""
    poses, behaviors = [], []
    before = None
    for node, origin in zip(result.nodes, result.origins, strict=True):
        frames = int(graph.node_frames[node])
        local = graph.tracks[graph.node_track[node] : graph.node_track[node] + frames + 1]
        world = compose(origin, local)
        faded = world.copy()
        if before is not None:
            blend_offset = before - origin
            blend_offset[2] = wrap_angle(blend_offset[2])
            u = np.minimum(np.arange(frames + 1) / 12.0, 1.0)
            faded += (1.0 - u * u * (3.0 - 2.0 * u))[:, None] * blend_offset
        poses.append(faded)
        behaviors.append(np.full(frames + 1, graph.node_behavior[node], np.int32))
        before = world[-1]
    return np.concatenate(poses), np.concatenate(behaviors)
