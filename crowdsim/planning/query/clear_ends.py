"""Free ends of a path for an agent that stands closer to obstacles than plans allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, distance, sin
from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.query.requirements import Requirements

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

REACH = 0.1
"""Largest distance of the free place from the given one [m]: twice the usual margin, as in a corner the nearest free
place is farther than one margin."""

_RINGS = 8
"""Rings of candidate places around the given one."""
_DIRECTIONS = 24
"""Candidate places on each ring."""
_ROUNDING = 1e-7
"""Clearance shortfall that counts as rounding [m]."""
_PROBE = 0.005
"""Distance between places whose clearance is measured [m]; between them, clearance is at most half of this less."""


def clear_ends(meshes: Sequence[NavMesh], need: Requirements, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``points`` (n, 2) [m], or places nearby with planned clearance for those that have only a body's own.

    A motion strays from its path, so an agent at rest may be closer to obstacles than planned. A point with the planned
    clearance of any upright behavior (one that is not turned) stays. Any other is moved, by REACH at most, to a place
    with the planned clearance of the widest behavior, upright or turned, whose body fits at the point and for which
    there is such a place. If there is none for any behavior, the point stays.
    """
    upright = need.narrowest_upright  # if a wider behavior fits, this one fits, too
    if upright is not None:
        places = np.concatenate([points, points], axis=1)
        if are_free(layers_of(meshes), upright - _ROUNDING, places):
            return points
    limit = float(need.radii.max()) + REACH
    clear = np.array([mesh.clearances(points, limit) for mesh in meshes]).T + _ROUNDING
    planned = np.all(clear[:, None] >= need.radii, axis=2)
    free = np.any(planned & ~need.turned, axis=1)
    return np.array([points[i] if free[i] else _clear_end(meshes, need, points[i]) for i in range(len(points))])


def _clear_end(meshes: Sequence[NavMesh], need: Requirements, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a place near ``point`` (2,) with planned clearance for the widest behavior possible, or the point.

    No upright behavior has its planned clearance at the point itself; turned ones count, too.
    """
    ring, offsets = _rings()
    places = point + offsets
    # Clearance beyond this limit does not matter: it grows by at most REACH on the way to a place.
    clear = np.array([mesh.clearances(places, float(need.radii.max()) + REACH) for mesh in meshes]) + _ROUNDING
    # The widest behavior whose body fits here (place 0) and whose planned clearance exists nearby; of the nearest ring,
    # the place with the most room.
    for radii, body in zip(need.radii[::-1], need.bodies[::-1], strict=True):
        room = (clear - radii[:, None]).min(axis=0)
        if (clear[:, 0] >= body).all() and (room >= 0.0).any():
            nearest = ring[int(np.argmax(room >= 0.0))]
            roomiest: NDArray[np.float64] = places[int(np.argmax(np.where(ring == nearest, room, -np.inf)))]
            return roomiest
    return point


def nearby_place(mesh: NavMesh, point: NDArray[np.float64], radius: float) -> NDArray[np.float64] | None:
    """Return ``point`` (2,) if it has clearance ``radius`` [m], else a place nearby that has it; None if none is found.

    Places are those of :func:`_rings`, the nearest ring first.
    """
    if mesh.clearances(point[None], 2.0 * radius)[0] >= radius:
        return point
    _, offsets = _rings()
    places = point + offsets
    clear = mesh.clearances(places, 2.0 * radius) >= radius
    return places[int(np.argmax(clear))] if clear.any() else None


@cache
def _rings() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return ring number (n,) and offset (n, 2) [m] of the origin (ring 0) and of places around it out to REACH."""
    ring = np.append(0, np.repeat(np.arange(1, _RINGS + 1), _DIRECTIONS))
    angle = np.append(0.0, np.tile(np.arange(_DIRECTIONS) * 2.0 * np.pi / _DIRECTIONS, _RINGS))
    return ring, (ring * REACH / _RINGS)[:, None] * np.stack([cos(angle), sin(angle)], axis=1)


def missing_at_ends(
    meshes: Sequence[NavMesh], need: Requirements, path: AnnotatedPath, ends: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the largest shortfalls of planned clearance on the straight lines from ``ends`` (2, 2) to the path [m].

    The clearance is that of the path's first and of its last section.
    """
    pieces = ((ends[0], path.points[0], path.sections[0]), (path.points[-1], ends[1], path.sections[-1]))
    before, after = (_missing(meshes, need.radii[section.behavior], one, other) for one, other, section in pieces)
    return before, after


def _missing(
    meshes: Sequence[NavMesh], radii: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64]
) -> float:
    """Return the largest shortfall of clearances ``radii`` (m,) on the way straight from ``one`` to ``other`` [m].

    It is 0 if there is no shortfall.
    """
    length = distance(one, other)
    if length == 0.0:
        return 0.0
    places = one + np.linspace(0.0, 1.0, int(length / _PROBE) + 2)[:, None] * (other - one)
    pairs = zip(meshes, radii.tolist(), strict=True)
    return float(max(radius - mesh.clearances(places, radius).min() for mesh, radius in pairs))


def joined_to(path: AnnotatedPath, ends: NDArray[np.float64], costs: NDArray[np.float64]) -> AnnotatedPath:
    """Return the path with its first and last section lengthened to start and goal, ``ends`` (2, 2) [m].

    ``costs`` (n,) are those of a meter with each behavior.
    """
    before, after = distance(path.points[0], ends[0]), distance(path.points[-1], ends[1])
    if before == after == 0.0:
        return path
    points = np.concatenate([ends[:1][: before > 0.0], path.points, ends[1:][: after > 0.0]])
    arc = arc_lengths(points)
    bounds = [0.0, *(section.end + before for section in path.sections[:-1]), float(arc[-1])]
    sections = tuple(
        Section(section.behavior, low, high)
        for section, low, high in zip(path.sections, bounds[:-1], bounds[1:], strict=True)
    )
    cost = path.cost + before * costs[sections[0].behavior] + after * costs[sections[-1].behavior]
    return replace(path, points=points, arc=arc, sections=sections, cost=float(cost))
