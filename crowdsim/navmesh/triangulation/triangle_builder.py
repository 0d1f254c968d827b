"""The constrained triangulation of Shewchuk's Triangle in the engine's own arrays.

The package `triangle` compiles code whose license excludes commercial distribution, so it is imported only on request.
It ends the process on NaN, fails on collinear points and leaves duplicate vertices unconnected. So the points it gets
from here are finite, distinct and inside a box whose corners it gets as well.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, MeshArrays, Rings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MOST_PASSES = 16
"""Most triangulations until no segments cross. Crossings move to the grid, which may make new ones, fewer each time."""


class Triangulation(NamedTuple):
    """The result of Triangle for rings; the rings have got one more corner at each crossing."""

    rings: Rings
    ids: Ints
    """(n,) vertex of each point of the rings."""
    vertices: Floats
    """(nv, 2) places [m]; the corners of the box first."""
    triangles: Ints
    """(nt, 3) vertices, counter-clockwise."""
    neighbors: Ints
    """(nt, 3) triangle opposite to each corner, -1 outside of the box."""


def _package() -> ModuleType:
    """Import the package `triangle`, or raise GeometryError."""
    try:
        import triangle
    except ImportError as error:
        raise GeometryError(
            "builder: 'triangle' needs the package of that name (pip install triangle; not for commercial "
            "distribution); builder='own' gives the same mesh without it"
        ) from error
    package: ModuleType = triangle
    return package


def _distinct(points: Floats, order: Ints, frame: NDArray[Any]) -> tuple[Floats, Ints]:
    """Return the distinct ``points`` in the order they are first met, and the index of each point among them (n,).

    ``points`` is (n, 2) on the grid [m]; ``order`` (n,) says in which order they are met; ``frame`` is (1,) FRAME.
    """
    # A point as one whole number: its row and column of grid cells.
    x0, y0, cell = frame[["x0", "y0", "cell"]][0].item()
    x, y = ((points[order] - (x0, y0)) / cell).astype(np.int64).T
    _, first, same = np.unique(x << 31 | y, return_index=True, return_inverse=True)
    by_order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[by_order] = np.arange(len(first))
    ids = np.empty(len(points), np.int64)
    ids[order] = rank[same]
    return points[order[first[by_order]]], ids


def _next_points(rings: Rings) -> Ints:
    """Return for each point (n,) the next one around its ring; points of no ring follow themselves."""
    begins = np.append(0, rings.ends)
    following = np.arange(len(rings.points))
    following[: begins[-1]] += 1
    following[rings.ends - 1] = begins[:-1]
    return following


def _through(rings: Rings, order: Ints, places: Floats, cell: float) -> tuple[Rings, Ints]:
    """Lead each side of the rings through those ``places`` (k, 2) [m] whose grid cells it meets.

    Return the rings with these new corners, and a new ``order`` (n,): the old points under the numbers that they have
    now, then the new corners. This is snap rounding: sides that cross meet in the place that their crossing moved to.
    ``cell`` is the side of a grid cell [m].
    """
    ends = rings.points[_next_points(rings)]
    tree = shapely.STRtree(shapely.linestrings(np.stack([rings.points, ends], axis=1)))
    low, high = places - 0.5 * cell, places + 0.5 * cell
    # Pairs of a place and a side; a place that is an end of the side needs no corner there.
    which, side = tree.query(shapely.box(*low.T, *high.T), predicate="intersects")
    at = places[which]
    inner = (at != rings.points[side]).any(axis=1) & (at != ends[side]).any(axis=1)
    at, side = at[inner], side[inner].astype(np.int64)
    along = ((at - rings.points[side]) * (ends[side] - rings.points[side])).sum(axis=1)
    # Several places on one side, in the order along it.
    by_place = np.lexsort((along, side))
    at, after = at[by_place], side[by_place] + 1
    points = np.insert(rings.points, after, at, axis=0)
    moved = order + np.searchsorted(after, order, side="right")
    new = after + np.arange(len(after))
    return Rings(points, rings.ends + np.searchsorted(after, rings.ends, side="right")), np.append(moved, new)


def _turns(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return -1, 0 or 1 (n,) if points c (n, 2) are right of, on or left of the lines from a to b.

    Exact on the grid.
    """
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    turns: Floats = np.sign(ux * vy - uy * vx)
    return turns


