"""From nodes and the pairs that may join to the motion graph: its largest strongly connected part, as arrays."""

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

    edges: all that may follow each other. transitions: those of them that do not simply go on with a capture.
    branching: (N + 2T) / (N + T) with N nodes and T transitions: the papers' average branching factor, which counts
        transitions as nodes.
    out_degree: edges a node.
    threshold: meters up to which moments were joined.
    dropped: (node, why) of the segments that are not in the graph.
    skating: transitions left out because of what they add to the drift of a planted foot.
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
    """A strongly connected graph of motion segments, and their poses."""

    arrays: GraphArrays
    node_names: tuple[str, ...]
    poses: PoseTable
    skeleton: Skeleton
    report: GraphReport


def branching_factor(nodes: int, transitions: int) -> float:
    """The papers' average branching factor (2011 paper, table 1, whose twelve rows this fits)."""
    return (nodes + 2 * transitions) / (nodes + transitions)


def largest_component(count: int, source: Indices, target: Indices) -> NDArray[np.bool_]:
    """(count,) whether each node is in the strongly connected component of most nodes, the first of equals."""
    joined = coo_array((np.ones(len(source), bool), (source, target)), (count, count)).tocsr()
    _, label = connected_components(joined, directed=True, connection="strong")
    sizes = np.bincount(label)
    best = next(int(component) for component in label if sizes[component] == sizes.max())
    inside: NDArray[np.bool_] = label == best
    return inside


def clip_frames(name: str) -> tuple[str, int, int]:
    """Clip, first and last frame that the name of a node tells."""
    clip, _, frames = name.rpartition(":")
    first, _, last = frames.partition("-")
    return clip, int(first), int(last)


def follows(before: Node, after: Node) -> bool:
    """Whether ``after`` simply goes on where ``before`` ends."""
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
    """The graph of ``nodes`` and the edges (source, target) (E,), which lie in one strongly connected component.

    Edges are sorted by source, then target; ``alignments`` holds their ends and starts. An edge turns about the foot
    that is planted where it leaves.
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
        stop_edge=np.zeros(0, np.int32),
    )
    arrays = arrays._replace(stop_edge=choose_stop_edges(arrays))
    transitions = sum(not follows(nodes[i], nodes[j]) for i, j in zip(source, target, strict=True))
    n, e = len(nodes), len(target)
    report = GraphReport(n, e, transitions, branching_factor(n, transitions), e / n, float(threshold), tuple(dropped))
    names = tuple(node.name for node in nodes)
    return MotionGraph(arrays, names, make_pose_table(prepared, nodes), prepared[0].clip.skeleton, report)


def _pinned_transforms(rotation: Floats, pivot_a: Floats, pivot_b: Floats) -> Floats:
    """(E, 3) poses that turn by ``rotation`` and bring ``pivot_b`` onto ``pivot_a``."""
    c, s = cos(rotation), sin(rotation)
    x = pivot_a[:, 0] - (c * pivot_b[:, 0] - s * pivot_b[:, 1])
    y = pivot_a[:, 1] - (s * pivot_b[:, 0] + c * pivot_b[:, 1])
    return np.stack([x, y, rotation], axis=1)
