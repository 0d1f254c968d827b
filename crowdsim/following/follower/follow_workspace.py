"""Input and workspace of a search along a path: the path as kernels read it, rules, arrays of stages and branches."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.follower.arrival_kernels import MOST_BENT
from crowdsim.following.follower.beam_kernels import CHILDREN, LINK_COLUMNS, MEASURE_COLUMNS, STRETCH
from crowdsim.following.follower.candidate_kernels import STAGE_COLUMNS, STATE_COLUMNS
from crowdsim.following.follower.path_kernels import near_planned
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]


class Samples(Protocol):
    """A path at equal steps: pose (m, 3) x, y [m], direction of motion [rad]; arc (m,) [m]; behavior (m,) int32."""

    @property
    def pose(self) -> Floats:
        """Return x, y [m] and direction of motion [rad] of each sample, (m, 3)."""
        ...

    @property
    def arc(self) -> Floats:
        """Return the arc length of each sample (m,) [m]."""
        ...

    @property
    def behavior(self) -> NDArray[np.int32]:
        """Return the behavior of each sample (m,) int32."""
        ...


class Guide(NamedTuple):
    """A path as :mod:`crowdsim.following.follower.path_kernels` reads it.

    pose: (m, 3) as of :class:`Samples`. behavior: (m,) planned behavior. allowed: (B, m), True where each behavior may
    be used. length: arc length of the path [m]. step: distance between samples [m]. per_meter: samples per meter.
    remaining: (m,) time from each sample to the end of the path, at the speeds of the planned behaviors [s].
    """

    pose: Floats
    behavior: NDArray[np.int32]
    allowed: NDArray[np.bool_]
    length: float
    step: float
    per_meter: float
    remaining: Floats


class Rules(NamedTuple):
    """Radii and facings of the behaviors as of `Character`, and the options of a search as of `FollowOptions`.

    goal_heading is nan if any heading will do.
    """

    radii: Floats
    facings: Floats
    goal_tolerance: float
    end_standing: bool
    margin: float
    heading_tolerance: float
    deviation: float
    sampling_margin: float
    candidates: int
    budget: int
    goal_heading: float
    goal_heading_tolerance: float
    most_still: int


class Laid(NamedTuple):
    """Entries of the present map as they were laid last, one row each, valid for the stage whose ``serial`` it carries.

    fit: may be taken. wide: of a wider behavior than planned. reached: at the goal. free: (entries, layers + 1), found
    free on each layer; in the last column, all joints found in their section. node, edge, twist [rad], origin
    (entries, 3): as of `FollowResult`. end: (entries, 3) pose x, y [m], heading [rad] at its end. arc: arc length of
    the path beside the end [m]. area: cost of the branch up to the end [m2]. time: that the branch takes up to the end
    [s]. off: cost of the error at the end [m2]. strayed: largest distance of the track from the path [m], infinite if
    it was not measured.
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
    time: Floats
    off: Floats
    strayed: Floats


