"""How near to its goal, and how turned, a motion must end; and what is tried where that cannot be had."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.motion_plan import Request
from crowdsim.following.follower.exact_following import FEW_BRANCHES, meters_off
from crowdsim.following.follower.path_follower import (
    THOROUGH_BRANCHES,
    FollowOptions,
    FollowResult,
    FollowStatus,
    PathFollower,
)
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.scenario.schema.agents import STAND_WITHIN

STRICT_BUDGET = 500
"""Map queries of each search for a motion that ends just as asked for."""

_TRIES = 40
"""Solutions of one search that are bent to their goal until one arrives: each after the first costs next to nothing."""

_FURTHER = 20
"""Map queries until the next of them is given up."""


def attempts(request: Request, budget: int, strictly: bool) -> Iterator[tuple[FollowOptions, bool]]:
    """What motions are searched for one after another until there is one.

    Who stands at its goal is asked to be where, and turned how, it shall be: with a quick search, then with a thorough
    one; or, if only a bent motion gets as near, with several that end differently.
    If none succeeds, or not ``strictly``, it is enough to come near. With each goes whether it is to be bent.
    """
    quick, nearest = max(budget // 4, 1), request.within < STAND_WITHIN
    if strictly and request.stays:
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


def nearest_end(
    graph: GraphArrays,
    search: PathFollower,
    found: FollowResult,
    request: Request,
    goal: NDArray[np.float64],
    kept: int,
) -> tuple[FollowResult, float]:
    """Of the solutions of a search from ``found`` on, bent where that is needed, the first that is near enough.

    goal: (2,) end of the path. ``kept`` nodes at the beginning stay as they are. Returns it with the meters it ends off
    the goal, or that which ends nearest where none is within what is asked for.
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
