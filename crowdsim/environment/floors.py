"""The walkable floor of a place, found or given, and the parts that are no obstacles on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.footprints import GRID
from crowdsim.environment.layers import AnySolid, polygons_only
from crowdsim.environment.levels import (
    LEAST_LEVEL,
    SAME_LEVEL,
    STEP,
    Level,
    Surfaces,
    find_levels,
    level_surfaces,
    one_storey,
    rounded_height,
)
from crowdsim.environment.sections import snapped_union
from crowdsim.environment.solids import Solid
from crowdsim.errors import GeometryError, PlaceError
from crowdsim.geometry.polygons import buffered, clean_polygon

CEILING = 2.0
"""Height above the floor [m] from which large parts count as ceilings."""

_SEAM = 0.15
"""Half the width of the gaps in the floor that are closed: those under walls and doors between rooms [m]."""

_DOOR = 0.75
"""Half the width of the doors that are closed to see what walls enclose [m]."""

_LEAST_SHARE = 0.25
"""Least share of a place's area that its floor covers; smaller level surfaces may be tables."""


@dataclass(frozen=True)
class DerivedFloor:
    """A floor found in a scene.

    Attributes
    ----------
    polygon
        The area of the floor [m], with the obstacles on it.
    height
        Height of the floor in the scene [m].
    report
        What was found and assumed, one line each.
    """

    polygon: Polygon | MultiPolygon
    height: float
    report: tuple[str, ...]


@dataclass(frozen=True)
class SolidsOnFloor:
    """A floor at height 0 and the solids on it, moved with the floor.

    Attributes
    ----------
    solids
        The solids that are obstacles.
    kept
        Their indices among the given solids.
    floor
        The walkable area [m].
    report
        What was found and assumed, one line each.
    """

    solids: tuple[AnySolid, ...]
    kept: tuple[int, ...]
    floor: Polygon | MultiPolygon
    report: tuple[str, ...]


def place_on_floor(
    solids: Sequence[AnySolid], floor: Polygon | MultiPolygon | None = None, height: float | None = None
) -> SolidsOnFloor:
    """Move solids so that the floor is at height 0, and drop those that are no obstacles.

    Parameters
    ----------
    solids
        The parts of a scene.
    floor
        The walkable floor [m]; by default :func:`derive_floor` finds it.
    height
        Height of the floor in the scene [m]; by default it is found, or 0 if there are no solids. If it is given, the
        choice of the storey is the caller's; if ``floor`` is given as well, no floor is looked for.

    Raises
    ------
    PlaceError
        If the floor or its height cannot be found, or if ``height`` is not given and there are two walkable heights
        over one point.
    GeometryError
        If the given floor is no polygon with an area, or the height is not finite.
    """
    found: DerivedFloor | None = None
    if height is not None and not math.isfinite(height):
        raise GeometryError(f"floor: its height {height} m must be a finite number")
    if floor is not None:
        floor = clean_polygon(floor, "floor")
    if floor is None or (height is None and solids):
        found = derive_floor(solids, height, floor)
    report = list(found.report) if found else []
    base = found.height if found else height or 0.0
    polygon = floor if floor is not None or found is None else clean_polygon(found.polygon, "floor")
    assert polygon is not None
    roles = [_role(solid, base) for solid in solids]
    dropped = {role: [solid for solid, its in zip(solids, roles, strict=True) if its == role] for role in _ROLES}
    report += [f"dropped {_ROLES[role]}: {_names(parts)}" for role, parts in dropped.items() if parts]
    kept = [number for number, role in enumerate(roles) if role is None]
    moved = [solids[number].lifted(-base) if base else solids[number] for number in kept]
    return SolidsOnFloor(tuple(moved), tuple(kept), polygon, tuple(report))


_ROLES = {
    "below": "as they lie below the floor",
    "flat": f"as they are the floor or rise less than {STEP:g} m from it",
    "ceiling": f"as ceilings, {CEILING:g} m or more above the floor",
}


