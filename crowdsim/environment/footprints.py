"""Footprints of solids of triangles in a band of heights, of many at once.

The footprint in a band of heights is the union of the projections of its triangles, clipped to the band, and of the
areas that its sections enclose; docs/places.md says why neither alone is right. Arrays hold the triangles of all
solids, as a place may have thousands of small ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.environment.sections import DIGITS, enclosed, section_segments, snapped_union, snapped_unions
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.polygons import buffered
from crowdsim.processors import usable_processors

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Shapes = NDArray[np.object_]

STRIP = 5e-3
"""Width that a surface seen edge-on counts with, such as a sheet of wall [m]."""

GRID = 1e-5
"""Grid that footprints are rounded to, so that the union of many triangles is robust [m]."""

PINHOLE = 0.1
"""Area below which holes in the footprint of one solid are filled, such as the inside of a bucket [m2]."""

_LARGEST = 200
"""Number of the largest pieces that are joined before the others."""

_COVERED = 1e-3
"""How far an edge-on surface may stand out of the rest of the footprint before it gets a strip [m]."""

_SMOOTHING = 5e-4
"""How far corners of the footprint may move when its outline is straightened [m]."""

_LEAST_LINE = 1e-4
"""Length of the line that a surface seen as a point counts as [m]."""

CORNER_PAIRS = ((0, 1), (1, 2), (2, 0))
"""The edges of a triangle, as indices of its corners."""


_TRIANGLES_AT_ONCE = 20_000
"""Number of triangles whose footprints are computed together."""


class Triangles(Protocol):
    """A solid of triangles."""

    @property
    def corners(self) -> Floats:
        """Return the corners (m, 3, 3) of each triangle [m]."""
        ...

    @property
    def closed(self) -> bool:
        """Return whether the triangles enclose a volume."""
        ...

    @property
    def bottom(self) -> float:
        """Return the height of the lowest corner [m]."""
        ...

    @property
    def top(self) -> float:
        """Return the height of the highest corner [m]."""
        ...


def footprints_of(
    solids: Sequence[Triangles], low: float, high: float, progress: Callable[[int], None] | None = None
) -> Shapes:
    """Return the footprint (n,) of each solid in the band from ``low`` to ``high`` [m], which all of them meet.

    Places have many copies of one chair: the footprint of the first one is moved to the others. ``progress`` is called
    with the number of solids that are done, if there are too many triangles to treat at once.
    """
    originals, of, moved = _copies(solids)
    blocks = list(_blocks([solids[number] for number in originals]))
    if len(blocks) < 2:
        return _moved(_block(blocks[0], low, high)[of] if blocks else objects([]), moved)
    found = [objects([])]
    # Overlays of shapes, which take most of the time, run side by side; the results are the same with any number.
    with ThreadPoolExecutor(usable_processors()) as pool:
        for areas in pool.map(lambda block: _block(block, low, high), blocks):
            found.append(areas)
            if progress is not None:
                # Done are all solids that are like an original done so far.
                progress(int((of < sum(map(len, found))).sum()))
    return _moved(np.concatenate(found)[of], moved)


def _copies(solids: Sequence[Triangles]) -> tuple[list[int], Ints, Floats]:
    """Find solids that are copies of an earlier one, moved along the floor.

    Copies have the same triangles in the same order and at the same heights, to :data:`GRID`. Returned are the indices
    of solids that are no copies, the position (n,) among these of the one that each solid is like, and how far it is
    moved from there (n, 2) [m].
    """
    originals: list[int] = []
    of, moved = np.zeros(len(solids), np.int64), np.zeros((len(solids), 2))
    seen: dict[bytes, int] = {}
    for number, solid in enumerate(solids):
        first = solid.corners[0, 0, :2]
        shape = np.rint((solid.corners - np.array([*first, 0.0])) / GRID).astype(np.int64).tobytes()
        of[number] = seen.setdefault(shape, len(originals))
        if of[number] == len(originals):
            originals.append(number)
        moved[number] = first - solids[originals[of[number]]].corners[0, 0, :2]
    return originals, of, moved


def _moved(areas: Shapes, offsets: Floats) -> Shapes:
    """Return areas (n,), each moved by its offset (n, 2) [m]."""
    points, owners = shapely.get_coordinates(areas, return_index=True)
    moved: Shapes = shapely.set_coordinates(areas.copy(), points + offsets[owners])
    return moved


def objects(values: Sequence[Any]) -> Shapes:
    """Return an array (n,) with the n ``values`` as objects, of which numpy makes no further dimensions."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def _blocks(solids: Sequence[Triangles]) -> Iterator[Sequence[Triangles]]:
    """Yield the solids in their order, in blocks of about as many triangles as are treated at once."""
    begin = count = 0
    for number, solid in enumerate(solids):
        count += len(solid.corners)
        if count >= _TRIANGLES_AT_ONCE or number == len(solids) - 1:
            yield solids[begin : number + 1]
            begin, count = number + 1, 0


