"""The environment of a recording as meshes: floor, solids and planned paths; all lengths and positions are in meters.

What lies on the floor is drawn a few millimeters above it, each kind at a height of its own, so that one hides the
other without flicker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import RecordingError
from crowdsim.playback.surfaces import Floats
from crowdsim.recording.header import MeshRecord, PlannedPath, RecordingHeader, SolidRecord

PATH_HEIGHT = 0.015
"""Height of planned paths above the floor [m]."""
_PATH_WIDTH = 0.045

_SHADOW_REACH = 0.3
"""Distance over which the shadow beside a solid fades out [m]."""
_SHADOW_HEIGHT = 0.006


@dataclass(frozen=True)
class FlatMesh:
    """Triangles (F, 3) over points (V, 3) [m]; an outline of L lines as pairs of points (2L, 3).

    Faces that meet at a crease do not share points, so that each is shaded flat.
    """

    points: Floats
    triangles: NDArray[np.int64]
    outline: Floats


def floor_mesh(header: RecordingHeader) -> FlatMesh:
    """Return the whole floor, also below obstacles, at z = 0."""
    polygons = _polygons(header.floor, "the floor")
    return _merge([_cap(polygon, 0.0) for polygon in polygons], [_ring_lines(polygon, 0.0) for polygon in polygons])


def solids_mesh(solids: Sequence[SolidRecord]) -> FlatMesh:
    """Return all of ``solids``, extruded from bottom to top, without the lower faces, which no camera sees."""
    parts: list[tuple[Floats, NDArray[np.int64]]] = []
    lines: list[Floats] = []
    for solid in solids:
        for polygon in _polygons(solid.footprint, f"solid '{solid.name}'"):
            polygon = shapely.remove_repeated_points(polygon, 1e-6)  # sides without length have no direction
            parts += [_cap(polygon, solid.top), *_sides(polygon, solid.bottom, solid.top)]
            lines += [
                _ring_lines(polygon, solid.top),
                _ring_lines(polygon, solid.bottom),
                _corner_lines(polygon, solid),
            ]
    return _merge(parts, lines)


def meshes_mesh(meshes: Sequence[MeshRecord]) -> FlatMesh:
    """Return all of ``meshes``; outlines run along borders and edges that bend by more than 25 degrees."""
    parts, lines = [], []
    for mesh in meshes:
        corners = np.asarray(mesh.points, np.float64)[mesh.triangles]
        parts.append((corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)))
        lines.append(_sharp_edges(corners))
    return _merge(parts, lines)


def path_ribbons(paths: Sequence[PlannedPath]) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return narrow ribbons on the floor: points (V, 3), triangles (F, 3), and the behavior of each triangle (F,)."""
    starts, ends, behaviors = [], [], []
    for path in paths:
        # A path has a behavior for each point, that of the piece which begins there.
        starts.append(path.points[:-1])
        ends.append(path.points[1:])
        behaviors.append(path.behaviors[:-1])
    if not starts:
        return np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty(0, np.int64)
    start, end, behavior = np.concatenate(starts), np.concatenate(ends), np.concatenate(behaviors)
    along = end - start
    length = np.hypot(along[:, 0], along[:, 1])
    keep = length > 1e-9  # pieces without length have no direction
    start, end, behavior = start[keep], end[keep], behavior[keep].astype(np.int64)
    along = along[keep] / length[keep, None]
    half = 0.5 * _PATH_WIDTH
    side = half * np.stack([-along[:, 1], along[:, 0]], axis=1)
    # Each piece extends a quarter of its width beyond both ends of its segment, so that no gap opens at a bend.
    start, end = start - 0.5 * half * along, end + 0.5 * half * along
    corners = np.stack([start - side, end - side, end + side, start + side], axis=1).reshape(-1, 2)
    points = np.column_stack([corners, np.full(len(corners), PATH_HEIGHT)])
    first = 4 * np.arange(len(start))[:, None]
    triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return points, triangles, np.tile(behavior, 2)


