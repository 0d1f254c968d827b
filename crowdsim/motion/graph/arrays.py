"""The motion graph as flat arrays, the form that kernels read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class GraphArrays(NamedTuple):
    """N nodes and E edges, edges sorted by source (compressed rows).

    node_frames: (N,) int32, frames L of a node; it has L + 1 track samples.
    node_track: (N,) int32, first row of the node in ``tracks``.
    tracks: (T, 3) float64, track pose (x, y [m], heading [rad]) of every sample relative to its node's first sample.
    node_motion: (N, 3) float64, last track sample of each node, relative to its first.
    node_length: (N,) float64, length of the track [m].
    node_behavior: (N,) int32, index of the behavior; 0 is the narrowest, which is the least preferred.
    node_ends_standing: (N,) bool, True if an agent may stay where the node ends.
    node_idle: (N,) bool, True for waiting in place: never part of a path.
    edge_start: (N + 1,) int32, rows ``edge_start[n]:edge_start[n + 1]`` are the edges out of node n.
    edge_target: (E,) int32, the node that an edge enters.
    edge_transform: (E, 3) float64, start of the target (x, y [m], heading [rad]) in the frame of the source's last
    track sample.
    edge_pivot: (E, 2) float64, planted foot in that same frame: extra rotation turns about it [m].
    edge_low, edge_high: (E,) float64, range of extra rotation, low <= 0 <= high [rad].
    stop_edge: (N,) int32, edge to take at a node's end to stand soonest; -1 if it ends standing or never can.
    """

    node_frames: NDArray[np.int32]
    node_track: NDArray[np.int32]
    tracks: NDArray[np.float64]
    node_motion: NDArray[np.float64]
    node_length: NDArray[np.float64]
    node_behavior: NDArray[np.int32]
    node_ends_standing: NDArray[np.bool_]
    node_idle: NDArray[np.bool_]
    edge_start: NDArray[np.int32]
    edge_target: NDArray[np.int32]
    edge_transform: NDArray[np.float64]
    edge_pivot: NDArray[np.float64]
    edge_low: NDArray[np.float64]
    edge_high: NDArray[np.float64]
    stop_edge: NDArray[np.int32]
