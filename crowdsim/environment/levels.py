"""Level surfaces of a scene: where people could walk, and if that is in two storeys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.footprints import GRID
from crowdsim.environment.layers import AnySolid, areas_between, polygons_only
from crowdsim.environment.sections import snapped_union
from crowdsim.environment.solids import Solid
from crowdsim.errors import PlaceError
from crowdsim.geometry.polygons import buffered

STEP = 0.10
"""Height [m] above the floor up to which something is walked over."""

HEADROOM = 1.9
"""Free height that people need to stand [m]."""

LEAST_LEVEL = 4.0
"""Area of the smallest surface that counts as a level to walk on [m2]."""

_FLAT = 0.99
"""Least vertical component of a level surface's normal."""

SAME_LEVEL = 0.05
"""Greatest difference of heights on one level [m]."""

_BODY = 0.2
"""Half the width of the narrowest surface that is walked on, so not the tops of walls [m]."""

_LINED = 0.5
"""Least share of a floor's outline with walls along it if there is a ceiling over it."""


@dataclass(frozen=True)
class Level:
    """Surfaces at about one height [m]."""

    height: float
    surface: BaseGeometry
    parts: NDArray[np.int64]
    """(k,) indices of all solids with a surface at this height, wide or not; none for ground without a surface."""


Surfaces = tuple[NDArray[np.object_], NDArray[np.float64], NDArray[np.int64]]
"""Polygons (n,), their heights (n,) [m], and the indices of their solids (n,)."""


def level_surfaces(solids: Sequence[AnySolid], both: bool) -> Surfaces:
    """Return the level triangles of meshes that face up or, with ``both``, up or down, and the tops of prisms."""
    shapes: list[NDArray[np.object_]] = []
    heights, owners = [], []
    for number, solid in enumerate(solids):
        if isinstance(solid, Solid):
            shapes.append(np.array([solid.footprint], dtype=object))
            heights.append([solid.top])
        else:
            corners = solid.corners
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            lengths = np.linalg.norm(normals, axis=1)
            upright = np.abs(normals[:, 2]) if both else normals[:, 2]
            # The length of the cross product is twice the area [m2]: triangles without an area have no normal.
            level = (upright > _FLAT * lengths) & (lengths > 1e-9)
            shapes.append(shapely.polygons(corners[level, :, :2]) if level.any() else np.empty(0, object))
            heights.append(corners[level, :, 2].mean(axis=1))
        owners.append(np.full(len(shapes[-1]), number, np.int64))
    return np.concatenate(shapes), np.concatenate(heights), np.concatenate(owners)


def find_levels(
    shapes: NDArray[np.object_], heights: NDArray[np.float64], owners: NDArray[np.int64], within: BaseGeometry | None
) -> list[Level]:
    """Find levels wide and large enough to walk on, lowest first; only parts ``within`` an outline if one is given.

    ``shapes`` (n,) are the outlines of horizontal surfaces, ``heights`` (n,) where they lie [m], ``owners`` (n,) the
    indices of the solids that they belong to.
    """
    order = np.argsort(heights, kind="stable")
    shapes, heights, owners = shapes[order], heights[order], owners[order]
    areas = shapely.area(shapes)
    levels = []
    first = 0
    while first < len(heights):
        # Surfaces up to SAME_LEVEL above the lowest one are one level; the next one begins above them.
        last = int(np.searchsorted(heights, heights[first] + SAME_LEVEL, side="right"))
        if areas[first:last].sum() >= LEAST_LEVEL:
            # The median height by area: that of a large floor, even if there are many small surfaces.
            share = np.cumsum(areas[first:last])
            height = rounded_height(heights[first + int(np.searchsorted(share, 0.5 * share[-1]))])
            surface = snapped_union(shapes[first:last], GRID)
            surface = _wide(surface if within is None else surface.intersection(within))
            if surface.area >= LEAST_LEVEL:
                levels.append(Level(height, surface, np.unique(owners[first:last])))
        first = last
    return levels


def rounded_height(height: float) -> float:
    """Round a height to a micrometer, so that a floor drawn at 0 stays there."""
    # Adding 0 turns -0.0 into 0.0.
    return round(float(height), 6) + 0.0


def _wide(area: BaseGeometry) -> BaseGeometry:
    """Return the parts of ``area`` wide enough for a body: shrunk until narrow parts vanish, and grown again."""
    return polygons_only(buffered(buffered(area, -_BODY, join_style="mitre"), _BODY, join_style="mitre"))


def one_storey(levels: list[Level], solids: Sequence[AnySolid], report: list[str]) -> list[Level]:
    """Return ``levels``, lowest first, without ceilings seen from above, which are reported.

    Raise PlaceError if two levels, one at least HEADROOM above the other, both offer standing room on LEAST_LEVEL or
    more of the same ground, and the upper one is no ceiling.
    """
    kept: list[Level] = []
    for level in levels:
        # People can stand on a lower level only if this level leaves headroom over it.
        for lower in [other for other in kept if level.height >= other.height + HEADROOM]:
            both = _wide(lower.surface.intersection(level.surface))
            # What solids block costs more to compute: only if the levels overlap at all.
            if both.area >= LEAST_LEVEL:
                both = _wide(both.difference(_blocked(lower, solids)).difference(_blocked(level, solids)))
            if both.area < LEAST_LEVEL:
                continue
            if not _is_ceiling(level, lower, solids):
                x, y = both.representative_point().coords[0]
                raise PlaceError(
                    f"floor: around ({x:.2f}, {y:.2f}) people could walk at {lower.height:.3g} m and, above that, at "
                    f"{level.height:.3g} m ({both.area:.1f} m2), but a place has only one floor: take the parts of "
                    f"one storey, or give the floor's outline and its height"
                )
            report.append(
                f"floor: the level at {level.height:.3g} m is a ceiling seen from above: nothing stands on it"
            )
            break
        else:
            kept.append(level)
    return kept


def _blocked(level: Level, solids: Sequence[AnySolid]) -> BaseGeometry:
    """Return the area within the headroom over ``level`` that solids take, so that people cannot stand there."""
    return shapely.union_all(areas_between(solids, level.height + STEP, level.height + HEADROOM))


def _is_ceiling(level: Level, lower: Level, solids: Sequence[AnySolid]) -> bool:
    """Return True if ``level`` is a ceiling over ``lower``, not another floor that people could walk on.

    A ceiling covers most of the lower level (0.8 of its area), nothing taller than a meter stands on it, and walls run
    within 0.3 m of at least the share _LINED of the lower level's outline.
    """
    if shapely.intersection(level.surface, lower.surface).area < 0.8 * lower.surface.area:
        return False
    tall = [solid for solid in solids if solid.top > level.height + 1.0]
    on_top = areas_between(tall, level.height + STEP, level.height + HEADROOM)
    if any(shapely.intersects(level.surface, shape) for shape in on_top):
        return False
    # Walls are what reaches above furniture, between 1 m and head height.
    walls = shapely.union_all(areas_between(solids, lower.height + 1.0, lower.height + HEADROOM))
    outline = lower.surface.boundary
    return bool(outline.intersection(buffered(walls, 0.3)).length >= _LINED * outline.length)
