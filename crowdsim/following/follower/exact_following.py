"""Follow a path to its very end, by branch kinematics on the solutions of the path follower."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import THOROUGH_BRANCHES, FollowOptions
from crowdsim.following.follower.follow_workspace import Samples
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.geometry.elementary import distance
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]

_QUICK_TRIES = 40
_TRIES = 200
"""Solutions tried in a quick search and in one with the whole budget. Further solutions end elsewhere and cost
little."""

FEW_BRANCHES = 8
"""Branches laid at each stage of narrow searches, which find other motions than broad ones, and sooner."""


def follow_exactly(
    character: Character,
    samples: Samples,
    meshes: tuple[Any, ...],
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
    arrival: float = 0.01,
) -> tuple[FollowResult, float]:
    """Follow a path to a stand within ``arrival`` meters of its end, by bending the motion at its last edges.

    Of the solutions that end within the goal tolerance of ``options`` (10 cm by default), take the first that ends
    within ``arrival`` meters or can be bent to do so. If there is none, searches with other tolerances, a wider range
    of headings and other numbers of branches follow until one succeeds. Other arguments as of :func:`follow_path`.

    Returns
    -------
    (result, distance of its end from the goal [m]). If no solution arrives, the result is the one that ends nearest to
    the goal; if there is no solution, it is the partial motion that came farthest.
    """
    graph = character.graph
    options = replace(options or FollowOptions(goal_tolerance=0.1), end_standing=True)
    goal = np.asarray(samples.pose[-1, :2], np.float64)
    best: tuple[FollowResult, float] | None = None
    for sought, tries in _searches(options):
        search = PathFollower(character, samples, meshes, start_pose, start_node, sought)
        for _ in range(tries):
            found = search.next()
            off = meters_off(graph, found, goal)
            if found.status == FollowStatus.FOUND and off > arrival:
                bent = search.arrive(arrival, options.goal_heading_tolerance)
                if bent is not None:
                    found, off = bent, meters_off(graph, bent, goal)
            # Found with a wider range of headings, and not bent to the required one: try the next solution.
            if found.status == FollowStatus.FOUND and not _faces(graph, found, options):
                continue
            if best is None or _rank(found, off) < _rank(*best):
                best = found, off
            # Nothing more is found, or this one arrives.
            if found.status != FollowStatus.FOUND or off <= arrival:
                break
        if best is not None and best[0].status == FollowStatus.FOUND and best[1] <= arrival:
            break
    assert best is not None
    return best


def _searches(options: FollowOptions) -> Iterator[tuple[FollowOptions, int]]:
    """Yield the options of one search after the other, with the number of solutions to try in each.

    Where motions end is a matter of chance. One search goes on to similar ends; searches with another number of
    branches or another tolerance find others. If a heading is required, twice its tolerance is tried as well: bending
    may turn such a solution to the required heading.
    """
    spreads = (1.0,) if options.goal_heading is None else (1.0, 2.0)
    rounds = (
        (options.branches, max(options.budget // 4, 1), _QUICK_TRIES),
        (FEW_BRANCHES, options.budget, _TRIES),
        (THOROUGH_BRANCHES, options.budget, _TRIES),
    )
    for branches, budget, tries in rounds:
        for share in (1.0, 0.5):
            for spread in spreads:
                sought = replace(
                    options,
                    goal_tolerance=share * options.goal_tolerance,
                    goal_heading_tolerance=min(spread * options.goal_heading_tolerance, math.pi),
                    branches=branches,
                    budget=budget,
                )
                yield sought, tries


def _rank(found: FollowResult, off: float) -> tuple[bool, float]:
    """Return a sort key, least is best: solutions by ``off``, their distance from the goal [m], then partial motions.

    Of partial motions, the one that came farther along the path is better.
    """
    solved = found.status == FollowStatus.FOUND
    return not solved, off if solved else -found.reached


def _faces(graph: GraphArrays, found: FollowResult, options: FollowOptions) -> bool:
    """Return True if a motion ends with the required heading, or none is required."""
    if options.goal_heading is None:
        return True
    heading = found.origins[-1, 2] + graph.node_motion[found.nodes[-1], 2]
    # A little more than the tolerance, as the kernel rounds differently.
    return abs(float(wrap_angle(heading - options.goal_heading))) <= options.goal_heading_tolerance + 1e-9


def meters_off(graph: GraphArrays, found: FollowResult, goal: Floats) -> float:
    """Return the distance from a motion's end to ``goal`` (2,) [m]; infinite if it has no nodes."""
    if not len(found.nodes):
        return math.inf
    end = compose(found.origins[-1], graph.node_motion[found.nodes[-1]])
    return distance(end[:2], goal)
