"""From an annotated path to the nodes of the motion graph that walk it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import MotionError
from crowdsim.following.follower.arrival_kernels import arrive
from crowdsim.following.follower.body_reach import BodyReach
from crowdsim.following.follower.follow_kernels import (
    BEST,
    BLOCKED,
    COUNT,
    FOUND,
    KEPT,
    OUT_OF_BUDGET,
    PAST_KEPT,
    QUERIES,
    TOP,
    follow,
)
from crowdsim.following.follower.follow_workspace import (
    Chain,
    Laid,
    Rules,
    Samples,
    Search,
    make_chain,
    make_guide,
    make_workspace,
)
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]


class FollowStatus(IntEnum):
    """How a search for motion along a path ended. PAST_KEPT: all that is left would change nodes that must stay."""

    FOUND = FOUND
    OUT_OF_BUDGET = OUT_OF_BUDGET
    BLOCKED = BLOCKED
    PAST_KEPT = PAST_KEPT


THOROUGH_BRANCHES = 200
"""Branches laid at each stage of the second search, where a quick one found nothing."""


@dataclass(frozen=True)
class FollowOptions:
    """What the follower holds to.

    goal_tolerance: meters from the path's end within which the last node must pass, or end where end_standing.
    end_standing: whether the last node must end standing.
    goal_heading: radians, how the body must be turned where the last node ends, which then is within the tolerance of
        the goal; None where that does not matter. goal_heading_tolerance: radians.
    margin: meters kept free beyond the body's radius by nodes of a wider behavior than the planned: what plans keep.
    transition_reach: meters around a section in which a behavior that faces off the direction of motion is allowed.
    heading_tolerance: radians between body and path at the end of each node that moves.
    deviation: meters that the end of a node may lie off the path.
    slack: meters kept free beyond the body's radius, for what passes between two samples of the test.
    candidates: branches kept at each stage beside the single successors.
    branches: branches laid on the path at each stage beside the single successors: of more, those that promise most.
        A search that finds nothing with them is made again with THOROUGH_BRANCHES.
    budget: map queries until the search gives up.
    """

    goal_tolerance: float = 0.35
    end_standing: bool = False
    goal_heading: float | None = None
    goal_heading_tolerance: float = float(np.radians(15.0))
    margin: float = TRACKING_MARGIN
    transition_reach: float = 2.0
    heading_tolerance: float = float(np.radians(35.0))
    deviation: float = 0.6
    slack: float = 0.005
    candidates: int = 48
    branches: int = 24
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


@dataclass(frozen=True)
class Character:
    """Who follows paths: its motions, its body, and which way it may face.

    radii: (B, layers) meters, the radius of the body in each behavior on each layer. facings: (B, F) radians off the
    direction of motion that the body may face in each behavior, padded with NaN. reach: where the body's joints are, to
    keep every one of them in its section; without it the discs alone count.
    """

    graph: GraphArrays
    maps: MotionMaps
    radii: Floats
    facings: Floats
    reach: BodyReach | None = None


class PathFollower:
    """One search for motion along a path, that can be asked for more than the first solution.

    Arguments as of :func:`follow_path`. Of one thread at a time.
    """

    def __init__(
        self,
        character: Character,
        samples: Samples,
        meshes: tuple[Any, ...],
        start_pose: Floats,
        start_node: int = -1,
        options: FollowOptions | None = None,
    ) -> None:
        options = options or FollowOptions()
        _check(character, samples, meshes, options)
        graph, maps, reach = character.graph, character.maps, character.reach
        guide = make_guide(samples, character.facings, options.transition_reach)
        rules = Rules(
            radii=np.ascontiguousarray(character.radii, np.float64),
            facings=np.ascontiguousarray(character.facings, np.float64),
            goal_tolerance=float(options.goal_tolerance),
            end_standing=bool(options.end_standing),
            margin=float(options.margin),
            heading_tolerance=float(options.heading_tolerance),
            deviation=float(options.deviation),
            slack=float(options.slack),
            candidates=int(options.candidates),
            budget=int(options.budget),
            goal_heading=float("nan") if options.goal_heading is None else float(options.goal_heading),
            goal_heading_tolerance=float(options.goal_heading_tolerance),
        )
        self._search, laid = make_workspace(graph, maps, guide.length, rules, options.branches)
        start = np.array(start_pose, np.float64)
        self._arguments = graph, maps.arrays, guide, rules, meshes, reach, start, int(start_node), self._search, laid

    def next(self) -> FollowResult:
        """The first solution, or the next: how the search goes on from there. Not FOUND where there is no further one.

        Expansions are counted from the first on.
        """
        status, count, reached, expansions = follow(*self._arguments)
        search = self._search
        return _result(status, search.best_step[:count], search.best_place[:count], reached, expansions)

    def advance(self, queries: int, kept: int = 0) -> FollowResult | None:
        """Go on for so many map queries: what :meth:`next` gives, or None where the search and its budget are not over.

        kept: nodes at the beginning of what :attr:`present` was last that must stay, as they are being played.
        """
        state, (graph, maps, guide, rules, *rest) = self._search.state, self._arguments
        limit = min(int(state[QUERIES]) + queries, rules.budget)
        state[KEPT] = kept
        status, count, reached, expansions = follow(graph, maps, guide, rules._replace(budget=limit), *rest)
        if status == OUT_OF_BUDGET and limit < rules.budget:
            return None
        search = self._search
        return _result(status, search.best_step[:count], search.best_place[:count], reached, expansions)

    def arrive(self, within: float, heading_tolerance: float | None = None) -> FollowResult | None:
        """What :meth:`next` found last, with its last transitions turned so that it ends at the end of the path.

        within: meters from there that are near enough. heading_tolerance: radians within which the heading must be that
        the options ask for, if they do; theirs by default. What is bent is tested as the search tests. None where it
        cannot be bent so. For searches that end standing: others pass the end on their way.
        """
        (graph, _, guide, rules, layers, reach, *_), count = self._arguments, int(self._search.state[BEST])
        tolerance = rules.goal_heading_tolerance if heading_tolerance is None else heading_tolerance
        search, laid, _ = self._chain
        asked = float(within), rules.goal_heading, float(tolerance)
        bent, reached = arrive(graph, guide, rules, layers, reach, *self._chain, count, *asked)
        if not bent:
            return None
        places = search.best_place[:count].copy()
        places[count - bent :] = np.column_stack([laid.origin[:bent], laid.twist[:bent]])
        return _result(FOUND, search.best_step[:count], places, reached, int(search.state[QUERIES]))

    @cached_property
    def _chain(self) -> tuple[Search, Laid, Chain]:
        return make_chain(self._search, self._arguments[3])

    @property
    def present(self) -> FollowResult:
        """What the search is trying to go on from, after :meth:`advance` gave None; ``reached`` is its end."""
        search, top = self._search, self._search.state[TOP]
        count, reached = int(search.stage[top, COUNT]), float(search.stage_arc[top])
        return _result(OUT_OF_BUDGET, search.step[:count], search.place[:count], reached, int(search.state[QUERIES]))


def _result(status: int, steps: NDArray[np.int64], places: Floats, reached: float, expansions: int) -> FollowResult:
    """A copy of a solution."""
    return FollowResult(
        FollowStatus(status),
        steps[:, 0].astype(np.int32),
        steps[:, 1].astype(np.int32),
        places[:, 3].copy(),
        places[:, :3].copy(),
        float(reached),
        int(expansions),
    )


def follow_path(
    character: Character,
    samples: Samples,
    meshes: tuple[Any, ...],
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
) -> FollowResult:
    """Find nodes that walk along a path with every body disc free on all layers (2012 paper, section 5).

    meshes: kernel arrays of each layer's mesh. start_pose: (3,) where the first node starts. start_node: the first
    node, taken as being played already and not tested; -1 to choose one. Safe to call from several threads at once.
    MotionError where shapes do not fit.

    A quarter of the budget goes into a quick search. Where that finds nothing, a thorough one looks at more branches.
    """
    options = options or FollowOptions()
    quick = replace(options, budget=max(options.budget // 4, 1))
    arguments = character, samples, meshes, start_pose, start_node
    found = PathFollower(*arguments, quick).next()
    if found.status == FollowStatus.FOUND or options.budget <= quick.budget:
        return found
    thorough = replace(
        options, budget=options.budget - found.expansions, branches=max(options.branches, THOROUGH_BRANCHES)
    )
    again = PathFollower(*arguments, thorough).next()
    expansions = found.expansions + again.expansions
    farther = again.status == FollowStatus.FOUND or again.reached >= found.reached
    return replace(again if farther else found, status=again.status, expansions=expansions)


def _check(character: Character, samples: Samples, meshes: tuple[Any, ...], options: FollowOptions) -> None:
    """MotionError where shapes or numbers do not fit."""
    radii, facings, reach = character.radii, character.facings, character.reach
    behaviors = int(character.graph.node_behavior.max(initial=0)) + 1
    if len(samples.arc) < 2 or not samples.arc[-1] > 0.0:
        raise MotionError("a path to follow needs two samples and a length; there is nothing to walk")
    if len(radii) < behaviors or len(facings) != len(radii) or radii.shape[1] != len(meshes):
        raise MotionError(
            f"radii {radii.shape} and facings {facings.shape} must have a row for each of the {behaviors} behaviors,"
            f" radii a column for each of the {len(meshes)} layers"
        )
    if options.branches < 1 or options.candidates < 1:
        raise MotionError(
            "a search keeps one candidate and looks at one branch or more, "
            f"not {options.candidates}, {options.branches}"
        )
    if reach is not None and len(reach.room) <= int(np.max(samples.behavior)):
        raise MotionError(f"the body has room for {len(reach.room)} behaviors; the path is planned for more")