def crossings(rings: Rings) -> Floats:
    """Return the places (k, 2) where sides of ``rings`` cross each other [m], not on the grid.

    Triangle finds them as well, but may never end on them.
    """
    a, b = rings.points, rings.points[_next_points(rings)]
    sides = shapely.linestrings(np.stack([a, b], axis=1))
    # Pairs whose boxes meet. The exact test on the grid takes a tenth of the time of shapely's predicate.
    one, other = shapely.STRtree(sides).query(sides)
    one, other = one[one < other], other[one < other]
    cross = _turns(a[one], b[one], a[other]) * _turns(a[one], b[one], b[other]) < 0.0
    cross &= _turns(a[other], b[other], a[one]) * _turns(a[other], b[other], b[one]) < 0.0
    points: Floats = shapely.get_coordinates(shapely.intersection(sides[one[cross]], sides[other[cross]]))
    return points


def triangulation(rings: Rings, order: Ints, frame: NDArray[Any]) -> Triangulation:
    """Triangulate the box of ``frame``, (1,) FRAME, with the sides of ``rings``.

    Vertices are numbered behind the corners of the box in ``order`` (n,), a permutation of the points of the rings.

    Raises
    ------
    GeometryError
        If `triangle` is not installed, or if crossings moved to the grid keep making new ones.
    """
    package = _package()
    x0, y0, x1, y1, cell = frame[["x0", "y0", "x1", "y1", "cell"]][0].item()
    box = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    # Triangle drops all that no ring encloses, so the box is a ring.
    border = np.array([(0, 1), (1, 2), (2, 3), (0, 3)])
    for _ in range(_MOST_PASSES):
        # Crossings first become corners of the rings.
        met = crossings(rings)
        if len(met):
            rings, order = _through(rings, order, np.unique(snap(met, cell), axis=0), cell)
            continue
        corners, ids = _distinct(rings.points, order, frame)
        vertices, ids = np.concatenate([box, corners]), ids + BOX_CORNERS
        sides = np.sort(np.column_stack([ids, ids[_next_points(rings)]]), axis=1)
        sides = sides[sides[:, 0] != sides[:, 1]]
        # Switches of Triangle: p, keep the segments; n, return the neighbors.
        found = package.triangulate({"vertices": vertices, "segments": np.concatenate([border, sides])}, "pn")
        # Vertices that it added, where it found sides that still cross.
        met = found["vertices"][len(vertices) :]
        if len(met) == 0:
            return Triangulation(rings, ids, vertices, found["triangles"], found["neighbors"])
        rings, order = _through(rings, order, np.unique(snap(met, cell), axis=0), cell)
    raise GeometryError(
        f"builder: 'triangle' still finds crossing sides after {_MOST_PASSES} passes; use builder='own', or simplify "
        f"the walkable area"
    )


def fill(mesh: MeshArrays, found: Triangulation) -> None:
    """Enter vertices and triangles into an empty mesh that has room for them; ``build`` adds the constraints."""
    count, triangles = len(found.vertices), found.triangles.astype(np.int64)
    opposite = found.neighbors.astype(np.int64)[:, [2, 0, 1]]  # across the side that starts at each corner
    # The twin of side i -> i + 1 is the side of that neighbor that starts at corner i + 1.
    starts_there = triangles[opposite] == triangles[:, [1, 2, 0], None]
    twins = np.where(opposite < 0, -1, 3 * opposite + starts_there.argmax(axis=2))
    vertices, sides = mesh.vertices[:count], mesh.sides[: triangles.size]
    vertices["x"], vertices["y"] = found.vertices.T
    vertices["vref"] = np.bincount(found.ids, minlength=count)
    sides["org"], sides["twin"] = triangles.ravel(), twins.ravel()
    sides["use"] = sides["corner_clearance"] = -1
    vertices["vhe"][triangles.ravel()] = np.arange(triangles.size)
    mesh.frame["vertices"], mesh.frame["triangles"] = count, len(triangles)
