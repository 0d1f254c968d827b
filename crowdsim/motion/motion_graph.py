"""Feature-based motion graphs (2011 paper, section 3): clips cut by features, joined where they look alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from crowdsim.errors import MotionError
from crowdsim.motion.frame_distance import Alignments, align_all
from crowdsim.motion.graph_arrays import GraphArrays
from crowdsim.motion.graph_nodes import BOTH_FEET, MotionSource, Node, make_nodes
from crowdsim.motion.kinematics import Floats
from crowdsim.motion.pose_table import PoseTable, make_pose_table
from crowdsim.motion.skeleton import Skeleton
from crowdsim.motion.stop_edges import choose_stop_edges

__all__ = ["DEFAULT_THRESHOLD", "GraphReport", "MotionGraph", "MotionSource", "build_motion_graph"]

DEFAULT_THRESHOLD = 0.06
"""Meters of point-cloud distance up to which two moments may be joined."""

STANDING_ALLOWANCE = 1.5
"""How many times the threshold two standing poses may differ: a body at rest has the time to settle, and people never
come to rest just as they set out."""


@dataclass(frozen=True)
class GraphReport:
    """Counts of a built graph.

    branching: (N + 2E) / (N + E), the papers' average branching factor, which counts transitions as nodes.
    out_degree: E / N.
    dropped: (node, why) of the segments that are not in the graph.
    """

    nodes: int
    edges: int
    branching: float
    out_degree: float
    dropped: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class MotionGraph:
    """A strongly connected graph of motion segments, and their poses."""

    arrays: GraphArrays
    node_names: tuple[str, ...]
    poses: PoseTable
    skeleton: Skeleton
    report: GraphReport


def build_motion_graph(
    sources: Sequence[MotionSource], threshold: float = DEFAULT_THRESHOLD, max_out_edges: int | None = None
) -> MotionGraph:
    """Cut the clips, join their segments wherever the distance allows, keep the largest strongly connected part.

    An end may join a start if the same foot is planted in both, or both stand, and their distance is at most
    ``threshold`` meters (root mean square over joints and frames). ``max_out_edges`` keeps the nearest so many
    edges out of each node; the one to the segment that followed in the capture always stays.
    """
    nodes, tracks = make_nodes(sources)
    dropped = [(node.name, "leads nowhere") for node in nodes if node.leads_nowhere() and not sources[node.source].idle]
    nodes = [node for node in nodes if not node.leads_nowhere() or sources[node.source].idle]
    if not nodes:
        raise MotionError("the detectors cut no segment out of these clips; check the detectors and the clips' lengths")

    alignments = align_all(np.stack([n.end.cloud for n in nodes]), np.stack([n.start.cloud for n in nodes]))
    joined = _joined(nodes, alignments, threshold, max_out_edges)
    _require_loops(sources, nodes, joined, alignments)
    keep = _largest_component(joined)
    dropped += [(nodes[i].name, "not strongly connected with the rest") for i in np.flatnonzero(~keep)]
    kept = np.flatnonzero(keep)
    if not joined[np.ix_(kept, kept)].any():
        nearest = float(np.min(alignments.distance))
        raise MotionError(
            f"no cycle of segments joins within {threshold:g} m (the nearest end and start are {nearest:.3f} m "
            f"apart); raise the threshold or add clips"
        )
    arrays = _arrays(sources, nodes, kept, joined, alignments, threshold)
    nodes = [nodes[i] for i in kept]
    n, e = len(nodes), len(arrays.edge_target)
    report = GraphReport(n, e, (n + 2 * e) / (n + e), e / n, tuple(dropped))
    names = tuple(node.name for node in nodes)
    return MotionGraph(arrays, names, make_pose_table(sources, tracks, nodes), sources[0].clip.skeleton, report)


def _joined(
    nodes: Sequence[Node], alignments: Alignments, threshold: float, max_out_edges: int | None
) -> NDArray[np.bool_]:
    """(N, N) whether row's end may be followed by column's start."""
    natural = np.array(
        [[a.source == b.source and a.segment.last == b.segment.first for b in nodes] for a in nodes], bool
    )
    end_foot, start_foot = np.array([n.end.foot for n in nodes]), np.array([n.start.foot for n in nodes])
    distance = np.where(natural, 0.0, alignments.distance)
    limit = np.where(end_foot == BOTH_FEET, STANDING_ALLOWANCE, 1.0)[:, None] * threshold
    joined = (distance <= limit) & (end_foot[:, None] == start_foot[None, :])
    if max_out_edges is not None:
        order = np.argsort(np.where(joined, distance, np.inf), axis=1, kind="stable")
        near = np.zeros_like(joined)
        np.put_along_axis(near, order[:, :max_out_edges], True, axis=1)
        joined &= near
    return joined | natural


def _require_loops(
    sources: Sequence[MotionSource], nodes: Sequence[Node], joined: NDArray[np.bool_], alignments: Alignments
) -> None:
    """MotionError for an idle clip that cannot follow itself: who waits would have to stop waiting."""
    for i, node in enumerate(nodes):
        if sources[node.source].idle and not joined[i, i]:
            raise MotionError(
                f"idle clip '{sources[node.source].clip.name}' ends {alignments.distance[i, i]:.3f} m away from the "
                f"pose it starts in and cannot repeat; trim it to end as it began, or raise the threshold"
            )


def _largest_component(joined: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) whether each node is in the strongly connected component of most nodes, the first of equals."""
    _, label = connected_components(csr_array(joined), directed=True, connection="strong")
    sizes = np.bincount(label)
    best = next(int(component) for component in label if sizes[component] == sizes.max())
    return label == best


