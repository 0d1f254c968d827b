"""The quickest way to stand: for each node the edge toward the nearest node that ends standing."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.motion.graph.arrays import GraphArrays

TURN_COST = 1.0
"""Cost of turning on the way to a stand [m/rad]. Higher: agents come to rest facing as they walked."""


def choose_stop_edges(graph: GraphArrays) -> NDArray[np.int32]:
    """Return the edge to take at each node's end to come to a stand, (N,).

    NONE if the node ends standing or no standing node can be reached. Of all paths to a stand, the one with the least
    track length is taken, with TURN_COST for turning, so that a stopping agent keeps its heading; of equal ones, the
    one with the fewest frames. Only paths on which no node has a wider behavior than the one before it count, as a
    stopping agent must not need more space than it has. All paths count for a node that has no such path.
    """
    source = np.repeat(np.arange(len(graph.node_frames)), np.diff(graph.edge_start))
    target = graph.edge_target
    # Behaviors are numbered from the narrowest (the least preferred), 0. Idle nodes are never part of a path.
    usable = ~graph.node_idle[target]
    narrowing = usable & (graph.node_behavior[target] <= graph.node_behavior[source])
    stop = _nearest_standing(graph, source, narrowing)
    anyhow = _nearest_standing(graph, source, usable)
    return np.where(stop == NONE, anyhow, stop).astype(np.int32)


def _nearest_standing(graph: GraphArrays, source: NDArray[np.int64], allowed: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the first edge (N,) of each node's cheapest path to a stand over edges that are ``allowed`` (E,).

    NONE for a node that ends standing itself, or from which no stand can be reached. The search (Dijkstra) goes
    backward from all standing ends. source: (E,) node that each edge leaves.
    """
    count = len(graph.node_frames)
    incoming: list[list[int]] = [[] for _ in range(count)]
    for edge in np.flatnonzero(allowed).tolist():
        incoming[graph.edge_target[edge]].append(edge)
    best = np.full(count, NONE, np.int32)
    done = np.zeros(count, bool)
    queue: list[tuple[float, int, int, int]] = [
        (0.0, 0, node, NONE) for node in np.flatnonzero(graph.node_ends_standing).tolist()
    ]
    heapq.heapify(queue)
    while queue:
        meters, frames, node, edge = heapq.heappop(queue)
        # A cheaper path to this node was found before.
        if done[node]:
            continue
        done[node] = True
        best[node] = edge
        for way_in in incoming[node]:
            before = int(source[way_in])
            if not done[before]:
                # An edge costs what its target is long: at the end of ``before``, ``node`` is still to be played.
                way = float(graph.node_length[node]) + TURN_COST * abs(float(graph.node_motion[node, 2]))
                cost = meters + way, frames + int(graph.node_frames[node])
                heapq.heappush(queue, (*cost, before, way_in))
    return best
