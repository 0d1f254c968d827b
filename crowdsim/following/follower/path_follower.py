"""Find the nodes of the motion graph that walk along an annotated path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.following.follower.arrival_kernels import arrive
from crowdsim.following.follower.beam_kernels import quicken
from crowdsim.following.follower.candidate_kernels import BEST, COUNT, FULL, KEPT, QUERIES, TOP
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_kernels import BLOCKED, FOUND, OUT_OF_BUDGET, PAST_KEPT, follow
from crowdsim.following.follower.follow_options import (
    BRIEFLY,
    QUICKEN_BUDGET,
    QUICKER,
    SLOW,
    THOROUGH_BRANCHES,
    FollowOptions,
)
from crowdsim.following.follower.follow_workspace import (
    Chain,
    Laid,
    Rules,
    Samples,
    Search,
    make_beam,
    make_chain,
    make_guide,
    make_workspace,
)
from crowdsim.navmesh.mesh.address_kernels import places_of

Floats = NDArray[np.float64]


class FollowStatus(IntEnum):
    """Result of a search along a path, as :func:`~crowdsim.following.follower.follow_kernels.follow` returns it.

    FOUND: a motion to the goal. OUT_OF_BUDGET: all map queries are made. BLOCKED: no branch is left to try. PAST_KEPT:
    branches that are left would change nodes that must stay.
    """

    FOUND = FOUND
    OUT_OF_BUDGET = OUT_OF_BUDGET
    BLOCKED = BLOCKED
    PAST_KEPT = PAST_KEPT


_STATUSES = tuple(FollowStatus)
"""Statuses by number: an index is faster than a call of FollowStatus."""

TIGHTER = (0.45, 0.4, 0.35, 0.3, 0.25, 0.2)
"""Smaller clearances that are tried for a path that cannot be followed in its own [m]."""


@dataclass(frozen=True)
class FollowResult:
    """Nodes of the motion graph in order, as far as the search came.

    Attributes
    ----------
    status : FollowStatus
        FOUND if the path was followed to its end.
    nodes, edges : (K,) int32
        Each node, and the edge taken into it, -1 for the first.
    twists : (K,) float64
        Extra rotation at that edge [rad].
    origins : (K, 3) float64
        World pose at the start of each node: x, y [m], heading [rad].
    reached : float
        Arc length of the path at the end [m].
    expansions : int
        Number of map queries.
    """

    status: FollowStatus
    nodes: NDArray[np.int32]
    edges: NDArray[np.int32]
    twists: Floats
    origins: Floats
    reached: float
    expansions: int


class PathFollower:
    """One search for motion along a path, which can be continued beyond the first solution.

    Arguments as of :func:`follow_path`. One thread at a time.
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
        guide = make_guide(
            samples, len(character.facings), character.turned, options.transition_reach, maps.arrays.speeds
        )
        rules = Rules(
            radii=np.ascontiguousarray(character.radii, np.float64),
            facings=np.ascontiguousarray(character.facings, np.float64),
            goal_tolerance=float(options.goal_tolerance),
            end_standing=bool(options.end_standing),
            margin=float(options.margin),
            heading_tolerance=float(options.heading_tolerance),
            deviation=float(options.deviation),
            sampling_margin=float(options.sampling_margin),
            candidates=int(options.candidates),
            budget=int(options.budget),
            goal_heading=float("nan") if options.goal_heading is None else float(options.goal_heading),
            goal_heading_tolerance=float(options.goal_heading_tolerance),
            most_still=int(options.most_still),
        )
        self._search, laid = make_workspace(graph, maps, guide.length, rules, options.branches)
        start = np.array(start_pose, np.float64)
        self._meshes = meshes  # kernels read them at these addresses
        layers = np.array([places_of(mesh) for mesh in meshes])
        self._arguments = graph, maps.arrays, guide, rules, layers, reach, start, int(start_node), self._search, laid

    def next(self) -> FollowResult:
        """Return the first solution, or the next one; a status other than FOUND if there is none.

        Expansions are counted from the first call on.
        """
        status, count, reached, expansions = follow(*self._arguments)
        search = self._search
        return _result(status, search.best_step[:count], search.best_place[:count], reached, expansions)

    def advance(self, queries: int, kept: int = 0) -> FollowResult | None:
        """Continue for ``queries`` map queries; return a result as of :meth:`next`, None if the search is not over.

        kept: number of nodes at the beginning of the last :attr:`present` that must not change, as they are being
        played.
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
        """Bend the latest solution at its last edges so that it ends at the end of the path; None if that fails.

        Distance from the path, discs and joints of what is bent are tested as the search tests them. Only for searches
        that end standing; others pass the end on their way.

        Parameters
        ----------
        within: largest distance from the path's end [m].
        heading_tolerance: tolerance of the options' ``goal_heading``, if they have one [rad]; that of the options by
        default.
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

    def is_slow(self, found: FollowResult) -> bool:
        """Return True if a motion takes SLOW seconds longer, or more, than the path does as planned."""
        return self._seconds(found) - float(self._arguments[2].remaining[0]) >= SLOW

    def _seconds(self, found: FollowResult) -> float:
        """Return the time that a motion takes after the node that is played already [s]."""
        begins = 0 if self._arguments[7] < 0 else 1
        return float(self._arguments[0].node_frames[found.nodes[begins:]].sum()) / CAPTURE_RATE

    def quicken(self, found: FollowResult, queries: int = QUICKEN_BUDGET) -> FollowResult | None:
        """Search another motion, which takes at most the share QUICKER of the time of ``found``; None if none is found.

        In it, the body stands BRIEFLY at most. ``found`` is the latest solution; ``queries`` is the largest number of
        map queries, if it is below QUICKEN_BUDGET. :meth:`arrive` bends the other motion, if there is one. The search
        cannot be continued beyond this.
        """
        graph, maps, guide, rules, *rest, search, laid = self._arguments
        beam = make_beam(guide, rules, search, laid, min(queries, QUICKEN_BUDGET))
        brief = rules._replace(most_still=min(rules.most_still, BRIEFLY))
        limit = QUICKER * self._seconds(found)
        count, reached = quicken(graph, maps, guide, brief, *rest, search, laid, beam, limit)
        if not count:
            return None
        return _result(FOUND, search.best_step[:count], search.best_place[:count], reached, self.queries)

    @property
    def queries(self) -> int:
        """Return the number of map queries so far."""
        return int(self._search.state[QUERIES])

    @cached_property
    def _chain(self) -> tuple[Search, Laid, Chain]:
        """Return arrays to bend solutions in, made on first use."""
        return make_chain(self._search, self._arguments[3])

    @property
    def left_out(self) -> bool:
        """Return True if a stage listed as many entries as it may, so that more ``branches`` may find other motions."""
        return bool(self._search.state[FULL])

    @property
    def present(self) -> FollowResult:
        """Return the partial solution that the search tries to continue, after :meth:`advance` returned None."""
        search, top = self._search, self._search.state[TOP]
        count, reached = int(search.stage[top, COUNT]), float(search.stage_arc[top])
        return _result(OUT_OF_BUDGET, search.step[:count], search.place[:count], reached, int(search.state[QUERIES]))