def _block(solids: Sequence[Triangles], low: float, high: float) -> Shapes:
    """Return the footprint (n,) of each solid of a block in the band from ``low`` to ``high`` [m]."""
    counts = [len(solid.corners) for solid in solids]
    corners = np.concatenate([solid.corners for solid in solids])
    shapes, longest, owners = _pieces(corners, np.repeat(np.arange(len(solids)), counts), low, high)
    # The width of a piece, as if it were a triangle: its height over the longest side. Wide pieces have an area; narrow
    # ones, which upright triangles leave, count as strips. Between the two limits a piece is both.
    lengths = hypot(*(longest[:, 1] - longest[:, 0]).T)
    widths = 2.0 * shapely.area(shapes) / np.maximum(lengths, GRID)
    wide, narrow = widths > GRID, widths < STRIP
    parts = np.split(shapes[wide], np.searchsorted(owners[wide], np.arange(1, len(solids))))
    areas = _unions(
        [np.concatenate([_inside(solid, low, high), part]) for solid, part in zip(solids, parts, strict=True)]
    )
    footprints = with_strips(areas, longest[narrow], owners[narrow])
    # No triangle in the open band: nothing of the solid is in it.
    without = np.bincount(owners, minlength=len(solids)) == 0
    footprints[without] = shapely.Polygon()
    return footprints


def _inside(solid: Triangles, low: float, high: float) -> Shapes:
    """Return the areas (k,) that sections of a solid enclose in the band from ``low`` to ``high`` [m].

    k is the number of sections that are needed: 3, 1 or 0.
    """
    # Cuts just above (True) or below a height, so that they are in the open band. A solid that is not closed is cut at
    # bottom, middle and top of its part; for closed ones see `MeshSolid.closed`.
    lowest, highest = max(low, solid.bottom), min(high, solid.top)
    middle = 0.5 * (lowest + highest)
    if not solid.closed:
        cuts = [(lowest, True), (middle, True), (highest, False)]
    # A closed solid that spans the band: a vertical line may be inside of it all along, without any triangle.
    elif solid.bottom <= low and solid.top >= high:
        cuts = [(middle, True)]
    else:
        # All that is inside has a triangle of the band above or below it.
        cuts = []
    return objects([enclosed(section_segments(solid.corners, z, above)) for z, above in cuts])


