"""Feature-based motion graphs (2011 paper, section 3): clips cut by features, joined where they look alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.motion.graph.assembly import (
    GraphReport,
    MotionGraph,
    assemble,
    branching_factor,
    follows,
    largest_component,
)
from crowdsim.motion.graph.frame_distance import Alignments, align_all
from crowdsim.motion.graph.nodes import (
    BOTH_FEET,
    MotionSource,
    Node,
    PreparedSource,
    feature_segments,
    make_nodes,
    prepare_sources,
)

__all__ = ["DEFAULT_THRESHOLD", "GraphReport", "MotionGraph", "MotionSource", "build_motion_graph"]

DEFAULT_THRESHOLD = 0.06
"""Largest point-cloud distance of two moments that may join [m]. Higher: more edges, less smooth."""

STANDING_ALLOWANCE = 1.5
"""Threshold of two standing poses, as a multiple: a body at rest has time to settle, and people never come to rest
exactly as they set out."""

WIDEST_THRESHOLD = 0.3
"""Largest threshold that is tried for a required branching factor [m]."""

CAPTURED_DRIFT = 0.005
"""Largest drift of a planted foot that a transition between captures may add to that of the captures [m]."""

FARTHEST_DRIFT = 0.05
"""Drift that a transition may add if feet are pinned where they stand [m]: beyond, legs would be seen to reach far."""

_AROUND = 8
"""Number of distances tried on either side of the one that bisection finds."""


def build_motion_graph(
    sources: Sequence[MotionSource],
    threshold: float = DEFAULT_THRESHOLD,
    max_out_edges: int | None = None,
    branching: float | None = None,
    most_drift: float | None = None,
    whole: bool = False,
) -> MotionGraph:
    """Cut the clips, join their segments where the distance allows, and keep the largest strongly connected part.

    An end may join a start if the same foot is planted in both, or both stand.

    Parameters
    ----------
    sources : sequence of MotionSource
        The clips.
    threshold : float
        Largest distance of moments that join, root mean square over joints and frames [m]; of two standing poses,
        STANDING_ALLOWANCE times that.
    max_out_edges : int or None
        Keep only so many nearest edges out of each node; the one to the segment that followed in the capture always
        stays, as does that of an idle clip to itself.
    branching : float or None
        Required branching factor. The threshold is then the one up to WIDEST_THRESHOLD that comes nearest to it and, if
        possible, keeps at least half of the nodes that WIDEST_THRESHOLD would. If many segments are alike, only
        ``max_out_edges`` can lower it.
    most_drift : float or None
        Leave out transitions that add more than this to the drift of a planted foot [m]; clip names must be unique. An
        agent must be able to rest after a segment that ends standing. If that would lose all its transitions to idle
        clips, there are two cases: if the next segment of its capture ends standing and can rest, it no longer counts
        as ending standing; else its transition to the nearest idle clip stays.
    whole : bool
        True to leave out no transition at all for its drift if segments would fall out of the graph otherwise.

    Returns
    -------
    MotionGraph
        The graph.

    Raises
    ------
    MotionError
        If clips do not fit together, or nothing joins.

    Examples
    --------
    >>> clips = load_behavior_set(["frontal"], [(0.0, 2.0)]).clips[0].clips
    >>> graph = build_motion_graph([MotionSource(clip, 0, ("crossing", "standing")) for clip in clips])
    >>> graph.report.nodes, graph.report.transitions
    (46, 815)
    """
    candidates = _candidates(sources, max_out_edges)
    if branching is not None:
        threshold = _calibrated(candidates, branching)
    _require_loops(candidates, threshold)
    graph, keep = _joined(candidates, threshold)
    if most_drift is None:
        return graph
    # Imported here: it compiles pose blending, which the default set does not need.
    from crowdsim.motion.graph.transition_drift import skating_edges

    leave, enter = np.flatnonzero(keep)[skating_edges(graph, [source.clip for source in sources], most_drift)]
    if not len(leave):
        return graph
    candidates = _without(candidates, leave, enter, threshold)
    if whole and _edges(candidates, threshold)[2].sum() < keep.sum():
        return graph
    graph, _ = _joined(candidates, threshold)
    skating = int(np.isinf(candidates.needed[leave, enter]).sum())
    return replace(graph, report=replace(graph.report, skating=skating))


def _without(
    candidates: _Candidates, leave: NDArray[np.int64], enter: NDArray[np.int64], threshold: float
) -> _Candidates:
    """Return the candidates without the transitions from nodes ``leave`` (n,) to ``enter`` (n,).

    After a node that would lose all its idle clips, agents could not rest. If its capture goes on to a node that ends
    standing and can rest, the body only paused in a stride, before it drew up the other foot: the node that would lose
    them no longer counts as ending standing. Else it keeps the transition to its nearest idle clip. threshold: largest
    ``needed`` of an edge [m].
    """
    idle = np.array([candidates.prepared[node.source].source.idle for node in candidates.nodes])
    stands = np.array([node.segment.ends_standing for node in candidates.nodes])
    needed, nodes = candidates.needed.copy(), list(candidates.nodes)
    needed[leave, enter] = np.inf
    rests = np.any(needed[:, idle] <= threshold, axis=1)
    for number in np.unique(leave[idle[enter]]).tolist():
        # Another idle clip is left.
        if rests[number]:
            continue
        # 0: the segment that followed in the capture.
        if (stands & rests & ~idle & (needed[number] == 0.0)).any():
            node = nodes[number]
            nodes[number] = replace(node, segment=replace(node.segment, ends_standing=False))
            continue
        near = np.flatnonzero(idle & (candidates.needed[number] <= threshold))
        nearest = near[np.argmin(candidates.needed[number, near])]
        needed[number, nearest] = candidates.needed[number, nearest]
    return replace(candidates, nodes=nodes, needed=needed)


def _joined(candidates: _Candidates, threshold: float) -> tuple[MotionGraph, NDArray[np.bool_]]:
    """Return the graph of the largest component at ``threshold`` [m], and the mask (N,) of its nodes.

    Raise MotionError if it has no edge.
    """
    nodes, alignments = candidates.nodes, candidates.alignments
    source, target, keep = _edges(candidates, threshold)
    if not len(source):
        apart = candidates.needed[candidates.needed > 0.0]
        nearest = f"{float(apart.min()):.3f} m apart" if np.isfinite(apart).any() else "on different feet"
        raise MotionError(
            f"no cycle of segments joins within {threshold:g} m (the nearest end and start of different segments are "
            f"{nearest}); raise the threshold or add clips"
        )
    # Nodes that are kept get new numbers, ``place``.
    dropped = list(candidates.dropped)
    dropped += [(nodes[i].name, "not strongly connected with the rest") for i in np.flatnonzero(~keep)]
    place = np.cumsum(keep) - 1
    graph = assemble(
        candidates.prepared,
        [nodes[i] for i in np.flatnonzero(keep)],
        place[source],
        place[target],
        alignments.pairs(source, target),
        threshold,
        dropped,
    )
    return graph, keep


@dataclass(frozen=True)
class _Candidates:
    """N nodes, and how near each end is to each start.

    alignments: of all ends with all starts. needed: (N, N) threshold from which on the row's end joins the column's
    start [m]; 0 if it continues the capture, infinite if it never may. dropped: (node, reason) of segments left out.
    """

    prepared: list[PreparedSource]
    nodes: list[Node]
    alignments: Alignments
    needed: NDArray[np.float64]
    dropped: list[tuple[str, str]]


def _candidates(sources: Sequence[MotionSource], max_out_edges: int | None) -> _Candidates:
    """Cut the sources into nodes and compare all ends with all starts.

    max_out_edges: as of :func:`build_motion_graph`. Raise MotionError if no segment is left.
    """
    prepared = prepare_sources(sources)
    cut = [node for i, source in enumerate(prepared) for node in make_nodes(source, i, feature_segments(source))]
    idle = [source.idle for source in sources]
    nodes = [node for node in cut if idle[node.source] or not node.leads_nowhere()]
    if not nodes:
        raise MotionError("the detectors cut no segment out of these clips; check the detectors and the clips' lengths")
    dropped = [(node.name, "leads nowhere") for node in cut if not idle[node.source] and node.leads_nowhere()]
    alignments = align_all(np.stack([n.end.cloud for n in nodes]), np.stack([n.start.cloud for n in nodes]))
    natural = np.array([[follows(a, b) for b in nodes] for a in nodes], bool)
    end_foot, start_foot = np.array([n.end.foot for n in nodes]), np.array([n.start.foot for n in nodes])
    # Two rests may differ by STANDING_ALLOWANCE times the threshold, so they need a smaller one.
    needed = alignments.distance / np.where(end_foot == BOTH_FEET, STANDING_ALLOWANCE, 1.0)[:, None]
    needed = np.where(natural, 0.0, np.where(end_foot[:, None] == start_foot[None, :], needed, np.inf))
    if max_out_edges is not None:
        order = np.argsort(needed, axis=1, kind="stable")
        far = np.ones_like(natural)
        np.put_along_axis(far, order[:, :max_out_edges], False, axis=1)
        # Whatever their rank, continuations of captures stay, and a waiting agent repeats its idle clip.
        loops = np.diag([idle[node.source] for node in nodes])
        needed = np.where(far & ~natural & ~loops, np.inf, needed)
    return _Candidates(prepared, nodes, alignments, needed, dropped)


def _edges(candidates: _Candidates, threshold: float) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return sources and targets (E,) of the edges in the largest component at ``threshold`` [m].

    Also return the mask (N,) of its nodes.
    """
    source, target = np.nonzero(candidates.needed <= threshold)
    keep = largest_component(len(candidates.nodes), source, target)
    inside = keep[source] & keep[target]
    return source[inside], target[inside], keep


