"""Remove edges from a motion graph, to search as sparse a graph as that of the 2011 paper."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from crowdsim.motion.graph.arrays import GraphArrays

_OF_NODES = tuple(("node_frames node_track node_motion node_length node_behavior node_ends_standing node_idle").split())
_OF_EDGES = ("edge_transform", "edge_pivot", "edge_low", "edge_high")


def thinned(graph: GraphArrays, edges: int) -> GraphArrays:
    """Keep at most ``edges`` edges out of each node of ``graph``; return the largest part that is strongly connected.

    The edges with the largest range of rotation are kept, which are those with the smallest distance; of equal ones the
    first. Stop edges, which only the crowd uses, are removed (-1).
    """
    # The rank of an edge among those out of its node, the largest range of rotation first.
    count = len(graph.node_frames)
    source = np.repeat(np.arange(count), np.diff(graph.edge_start))
    order = np.lexsort((np.arange(len(source)), graph.edge_low - graph.edge_high, source))
    rank = np.empty(len(source), np.int64)
    rank[order] = np.arange(len(source)) - graph.edge_start[source]
    kept = rank < edges
    joined = csr_array((kept[kept], (source[kept], graph.edge_target[kept])), shape=(count, count))
    _, label = connected_components(joined, directed=True, connection="strong")
    nodes = label == np.argmax(np.bincount(label))
    kept &= nodes[source] & nodes[graph.edge_target]
    number = np.cumsum(nodes) - 1  # of the nodes that stay
    return graph._replace(
        **{name: getattr(graph, name)[nodes] for name in _OF_NODES},
        **{name: getattr(graph, name)[kept] for name in _OF_EDGES},
        edge_start=np.searchsorted(number[source[kept]], np.arange(nodes.sum() + 1)).astype(np.int32),
        edge_target=number[graph.edge_target[kept]].astype(np.int32),
        stop_edge=np.full(int(nodes.sum()), -1, np.int32),
    )
