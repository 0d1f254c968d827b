"""Path following that ends exactly at the end of the path, by branch kinematics on what the follower finds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.following.graph_search import SearchOptions, exact_arrival
from crowdsim.following.motion_maps import MotionMaps
from crowdsim.following.path_follower import FollowOptions, FollowResult, FollowStatus, Samples, follow_path
from crowdsim.following.probes import Probes
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph_arrays import GraphArrays

Floats = NDArray[np.float64]

_SHARES = (1.0, 0.7, 0.5, 0.3, 0.2, 0.1)
"""Of the tolerance, tried one after the other: what ends nearer needs less bending, but is searched for longer."""


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
) -> tuple[FollowResult, float]:
    """Follow a path to a stand, with the last transitions turned so that it is within ``arrival`` meters of the end.

    Arguments as of :func:`follow_path`, ``probes`` as of :func:`exact_arrival`. The follower looks for motions that end
    ever nearer, from the goal tolerance in ``options`` (10 cm without) down to a tenth of it, until one can be bent.
    Returns the motion and the meters it ends off: that of least where none arrives, the first where none is found.
    """
    options = replace(options or FollowOptions(goal_tolerance=0.1), end_standing=True)
    goal = samples.pose[-1, :2]
    best: tuple[FollowResult, float] | None = None
    for share in _SHARES:
        nearer = replace(options, goal_tolerance=share * options.goal_tolerance)
        found = follow_path(graph, maps, samples, meshes, radii, facings, start_pose, start_node, nearer)
        off = _off(graph, found, goal)
        if best is None or (found.status == FollowStatus.FOUND and off < best[1]):
            best = found, off
        if found.status != FollowStatus.FOUND:
            break
        if off <= arrival:
            return found, off
        bent = exact_arrival(graph, probes, found, goal, meshes=meshes, options=SearchOptions(arrival=arrival))
        if bent is not None:
            return bent, _off(graph, bent, goal)
    assert best is not None
    return best


def _off(graph: GraphArrays, found: FollowResult, goal: Floats) -> float:
    """Meters from where the motion ends to ``goal``."""
    if not len(found.nodes):
        return float("inf")
    end = compose(found.origins[-1], graph.node_motion[found.nodes[-1]])
    return float(np.hypot(*(end[:2] - goal)))
