"""Standard motion graphs (Kovar, Gleicher and Pighin 2002), with which the 2011 paper compares feature-based ones.

All frames are compared with all others; clips are cut and joined at the local minima of that error image, wherever they
are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.motion.analysis.error_image import ErrorImage, error_image, valleys
from crowdsim.motion.graph.assembly import MotionGraph, assemble, largest_component
from crowdsim.motion.graph.features import StandingDetector
from crowdsim.motion.graph.frame_distance import PairAlignments, align_pairs, join_pairs
from crowdsim.motion.graph.motion_graph import DEFAULT_THRESHOLD
from crowdsim.motion.graph.nodes import MotionSource, Node, PreparedSource, make_nodes, prepare_sources
from crowdsim.motion.graph.segmentation import Segment

_PAIRS = 2000
"""Pairs of clouds aligned at once."""


def build_standard_graph(
    sources: Sequence[MotionSource],
    threshold: float = DEFAULT_THRESHOLD,
    max_out_edges: int | None = None,
    image: ErrorImage | None = None,
    most_drift: float | None = None,
) -> MotionGraph:
    """Cut the clips at the valleys of their error image, join them there, keep the largest strongly connected part.

    Detectors have no effect here, and idle clips are left out.

    Parameters
    ----------
    sources: clips on the same joints.
    threshold: largest distance of moments that join [m].
    max_out_edges: keep only so many nearest transitions out of each frame.
    image: error image of the clips that are not idle, if it is known.
    most_drift: leave out transitions that add more than this to the drift of a planted foot [m]; clip names must be
    unique.

    Raises
    ------
    MotionError: if clips do not fit together, or no moments join.
    """
    sources = [source for source in sources if not source.idle]
    prepared = prepare_sources(sources)
    if image is None:
        image = error_image([source.clip for source in sources])
    leave, enter = valleys(image, threshold)
    if max_out_edges is not None:
        leave, enter = _nearest(image, leave, enter, max_out_edges)
    cuts = np.unique(np.concatenate([leave, enter]))
    # The image compares frames as they are, also around a stand; so must the clouds of nodes (hold_standing).
    clip_of = image.clip_of(cuts)
    nodes: list[Node] = []
    for index, source in enumerate(prepared):
        frames = cuts[clip_of == index] - image.clip_first[index]
        nodes += make_nodes(source, index, _segments(source, frames.tolist()), hold_standing=False)
    before, after = _edges(nodes, image, leave, enter)
    if not len(before):
        raise MotionError(
            f"no two moments of these clips join within {threshold:g} m; raise the threshold or add clips"
        )
    graph, keep = _joined(prepared, nodes, before, after, threshold)
    if most_drift is None:
        return graph
    from crowdsim.motion.graph.transition_drift import skating_edges

    leave, enter = np.flatnonzero(keep)[skating_edges(graph, [source.clip for source in sources], most_drift)]
    if not len(leave):
        return graph
    stays = ~np.isin(before * len(nodes) + after, leave * len(nodes) + enter)
    graph, _ = _joined(prepared, nodes, before[stays], after[stays], threshold)
    return replace(graph, report=replace(graph.report, skating=len(leave)))


def _joined(
    prepared: Sequence[PreparedSource],
    nodes: list[Node],
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    threshold: float,
) -> tuple[MotionGraph, NDArray[np.bool_]]:
    """Return the largest component of ``nodes`` with edges ``before`` to ``after``, and the mask (N,) of its nodes.

    before, after: (E,) sources and targets. threshold: largest distance of moments that join [m]. Raise MotionError if
    no edge is left.
    """
    keep = largest_component(len(nodes), before, after)
    inside = keep[before] & keep[after]
    before, after = before[inside], after[inside]
    if not len(before):
        raise MotionError(f"no cycle of segments joins within {threshold:g} m; raise the threshold or add clips")
    place = np.cumsum(keep) - 1
    dropped = [(nodes[i].name, "not strongly connected with the rest") for i in np.flatnonzero(~keep)]
    alignments = _align(nodes, before, after)
    kept = [nodes[i] for i in np.flatnonzero(keep)]
    return assemble(prepared, kept, place[before], place[after], alignments, threshold, dropped), keep


def _nearest(
    image: ErrorImage, leave: NDArray[np.int64], enter: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the ``count`` nearest transitions out of each frame, in their order.

    leave, enter: (n,) rows of the image that transitions leave and enter, as those returned.
    """
    order = np.lexsort((enter, image.distance[leave, enter], leave))
    # Rank of each transition among those out of its frame.
    ordered = leave[order]
    rank = np.arange(len(order)) - np.searchsorted(ordered, ordered)
    chosen = np.sort(order[rank < count])
    return leave[chosen], enter[chosen]


def _segments(source: PreparedSource, frames: list[int]) -> list[Segment]:
    """Return the segments between consecutive ``frames``, the cuts; a cut is standing if both feet are slow there."""
    still = source.foot_speed.max(axis=1) < StandingDetector.speed
    return [Segment(a, b, bool(still[a]), bool(still[b])) for a, b in pairwise(frames)]


def _edges(
    nodes: Sequence[Node], image: ErrorImage, leave: NDArray[np.int64], enter: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return sources and targets (E,) of all edges, sorted: continuations of clips, and transitions.

    leave, enter: (n,) rows of the image that transitions leave and enter. A transition counts only if a node ends at
    the row that it leaves, and one starts at the row that it enters.
    """
    count = int(image.clip_first[-1])
    ending, starting = np.full(count, -1), np.full(count, -1)
    for index, node in enumerate(nodes):
        row = image.clip_first[node.source]
        ending[row + node.segment.last], starting[row + node.segment.first] = index, index
    # Nodes that meet at a frame of their clip, and nodes that meet at a transition.
    frames = np.arange(count)
    source = ending[np.concatenate([frames, leave])]
    target = starting[np.concatenate([frames, enter])]
    both = (source >= 0) & (target >= 0)
    pairs = np.unique(np.column_stack([source[both], target[both]]), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _align(nodes: Sequence[Node], source: NDArray[np.int64], target: NDArray[np.int64]) -> PairAlignments:
    """Return the alignments of edges (source, target), a few at a time."""
    parts = []
    for begin in range(0, len(source), _PAIRS):
        chosen = slice(begin, begin + _PAIRS)
        ends = np.stack([nodes[i].end.cloud for i in source[chosen]])
        starts = np.stack([nodes[i].start.cloud for i in target[chosen]])
        parts.append(align_pairs(ends, starts))
    return join_pairs(parts)
