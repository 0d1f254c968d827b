"""Room for hands that swing out while a body turns: the middle of a turn asks for more than walking ahead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.planning.annotated_path import AnnotatedPath
from crowdsim.planning.behaviors import Behavior
from crowdsim.planning.labelling_kernels import TURN_ROOM
from crowdsim.planning.query import Query
from crowdsim.planning.requirements import TOUCH

STATION = 0.06
"""Meters between the places of a turn that are looked at."""

WORTH = 0.005
"""Share of the cost that the room for a turn may take."""

_PROBE = 0.03
"""Meters to the sides where it is looked for more room."""

_CHORD = 0.002
"""Meters of clearance beyond what is needed, for the straight pieces between stations."""


def with_turn_room(query: Query, path: AnnotatedPath, behaviors: Sequence[Behavior]) -> AnnotatedPath:
    """The same way, farther from obstacles where a body reaches beyond its planned clearance while it turns.

    That is the middle half of the room for a turn. Where the path cannot lead aside it stays as it is.
    """
    turned = query.need.turned
    for k in range(len(path.sections) - 1):
        if len(path.sections) <= k + 1:
            break
        one, other = path.sections[k : k + 2]
        if turned[one.behavior] == turned[other.behavior]:
            continue
        back = bool(turned[one.behavior])
        reach = behaviors[one.behavior if back else other.behavior].turning
        if reach is not None and (reach[int(back)] > query.need.radii[-1]).any():
            middle = one.end + (0.5 if back else -0.5) * TURN_ROOM
            path = _roomier(query, path, middle, reach[int(back)])
    return path


def _roomier(query: Query, path: AnnotatedPath, middle: float, reach: NDArray[np.float64]) -> AnnotatedPath:
    """The path with ``reach`` (m,) meters of clearance about arc length ``middle``, if it can lead there."""
    count = int(0.25 * TURN_ROOM / STATION) + 1
    arc = np.linspace(middle - (count + 1) * STATION, middle + (count + 1) * STATION, 2 * count + 3)
    if arc[0] <= 0.0 or arc[-1] >= path.length:
        return path
    places = path.at(arc)
    inner = slice(1, -1)  # the first and the last stay on the path
    lack = _lacking(query, places[inner], reach)
    if (lack <= 0.0).all():
        return path
    chords = places[2:] - places[:-2]
    normal = np.stack([-chords[:, 1], chords[:, 0]], axis=1) / np.hypot(chords[:, 0], chords[:, 1])[:, None]
    sides = np.concatenate([places[inner] + _PROBE * normal, places[inner] - _PROBE * normal])
    left, right = _lacking(query, sides, reach).reshape(2, -1)
    aside = np.where(left <= right, 1.0, -1.0) * np.where(lack > 0.0, lack + _CHORD, 0.0)
    places[inner] += aside[:, None] * normal
    points = np.concatenate([path.points[path.arc < arc[0]], places, path.points[path.arc > arc[-1]]])
    if len(query.meshes[0].violations(points, query.need.search_radius - TOUCH)):
        return path
    found = query.annotated(points)
    return found if found.sections and found.cost <= path.cost * (1.0 + WORTH) else path


def _lacking(query: Query, places: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) meters that ``places`` (n, 2) lack to have ``reach`` (m,) of clearance in all layers; at most 0 for none.

    Layers where that is no more than planned do not count.
    """
    lacks = [
        radius + _PROBE - mesh.clearances(places, radius + _PROBE)
        for mesh, radius, planned in zip(query.meshes, reach.tolist(), query.need.radii[-1].tolist(), strict=True)
        if radius > planned
    ]
    return np.max(lacks, axis=0) - _PROBE
