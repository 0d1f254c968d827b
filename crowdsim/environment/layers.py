"""From solids to clearance layers: what each height band of a body may not walk through."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shapely import MultiPolygon, Polygon, union_all
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.solids import Solid
from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import clean_polygon


@dataclass(frozen=True)
class Band:
    """A range of heights above the floor, meters."""

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise GeometryError(f"layer '{self.name}': its high {self.high} m must lie above its low {self.low} m")


LEGS = Band("legs", 0.10, 2.0)
TORSO = Band("torso", 0.80, 1.50)


@dataclass(frozen=True)
class ClearanceLayer:
    """One band with the area its part of a body cannot enter, and the floor that is left.

    ``obstacles`` is not clipped to the floor; ``free`` is. Both are valid and hold polygons only.
    """

    name: str
    low: float
    high: float
    obstacles: MultiPolygon
    free: MultiPolygon


def clearance_layers(floor: Polygon, solids: Sequence[Solid], bands: Sequence[Band]) -> tuple[ClearanceLayer, ...]:
    """Project the solids of each band onto the floor.

    A solid belongs to a band if part of it lies strictly inside the band's heights. The lowest band is the ground
    layer, on which paths are found: it holds every solid of any band, so that a place that is free on the ground is
    free in every layer (2018 paper, section 3.2).

    Returns
    -------
    tuple of ClearanceLayer
        Lowest band first; of two that start at one height the one that reaches higher comes first.

    Raises
    ------
    GeometryError
        If there are no bands, two of one name, or the floor has no area.
    """
    names = [band.name for band in bands]
    if not names or len(set(names)) < len(names):
        raise GeometryError(f"clearance layers need distinct names, got {names}")
    walkable = clean_polygon(floor, "floor")
    ordered = sorted(bands, key=lambda band: (band.low, -band.high, band.name))
    layers = []
    for number, band in enumerate(ordered):
        members = [s for s in solids if any(s.overlaps(b.low, b.high) for b in (ordered if number == 0 else [band]))]
        obstacles = union_all([solid.footprint for solid in members])
        free = walkable.difference(obstacles)
        layers.append(ClearanceLayer(band.name, band.low, band.high, polygons_only(obstacles), polygons_only(free)))
    return tuple(layers)


def dropped_solids(solids: Sequence[Solid], bands: Sequence[Band]) -> tuple[Solid, ...]:
    """Solids that no band meets: carpets and thresholds below all of them, lamps and ceilings above."""
    return tuple(solid for solid in solids if not any(solid.overlaps(band.low, band.high) for band in bands))


def polygons_only(geometry: BaseGeometry) -> MultiPolygon:
    """The parts of ``geometry`` that have an area; lines and points that overlays leave behind go."""
    parts = [geometry]
    while any(hasattr(part, "geoms") for part in parts):
        parts = [inner for part in parts for inner in getattr(part, "geoms", [part])]
    return MultiPolygon([part for part in parts if isinstance(part, Polygon) and not part.is_empty])
