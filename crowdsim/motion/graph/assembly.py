"""Assemble a motion graph from nodes and pairs that may join: its largest strongly connected part, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.frame_distance import PairAlignments
from crowdsim.motion.graph.nodes import Node, PreparedSource
from crowdsim.motion.graph.pose_table import PoseTable, make_pose_table
from crowdsim.motion.graph.stop_edges import choose_stop_edges

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class GraphReport:
    """Counts of a built graph.

    edges: all pairs that may follow each other. transitions: edges that do not simply continue a capture.
    branching: (N + 2T) / (N + T) with N nodes and T transitions: the papers' average branching factor, which counts
    transitions as nodes.
    out_degree: edges per node.
    threshold: distance up to which moments were joined [m].
    dropped: (node, reason) of the segments that are not in the graph.
    skating: transitions left out because they add too much to the drift of a planted foot.
    """

    nodes: int
    edges: int
    transitions: int
    branching: float
    out_degree: float
    threshold: float
    dropped: tuple[tuple[str, str], ...]
    skating: int = 0


@dataclass(frozen=True)
class MotionGraph:
    """A strongly connected graph of motion segments, and their poses; :func:`build_motion_graph` makes it.

    Attributes
    ----------
    arrays : GraphArrays
        Nodes and edges in the form that kernels read.
    node_names : tuple of str
        Clip and frames of each node, as ``walk:30-61``.
    poses : PoseTable
        Poses of all frames of all nodes.
    skeleton : Skeleton
        Skeleton of all clips.
    report : GraphReport
        Sizes, and what was left out.

    Examples
    --------
    >>> graph = load_behavior_set(["frontal"], [(0.0, 2.0)]).graph
    >>> len(graph.node_names), graph.report.edges, graph.node_names[0]
    (47, 868, 'walk:10-66')
    """

    arrays: GraphArrays
    node_names: tuple[str, ...]
    poses: PoseTable
    skeleton: Skeleton
    report: GraphReport


def branching_factor(nodes: int, transitions: int) -> float:
    """Return the papers' average branching factor (2011 paper, table 1, whose twelve rows this formula fits)."""
    return (nodes + 2 * transitions) / (nodes + transitions)


def largest_component(count: int, source: Indices, target: Indices) -> NDArray[np.bool_]:
    """Return the mask (count,) of the largest strongly connected component, the first of equally large ones.

    source, target: (E,) nodes that edges lead from and to.
    """
    joined = coo_array((np.ones(len(source), bool), (source, target)), (count, count)).tocsr()
    _, label = connected_components(joined, directed=True, connection="strong")
    sizes = np.bincount(label)
    best = next(int(component) for component in label if sizes[component] == sizes.max())
    inside: NDArray[np.bool_] = label == best
    return inside


def clip_frames(name: str) -> tuple[str, int, int]:
    """Return clip, first and last frame that a node's name contains."""
    clip, _, frames = name.rpartition(":")
    first, _, last = frames.partition("-")
    return clip, int(first), int(last)


def follows(before: Node, after: Node) -> bool:
    """Return True if ``after`` simply continues where ``before`` ends."""
    return before.source == after.source and before.segment.last == after.segment.first


def assemble(
    prepared: Sequence[PreparedSource],
    nodes: Sequence[Node],
    source: Indices,
    target: Indices,
    alignments: PairAlignments,
    threshold: float,
    dropped: Sequence[tuple[str, str]],
) -> MotionGraph:
    """Return the graph of ``nodes`` and edges (source, target) (E,), which form one strongly connected component.

    Edges are sorted by source, then target. An edge turns about the foot that is planted where it leaves.

    prepared: the sources that the nodes number. alignments: of the end of each edge's source with the start of its
    target, in the order of edges. threshold: largest distance of moments that join, which bounds the extra rotation of
    edges [m]. dropped: (node, reason) of segments that are not in the graph, for the report.
    """
    planted = [nodes[i].end.foot for i in source]
    pivot_a = np.array([nodes[i].end.pivots[foot] for i, foot in zip(source, planted, strict=True)]).reshape(-1, 2)
    pivot_b = np.array([nodes[i].start.pivots[foot] for i, foot in zip(target, planted, strict=True)]).reshape(-1, 2)
    low, high = alignments.rotation_range(pivot_a, pivot_b, threshold)
    frames = np.array([len(node.track) - 1 for node in nodes], np.int32)
    arrays = GraphArrays(
        node_frames=frames,
        node_track=np.concatenate([[0], np.cumsum(frames[:-1] + 1)]).astype(np.int32),
        tracks=np.concatenate([node.track for node in nodes]),
        node_motion=np.array([node.track[-1] for node in nodes]),
        node_length=np.array([node.length for node in nodes]),
        node_behavior=np.array([prepared[node.source].source.behavior for node in nodes], np.int32),
        node_ends_standing=np.array([node.segment.ends_standing for node in nodes], bool),
        node_idle=np.array([prepared[node.source].source.idle for node in nodes], bool),
        edge_start=np.searchsorted(source, np.arange(len(nodes) + 1)).astype(np.int32),
        edge_target=target.astype(np.int32),
        edge_transform=_pinned_transforms(alignments.rotation, pivot_a, pivot_b),
        edge_pivot=pivot_a,
        edge_low=low,
        edge_high=high,
        # Chosen below, from the other arrays.
        stop_edge=np.zeros(0, np.int32),
    )
    arrays = arrays._replace(stop_edge=choose_stop_edges(arrays))
    transitions = sum(not follows(nodes[i], nodes[j]) for i, j in zip(source, target, strict=True))
    n, e = len(nodes), len(target)
    report = GraphReport(n, e, transitions, branching_factor(n, transitions), e / n, float(threshold), tuple(dropped))
    names = tuple(node.name for node in nodes)
    return MotionGraph(arrays, names, make_pose_table(prepared, nodes), prepared[0].clip.skeleton, report)


def _pinned_transforms(rotation: Floats, pivot_a: Floats, pivot_b: Floats) -> Floats:
    """Return poses (E, 3) that turn by ``rotation`` (E,) [rad] and bring ``pivot_b`` (E, 2) onto ``pivot_a`` [m]."""
    c, s = cos(rotation), sin(rotation)
    x = pivot_a[:, 0] - (c * pivot_b[:, 0] - s * pivot_b[:, 1])
    y = pivot_a[:, 1] - (s * pivot_b[:, 0] + c * pivot_b[:, 1])
    return np.stack([x, y, rotation], axis=1)
