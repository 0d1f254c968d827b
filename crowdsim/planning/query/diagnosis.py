"""The reason why there is no path: which layer is too narrow, where, and by how much."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.planning.labels.annotated_path import arc_lengths, points_at
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

LEAST_WAY = 0.01
"""Clearance below which the search for the narrowest place gives up [m]."""


def why_not(query: Query, in_3d: bool = False) -> str:
    """Return the reason why no behavior has a path, as a message for the user.

    ``in_3d`` is True if whole bodies were tested in 3D instead of the layers.
    """
    mesh, radius = query.meshes[0], query.need.search_radius
    try:
        path = mesh.find_path(query.ends[0], query.ends[1], radius)
    except PathNotFound as failure:
        return _too_narrow_below(query, failure)
    for layer in range(1, len(query.meshes)):
        radius = float(query.need.radii[0, layer])
        if len(query.meshes[layer].violations(path.points, radius - CONTACT_TOLERANCE)):
            return _narrowest_place(query, layer, path.points, radius)
    # Bodies reach beyond the heights of the layers, and solids may be wider there.
    if in_3d:
        return (
            "no path: the layers have room, but in 3D the body of every behavior touches a solid on the way, above,"
            " below or between the layers; move such solids, or choose the planner 'layered'"
        )
    raise AssertionError("a path that keeps every clearance of some behavior has sections")


def _too_narrow_below(query: Query, failure: PathNotFound) -> str:
    """Return why the lowest layer has no path.

    It is a blocked end, no way at all, or the narrowest place of its widest way.
    """
    mesh, radius = query.meshes[0], query.need.search_radius
    if (mesh.clearances(query.ends, radius) < radius - CONTACT_TOLERANCE).any():
        return f"{failure}; choose a place with more room"
    # Bisect for the largest clearance with which a way exists.
    low, high = LEAST_WAY, radius
    for _ in range(10):
        middle = (low + high) / 2.0
        if mesh.reachable(query.ends[0], query.ends[1], middle):
            low = middle
        else:
            high = middle
    if low == LEAST_WAY:
        return f"{failure}; no way wider than {2.0 * LEAST_WAY:g} m leads there; open a passage"
    widest = mesh.find_path(query.ends[0], query.ends[1], low)
    return _narrowest_place(query, 0, widest.points, radius)


def _narrowest_place(query: Query, layer: int, points: NDArray[np.float64], radius: float) -> str:
    """Describe the place with the least clearance along ``points`` (n, 2) on a layer, for bodies of ``radius`` [m]."""
    mesh, name = query.meshes[layer], f"layer {layer}" if layer else "legs layer"
    widest = f"; the widest pose is in {query.need.widest[layer]}" if query.need.widest else ""
    arc = arc_lengths(points)
    # Every 5 cm along the path.
    places = points_at(points, arc, np.linspace(0.0, arc[-1], int(arc[-1] / 0.05) + 2))
    clearances = mesh.clearances(places, radius)
    k = int(np.argmin(clearances))
    x, y = places[k]
    # The passage must widen by twice what a radius lacks, rounded up to a centimeter.
    return (
        f"no path: the {name} is too narrow for every behavior, most of all near ({x:.2f}, {y:.2f}), where a body of"
        f" radius {radius:.2f} m (margin included) has {clearances[k]:.2f} m; widen the passage by"
        f" {ceil(200.0 * (radius - clearances[k])) / 100.0:.2f} m{widest}"
    )
