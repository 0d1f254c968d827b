"""Ends of motions: how near to the goal and in which direction a motion must end, and what is tried to get there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.motion_plan import Request
from crowdsim.following.follower.exact_following import FEW_BRANCHES, meters_off
from crowdsim.following.follower.follow_options import BRIEFLY, THOROUGH_BRANCHES, FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.scenario.schema.agents import STAND_WITHIN

STRICT_BUDGET = 500
"""Map queries of each search for a motion that ends exactly as requested."""

_STRICTLY_STILL = 2
"""Nodes in a row without progress in the second of two searches for a motion that ends exactly as requested. In
furnished rooms, with any heading to end in, 4.6 % of the motions stood for over 7 s; with 6 instead of 2, 8 % did."""

_TRIES = 40
"""Largest number of solutions of one search that are bent to their goal until one arrives; each after the first costs
little."""

_FURTHER = 20
"""Map queries after which the search for the next solution is given up."""


def attempts(request: Request, budget: int, strictly: bool) -> Iterator[tuple[FollowOptions, bool]]:
    """Yield the options of the searches to try in turn until one succeeds, and True if its solution is to be bent.

    If the motion is to end standing, and ``strictly`` is True, the first searches have the requested distance and
    heading: a quick search, then a thorough one. If that distance is below STAND_WITHIN, only a motion that is bent to
    the goal comes as near: then there are six searches, with different options, to find different motions to bend. For
    the last two searches it is enough to end within the default distance, with any heading: a quick one with a quarter
    of ``budget`` (map queries), then a thorough one with the rest. Each of these searches comes twice: at first the
    body may stand BRIEFLY at most before it goes on, then for longer.
    """
    # A search alone ends within STAND_WITHIN of the goal; a motion that is to end nearer has to be bent.
    quick, nearest = max(budget // 4, 1), request.within < STAND_WITHIN
    if strictly and request.stays:
        # Number of candidate branches of each search: as usual, fewer, and more.
        breadths = (
            (FollowOptions.branches, FEW_BRANCHES, THOROUGH_BRANCHES)
            if nearest
            else (FollowOptions.branches, THOROUGH_BRANCHES)
        )
        for breadth in breadths:
            for share in (1.0, 0.5) if nearest else (1.0,):
                for still in (BRIEFLY, _STRICTLY_STILL):
                    options = FollowOptions(
                        end_standing=True,
                        goal_tolerance=share * max(request.within, STAND_WITHIN),
                        goal_heading=request.heading,
                        branches=breadth,
                        budget=min(STRICT_BUDGET, budget),
                        most_still=still,
                    )
                    yield options, nearest
    # A search needs a budget of 1 at least.
    for breadth, share in ((FollowOptions.branches, quick), (THOROUGH_BRANCHES, budget - quick)):
        for still in (BRIEFLY, FollowOptions.most_still):
            options = FollowOptions(
                end_standing=request.stays, branches=breadth, budget=max(share, 1), most_still=still
            )
            yield options, False


def only_searches_more(options: FollowOptions, than: FollowOptions) -> bool:
    """Return True if ``options`` differ from ``than``, those of another search, at most by budget and more branches.

    If the other search ended without leaving out a branch, a search with ``options`` finds the same.
    """
    return options.branches >= than.branches and replace(options, branches=than.branches, budget=than.budget) == than


def quicker_end(
    graph: GraphArrays,
    search: PathFollower,
    found: FollowResult,
    request: Request,
    goal: NDArray[np.float64],
    exactly: bool,
    queries: int,
) -> FollowResult:
    """Return a quicker motion than ``found``, the latest solution of a search, that ends as requested, or ``found``.

    ``queries`` is the largest number of map queries, ``goal`` (2,) the end of the path [m]. If ``exactly``, the quicker
    motion is bent to the goal if it ends farther off than requested. The search is over then.
    """
    quicker = search.quicken(found, queries)
    if quicker is not None and exactly and meters_off(graph, quicker, goal) > request.within:
        quicker = search.arrive(request.within)
    return quicker or found


def nearest_end(
    graph: GraphArrays,
    search: PathFollower,
    found: FollowResult,
    request: Request,
    goal: NDArray[np.float64],
    kept: int,
) -> tuple[FollowResult, float]:
    """Bend the solutions of a search, from ``found`` on, to the goal until one is near enough.

    Up to _TRIES solutions are tried; one that is near enough as it is need not be bent.

    Parameters
    ----------
    graph : GraphArrays
        Motion graph.
    search : PathFollower
        The search, which goes on to further solutions.
    found : FollowResult
        Its first solution.
    request : Request
        The request, of which only the distance from the goal, ``within``, counts.
    goal : (2,) float64
        End of the path [m].
    kept : int
        Number of nodes at the beginning, the departure included, that must not change.

    Returns
    -------
    FollowResult, float
        The solution and its distance from the goal [m]; the nearest solution, not bent, if none comes as near as
        requested.
    """
    best, least = found, meters_off(graph, found, goal)
    for _ in range(_TRIES):
        bent = search.arrive(request.within) if least > request.within else None
        if bent is not None and np.array_equal(bent.origins[:kept], best.origins[:kept]):
            return bent, meters_off(graph, bent, goal)
        further = search.advance(_FURTHER, kept) if least > request.within else None
        if further is None or further.status != FollowStatus.FOUND:
            break
        off = meters_off(graph, further, goal)
        if off < least:
            best, least = further, off
    return best, least
