"""What a search along a path reads and writes: the path as kernels read it, the rules, room for stages and branches."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.follower.arrival_kernels import MOST_BENT
from crowdsim.following.follower.follow_kernels import STAGE_COLUMNS, STATE_COLUMNS
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]


class Samples(Protocol):
    """A path at equal steps: pose (m, 3) x, y and direction of motion; arc (m,); behavior (m,) int32."""

    @property
    def pose(self) -> Floats: ...
    @property
    def arc(self) -> Floats: ...
    @property
    def behavior(self) -> NDArray[np.int32]: ...


class Guide(NamedTuple):
    """A path as :mod:`crowdsim.following.follower.path_kernels` reads it.

    allowed: (B, m), where each behavior may be used.
    """

    pose: Floats
    behavior: NDArray[np.int32]
    allowed: NDArray[np.bool_]
    length: float
    step: float
    per_meter: float


class Rules(NamedTuple):
    """Radii and facings of the behaviors, and the options of a search; goal_heading is nan where any will do."""

    radii: Floats
    facings: Floats
    goal_tolerance: float
    end_standing: bool
    margin: float
    heading_tolerance: float
    deviation: float
    slack: float
    candidates: int
    budget: int
    goal_heading: float
    goal_heading_tolerance: float


class Laid(NamedTuple):
    """Entries of the map at hand as they were laid last, a row each, of the stage whose ``serial`` it carries.

    fit: may be taken. wide: of a wider behavior than planned. reached: at the goal. free: (entries, layers + 1) found
    free on each layer, and of joints out of their section. strayed: meters that the track is off the path at most.
    The rest as in :func:`crowdsim.following.follower.branch_kernels.lay_branch`.
    """

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
    strayed: Floats


class Search(NamedTuple):
    """Stack of stages, their candidates, and the present and the best solution.

    state: (STATE_COLUMNS,); best_arc: (1,) meters of path that the best solution reached.
    stage: (S, STAGE_COLUMNS); stage_origin, stage_end: (S, 3); stage_arc: (S,); candidate, score: S equal shares.
    step, best_step: (K, 2) node and the edge taken into it; place, best_place: (K, 4) its origin and twist.
    """

    state: NDArray[np.int64]
    best_arc: Floats
    stage: NDArray[np.int64]
    stage_origin: Floats
    stage_end: Floats
    stage_arc: Floats
    candidate: NDArray[np.int64]
    score: Floats
    listed: NDArray[np.int64]
    listed_score: Floats
    marked: NDArray[np.int64]
    branch: NDArray[np.int64]
    memory: NDArray[np.int64]
    step: NDArray[np.int64]
    place: Floats
    best_step: NDArray[np.int64]
    best_place: Floats


class Chain(NamedTuple):
    """Joints that are bent: joint (J, 2) places, limit (J, 2) and turn (J,) radians; end (3,) of what they carry."""

    joint: Floats
    limit: Floats
    turn: Floats
    end: Floats


def make_guide(samples: Samples, facings: Floats, reach: float) -> Guide:
    length = float(samples.arc[-1])
    pieces = len(samples.arc) - 1
    allowed = _allowed(samples, facings, reach)
    return Guide(samples.pose, samples.behavior, allowed, length, length / pieces, pieces / length)


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


def make_workspace(
    graph: GraphArrays, maps: MotionMaps, length: float, rules: Rules, branches: int
) -> tuple[Search, Laid]:
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

    search = Search(
        state=np.zeros(STATE_COLUMNS, np.int64),
        best_arc=np.empty(1),
        stage=np.empty((stages, STAGE_COLUMNS), np.int64),
        stage_origin=np.empty((stages, 3)),
        stage_end=np.empty((stages, 3)),
        stage_arc=np.empty(stages),
        candidate=ints(pool),
        score=np.empty(pool),
        listed=ints(branches),
        listed_score=np.empty(branches),
        marked=np.zeros((2, entries), np.int64),
        branch=ints(depth),
        memory=np.zeros(memory, np.int64),
        step=np.empty((nodes, 2), np.int64),
        place=np.empty((nodes, 4)),
        best_step=np.empty((nodes, 2), np.int64),
        best_place=np.empty((nodes, 4)),
    )
    return search, _make_laid(entries, rules)


def _make_laid(entries: int, rules: Rules) -> Laid:
    return Laid(
        serial=np.zeros(entries, np.int64),
        fit=np.empty(entries, np.bool_),
        wide=np.empty(entries, np.bool_),
        reached=np.zeros(entries, np.bool_),
        free=np.empty((entries, rules.radii.shape[1] + 1), np.bool_),
        node=np.empty(entries, np.int64),
        edge=np.empty(entries, np.int64),
        twist=np.empty(entries),
        origin=np.empty((entries, 3)),
        end=np.empty((entries, 3)),
        arc=np.empty(entries),
        area=np.empty(entries),
        off=np.empty(entries),
        strayed=np.full(entries, np.inf),
    )


def make_chain(search: Search, rules: Rules) -> tuple[Search, Laid, Chain]:
    """Room to bend the solutions of a search in: its last nodes are entries of their own, 0 being the first of them."""
    chain = Chain(np.empty((MOST_BENT, 2)), np.empty((MOST_BENT, 2)), np.empty(MOST_BENT), np.empty(3))
    return search._replace(branch=np.arange(MOST_BENT)), _make_laid(MOST_BENT, rules), chain
