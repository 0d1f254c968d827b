"""From an annotated path to the nodes of the motion graph that walk it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import MotionError
from crowdsim.following.follow_kernels import BLOCKED, FOUND, OUT_OF_BUDGET, STAGE_COLUMNS, follow
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.motion.graph_arrays import GraphArrays

Floats = NDArray[np.float64]


class Samples(Protocol):
    """A path at equal steps: pose (m, 3) x, y and direction of motion; arc (m,); behavior (m,) int32."""

    @property
    def pose(self) -> Floats: ...
    @property
    def arc(self) -> Floats: ...
    @property
    def behavior(self) -> NDArray[np.int32]: ...


class FollowStatus(IntEnum):
    """How a search for motion along a path ended."""

    FOUND = FOUND
    OUT_OF_BUDGET = OUT_OF_BUDGET
    BLOCKED = BLOCKED


@dataclass(frozen=True)
class FollowOptions:
    """What the follower holds to.

    goal_tolerance: meters from the path's end within which the last node must pass, or end where end_standing.
    end_standing: whether the last node must end standing.
    margin: meters kept free beyond the body's radius by nodes of a wider behavior than the planned: what plans keep.
    transition_reach: meters around a section in which a behavior that faces off the direction of motion is allowed.
    heading_tolerance: radians between body and path at the end of each node that moves.
    deviation: meters that the end of a node may lie off the path.
    stray: meters that a track may lie off the path anywhere, without limit where only collisions count.
    slack: meters kept free beyond the body's radius, for what passes between two samples of the test.
    candidates: branches kept at each stage beside the single successors.
    looks: branches laid on the path at each stage beside the single successors: of more, those that promise most.
    budget: map queries until the search gives up.
    """

    goal_tolerance: float = 0.35
    end_standing: bool = False
    margin: float = TRACKING_MARGIN
    transition_reach: float = 2.0
    heading_tolerance: float = float(np.radians(35.0))
    deviation: float = 0.6
    stray: float = float("inf")
    slack: float = 0.005
    candidates: int = 48
    looks: int = 24
    budget: int = 4_000


@dataclass(frozen=True)
class FollowResult:
    """Nodes of the motion graph in order, as far as the search came.

    nodes, edges: (K,) int32, edge taken into each node, -1 for the first. twists: (K,) radians of extra rotation at
    that edge. origins: (K, 3) world pose where each node starts. reached: arc length of the path at the end.
    expansions: map queries made.
    """

    status: FollowStatus
    nodes: NDArray[np.int32]
    edges: NDArray[np.int32]
    twists: Floats
    origins: Floats
    reached: float
    expansions: int


class _Guide(NamedTuple):
    pose: Floats
    behavior: NDArray[np.int32]
    allowed: NDArray[np.bool_]
    length: float
    step: float
    per_meter: float


class _Rules(NamedTuple):
    radii: Floats
    facings: Floats
    goal_tolerance: float
    end_standing: bool
    margin: float
    heading_tolerance: float
    deviation: float
    stray: float
    slack: float
    candidates: int
    budget: int


class _Laid(NamedTuple):
    serial: NDArray[np.int64]
    fit: NDArray[np.bool_]
    wide: NDArray[np.bool_]
    reached: NDArray[np.bool_]
    free: NDArray[np.bool_]
    node: NDArray[np.int64]
    edge: NDArray[np.int64]
    twist: Floats
    origin: Floats
    end: Floats
    arc: Floats
    area: Floats
    off: Floats


class _Search(NamedTuple):
    """Stack of stages, their candidates, and the present and the best solution.

    stage: (S, STAGE_COLUMNS); stage_origin, stage_end: (S, 3); stage_arc: (S,); candidate, score: S equal shares.
    step, best_step: (K, 2) node and the edge taken into it; place, best_place: (K, 4) its origin and twist.
    """

    stage: NDArray[np.int64]
    stage_origin: Floats
    stage_end: Floats
    stage_arc: Floats
    candidate: NDArray[np.int64]
    score: Floats
    look: NDArray[np.int64]
    look_score: Floats
    marked: NDArray[np.int64]
    branch: NDArray[np.int64]
    memory: NDArray[np.int64]
    step: NDArray[np.int64]
    place: Floats
    best_step: NDArray[np.int64]
    best_place: Floats


def follow_path(
    graph: GraphArrays,
    maps: MotionMaps,
    samples: Samples,
    meshes: tuple[Any, ...],
    radii: Floats,
    facings: Floats,
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
) -> FollowResult:
    """Find nodes that walk along a path with every body disc free on all layers (2012 paper, section 5).

    meshes: kernel arrays of each layer's mesh. radii: (B, layers) body radius of each behavior on them.
    facings: (B, F) allowed headings of the body relative to its direction of motion, padded with NaN.
    start_pose: (3,) where the first node starts. start_node: the first node, taken as being played already and not
    tested; -1 to choose one. Safe to call from several threads at once. MotionError where shapes do not fit.
    """
    options = options or FollowOptions()
    behaviors = int(graph.node_behavior.max(initial=0)) + 1
    if len(samples.arc) < 2 or not samples.arc[-1] > 0.0:
        raise MotionError("a path to follow needs two samples and a length; there is nothing to walk")
    if len(radii) < behaviors or len(facings) != len(radii) or radii.shape[1] != len(meshes):
        raise MotionError(
            f"radii {radii.shape} and facings {facings.shape} must have a row for each of the {behaviors} behaviors,"
            f" radii a column for each of the {len(meshes)} layers"
        )
    if options.looks < 1 or options.candidates < 1:
        raise MotionError(
            f"a search keeps one candidate and looks at one branch or more, not {options.candidates}, {options.looks}"
        )
    guide = _guide(samples, facings, options.transition_reach)
    rules = _Rules(
        np.ascontiguousarray(radii, np.float64),
        np.ascontiguousarray(facings, np.float64),
        float(options.goal_tolerance),
        bool(options.end_standing),
        float(options.margin),
        float(options.heading_tolerance),
        float(options.deviation),
        float(options.stray),
        float(options.slack),
        int(options.candidates),
        int(options.budget),
    )
    search, laid = _workspace(graph, maps, float(samples.arc[-1]), rules, options.looks)
    start = np.array(start_pose, np.float64)
    status, count, reached, expansions = follow(
        graph, maps.arrays, guide, rules, meshes, start, int(start_node), search, laid
    )
    return FollowResult(
        FollowStatus(status),
        search.best_step[:count, 0].astype(np.int32),
        search.best_step[:count, 1].astype(np.int32),
        search.best_place[:count, 3].copy(),
        search.best_place[:count, :3].copy(),
        float(reached),
        int(expansions),
    )


def _guide(samples: Samples, facings: Floats, reach: float) -> _Guide:
    length = float(samples.arc[-1])
    pieces = len(samples.arc) - 1
    allowed = _allowed(samples, facings, reach)
    return _Guide(samples.pose, samples.behavior, allowed, length, length / pieces, pieces / length)


def _allowed(samples: Samples, facings: Floats, reach: float) -> NDArray[np.bool_]:
    """Where along the path each behavior may be used, (B, m).

    A behavior that faces along the motion may be used anywhere; one that does not (stepping sideways) only within
    ``reach`` of a section planned for it or for a narrower one.
    """
    allowed = np.ones((len(facings), len(samples.arc)), np.bool_)
    for b, row in enumerate(facings):
        if (np.abs(row) <= np.pi / 4.0).any():
            continue
        planned = samples.arc[samples.behavior <= b]
        if not len(planned):
            allowed[b] = False
            continue
        after = np.minimum(np.searchsorted(planned, samples.arc), len(planned) - 1)
        before = np.maximum(after - 1, 0)
        gap = np.minimum(np.abs(planned[after] - samples.arc), np.abs(planned[before] - samples.arc))
        allowed[b] = gap <= reach
    return allowed


def _workspace(graph: GraphArrays, maps: MotionMaps, length: float, rules: _Rules, looks: int) -> tuple[_Search, _Laid]:
    """Room for one search; a solution has some nodes for each meter of path."""
    depth = maps.depth
    stages = 64 + int(8.0 * length)
    nodes = stages * depth + 1
    entries = max(maps.most_entries, len(graph.node_frames))
    # Every single successor is an entry; what of the pool is never touched takes no memory.
    pool = stages * (rules.candidates + entries)
    memory = 1 << max(10, int(2 * rules.budget).bit_length())

    def ints(n: int) -> NDArray[np.int64]:
        return np.empty(n, np.int64)

    search = _Search(
        stage=np.empty((stages, STAGE_COLUMNS), np.int64),
        stage_origin=np.empty((stages, 3)),
        stage_end=np.empty((stages, 3)),
        stage_arc=np.empty(stages),
        candidate=ints(pool),
        score=np.empty(pool),
        look=ints(looks),
        look_score=np.empty(looks),
        marked=np.zeros((2, entries), np.int64),
        branch=ints(depth),
        memory=np.zeros(memory, np.int64),
        step=np.empty((nodes, 2), np.int64),
        place=np.empty((nodes, 4)),
        best_step=np.empty((nodes, 2), np.int64),
        best_place=np.empty((nodes, 4)),
    )
    laid = _Laid(
        serial=np.zeros(entries, np.int64),
        fit=np.empty(entries, np.bool_),
        wide=np.empty(entries, np.bool_),
        reached=np.empty(entries, np.bool_),
        free=np.empty((entries, rules.radii.shape[1]), np.bool_),
        node=ints(entries),
        edge=ints(entries),
        twist=np.empty(entries),
        origin=np.empty((entries, 3)),
        end=np.empty((entries, 3)),
        arc=np.empty(entries),
        area=np.empty(entries),
        off=np.empty(entries),
    )
    return search, laid