def paths_ahead(paths: Sequence[PlannedPath], x: NDArray[Any], y: NDArray[Any]) -> list[PlannedPath]:
    """Return the rest of each path, from the point nearest to its agent; x, y (N,) are the places of all agents [m].

    The path of an agent whose position is nan, and a path of a single point, are left out.
    """
    left = []
    for path in paths:
        place = np.array([x[path.agent], y[path.agent]], np.float64)
        if len(path.points) < 2 or not np.isfinite(place).all():
            continue
        starts, ways = path.points[:-1], np.diff(path.points, axis=0)
        lengths2 = np.maximum(np.sum(ways * ways, axis=1), 1e-12)
        shares = np.clip(np.sum((place - starts) * ways, axis=1) / lengths2, 0.0, 1.0)
        nearest = starts + shares[:, None] * ways
        piece = int(np.sum((nearest - place) * (nearest - place), axis=1).argmin())
        points = np.concatenate([nearest[piece : piece + 1], path.points[piece + 1 :]])
        left.append(PlannedPath(path.agent, path.step, points, path.behaviors[piece:]))
    return left


def contact_shadows(solids: Sequence[SolidRecord], floor: str) -> tuple[FlatMesh, NDArray[np.float64]]:
    """Return soft shadows on the floor around solids, and the darkness of each of their points, (V,) from 0 to 1.

    Solids that begin at _SHADOW_REACH above the floor or higher cast none; ``floor`` is WKT, to which shadows are cut.
    """
    standing = [solid for solid in solids if solid.bottom < _SHADOW_REACH]
    polygons = [part for solid in standing for part in _polygons(solid.footprint, f"solid '{solid.name}'")]
    if not polygons:
        return _merge([], []), np.zeros(0)
    # Drawing interpolates darkness linearly between points. Two bands, up to half of the reach and beyond, give a row
    # of points in the middle, so that what is drawn follows the square below more closely.
    footprint = shapely.union_all(polygons)
    ground = shapely.union_all(_polygons(floor, "the floor"))
    rims = [
        shapely.buffer(footprint, reach, quad_segs=4).difference(shapely.buffer(footprint, reach - 0.5 * _SHADOW_REACH))
        for reach in (0.5 * _SHADOW_REACH, _SHADOW_REACH)
    ]
    parts = [
        part for rim in rims for part in shapely.get_parts(rim.intersection(ground)) if part.geom_type == "Polygon"
    ]
    mesh = _merge([_cap(part, _SHADOW_HEIGHT) for part in parts], [])
    away = shapely.distance(footprint, shapely.points(mesh.points[:, :2]))
    dark = np.clip(1.0 - away / _SHADOW_REACH, 0.0, 1.0)
    return mesh, np.asarray(dark * dark)


def grid_lines(header: RecordingHeader, spacing: float = 1.0) -> Floats:
    """Return lines on the floor every ``spacing`` meters, as pairs of points (2L, 3)."""
    floor = shapely.union_all(_polygons(header.floor, "the floor"))
    low_x, low_y, high_x, high_y = floor.bounds
    xs = spacing * np.arange(np.ceil(low_x / spacing), np.floor(high_x / spacing) + 1)
    ys = spacing * np.arange(np.ceil(low_y / spacing), np.floor(high_y / spacing) + 1)
    lines = [shapely.LineString([(x, low_y), (x, high_y)]) for x in xs]
    lines += [shapely.LineString([(low_x, y), (high_x, y)]) for y in ys]
    cut = shapely.get_parts(shapely.intersection(np.array(lines, dtype=object), floor)) if lines else []
    pieces = [np.asarray(line.coords) for line in cut if line.geom_type == "LineString"]
    if not pieces:
        return np.empty((0, 3))
    ends = np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1).reshape(-1, 2) for piece in pieces])
    return np.column_stack([ends, np.full(len(ends), 0.004)])  # below all shadows


def _polygons(wkt: str, what: str) -> list[shapely.Polygon]:
    """Return the polygons of a recorded shape; raise RecordingError, which names ``what``, if its text is damaged."""
    try:
        shape = shapely.from_wkt(wkt)
    except shapely.errors.ShapelyError as error:
        raise RecordingError(
            f"the recording holds no usable shape for {what} ({error}); run the scenario again"
        ) from None
    return [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and not part.is_empty]


def _cap(polygon: shapely.Polygon, height: float) -> tuple[Floats, NDArray[np.int64]]:
    """Return points (n, 3) [m] and triangles (k, 3) that cover a polygon at a height, counter-clockwise from above."""
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = np.array([np.asarray(piece.exterior.coords)[:3] for piece in pieces]).reshape(-1, 3, 2)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    points = np.column_stack([corners.reshape(-1, 2), np.full(3 * len(corners), height)])
    return points, np.arange(len(points)).reshape(-1, 3)


