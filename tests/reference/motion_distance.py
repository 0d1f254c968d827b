"""Slow twins of motion graphs: frame distance by search, and stopping by trying all paths."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import minimize

from crowdsim.geometry.planar import transform_points
from crowdsim.motion.graph.arrays import GraphArrays


def distance_under(a: np.ndarray, b: np.ndarray, pose: np.ndarray) -> float:
    """Return the root mean square distance of points (P, 3) if ``b`` moves by a planar pose."""
    planar = transform_points(pose, b[:, :2]) - a[:, :2]
    return float(np.sqrt(np.mean(np.sum(planar**2, axis=1) + (b[:, 2] - a[:, 2]) ** 2)))


def best_distance(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Return the least distance over all planar motions of ``b``, and its rotation, by descent from 8 rotations."""
    results = [
        minimize(lambda p: distance_under(a, b, p) ** 2, [0.0, 0.0, turn], method="BFGS", options={"gtol": 1e-12})
        for turn in np.arange(8) * np.pi / 4
    ]
    best = min(results, key=lambda r: r.fun)
    return float(np.sqrt(best.fun)), float(best.x[2])


def shortest_stop(graph: GraphArrays, start: int, narrowing: bool) -> float:
    """Return the least cost (meters, plus one per radian) from the end of ``start`` to a stand, relaxing all edges."""
    source = np.repeat(np.arange(len(graph.node_frames)), np.diff(graph.edge_start))
    cost = np.where(graph.node_ends_standing, 0.0, np.inf)
    for _ in range(len(graph.node_frames)):
        for s, t in itertools.zip_longest(source, graph.edge_target):
            if graph.node_idle[t] or (narrowing and graph.node_behavior[t] > graph.node_behavior[s]):
                continue
            cost[s] = min(cost[s], cost[t] + graph.node_length[t] + abs(graph.node_motion[t, 2]))
    return float(cost[start])


def deepest_valleys(
    image: np.ndarray, clip_first: np.ndarray, threshold: float, window: int, reach: int
) -> list[tuple[int, int]]:
    """Return local minima of a symmetric error image, deepest first, none within ``reach`` of another; both ways."""
    clip = np.repeat(np.arange(len(clip_first) - 1), np.diff(clip_first))
    usable = [f for f in range(len(image)) if clip_first[clip[f]] + window <= f < clip_first[clip[f] + 1] - window]
    minima = []
    for i in usable:
        for j in usable:
            if j <= i or image[i, j] > threshold:
                continue
            around = [
                ((i + di, j + dj), image[i + di, j + dj])
                for di in (-1, 0, 1)
                for dj in (-1, 0, 1)
                if (di, dj) != (0, 0)
            ]
            if all(image[i, j] < v if place < (i, j) else image[i, j] <= v for place, v in around):
                minima.append((float(image[i, j]), i, j))
    kept: list[tuple[int, int]] = []
    for _, i, j in sorted(minima):
        if all(max(abs(i - a), abs(j - b)) > reach for a, b in kept):
            kept.append((i, j))
    return sorted(kept + [(j, i) for i, j in kept])
