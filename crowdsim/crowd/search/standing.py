"""Ends of motions: how near to the goal and in which direction a motion must end, and what is tried to get there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.motion_plan import Request
from crowdsim.following.follower.exact_following import FEW_BRANCHES, meters_off
from crowdsim.following.follower.follow_options import THOROUGH_BRANCHES, FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.scenario.schema.agents import STAND_WITHIN

STRICT_BUDGET = 500
"""Map queries of each search for a motion that ends exactly as requested."""

_TRIES = 40
"""Number of solutions of one search that are bent to their goal until one arrives; each after the first costs
little."""

_FURTHER = 20
"""Map queries after which the search for the next solution is given up."""


def attempts(request: Request, budget: int, strictly: bool) -> Iterator[tuple[FollowOptions, bool]]:
    """Yield the options of the searches to try in turn until one succeeds, and whether its solution is to be bent.

    If the motion is to end standing, and ``strictly``, first search with the requested distance and heading: a quick
    search, then a thorough one. If that distance is below STAND_WITHIN, only a bent motion comes as near: then more
    searches, with different options, find different motions to be bent. At last coming near is enough: within the
    default tolerance, by a quick search with a quarter of ``budget`` (map queries), then a thorough one with the rest.
    """
    # Searches alone end within STAND_WITHIN of the goal; what is to end nearer has to be bent.
    quick, nearest = max(budget // 4, 1), request.within < STAND_WITHIN
    if strictly and request.stays:
        # Number of candidate branches of each search.
        breadths = (
            (FollowOptions.branches, FEW_BRANCHES, THOROUGH_BRANCHES)
            if nearest
            else (FollowOptions.branches, THOROUGH_BRANCHES)
        )
        for breadth in breadths:
            for share in (1.0, 0.5) if nearest else (1.0,):
                options = FollowOptions(
                    end_standing=True,
                    goal_tolerance=share * max(request.within, STAND_WITHIN),
                    goal_heading=request.heading,
                    branches=breadth,
                    budget=min(STRICT_BUDGET, budget),
                )
                yield options, nearest
    for breadth, share in ((FollowOptions.branches, quick), (THOROUGH_BRANCHES, budget - quick)):
        yield FollowOptions(end_standing=request.stays, branches=breadth, budget=max(share, 1)), False


def only_searches_more(options: FollowOptions, than: FollowOptions) -> bool:
    """Return True if ``options`` differ from those of another search, ``than``, only by more branches or the budget.

    If the other search ended without leaving out a branch, a search with ``options`` finds the same.
    """
    return options.branches >= than.branches and replace(options, branches=than.branches, budget=than.budget) == than


def nearest_end(
    graph: GraphArrays,
    search: PathFollower,
    found: FollowResult,
    request: Request,
    goal: NDArray[np.float64],
    kept: int,
) -> tuple[FollowResult, float]:
    """Bend the solutions of a search, from ``found`` on, to the goal until one is near enough.

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
        Nodes at the beginning that must not change.

    Returns
    -------
    FollowResult, float
        The solution and its distance from the goal [m]; the nearest one if none is as near as requested.
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
