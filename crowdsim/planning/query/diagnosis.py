"""Why there is no path: which layer is too narrow, where, and by how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.planning.labels.annotated_path import arc_lengths, points_at
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

LEAST_WAY = 0.01
"""Clearance in meters below which a way is not looked for when the narrowest place is to be named."""


def why_not(query: Query) -> str:
    """Why no behavior has a path."""
    mesh, radius = query.meshes[0], query.need.search_radius
    try:
        path = mesh.find_path(query.ends[0], query.ends[1], radius)
    except PathNotFound as failure:
        return _too_narrow_below(query, failure)
    for layer in range(1, len(query.meshes)):
        radius = float(query.need.radii[0, layer])
        if len(query.meshes[layer].violations(path.points, radius - CONTACT_TOLERANCE)):
            return _narrowest_place(f"layer {layer}", query.meshes[layer], path.points, radius)
    raise AssertionError("a path that keeps every clearance of some behavior has sections")


def _too_narrow_below(query: Query, failure: PathNotFound) -> str:
    """Why the lowest layer has no path: an end that is not free, or where its widest way is narrowest."""
    mesh, radius = query.meshes[0], query.need.search_radius
    if (mesh.clearances(query.ends, radius) < radius - CONTACT_TOLERANCE).any():
        return f"{failure}; choose a place with more room"
    low, high = LEAST_WAY, radius
    for _ in range(10):
        middle = (low + high) / 2.0
        if mesh.reachable(query.ends[0], query.ends[1], middle):
            low = middle
        else:
            high = middle
    if low == LEAST_WAY:
        return f"{failure}; nothing wider than {2.0 * LEAST_WAY:g} m leads there at all: make a passage"
    widest = mesh.find_path(query.ends[0], query.ends[1], low)
    return _narrowest_place("legs layer", mesh, widest.points, radius)


def _narrowest_place(layer: str, mesh: NavMesh, points: NDArray[np.float64], radius: float) -> str:
    arc = arc_lengths(points)
    places = points_at(points, arc, np.linspace(0.0, arc[-1], int(arc[-1] / 0.05) + 2))
    clearances = mesh.clearances(places, radius)
    k = int(np.argmin(clearances))
    x, y = places[k]
    return (
        f"no path: the {layer} is too narrow for every behavior, most of all near ({x:.2f}, {y:.2f}), where a body of"
        f" radius {radius:.2f} m (margin included) has {clearances[k]:.2f} m; widen the passage by"
        f" {2.0 * (radius - clearances[k]):.2f} m"
    )
