"""Random edits of meshes, with shapes that are as degenerate as the grid allows."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.geometry.planar import rotation
from crowdsim.navmesh.navmesh import NavMesh

GROUNDS = ("lattice", "random", "apartment")
STEPS = 20
"""Number of edits in a sequence."""

_LATTICE = 8
_ROOM = 12.0
"""Sides of the square grounds [m]; on the lattice, corners have whole coordinates, so that many lie in line."""


def edit_at_random(seed: int, steps: int = STEPS) -> int:
    """Insert, move and remove shapes on one of :data:`GROUNDS`, by ``seed``; return the number of refused edits.

    At the end all shapes that are left are removed in random order. Only GeometryError counts as a refusal; other
    exceptions are not caught.
    """
    rng = np.random.default_rng(seed)
    mesh = NavMesh(_ground(GROUNDS[seed % len(GROUNDS)], rng))
    present: list[Any] = []
    refused = 0
    for _ in range(steps):
        try:
            chance = rng.random()
            if not present or chance < 0.6:
                present.append(mesh.insert_obstacle(_shape(mesh, rng)))
            elif chance < 0.8:
                mesh.remove(present.pop(int(rng.integers(len(present)))))
            elif chance < 0.9:
                mesh.move(present[int(rng.integers(len(present)))], _shape(mesh, rng))
            else:  # a move by at most two grid cells
                cells = float(mesh.arrays.frame["cell"][0]) * rng.integers(-2, 3, 2)
                mesh.move(present[int(rng.integers(len(present)))], *cells.tolist())
        except GeometryError:
            refused += 1
    while present:
        mesh.remove(present.pop(int(rng.integers(len(present)))))
    return refused


def _ground(kind: str, rng: np.random.Generator) -> shapely.Polygon | shapely.MultiPolygon:
    """Return a walkable area of a kind of GROUNDS.

    All but the apartment have up to five random holes; one that takes half of what is left, or more, is left out.
    """
    if kind == "apartment":
        return _apartment()
    area: Any = shapely.box(0, 0, _LATTICE, _LATTICE) if kind == "lattice" else shapely.box(0.0, 0.0, _ROOM, _ROOM)
    for _ in range(int(rng.integers(0, 6))):
        if kind == "lattice":
            x, y, width, height = rng.integers(0, _LATTICE, 2).tolist() + rng.integers(1, 4, 2).tolist()
            hole = shapely.box(x, y, x + width, y + height)
        else:
            hole = shapely.convex_hull(shapely.multipoints(rng.uniform(0.0, _ROOM, 2) + rng.uniform(-2, 2, (6, 2))))
        rest = shapely.difference(area, hole)
        area = rest if rest.area > 0.5 * area.area else area
    return area


@cache
def _apartment() -> shapely.Polygon | shapely.MultiPolygon:
    """Return the lowest layer of the built-in scenario of that name."""
    from crowdsim.scenario.loader import load_scenario

    return load_scenario("apartment").environment.layers[0].free


def _shape(mesh: NavMesh, rng: np.random.Generator) -> BaseGeometry | NDArray[np.float64]:
    """Return a random shape of a random kind, on or near features of the mesh.

    It is a geometry, corners (n, 2) or a point (2,) [m].
    """
    shape: BaseGeometry | NDArray[np.float64] = _SHAPES[int(rng.integers(len(_SHAPES)))](mesh, rng)
    return shape


def _places(mesh: NavMesh, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return random places (count, 2) [m]: anywhere, on whole coordinates, or within a few cells of vertices and edges.

    ``cell`` is the side of a grid cell, to which the mesh rounds all coordinates.
    """
    frame = mesh.arrays.frame
    cell = float(frame["cell"][0])
    low = np.array([frame["x0"][0], frame["y0"][0]])
    high = np.array([frame["x1"][0], frame["y1"][0]])
    sides = mesh.arrays.sides[: 3 * int(frame["triangles"][0])]
    # Half-edges, three of each triangle: their origins, and those of the next ones in their triangles.
    chosen = rng.integers(len(sides), size=count)
    after = chosen - chosen % 3 + (chosen + 1) % 3
    one, other = (_corners(mesh, sides["org"][some]) for some in (chosen, after))
    beside = one + cell * rng.integers(-3, 4, (count, 2))
    along = one + rng.choice([0.25, 0.5, rng.random()], count)[:, None] * (other - one)
    about = along + cell * rng.integers(-2, 3, (count, 2))
    anywhere = rng.uniform(low, high, (count, 2))
    kinds = np.stack([anywhere, np.rint(anywhere), one, beside, beside, along, about])
    places: NDArray[np.float64] = kinds[rng.integers(len(kinds), size=count), np.arange(count)]
    return places


def _corners(mesh: NavMesh, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the places (n, 2) [m] of vertices of the mesh with the ``numbers`` (n,)."""
    vertices = mesh.arrays.vertices[numbers]
    places: NDArray[np.float64] = np.stack([vertices["x"], vertices["y"]], axis=1)
    return places


def _point(mesh: NavMesh, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a single place (2,) [m]."""
    place: NDArray[np.float64] = _places(mesh, rng, 1)[0]
    return place


def _points(mesh: NavMesh, rng: np.random.Generator) -> BaseGeometry:
    """Return two to five points, each within three grid cells of one place along both axes."""
    around = _places(mesh, rng, 1) + float(mesh.arrays.frame["cell"][0]) * rng.integers(-3, 4, (5, 2))
    return shapely.multipoints(around[: int(rng.integers(2, 6))])


def _line(mesh: NavMesh, rng: np.random.Generator) -> BaseGeometry:
    """Return a polyline of two to five places; it may cross itself."""
    return shapely.linestrings(_places(mesh, rng, int(rng.integers(2, 6))))


def _sliver(mesh: NavMesh, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the corners (3 or 4, 2) [m] of a triangle or quadrangle that is only a few grid cells thick."""
    cell = float(mesh.arrays.frame["cell"][0])
    one, other = _places(mesh, rng, 2)
    middle = one + rng.random() * (other - one) + cell * rng.integers(-3, 4, 2)
    last = other + cell * rng.integers(-3, 4, 2)
    corners = [one, other, middle] if rng.random() < 0.5 else [one, other, last, middle]
    return np.array(corners, np.float64)


def _polygon(mesh: NavMesh, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return three to six corners (n, 2) [m] in any order, so that sides may cross."""
    return _places(mesh, rng, int(rng.integers(3, 7)))


def _box(mesh: NavMesh, rng: np.random.Generator) -> BaseGeometry:
    """Return a box along the axes between two places; it may have no area."""
    one, other = _places(mesh, rng, 2)
    return shapely.box(*np.minimum(one, other), *np.maximum(one, other))


def _turned_box(mesh: NavMesh, rng: np.random.Generator) -> BaseGeometry:
    """Return a box at a random place of the mesh, turned by up to half a turn."""
    x, y = _places(mesh, rng, 1)[0].tolist()
    box = shapely.box(x, y, x + rng.uniform(0.1, 2.5), y + rng.uniform(0.1, 2.5))
    c, s = rotation(rng.uniform(0.0, 180.0))
    turn = np.array([[c, s], [-s, c]])
    turned: BaseGeometry = shapely.transform(box, lambda points: (points - (x, y)) @ turn + (x, y))
    return turned


_SHAPES: tuple[Callable[[NavMesh, np.random.Generator], Any], ...] = (
    _point,
    _point,
    _points,
    _line,
    _sliver,
    _polygon,
    _box,
    _turned_box,
)