def _rings(polygon: shapely.Polygon) -> list[Floats]:
    """Return the outline counter-clockwise and holes clockwise (the solid is on the left), first point repeated."""
    polygon = shapely.geometry.polygon.orient(polygon)
    return [np.asarray(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]


def _sides(polygon: shapely.Polygon, bottom: float, top: float) -> list[tuple[Floats, NDArray[np.int64]]]:
    """Return the walls of a prism from ``bottom`` to ``top`` [m]: corners (k, 3) and triangles (t, 3) for each ring."""
    parts = []
    for ring in _rings(polygon):
        a, b = ring[:-1], ring[1:]
        low, high = np.full(len(a), bottom), np.full(len(a), top)
        corners = np.stack(
            [
                np.column_stack([a, low]),
                np.column_stack([b, low]),
                np.column_stack([b, high]),
                np.column_stack([a, high]),
            ],
            axis=1,
        )
        first = 4 * np.arange(len(a))[:, None]
        parts.append((corners.reshape(-1, 3), np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])))
    return parts


def _ring_lines(polygon: shapely.Polygon, height: float) -> Floats:
    """Return the sides of outline and holes at a height [m], as pairs of points (2L, 3)."""
    pieces = [np.stack([ring[:-1], ring[1:]], axis=1).reshape(-1, 2) for ring in _rings(polygon)]
    ends = np.concatenate(pieces)
    return np.column_stack([ends, np.full(len(ends), height)])


def _corner_lines(polygon: shapely.Polygon, solid: SolidRecord) -> Floats:
    """Return upright edges at which the outline turns by more than 25 degrees, as pairs of points (2L, 3).

    Round columns, whose outlines turn by less at each of their corners, have none.
    """
    uprights = []
    for ring in _rings(polygon):
        step = np.diff(ring, axis=0)
        before = np.roll(step, 1, axis=0)
        turn = np.arctan2(before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0], np.sum(before * step, axis=1))
        corner = ring[:-1][np.abs(turn) > np.radians(25.0)]
        pair = np.repeat(corner, 2, axis=0)
        heights = np.tile([solid.bottom, solid.top], len(corner))
        uprights.append(np.column_stack([pair, heights]))
    return np.concatenate(uprights)


def _sharp_edges(corners: Floats) -> Floats:
    """Return the edges of triangles (T, 3, 3) that a drawing needs, as pairs of points (2L, 3).

    These are the edges of one triangle alone, and those at which triangles meet at more than 25 degrees. As files list
    corners either way round, a fold by more than 155 degrees counts as flat.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # Files repeat a point for each face: merge those that are equal to 0.1 mm.
    _, index = np.unique(np.round(corners.reshape(-1, 3), 4), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    ends = np.stack([index, np.roll(index, -1, axis=1)], axis=2).reshape(-1, 2)
    _, edge, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    # Compare the normal of each triangle with that of the first one at the same edge: the absolute value of their
    # product is the cosine of the bend, whichever way round the corners are listed. Of several writes to one edge the
    # last counts, so in reverse order the first remains. The least cosine of an edge is that of its sharpest bend.
    normal = np.repeat(normals, 3, axis=0)
    first = np.full(len(count), -1)
    first[edge[::-1]] = np.arange(len(edge))[::-1]
    along = np.abs(np.sum(normal * normal[first[edge]], axis=1))
    flattest = np.ones(len(count))
    np.minimum.at(flattest, edge, along)
    sharp = (count == 1) | (flattest < np.cos(np.radians(25.0)))
    points = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    edges: Floats = points[first[sharp]].reshape(-1, 3)
    return edges


def _merge(parts: Sequence[tuple[Floats, NDArray[np.int64]]], lines: Sequence[Floats]) -> FlatMesh:
    """Return parts, each points (n, 3) and triangles (t, 3), and lines (2L, 3) as one mesh, triangles renumbered."""
    points = np.concatenate([np.empty((0, 3)), *(points for points, _ in parts)])
    firsts = np.cumsum([0, *(len(points) for points, _ in parts)])
    triangles = [triangles + first for (_, triangles), first in zip(parts, firsts, strict=False)]
    return FlatMesh(
        points,
        np.concatenate([np.empty((0, 3), np.int64), *triangles]),
        np.concatenate([np.empty((0, 3)), *lines]),
    )