class Search(NamedTuple):
    """Stack of S stages, their candidates, and the present and the best solution of up to K nodes.

    state: (STATE_COLUMNS,) and stage: (S, STAGE_COLUMNS), see :mod:`crowdsim.following.follower.candidate_kernels`.
    best_arc: (1,) arc length that the best solution reached [m]. stage_origin, stage_end: (S, 3) poses of the stage's
    node, x, y [m], heading [rad]. stage_arc: (S,) [m]. candidate, score: entries and their scores, in S parts of equal
    length, one for each stage. listed, listed_score: entries to be laid, with their estimated scores. marked: (2,
    entries) serial numbers. branch: entries of one branch. memory: hash set of visited stages, 0 in free slots.
    step, best_step: (K, 2) node and the edge into it, -1 for none. place, best_place: (K, 4) origin and twist of each
    node.
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


class Beam(NamedTuple):
    """Stages of a beam search, S of them, each with the branch that leads to it, of up to D nodes.

    link: (S, LINK_COLUMNS) and measure: (S, MEASURE_COLUMNS), see :mod:`crowdsim.following.follower.beam_kernels`.
    pose: (S, 6) origin and end of the last node, x, y [m], heading [rad]. step: (S, D, 2) and place: (S, D, 4) of the
    nodes of the branch, as of :class:`Search`. gone_on: (stretches,) stages of each stretch of the path that went on.
    ranked, ranked_cost: candidates of one stage and their costs [s].
    """

    link: NDArray[np.int64]
    measure: Floats
    pose: Floats
    step: NDArray[np.int64]
    place: Floats
    gone_on: NDArray[np.int64]
    ranked: NDArray[np.int64]
    ranked_cost: Floats


class Chain(NamedTuple):
    """Joints to be bent, and the pose at the end that they carry, with J = MOST_BENT.

    joint: (J, 2) places [m]. limit: (J, 2) least and greatest turn [rad]. turn: (J,) present turn [rad]. end: (3,) x, y
    [m], heading [rad].
    """

    joint: Floats
    limit: Floats
    turn: Floats
    end: Floats


def make_guide(samples: Samples, behaviors: int, turned: Iterable[int], reach: float, speeds: Floats) -> Guide:
    """Return the path as kernels read it.

    ``behaviors`` is the number of behaviors; ``turned`` are the numbers of those that face more than 45 degrees off
    their motion; ``reach`` [m] is the `transition_reach` of `FollowOptions`; ``speeds`` (B,) [m/s] are those of
    :class:`~crowdsim.following.maps.motion_maps.MapArrays`.
    """
    length = float(samples.arc[-1])
    pieces = len(samples.arc) - 1
    # A behavior may be used anywhere; a turned one (side-stepping) only near a section planned for it or for a narrower
    # one.
    allowed = np.ones((behaviors, len(samples.arc)), np.bool_)
    for b in turned:
        near_planned(samples.arc, samples.behavior, b, reach, allowed[b])
    # A behavior without nodes that move, or that the graph does not have, takes no time.
    known = np.append(speeds, np.full(max(behaviors, int(samples.behavior.max()) + 1), np.inf))
    seconds = length / pieces / known[samples.behavior[:-1]]
    remaining = np.append(np.cumsum(seconds[::-1])[::-1], 0.0)
    return Guide(samples.pose, samples.behavior, allowed, length, length / pieces, pieces / length, remaining)


def make_workspace(
    graph: GraphArrays, maps: MotionMaps, length: float, rules: Rules, branches: int
) -> tuple[Search, Laid]:
    """Return empty arrays for one search along ``length`` meters that lists up to ``branches`` entries at each stage.

    The number of stages grows with the length; once all are in use, the search goes no deeper. The arrays may be
    larger than needed: the system provides memory only when it is written.
    """
    depth = maps.depth
    stages = 64 + int(8.0 * length)
    nodes = stages * depth + 1
    entries = max(maps.most_entries, len(graph.node_frames))
    # Every direct successor is an entry, so one stage may have that many candidates.
    pool = stages * (rules.candidates + entries)
    # A hash set of a power of two slots, at most half of them used: each stage entered costs a query.
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
    """Return empty rows for ``entries`` entries, none of them laid: no stage has the serial number 0."""
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
        time=np.empty(entries),
        off=np.empty(entries),
        strayed=np.full(entries, np.inf),
    )


def make_beam(guide: Guide, rules: Rules, search: Search, laid: Laid, queries: int) -> Beam:
    """Return empty arrays for a beam search of so many map ``queries`` along a path, beside those of a search."""
    stages, depth = queries * CHILDREN + 1, len(search.branch)
    candidates = rules.candidates + len(laid.node)
    return Beam(
        link=np.empty((stages, LINK_COLUMNS), np.int64),
        measure=np.empty((stages, MEASURE_COLUMNS)),
        pose=np.empty((stages, 6)),
        step=np.empty((stages, depth, 2), np.int64),
        place=np.empty((stages, depth, 4)),
        gone_on=np.empty(int(guide.length / STRETCH) + 2, np.int64),
        ranked=np.empty(candidates, np.int64),
        ranked_cost=np.empty(candidates),
    )


def make_chain(search: Search, rules: Rules) -> tuple[Search, Laid, Chain]:
    """Return a search and arrays to bend its solutions in: rows 0 to n - 1 are for its last n nodes, at most MOST_BENT.

    The branch of this search names these rows one by one; the rest is shared with ``search``.
    """
    chain = Chain(np.empty((MOST_BENT, 2)), np.empty((MOST_BENT, 2)), np.empty(MOST_BENT), np.empty(3))
    return search._replace(branch=np.arange(MOST_BENT)), _make_laid(MOST_BENT, rules), chain