def _pieces(corners: Floats, owners: Ints, low: float, high: float) -> tuple[Shapes, Floats, Ints]:
    """Return the part of each triangle in the open band from ``low`` to ``high`` [m], seen from above.

    ``corners`` (m, 3, 3) are the corners of the triangles [m], ``owners`` (m,) the indices of their solids. Returned
    are outlines (k,), their two points farthest apart (k, 2, 2) [m], and their owners (k,), ascending. Triangles
    outside of the band have no part. Outlines of upright triangles are degenerate.
    """
    heights = corners[:, :, 2]
    least, most = heights.min(axis=1), heights.max(axis=1)
    meets = (least < high) & (most > low)
    whole = meets & (least >= low) & (most <= high)
    partly = meets & ~whole
    flat = corners[whole, :, :2]
    points, valid = _clipped(corners[partly], low, high)
    rows = np.broadcast_to(np.arange(len(points))[:, None], valid.shape)[valid]
    clipped = shapely.convex_hull(shapely.multipoints(points[valid], indices=rows)) if len(points) else objects([])
    # The first valid point stands in for the missing ones, which changes no distance.
    first = np.take_along_axis(points, valid.argmax(axis=1)[:, None, None], axis=1) if len(points) else points
    filled = np.where(valid[:, :, None], points, first)
    shapes = np.concatenate([shapely.polygons(flat) if len(flat) else objects([]), clipped])
    longest = np.concatenate([_farthest(flat), _farthest(filled)])
    found = np.concatenate([owners[whole], owners[partly]])
    order = np.argsort(found, kind="stable")
    return shapes[order], longest[order], found[order]