def _role(solid: AnySolid, height: float) -> str | None:
    """Return why a solid is no obstacle over a floor at ``height`` (a key of ``_ROLES``); None if it is one."""
    if solid.top < height - STEP:
        return "below"
    if solid.top <= height + STEP:
        return "flat"
    if solid.bottom >= height + CEILING and solid.footprint.area >= LEAST_LEVEL:
        return "ceiling"
    return None


def _names(solids: Sequence[AnySolid]) -> str:
    """List the names of up to six solids for the report."""
    names = [f"'{solid.name}'" for solid in solids[:6]]
    return ", ".join(names) + (f" and {len(solids) - 6} more" if len(solids) > 6 else "")


def derive_floor(
    solids: Sequence[AnySolid], height: float | None = None, within: Polygon | MultiPolygon | None = None
) -> DerivedFloor:
    """Find the floor: the lowest of the large level surfaces or, if there is none, the ground that walls enclose.

    A level consists of level surfaces at about one height, wide enough to walk on. Only surfaces that face up count; if
    these give no large level, those that face down count as well. All level surfaces up to :data:`STEP` above or below
    the chosen level belong to the floor, and seams between rooms are closed. Without a large level, the ground is the
    area that the outlines of all parts enclose, at the height on which most of them stand.

    Parameters
    ----------
    solids
        The parts of a scene.
    height
        Height of the wanted floor [m]; by default that of the lowest large level whose area is at least half that of
        the largest level.
    within
        Outline of the floor if that is known and only its height is not; surfaces elsewhere are ignored.

    Raises
    ------
    PlaceError
        If there is no part, or no level within :data:`STEP` of ``height``; if there is no large level, and the parts
        enclose less ground than :data:`LEAST_LEVEL`; or if ``height`` is not given, and two levels, one above the
        other, both offer standing room on :data:`LEAST_LEVEL` or more, unless the upper one is a ceiling.
    """
    if not solids:
        raise PlaceError("floor: there are no parts to find a floor from; give a floor")
    facing_up = level_surfaces(solids, both=False)
    surfaces: Surfaces | None = facing_up
    levels = find_levels(*facing_up, within)
    points = np.concatenate([_outline_points(solid) for solid in solids])
    extent = shapely.convex_hull(shapely.multipoints(points)) if within is None else within
    report = []
    if not _large(levels, extent):
        # Single sheets may face down, but so do ceilings, so they count only if no floor faces up.
        facing_any = level_surfaces(solids, both=True)
        surfaces, levels = facing_any, find_levels(*facing_any, within)
        if _large(levels, extent):
            report.append("floor: no large surface faces up, so surfaces that face down count as floor, too")
        else:
            # No floor at all: take the ground as a level.
            surfaces = None
            ground = _enclosed_ground(solids, extent, report) if within is None else within
            levels = sorted([_standing(solids, ground, report), *levels], key=lambda level: level.height)
    if height is None:
        levels = one_storey(levels, solids, report)
        # If the only large level was a ceiling, the others count.
        large = _large(levels, extent) or levels
        most = max(level.surface.area for level in large)
        chosen = next(level for level in large if level.surface.area >= 0.5 * most)
    else:
        near = [level for level in levels if abs(level.height - height) <= STEP]
        if not near:
            known = ", ".join(f"{level.height:.3g}" for level in levels)
            raise PlaceError(f"floor: there is no level surface at {height:g} m; there are some at {known} m")
        chosen = max(near, key=lambda level: level.surface.area)
    polygon, parts = _whole_floor(chosen, surfaces)
    polygon = polygon if within is None else within
    used = tuple(solids[number].name for number in parts if solids[number].top <= chosen.height + STEP)
    of = f" of {', '.join(map(repr, used[:4]))}{' and others' if len(used) > 4 else ''}" if used else ""
    given = " in the given outline" if within is not None else ""
    report.append(f"floor: {polygon.area:.1f} m2 at {chosen.height:.3g} m{given}{of}")
    report += [
        f"floor: a level of {other.surface.area:.1f} m2 at {other.height:.3g} m is not part of it"
        for other in levels
        if abs(other.height - chosen.height) > STEP
    ]
    return DerivedFloor(polygon, chosen.height, tuple(report))


