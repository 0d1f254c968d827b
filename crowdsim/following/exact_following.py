"""Path following that ends exactly at the end of the path, by branch kinematics on what the follower finds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.body_reach import BodyReach
from crowdsim.following.follow_workspace import Samples
from crowdsim.following.graph_search import SearchOptions, exact_arrival
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.following.path_follower import (
    THOROUGH_LOOKS,
    FollowOptions,
    FollowResult,
    FollowStatus,
    PathSearch,
)
from crowdsim.following.probes import Probes
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.graph_arrays import GraphArrays

Floats = NDArray[np.float64]

_TRIES = 40
"""Solutions looked at in one search: what it finds after the first ends elsewhere, and costs next to nothing."""


def follow_exactly(
    graph: GraphArrays,
    maps: MotionMaps,
    probes: Probes,
    samples: Samples,
    meshes: tuple[Any, Any],
    radii: Floats,
    facings: Floats,
    start_pose: Floats,
    start_node: int = -1,
    options: FollowOptions | None = None,
    arrival: float = 0.01,
    reach: BodyReach | None = None,
) -> tuple[FollowResult, float]:
    """Follow a path to a stand, with the last transitions turned so that it is within ``arrival`` meters of the end.

    Arguments as of :func:`follow_path`, ``probes`` as of :func:`exact_arrival`. Of the motions that end within the goal
    tolerance in ``options`` (10 cm without) the first that can be bent is taken, and where none can be of a quick
    search, of a thorough one. Returns the motion and the meters it ends off: that of least where none arrives, the one
    that came farthest where none is found.
    """
    options = replace(options or FollowOptions(goal_tolerance=0.1), end_standing=True)
    goal = samples.pose[-1, :2]
    best: tuple[FollowResult, float] | None = None
    for looks in (options.looks, THOROUGH_LOOKS):
        search = PathSearch(
            graph, maps, samples, meshes, radii, facings, start_pose, start_node, replace(options, looks=looks), reach
        )
        for _ in range(_TRIES):
            found = search.next()
            if found.status != FollowStatus.FOUND:
                if best is None or (best[0].status != FollowStatus.FOUND and found.reached > best[0].reached):
                    best = found, _off(graph, found, goal)
                break
            off = _off(graph, found, goal)
            if off > arrival:
                bent = exact_arrival(graph, probes, found, goal, meshes=meshes, options=SearchOptions(arrival=arrival))
                if bent is not None and _faces(graph, bent, options):
                    found, off = bent, _off(graph, bent, goal)
            if off <= arrival:
                return found, off
            if best is None or best[0].status != FollowStatus.FOUND or off < best[1]:
                best = found, off
    assert best is not None
    return best


def _faces(graph: GraphArrays, found: FollowResult, options: FollowOptions) -> bool:
    """Whether a motion ends with the heading that is asked for, if one is."""
    if options.goal_heading is None:
        return True
    heading = found.origins[-1, 2] + graph.node_motion[found.nodes[-1], 2]
    return abs(float(wrap_angle(heading - options.goal_heading))) <= options.goal_heading_tolerance


def _off(graph: GraphArrays, found: FollowResult, goal: Floats) -> float:
    """Meters from where the motion ends to ``goal``."""
    if not len(found.nodes):
        return float("inf")
    end = compose(found.origins[-1], graph.node_motion[found.nodes[-1]])
    return float(np.hypot(*(end[:2] - goal)))
