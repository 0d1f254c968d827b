"""Path following that ends exactly at the end of the path, by branch kinematics on what the follower finds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.body_reach import BodyReach
from crowdsim.following.follow_workspace import Samples
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.following.path_follower import (
    THOROUGH_LOOKS,
    FollowOptions,
    FollowResult,
    FollowStatus,
    PathSearch,
)
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph_arrays import GraphArrays

Floats = NDArray[np.float64]

SCHEDULE = ((1.0, 1.0, 24), (1.0, 2.0, 24), (0.5, 1.0, 24), (1.0, 1.0, 200), (0.5, 1.0, 200), (1.0, 2.0, 200))
_TRIES = 40
"""Solutions looked at in one search: what it finds after the first ends elsewhere, and costs next to nothing."""


def follow_exactly(
    graph: GraphArrays,
    maps: MotionMaps,
    samples: Samples,
    meshes: tuple[Any, ...],
    radii: Floats,
    facings: Floats,
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
    arrival: float = 0.01,
    reach: BodyReach | None = None,
) -> tuple[FollowResult, float]:
    """Follow a path to a stand, with the last transitions turned so that it is within ``arrival`` meters of the end.

    Arguments as of :func:`follow_path`. Of the motions that end within the goal tolerance in ``options`` (10 cm without)
    the first that can be bent is taken. Searches that end elsewhere follow one another until one does: to within other
    distances, a wider range of headings, of more branches. Returns the motion and the meters it ends off: that of least
    where none arrives, the one that came farthest where none is found.
    """
    options = replace(options or FollowOptions(goal_tolerance=0.1), end_standing=True)
    best: tuple[FollowResult, float] | None = None
    for sought in _searches(options):
        search = PathSearch(graph, maps, samples, meshes, radii, facings, start_pose, start_node, sought, reach)
        for _ in range(_TRIES):
            found = search.next()
            off = _off(graph, found, samples)
            if found.status == FollowStatus.FOUND and off > arrival:
                bent = search.arrive(arrival, options.goal_heading_tolerance)
                if bent is not None:
                    found, off = bent, _off(graph, bent, samples)
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


def _searches(options: FollowOptions) -> Iterator[FollowOptions]:
    """What is searched for one after the other until something arrives."""
    for scale, spread, looks in SCHEDULE:
        tolerance = min(spread * options.goal_heading_tolerance, math.pi)
        yield replace(
            options, goal_tolerance=scale * options.goal_tolerance, goal_heading_tolerance=tolerance, looks=looks
        )


def _rank(found: FollowResult, off: float) -> tuple[bool, float]:
    """Lower is better: a solution that ends nearer, or what came farther without being one."""
    solved = found.status == FollowStatus.FOUND
    return not solved, off if solved else -found.reached


def _faces(graph: GraphArrays, found: FollowResult, options: FollowOptions) -> bool:
    """Whether a motion ends with the heading that is asked for, if one is."""
    if options.goal_heading is None:
        return True
    heading = found.origins[-1, 2] + graph.node_motion[found.nodes[-1], 2]
    return abs(float(wrap_angle(heading - options.goal_heading))) <= options.goal_heading_tolerance


def _off(graph: GraphArrays, found: FollowResult, samples: Samples) -> float:
    """Meters from where the motion ends to the end of the path."""
    if not len(found.nodes):
        return math.inf
    end = compose(found.origins[-1], graph.node_motion[found.nodes[-1]])
    return float(np.hypot(*(end[:2] - samples.pose[-1, :2])))
