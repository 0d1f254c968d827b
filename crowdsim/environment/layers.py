"""Clearance layers: the part of the floor that is free of solids in a band of heights, or at one height."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import shapely
from shapely import MultiPolygon, Polygon, union_all
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.mesh_solid import MeshSolid, footprints_between
from crowdsim.environment.solids import Solid
from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import cos
from crowdsim.geometry.polygons import buffered, clean_polygon


@dataclass(frozen=True)
class Band:
    """A range of heights above the floor [m]."""

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise GeometryError(f"layer '{self.name}': its high {self.high} m must lie above its low {self.low} m")


@dataclass(frozen=True)
class Plane:
    """A horizontal plane at a height above the floor [m]: a layer as the 2018 paper defines it (section 3.2).

    It holds only what it cuts, so bands are the better choice (docs/places.md, "The footprint of a band").
    """

    name: str
    height: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.height):
            raise GeometryError(f"layer '{self.name}': its height {self.height} m must be a finite number")

    @property
    def low(self) -> float:
        """Return the height [m]."""
        return self.height

    @property
    def high(self) -> float:
        """Return the height [m]."""
        return self.height


AnyLayer = Band | Plane
AnySolid = Solid | MeshSolid

LEGS = Band("legs", 0.10, 2.0)
"""Band of the legs [m]."""
TORSO = Band("torso", 0.65, 1.50)
"""Band of the torso [m]. It begins at the height of the hands; if it began higher, they would reach into tables."""


@dataclass(frozen=True)
class ClearanceLayer:
    """The obstacles of a band or plane, and the floor that they leave free.

    Both areas are valid and hold polygons only. ``obstacles`` is not clipped to the floor; ``free`` is. ``low`` and
    ``high`` [m] are equal for a plane.
    """

    name: str
    low: float
    high: float
    obstacles: MultiPolygon
    free: MultiPolygon

    @cached_property
    def _rooms(self) -> dict[float, MultiPolygon]:
        """Return the rooms asked for so far, by their radius [m]."""
        return {}

    def room(self, radius: float) -> MultiPolygon:
        """Return the :func:`room_in` the free floor, prepared for queries; it is made once for each radius [m]."""
        if radius not in self._rooms:
            self._rooms[radius] = room_in(self.free, radius)
            shapely.prepare(self._rooms[radius])
        return self._rooms[radius]


def room_in(free: MultiPolygon, radius: float) -> MultiPolygon:
    """Return the part of the area ``free`` that is at least ``radius`` [m] from everything outside of it."""
    quarter = 16
    # The arcs of a buffer are polygons inside of the true arcs; a larger radius makes up for that.
    outer = radius / cos(math.pi / (4 * quarter))
    return polygons_only(buffered(free, -outer, quad_segs=quarter))


def clearance_layers(
    floor: Polygon | MultiPolygon,
    solids: Sequence[AnySolid],
    bands: Sequence[AnyLayer],
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ClearanceLayer, ...]:
    """Project the parts of solids in each band onto the floor, or cut the solids at each plane.

    A solid counts in a band with its parts strictly between the band's heights: people walk under a lamp, and their
    torsos pass over a table's edge. The lowest layer is the ground layer, on which paths are found. It holds the
    obstacles of all layers, so that a place that is free on the ground is free in every layer (2018 paper, section
    3.2).

    Parameters
    ----------
    floor
        The walkable area [m].
    solids
        The obstacles.
    bands
        The layers to make.
    progress
        Called as ``progress(done, all)`` with numbers of solids, each counted once for each layer, if there are more
        than some 20 000 triangles. Only meshes are reported as done, so ``done`` may stay below ``all``.

    Returns
    -------
    tuple of ClearanceLayer
        Lowest first; of two that start at the same height, the one that reaches higher first.

    Raises
    ------
    GeometryError
        If there are no layers, two of one name, or the floor has no area.
    """
    names = [band.name for band in bands]
    if not names or len(set(names)) < len(names):
        raise GeometryError(f"clearance layers need distinct names, got {names}")
    walkable = clean_polygon(floor, "floor")
    ordered = sorted(bands, key=lambda band: (band.low, -band.high, band.name))
    obstacles = []
    for number, layer in enumerate(ordered):
        of_layer = (
            None if progress is None else partial(_tell, progress, number * len(solids), len(ordered) * len(solids))
        )
        obstacles.append(union_all(areas_between(solids, layer.low, layer.high, of_layer)))
    obstacles[0] = union_all(obstacles)
    return tuple(
        ClearanceLayer(
            layer.name, layer.low, layer.high, polygons_only(taken), polygons_only(walkable.difference(taken))
        )
        for layer, taken in zip(ordered, obstacles, strict=True)
    )


def dropped_solids(solids: Sequence[AnySolid], bands: Sequence[AnyLayer]) -> tuple[AnySolid, ...]:
    """Return solids that are in no layer, such as carpets and thresholds below all layers, and lamps above them."""
    return tuple(solid for solid in solids if not any(_meets(solid, band) for band in bands))


def taken_between(solid: AnySolid, low: float, high: float) -> BaseGeometry:
    """Return the area that a solid takes between two heights [m], or at a plane if they are equal; it may be empty."""
    return solid.section(low) if low == high else solid.footprint_in(low, high)


def _tell(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    """Call ``progress`` with the solids that are done, ``before`` and ``done`` more, of ``total`` in all layers."""
    progress(before + done, total)


def areas_between(
    solids: Sequence[AnySolid], low: float, high: float, progress: Callable[[int], None] | None = None
) -> list[BaseGeometry]:
    """Return the area that each solid takes between two heights [m], or at a plane, as :func:`taken_between` does.

    Solids of triangles are treated together, which takes less time. ``progress`` is called with the number of these
    that are done, if they have many triangles.
    """
    if low == high:
        return [taken_between(solid, low, high) for solid in solids]
    meshes = [solid for solid in solids if isinstance(solid, MeshSolid)]
    together = iter(footprints_between(meshes, low, high, progress))
    return [next(together) if isinstance(solid, MeshSolid) else solid.footprint_in(low, high) for solid in solids]


def _meets(solid: AnySolid, layer: AnyLayer) -> bool:
    """Return True if the solid is in the layer: part of it lies in the band, or the plane cuts it."""
    # A plane cuts infinitesimally above its height, as `section` of solids does.
    if isinstance(layer, Plane):
        return solid.bottom <= layer.height < solid.top
    return solid.overlaps(layer.low, layer.high)


def polygons_only(geometry: BaseGeometry) -> MultiPolygon:
    """Return the parts of ``geometry`` that have an area, without lines and points that overlays leave behind."""
    parts = [geometry]
    while any(hasattr(part, "geoms") for part in parts):
        parts = [inner for part in parts for inner in getattr(part, "geoms", [part])]
    return MultiPolygon([part for part in parts if isinstance(part, Polygon) and not part.is_empty])
