"""Where each behavior may go: the meshes that are searched for paths.

The lowest layer alone cannot tell a bench from a wall: a body with swinging arms passes closer to the bench. So each
behavior has an area in which a disc of the legs' clearance can move exactly where the behavior fits on all layers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.geometry.elementary import cos
from crowdsim.geometry.polygons import buffered
from crowdsim.planning.query.requirements import Requirements

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_ARC_STEPS = 4
"""Chords of a quarter circle around a grown corner; they stay outside the circle. More: tighter areas, more
vertices."""


class BehaviorArea(NamedTuple):
    """Mesh in which to search for paths that fit a behavior.

    radius: clearance of such paths on ``mesh`` [m]. behavior: index k if the mesh is of polygon k of
    :func:`area_polygons`, None if it is a layer.
    """

    mesh: NavMesh
    radius: float
    behavior: int | None = None

    def find_path(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shortest path between ``ends`` (2, 2), (n, 2) [m]; raise PathNotFound if there is none."""
        return self.mesh.find_path(ends[0], ends[1], self.radius).points


def area_polygons(
    layers: Sequence[shapely.Geometry], behaviors: Sequence[Behavior], margin: float = TRACKING_MARGIN
) -> tuple[shapely.Geometry, ...]:
    """Return the area of each behavior, from the walkable areas of the layers, the legs' first.

    The obstacles of the upper layers grow by what the behavior, with ``margin`` [m], needs there beyond the legs'
    clearance. An area may be empty or consist of several parts.
    """
    areas = []
    for growths in area_growths(behaviors, len(layers), margin):
        area = layers[0]
        for layer, growth in zip(layers[1:], growths.tolist(), strict=True):
            if growth > 0.0:
                area = area.intersection(buffered(layer, -growth, quad_segs=_ARC_STEPS))
        areas.append(area)
    return tuple(areas)


def area_growths(behaviors: Sequence[Behavior], layers: int, margin: float = TRACKING_MARGIN) -> NDArray[np.float64]:
    """Return (n, layers - 1): growth of the upper layers' obstacles in each behavior's area [m], 0 for none.

    The n ``behaviors`` are planned with ``margin`` [m] beyond their bodies.
    """
    need = Requirements.of(behaviors, layers, margin)
    # Grown corners are polygons inside of their circles; growing by more makes them circumscribe these.
    widened: NDArray[np.float64] = np.maximum(need.radii[:, 1:] - need.search_radius, 0.0) / cos(
        np.pi / 4.0 / _ARC_STEPS
    )
    return widened


def grown(obstacle: shapely.Geometry, growth: float) -> shapely.Geometry:
    """Return an upper layer's obstacle as a behavior area contains it, grown by ``growth`` [m] of `area_growths`."""
    return buffered(obstacle, growth, quad_segs=_ARC_STEPS) if growth > 0.0 else obstacle


def area_excess(growth: float) -> float:
    """Return by how much an obstacle that needs to grow by ``growth`` [m] is grown too far at most [m].

    :func:`area_growths` grows all by more, as the arcs at corners become chords.
    """
    return max(growth, 0.0) * (1.0 / float(cos(np.pi / 4.0 / _ARC_STEPS)) - 1.0)


def make_areas(
    meshes: Sequence[NavMesh], need: Requirements, given: Sequence[NavMesh | None] | None
) -> tuple[BehaviorArea, ...]:
    """Return the behavior areas from the widest behavior to the narrowest.

    The last area has the legs' clearance, whether a behavior fits there or not.

    Parameters
    ----------
    meshes: one per layer, the legs' first. need: clearances of the behaviors.
    given: mesh of each of :func:`area_polygons`, None for an empty one. Without it, an area is the lowest layer with
    the largest clearance that the behavior needs on any layer.
    """
    if given is not None:
        least = need.search_radius
        areas = [BehaviorArea(mesh, least, k) for k, mesh in enumerate(given) if mesh is not None]
        # The area of the narrowest behavior is the legs' layer, unless an upper layer takes something from it.
        if given[0] is None or need.radii[0].max() > least:
            areas.insert(0, BehaviorArea(meshes[0], least))
        return tuple(areas[::-1])
    # Behaviors with the same clearance share an area.
    reach = np.unique(np.append(need.radii.max(axis=1), need.search_radius))[::-1]
    return tuple([BehaviorArea(meshes[0], radius) for radius in reach.tolist()])
