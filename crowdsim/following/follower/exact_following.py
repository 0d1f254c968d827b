"""Path following that ends exactly at the end of the path, by branch kinematics on what the follower finds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.follower.follow_workspace import Samples
from crowdsim.following.follower.path_follower import (
    THOROUGH_BRANCHES,
    Character,
    FollowOptions,
    FollowResult,
    FollowStatus,
    PathFollower,
)
from crowdsim.geometry.elementary import distance
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]

_QUICK_TRIES = 40
_TRIES = 200
"""Solutions looked at in a quick search and in one with the whole budget: what is found after the first ends elsewhere,
and costs little."""

FEW_BRANCHES = 8
"""Branches laid at each stage of searches that shall come to other motions than broader ones, sooner."""


def follow_exactly(
    character: Character,
    samples: Samples,
    meshes: tuple[Any, ...],
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
    arrival: float = 0.01,
) -> tuple[FollowResult, float]:
    """Follow a path to a stand, with the last transitions turned so that it is within ``arrival`` meters of the end.

    Arguments as of :func:`follow_path`. Of the motions that end within the tolerance in ``options`` (10 cm without)
    the first that can be bent is taken. Searches that end elsewhere follow one another until one does: to within other
    distances, a wider range of headings, of more branches. Returns the motion and the meters it ends off: that of least
    where none arrives, the one that came farthest where none is found.
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
            if found.status == FollowStatus.FOUND and not _faces(graph, found, options):
                continue
            if best is None or _rank(found, off) < _rank(*best):
                best = found, off
            if found.status != FollowStatus.FOUND or off <= arrival:
                break
        if best is not None and best[0].status == FollowStatus.FOUND and best[1] <= arrival:
            break
    assert best is not None
    return best


def _searches(options: FollowOptions) -> Iterator[tuple[FollowOptions, int]]:
    """What is searched for one after the other until something arrives, and how many solutions of it are looked at.

    Where motions end is a matter of chance, and one search goes on to what ends alike: searches of another breadth that
    end within other tolerances find others. A wider heading may be turned to the one that is asked for.
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
    """Lower is better: a solution that ends nearer, or what came farther without being one."""
    solved = found.status == FollowStatus.FOUND
    return not solved, off if solved else -found.reached


def _faces(graph: GraphArrays, found: FollowResult, options: FollowOptions) -> bool:
    """Whether a motion ends with the heading that is asked for, if one is."""
    if options.goal_heading is None:
        return True
    heading = found.origins[-1, 2] + graph.node_motion[found.nodes[-1], 2]
    # Kernels round otherwise.
    return abs(float(wrap_angle(heading - options.goal_heading))) <= options.goal_heading_tolerance + 1e-9


def meters_off(graph: GraphArrays, found: FollowResult, goal: Floats) -> float:
    """From where a motion ends to ``goal`` (2,); infinite where there is none."""
    if not len(found.nodes):
        return math.inf
    end = compose(found.origins[-1], graph.node_motion[found.nodes[-1]])
    return distance(end[:2], goal)