def _result(status: int, steps: NDArray[np.int64], places: Floats, reached: float, expansions: int) -> FollowResult:
    """Return a solution of K nodes, copied: steps (K, 2), node and edge into it; places (K, 4), origin and twist.

    The other arguments are as of :class:`FollowResult`.
    """
    return FollowResult(
        _STATUSES[status],
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

    If all joints must stay in their sections and nothing is found, try again with less clearance, each time with the
    whole budget (:data:`TIGHTER`). A motion that needs less clearance is valid with more, and tighter limits may keep a
    search on the path that goes astray among many free branches. So more clearance is never worse. Safe to call from
    several threads at once.

    Parameters
    ----------
    character : Character
        Motions and body.
    samples : Samples
        The path at equal steps, as :meth:`AnnotatedPath.sample` gives it.
    meshes : tuple of MeshArrays
        Kernel arrays of each layer's mesh, legs first: ``mesh.arrays``.
    start_pose : (3,) float64
        x, y [m] and heading [rad] at which the first node starts.
    start_node : int
        The first node, which is being played already and not tested; -1 to choose one.
    options : FollowOptions or None
        Requirements and limits of the search; None for the defaults.

    Returns
    -------
    FollowResult
        Nodes of the motion graph, and where each begins.

    Raises
    ------
    MotionError
        If shapes do not match, or a number is out of range.

    Examples
    --------
    >>> room, motion = NavMesh(shapely.box(0, 0, 10, 4)), load_behavior_set(["frontal"], [(0.0, 2.0)])
    >>> character = Character.of(motion.behaviors, motion.graph.arrays, MotionMaps.build(motion.graph.arrays))
    >>> samples = Planner([room], motion.behaviors).plan((1, 2), (9, 2)).sample()
    >>> found = follow_path(character, samples, (room.arrays,), samples.pose[0])
    >>> found.status.name, len(found.nodes)
    ('FOUND', 5)
    """
    found = search_path(character, samples, meshes, start_pose, start_node, options)
    reach = character.reach
    if reach is None:
        return found
    spent = found.expansions
    for room in TIGHTER:
        # Only clearances below the given one are left to try.
        if found.status == FollowStatus.FOUND or room >= reach.least:
            continue
        tighter = reach._replace(room=np.minimum(reach.room, room), least=room)
        again = search_path(replace(character, reach=tighter), samples, meshes, start_pose, start_node, options)
        spent += again.expansions
        found = again if again.status == FollowStatus.FOUND else found
    return replace(found, expansions=spent)


def search_path(
    character: Character,
    samples: Samples,
    meshes: tuple[Any, ...],
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
) -> FollowResult:
    """Search as :func:`follow_path` does, but with the given clearance only.

    A quarter of the budget goes into a quick search, in which the body stands BRIEFLY at most. If that finds nothing, a
    thorough search looks at more branches, with the budget that is left. If the motion that is found is slow, a beam
    search looks for a quicker one. If nothing is found, return the partial motion that came farther.
    """
    options = options or FollowOptions()
    quick = replace(options, budget=max(options.budget // 4, 1), most_still=min(options.most_still, BRIEFLY))
    arguments = character, samples, meshes, start_pose, start_node
    found = _found(PathFollower(*arguments, quick))
    if found.status == FollowStatus.FOUND or options.budget <= quick.budget:
        return found
    thorough = replace(
        options, budget=options.budget - found.expansions, branches=max(options.branches, THOROUGH_BRANCHES)
    )
    again = _found(PathFollower(*arguments, thorough))
    expansions = found.expansions + again.expansions
    # Of two partial motions, keep the one that came farther; the status is that of the last search.
    farther = again.status == FollowStatus.FOUND or again.reached >= found.reached
    return replace(again if farther else found, status=again.status, expansions=expansions)


def _found(search: PathFollower) -> FollowResult:
    """Return the first solution of a search; if that is slow, a quicker motion, if there is one."""
    found = search.next()
    if found.status == FollowStatus.FOUND and search.is_slow(found):
        found = search.quicken(found) or found
    return replace(found, expansions=search.queries)


def _check(character: Character, samples: Samples, meshes: tuple[Any, ...], options: FollowOptions) -> None:
    """Raise MotionError if shapes do not match or numbers are out of range."""
    radii, facings, reach, behaviors = character.radii, character.facings, character.reach, character.behaviors
    if len(samples.arc) < 2 or not samples.arc[-1] > 0.0:
        raise MotionError("a path to follow needs at least two samples and a length above 0")
    if len(radii) < behaviors or len(facings) != len(radii) or radii.shape[1] != len(meshes):
        raise MotionError(
            f"radii {radii.shape} and facings {facings.shape} must have a row for each of the {behaviors} behaviors,"
            f" radii a column for each of the {len(meshes)} layers"
        )
    if options.branches < 1 or options.candidates < 1:
        raise MotionError(
            "a search needs at least one candidate and one branch, "
            f"not {options.candidates} candidates and {options.branches} branches"
        )
    if reach is not None and len(reach.room) <= int(np.max(samples.behavior)):
        raise MotionError(f"the body has clearances for {len(reach.room)} behaviors, but the path is planned for more")
