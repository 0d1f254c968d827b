"""Cluttered rooms and random paths in them, for benchmarks of motion searches and motion maps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.environment.clutter import draw_clutter
from crowdsim.environment.layers import LEGS, TORSO, clearance_layers
from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh


class GroundKind(NamedTuple):
    """Parameters of a random room and its paths.

    Attributes
    ----------
    side : float
        Side of the square room [m].
    sizes : (float, float)
        Least and greatest extent of an obstacle [m].
    clearance : float
        Distance of paths from obstacles [m].
    lengths : (float, float)
        Least and greatest length of paths [m].
    """

    side: float
    sizes: tuple[float, float]
    clearance: float
    lengths: tuple[float, float]


class RandomGround(NamedTuple):
    """A room with ``obstacles`` obstacles of various heights, the meshes of its layers, and paths (n, 2) in it [m]."""

    obstacles: int
    legs: NavMesh
    torso: NavMesh
    paths: list[NDArray[np.float64]]


def random_ground(kind: GroundKind, density: float, paths: int, seed: int) -> RandomGround:
    """Return a room with ``paths`` paths between random places.

    A strip of 0.5 m along its edge is without obstacles; they cover the share ``density`` of the rest of the floor.
    """
    rng = np.random.default_rng(seed)
    floor = shapely.box(0.0, 0.0, kind.side, kind.side)
    solids = draw_clutter("clutter", floor.buffer(-0.5), density, kind.sizes, rng)
    legs, torso = (NavMesh(layer.free) for layer in clearance_layers(floor, solids, (LEGS, TORSO)))
    found: list[NDArray[np.float64]] = []
    while len(found) < paths:
        start, goal = rng.uniform(1.0, kind.side - 1.0, (2, 2))
        try:
            path = legs.find_path(start, goal, kind.clearance)
        except PathNotFound:
            continue
        if kind.lengths[0] <= path.length <= kind.lengths[1]:
            found.append(np.array(path.points))
    return RandomGround(len(solids), legs, torso, found)
