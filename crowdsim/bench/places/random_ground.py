"""Cluttered rooms and random paths in them, on which motion searches and motion maps are measured."""

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
    """How to draw a room and paths. side: meters of the square room. sizes: meters, least and greatest extent of an
    obstacle. clearance: meters that paths keep from obstacles. lengths: meters between which the paths are long."""

    side: float
    sizes: tuple[float, float]
    clearance: float
    lengths: tuple[float, float]


class RandomGround(NamedTuple):
    """A room of ``obstacles`` of varied height, the meshes of its layers, and paths (n, 2) among them."""

    obstacles: int
    legs: NavMesh
    torso: NavMesh
    paths: list[NDArray[np.float64]]


def random_ground(kind: GroundKind, density: float, paths: int, seed: int) -> RandomGround:
    """A room whose obstacles cover the share ``density`` of it, and so many ``paths`` between random places."""
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