def _clipped(corners: Floats, low: float, high: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Clip triangles (k, 3, 3) to a band [m]: return candidates (k, 9, 2) for corners of the parts, and which exist.

    The band reaches from ``low`` to ``high``, bounds included.
    The candidates are the three corners, and the points at which the three edges cross the two bounds of the band.
    Those that exist (k, 9) are the corners of a convex part, in no order; the places of the others mean nothing.
    """
    heights = corners[:, :, 2]
    points, valid = [corners[:, :, :2]], [(heights >= low) & (heights <= high)]
    for first, second in CORNER_PAIRS:
        swap = heights[:, first] > heights[:, second]
        # From the lower to the upper end, so that both triangles at an edge get the same point, bit by bit.
        lower = np.where(swap[:, None], corners[:, second], corners[:, first])
        upper = np.where(swap[:, None], corners[:, first], corners[:, second])
        rise = upper[:, 2] - lower[:, 2]
        for height in (low, high):
            crosses = (lower[:, 2] < height) & (upper[:, 2] > height)
            share = np.where(crosses, (height - lower[:, 2]) / np.where(crosses, rise, 1.0), 0.0)
            points.append(np.round(lower[:, :2] + share[:, None] * (upper[:, :2] - lower[:, :2]), DIGITS)[:, None])
            valid.append(crosses[:, None])
    return np.concatenate(points, axis=1), np.concatenate(valid, axis=1)


def _unions(groups: Sequence[Shapes]) -> Shapes:
    """Return the union (n,) of each of n groups of polygons or lines; that of an empty group is empty.

    In a group of more than 2 * _LARGEST, those inside of the union of the _LARGEST largest ones are skipped, to save
    time.
    """
    unions = objects([None] * len(groups))
    sizes = np.array([len(group) for group in groups], np.int64)
    for number in np.flatnonzero(sizes > 2 * _LARGEST).tolist():
        shapes = groups[number][np.argsort(-shapely.area(groups[number]), kind="stable")]
        large = snapped_union(shapes[:_LARGEST], GRID)
        shapely.prepare(large)
        small = shapes[_LARGEST:]
        unions[number] = snapped_union(np.concatenate([[large], small[~shapely.covers(large, small)]]), GRID)
    # The other groups together: shapely takes arrays with rows of one length. Groups with the same next power of two,
    # 2 ** place, as their size form one array, filled up with None.
    places = np.frexp(np.maximum(sizes, 1) - 1.0)[1].astype(np.int64)
    for place in np.unique(places[sizes <= 2 * _LARGEST]).tolist():
        chosen = np.flatnonzero((places == place) & (sizes <= 2 * _LARGEST))
        rows = np.full((len(chosen), 1 << place), None, dtype=object)
        for row, number in enumerate(chosen.tolist()):
            rows[row, : sizes[number]] = groups[number]
        unions[chosen] = snapped_unions(rows, GRID)
    return unions


def _farthest(points: Floats) -> Floats:
    """Return the two points (k, 2, 2) farthest apart among the p points of each row of (k, p, 2)."""
    first, second = np.triu_indices(points.shape[1], 1)
    apart = np.square(points[:, first] - points[:, second]).sum(axis=2)
    pair = apart.argmax(axis=1)
    rows = np.arange(len(points))
    return np.stack([points[rows, first[pair]], points[rows, second[pair]]], axis=1)


def with_strips(areas: Shapes, segments: Floats, owners: Ints) -> Shapes:
    """Return areas (n,) with strips along those parts of segments that stand out of them, and without pinholes.

    ``segments`` (k, 2, 2) are lines [m], seen from above. ``owners`` (k,), ascending, are the indices of the areas that
    they belong to.
    """
    areas = areas.copy()
    # A surface seen as a point has no direction: it counts as a short line along x.
    short = hypot(*(segments[:, 1] - segments[:, 0]).T) < _LEAST_LINE
    ends = segments.copy()
    ends[short, 1, 0] = ends[short, 0, 0] + _LEAST_LINE
    lines = shapely.linestrings(ends) if len(ends) else objects([])
    # Lines inside of their area, grown by _COVERED, are left out, and others cut at it. Lines whose area is empty stay.
    is_beside = ~shapely.is_empty(areas)[owners]
    around = objects([None] * len(areas))
    near = np.unique(owners[is_beside])
    around[near] = buffered(areas[near], _COVERED, join_style="mitre")
    shapely.prepare(around)
    kept = ~is_beside
    kept[is_beside] = ~shapely.covers(around[owners[is_beside]], lines[is_beside])
    cut = kept & is_beside
    lines[cut] = shapely.difference(lines[cut], around[owners[cut]])
    kept &= ~shapely.is_empty(lines)
    standing = np.unique(owners[kept])
    if len(standing):
        groups = np.split(lines[kept], np.searchsorted(owners[kept], standing[1:]))
        # Square ends make strips meet the area again, from which they were cut by ``_COVERED``.
        merged = shapely.line_merge(_unions(groups))
        strips = buffered(merged, 0.5 * STRIP, cap_style="square", join_style="mitre")
        areas[standing] = snapped_unions(np.stack([areas[standing], strips], axis=1), GRID)
    return _without_pinholes(areas)


def _without_pinholes(areas: Shapes) -> Shapes:
    """Return each area (n,) as polygons alone, without slivers; fill holes below PINHOLE, and straighten outlines.

    Corners are left out if the outline moves by at most _SMOOTHING. An area of which nothing is left is an empty
    polygon.
    """
    parts, owners = shapely.get_parts(areas, return_index=True)
    is_polygon = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    parts, owners = shapely.simplify(parts[is_polygon], _SMOOTHING), owners[is_polygon]
    for number in np.flatnonzero(shapely.get_num_interior_rings(parts)).tolist():
        holes = np.array(parts[number].interiors, dtype=object)
        large = shapely.area(shapely.polygons(holes)) >= PINHOLE
        if not large.all():
            parts[number] = shapely.Polygon(parts[number].exterior, list(holes[large]))
    # Slivers that rounding leaves are dropped.
    is_kept = shapely.area(parts) > GRID * STRIP
    parts, owners = parts[is_kept], owners[is_kept]
    counts = np.bincount(owners, minlength=len(areas))
    found = objects([shapely.Polygon()] * len(areas))
    single = counts[owners] == 1
    found[owners[single]] = parts[single]
    several = np.flatnonzero(counts > 1)
    # Straightened parts, or those in holes that were filled, may touch others.
    found[several] = [snapped_union(parts[owners == number], GRID) for number in several.tolist()]
    return found