def _arrays(
    sources: Sequence[MotionSource],
    nodes: Sequence[Node],
    kept: NDArray[np.int64],
    joined: NDArray[np.bool_],
    alignments: Alignments,
    threshold: float,
) -> GraphArrays:
    chosen = [nodes[i] for i in kept]
    source, target = np.nonzero(joined[np.ix_(kept, kept)])
    a, b = kept[source], kept[target]
    pivot_a = np.array([nodes[i].end.pivot for i in a])
    pivot_b = np.array([nodes[i].start.pivot for i in b])
    low, high = alignments.rotation_range(a, b, pivot_a, pivot_b, threshold)
    frames = np.array([len(node.track) - 1 for node in chosen], np.int32)
    arrays = GraphArrays(
        node_frames=frames,
        node_track=np.concatenate([[0], np.cumsum(frames[:-1] + 1)]).astype(np.int32),
        tracks=np.concatenate([node.track for node in chosen]),
        node_motion=np.array([node.track[-1] for node in chosen]),
        node_length=np.array([node.length for node in chosen]),
        node_behavior=np.array([sources[node.source].behavior for node in chosen], np.int32),
        node_ends_standing=np.array([node.segment.ends_standing for node in chosen], bool),
        node_idle=np.array([sources[node.source].idle for node in chosen], bool),
        edge_start=np.searchsorted(source, np.arange(len(chosen) + 1)).astype(np.int32),
        edge_target=target.astype(np.int32),
        edge_transform=_pinned_transforms(alignments.rotation[a, b], pivot_a, pivot_b),
        edge_pivot=pivot_a,
        edge_low=low,
        edge_high=high,
        stop_edge=np.zeros(0, np.int32),
    )
    return arrays._replace(stop_edge=choose_stop_edges(arrays))


def _pinned_transforms(rotation: Floats, pivot_a: Floats, pivot_b: Floats) -> Floats:
    """(E, 3) poses that turn by ``rotation`` and bring ``pivot_b`` onto ``pivot_a``."""
    c, s = np.cos(rotation), np.sin(rotation)
    x = pivot_a[:, 0] - (c * pivot_b[:, 0] - s * pivot_b[:, 1])
    y = pivot_a[:, 1] - (s * pivot_b[:, 0] + c * pivot_b[:, 1])
    return np.stack([x, y, rotation], axis=1)