def _calibrated(candidates: _Candidates, wanted: float) -> float:
    """Return the threshold whose graph comes nearest to the ``wanted`` branching factor, the smallest of equals [m].

    Only the distances themselves can change the graph. Branching grows with the threshold almost everywhere, but a node
    that joins the component can lower it: bisection finds the neighborhood, then the best threshold there is taken.
    Graphs with less than half of the nodes that the largest threshold keeps come last.
    """
    steps = np.unique(candidates.needed[candidates.needed <= WIDEST_THRESHOLD])
    if not len(steps):
        raise MotionError(f"no segments join within {WIDEST_THRESHOLD:g} m, so none branch; add clips that are alike")
    natural = candidates.needed == 0.0
    least = int(_edges(candidates, float(steps[-1]))[2].sum()) / 2.0

    def judge(place: int) -> tuple[bool, float]:
        """Return for ``steps[place]``: True if it loses too many nodes, and the excess over the wanted branching."""
        source, target, keep = _edges(candidates, float(steps[place]))
        transitions = len(source) - int(natural[source, target].sum())
        nodes = int(keep.sum())
        return nodes < least, branching_factor(nodes, transitions) - wanted

    low, high = 0, len(steps) - 1
    while low < high:
        middle = (low + high) // 2
        small, over = judge(middle)
        # Too few nodes or branches: a larger threshold is needed.
        if small or over < 0.0:
            low = middle + 1
        else:
            high = middle
    near = range(max(low - _AROUND, 0), min(low + _AROUND + 1, len(steps)))

    def rank(place: int) -> tuple[bool, float, int]:
        """Return the key by which thresholds ``steps[place]`` are ordered, the best first."""
        small, over = judge(place)
        return small, abs(over), place

    return float(steps[min(near, key=rank)])


def _require_loops(candidates: _Candidates, threshold: float) -> None:
    """Raise MotionError if an idle clip cannot follow itself: a waiting agent would have to stop waiting."""
    for i, node in enumerate(candidates.nodes):
        source = candidates.prepared[node.source].source
        if source.idle and candidates.needed[i, i] > threshold:
            raise MotionError(
                f"idle clip '{source.clip.name}' ends {candidates.alignments.distance[i, i]:.3f} m away from the "
                f"pose it starts in and cannot repeat; trim it to end as it began, or raise the threshold"
            )