def _outline_points(solid: AnySolid) -> NDArray[np.float64]:
    """Return the points (n, 2) of a solid as seen from above."""
    return (
        shapely.get_coordinates(solid.footprint) if isinstance(solid, Solid) else solid.corners[:, :, :2].reshape(-1, 2)
    )


def _large(levels: Sequence[Level], hull: BaseGeometry) -> list[Level]:
    """Return the levels that cover at least _LEAST_SHARE of ``hull``: large enough to be the floor.

    ``hull`` is the convex hull of all parts, or the floor's outline if that is known.
    """
    return [level for level in levels if level.surface.area >= _LEAST_SHARE * hull.area]


def _enclosed_ground(solids: Sequence[AnySolid], hull: BaseGeometry, report: list[str]) -> BaseGeometry:
    """Return the ground inside the outlines of all parts; ``hull`` if they enclose less than half of it. Report which.

    ``hull`` is the convex hull of all parts. Raise PlaceError if the ground is smaller than LEAST_LEVEL.
    """
    outlines = shapely.union_all([solid.footprint for solid in solids])
    # Grow the outlines until doors close, fill what is inside, and shrink it again by as much.
    closed = polygons_only(buffered(outlines, _DOOR, join_style="mitre"))
    filled = shapely.union_all([Polygon(part.exterior) for part in closed.geoms])
    ground = polygons_only(buffered(filled, -_DOOR, join_style="mitre"))
    how = "what the outlines of the parts enclose"
    if ground.area < 0.5 * hull.area:
        ground, how = hull, "the hull of all parts"
    if ground.area < LEAST_LEVEL:
        raise PlaceError(
            f"floor: there is no floor, and the parts enclose no more than {ground.area:.1f} m2; give a floor or units"
        )
    report.append(f"warning: there is no floor in the scene, so {how} is taken; give a floor if that is wrong")
    return ground


def _standing(solids: Sequence[AnySolid], ground: BaseGeometry, report: list[str]) -> Level:
    """Return ``ground`` as a level, at the height on which most parts stand, and report that.

    Parts stand at one height if their bottoms round to the same multiple of SAME_LEVEL; the height is their median.
    """
    bottoms = np.array([solid.bottom for solid in solids])
    steps, counts = np.unique(np.round(bottoms / SAME_LEVEL), return_counts=True)
    height = rounded_height(np.median(bottoms[np.round(bottoms / SAME_LEVEL) == steps[counts.argmax()]]))
    report.append(f"floor: taken to be at {height:.3g} m, where most parts stand")
    return Level(height, ground, np.empty(0, np.int64))


def _whole_floor(level: Level, surfaces: Surfaces | None) -> tuple[Polygon | MultiPolygon, NDArray[np.int64]]:
    """Return the floor with all level surfaces within a step of it, and the indices (k,) of the solids that make it.

    Without ``surfaces``, there is no large level surface: the floor is ``level`` as it is, usually the ground.
    """
    if surfaces is None:
        return level.surface, level.parts
    shapes, heights, owners = surfaces
    near = np.abs(heights - level.height) <= STEP
    area = snapped_union(shapes[near], GRID)
    # Grow the area until seams close, and shrink it again by as much.
    closed = polygons_only(buffered(buffered(area, _SEAM, join_style="mitre"), -_SEAM, join_style="mitre"))
    # Areas below 0.1 m2 are steps and sills, not floor.
    parts = [part for part in closed.geoms if part.area >= 0.1]
    # Small gaps that remain are those under legs and posts, which are obstacles anyway.
    polygon = parts[0] if len(parts) == 1 else MultiPolygon(parts)
    return shapely.simplify(polygon, 1e-4), np.unique(owners[near])
