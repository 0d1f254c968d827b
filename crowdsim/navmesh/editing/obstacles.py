"""Obstacles that come and go: handles, and the way of shapes into a mesh and out of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError, StaleHandle
from crowdsim.geometry.polygons import clean_polygon
from crowdsim.navmesh.editing import address_kernels, edit_kernels, outline_kernels, point_kernels
from crowdsim.navmesh.mesh_arrays import USE, MeshArrays, Workshop, resized, workshop
from crowdsim.navmesh.paths.paths import as_numbers
from crowdsim.navmesh.triangulation.use_kernels import keep_used

_LEAST_USES = 4096
"""Room for uses, of which each edit makes about one; when it is full those that nothing refers to any longer go."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Handle(NamedTuple):
    """An obstacle that was inserted. No two obstacles of a mesh ever have the same handle."""

    slot: int
    generation: int


class Shape(NamedTuple):
    """What an obstacle is made of: rings with it on their left, or polylines and points."""

    points: Floats
    """(n, 2) meters."""
    ends: Integers
    """(k,) chain i is points[ends[i-1]:ends[i]]."""
    winding: int
    """1 for rings, 0 for polylines and points."""

    def moved(self, dx: float, dy: float) -> Shape:
        """The same at another place."""
        return self._replace(points=self.points + (dx, dy))


_ONE_END = np.array([1])
_NOTHING = Shape(np.zeros((0, 2)), np.zeros(0, np.int64), 0)


def _chains(parts: list[Floats], winding: int) -> Shape:
    if not parts:
        return _NOTHING
    ends = np.cumsum([len(part) for part in parts]).astype(np.int64)
    return Shape(np.ascontiguousarray(np.concatenate(parts)), ends, winding)


def shape_of(geometry: Any) -> Shape:
    """The shape of a geometry of shapely, or of the corners (n, 2) of a polygon; invalid ones are repaired.

    Raises
    ------
    GeometryError
        For other types, coordinates that are not finite, and polygons without area.
    """
    if not isinstance(geometry, BaseGeometry):
        corners = as_numbers(geometry, "obstacle")
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
            raise GeometryError(
                f"obstacle: expected a shapely geometry, a point (2,) or at least three corners (n, 2), got shape "
                f"{corners.shape}"
            )
        if not np.isfinite(corners).all():
            raise GeometryError("obstacle: coordinates must be finite; the corners hold NaN or infinity")
        geometry = shapely.Polygon(corners)
    if isinstance(geometry, shapely.Polygon | shapely.MultiPolygon):
        if not geometry.is_valid and np.isfinite(shapely.get_coordinates(geometry)).all():
            # What the ring goes around twice, the middle of a pentagram say, is blocked as well.
            repaired = shapely.make_valid(geometry, method="structure", keep_collapsed=False)
            geometry = shapely.MultiPolygon([part for part in shapely.get_parts(repaired) if part.area > 0.0])
        oriented = shapely.orient_polygons(clean_polygon(geometry, "obstacle"))
        rings = shapely.get_rings(shapely.get_parts(oriented))
        return _chains([shapely.get_coordinates(ring)[:-1] for ring in rings], 1)
    kinds = shapely.Point | shapely.MultiPoint | shapely.LineString | shapely.LinearRing | shapely.MultiLineString
    if not isinstance(geometry, kinds):
        raise GeometryError(f"obstacle: expected polygons, lines or points, got {geometry.geom_type}")
    parts = [shapely.get_coordinates(part) for part in shapely.get_parts(geometry)]
    if not parts or not all(len(part) for part in parts):
        raise GeometryError("obstacle: the geometry is empty")
    if not all(np.isfinite(part).all() for part in parts):
        raise GeometryError("obstacle: coordinates must be finite; the geometry holds NaN or infinity")
    return _chains(parts, 0)


def _as_geometry(shape: Shape) -> BaseGeometry:
    """What ``shape`` covers; rings may touch, but not cross each other."""
    parts = np.split(shape.points, shape.ends[:-1])
    if shape.winding == 0:
        return shapely.GeometryCollection(
            [shapely.LineString(part) if len(part) > 1 else shapely.Point(part[0]) for part in parts]
        )
    rings = [shapely.Polygon(part) for part in parts]
    shells = [ring for ring in rings if ring.exterior.is_ccw]
    return shapely.union_all(shells).difference(shapely.union_all([ring for ring in rings if not ring.exterior.is_ccw]))


@dataclass
class _Slot:
    generation: int = 0
    shape: Shape = _NOTHING
    """What was inserted."""
    snapped: Shape = _NOTHING
    """What of it lies in the box, on the grid."""
    ids: Integers | None = None
    """(n,) the vertices of the corners of ``snapped``; None where it is not in the mesh."""


class Obstacles:
    """The obstacles that were inserted into one mesh, and the mesh.

    Parameters
    ----------
    mesh
        A finished mesh; it is copied.
    """

    mesh: MeshArrays

    def __init__(self, mesh: MeshArrays) -> None:
        self._base = mesh
        self._slots: list[_Slot] = []
        self._free: list[int] = []
        room = len(mesh.vertices) + len(mesh.vertices) // 4 + 256
        self._set(resized(mesh, room), workshop(room, _LEAST_USES))

    def _set(self, mesh: MeshArrays, work: Workshop) -> None:
        self.mesh, self._work = mesh, work
        self._places = address_kernels.places_of(mesh, work)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._set(self.mesh, self._work)  # which are elsewhere in a copy

    def copy(self) -> Obstacles:
        """A copy that is edited on its own, with the same handles."""
        twin = object.__new__(Obstacles)
        twin._base = self._base
        twin._slots = [replace(slot) for slot in self._slots]
        twin._free = list(self._free)
        work = workshop(len(self.mesh.vertices), len(self._work.uses))
        work.uses[:], work.progress[:] = self._work.uses, self._work.progress
        twin._set(resized(self.mesh, len(self.mesh.vertices)), work)
        return twin

    def insert(self, geometry: Any) -> Handle:
        """Put an obstacle in (see :meth:`crowdsim.navmesh.navmesh.NavMesh.insert_obstacle`)."""
        if not self._free:
            self._free.append(len(self._slots))
            self._slots.append(_Slot())
        number = self._free[-1]
        slot = self._slots[number]
        if not self._put_point(number, geometry):
            shape, snapped = self._read(geometry)
            self._put(number, snapped)
            slot.shape = shape
        self._free.pop()
        return Handle(number, slot.generation)

    def _put_point(self, number: int, geometry: Any) -> bool:
        """Insert ``geometry`` as slot ``number`` if it is a point in the box: the quick way for the most frequent."""
        if isinstance(geometry, shapely.Point) and not geometry.is_empty:
            point = np.array(((geometry.x, geometry.y),))
        elif isinstance(geometry, np.ndarray) and geometry.shape == (2,):
            point = geometry.astype(np.float64).reshape(1, 2)
        else:
            return False
        slot, snapped, ids = self._slots[number], point.copy(), np.empty(1, np.int64)
        status = point_kernels.edit_points(self._places, point_kernels.INSERT, snapped, ids)
        if status > 0 or status == point_kernels.NO_ROOM:
            return False
        slot.shape, slot.snapped, slot.ids = Shape(point, _ONE_END, 0), Shape(snapped, _ONE_END, 0), ids
        if status == 0 or (status == point_kernels.UNSETTLED and self._edit(point_kernels.SETTLE, number, slot)):
            return True
        slot.ids = None
        self._rebuild()
        return False

    def remove(self, handle: Handle) -> None:
        """Take an obstacle out."""
        number, slot = self._find(handle)
        self._take(number)
        slot.generation += 1
        slot.shape = slot.snapped = _NOTHING
        self._free.append(number)

    def move(self, handle: Handle, *place: Any) -> None:
        """Take an obstacle to another place, by (dx, dy) meters or to a new geometry."""
        number, slot = self._find(handle)
        if len(place) == 2:
            offset = as_numbers(place, "move: dx and dy")
            if offset.shape != (2,):
                raise GeometryError(f"move: expected dx and dy in meters, got arrays of shape {offset.shape[1:]}")
            dx, dy = offset.tolist()
            if not (math.isfinite(dx) and math.isfinite(dy)):
                raise GeometryError(f"move: dx and dy must be finite meters, got ({dx}, {dy})")
            shape = slot.shape.moved(dx, dy)
            snapped = self._cut(shape)
        elif len(place) == 1:
            shape, snapped = self._read(place[0])
        else:
            raise GeometryError(f"move: expected dx and dy, or a geometry, got {len(place)} values")
        before = slot.snapped
        self._take(number)
        try:
            self._put(number, snapped)
        except GeometryError:
            self._put(number, before)
            raise
        slot.shape = shape

    def _find(self, handle: Handle) -> tuple[int, _Slot]:
        if isinstance(handle, tuple) and len(handle) == 2 and handle[0] in range(len(self._slots)):
            number, slot = int(handle[0]), self._slots[handle[0]]
            if slot.generation == handle[1] and slot.ids is not None:
                return number, slot
        name = tuple(handle) if isinstance(handle, tuple) else handle
        raise StaleHandle(f"obstacle {name!r} is not in the mesh; was it removed, or is it another mesh's?")

    def _read(self, geometry: Any) -> tuple[Shape, Shape]:
        """The shape of ``geometry``, and what of it lies in the box, on the grid."""
        if not isinstance(geometry, BaseGeometry):
            geometry = as_numbers(geometry, "obstacle")
        if isinstance(geometry, np.ndarray) and geometry.shape == (2,):
            geometry = shapely.Point(geometry)
        if isinstance(geometry, np.ndarray) and geometry.ndim == 2 and geometry.shape[1] == 2:
            points = geometry
            snapped = np.empty_like(points)
            status = outline_kernels.check_outline(self.mesh, points, snapped)
            if status in (outline_kernels.OK, outline_kernels.BACKWARD):
                ends = np.array([len(points)])
                if status == outline_kernels.BACKWARD:
                    return Shape(points[::-1].copy(), ends, 1), Shape(np.ascontiguousarray(snapped[::-1]), ends, 1)
                return Shape(points.copy(), ends, 1), Shape(snapped, ends, 1)
        shape = shape_of(geometry)
        return shape, self._cut(shape)

    def _cut(self, shape: Shape) -> Shape:
        """What of ``shape`` lies in the box, on the grid."""
        points = np.ascontiguousarray(shape.points)
        snapped = np.empty_like(points)
        status = outline_kernels.snap_inside(self.mesh, points, snapped)
        if status == outline_kernels.NOT_FINITE:
            raise GeometryError("obstacle: coordinates must be finite")
        if status == outline_kernels.OUTSIDE:
            cell, *box = self.mesh.frame[["cell", "x0", "y0", "x1", "y1"]][0].item()
            inner = shapely.box(box[0] + 2 * cell, box[1] + 2 * cell, box[2] - 2 * cell, box[3] - 2 * cell)
            geometry = shapely.intersection(_as_geometry(shape), inner)
            if shape.winding == 0:
                parts = [part for part in shapely.get_parts(geometry) if not part.is_empty]
                inside = _chains([shapely.get_coordinates(part) for part in parts], 0)
            else:
                parts = shapely.get_parts(shapely.get_parts(geometry))  # twice: collections may hold multipolygons
                parts = parts[shapely.area(parts) > 0.0]
                inside = shape_of(shapely.MultiPolygon(list(parts))) if len(parts) else _NOTHING
            points = np.ascontiguousarray(inside.points)
            snapped = np.empty_like(points)
            outline_kernels.snap_inside(self.mesh, points, snapped)
            shape = inside
        return Shape(snapped, shape.ends, shape.winding)

    def _put(self, number: int, snapped: Shape) -> None:
        """Insert ``snapped`` as slot ``number``; where that fails the mesh is as if it never had been tried."""
        slot = self._slots[number]
        slot.snapped = snapped
        slot.ids = np.empty(len(snapped.points), np.int64)
        if not self._edit(point_kernels.INSERT, number, slot):
            slot.ids = None
            self._rebuild()
            slot.ids = np.empty(len(snapped.points), np.int64)
            if not self._edit(point_kernels.INSERT, number, slot):
                slot.ids = None
                self._rebuild()
                raise GeometryError(
                    f"the obstacle of {len(snapped.points)} corners cannot be put into the mesh; simplify or repair it"
                )

    def _take(self, number: int) -> None:
        """Remove what is in the mesh of slot ``number``."""
        slot = self._slots[number]
        done = self._edit(point_kernels.REMOVE, number, slot)
        slot.ids = None
        if not done:
            self._rebuild()

    def _edit(self, what: int, number: int, slot: _Slot) -> bool:
        """Run the kernel of edits, in larger arrays where it asks for them; False where it left the mesh useless."""
        shape, wanted = slot.snapped, 8 * len(slot.snapped.points) + 64
        while True:
            if len(shape.points) == len(shape.ends):
                status = point_kernels.edit_points(self._places, what, shape.points, slot.ids)
            else:
                status = edit_kernels.edit(
                    self._places, what, shape.points, shape.ends, shape.winding, number, slot.ids
                )
            if status == point_kernels.UNSETTLED:
                what, wanted = point_kernels.SETTLE, len(self.mesh.vertices)
            elif status != point_kernels.NO_ROOM:
                return bool(status == 0)
            self._grow(wanted)
            wanted *= 2

    def _grow(self, wanted: int) -> None:
        """Make room for ``wanted`` more vertices and uses."""
        mesh, work = self.mesh, self._work
        filled, present = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0]) // 2 + 3
        if present + wanted >= len(mesh.vertices):
            mesh = resized(mesh, filled + filled // 4 + 2 * wanted)
        kept = np.zeros(len(work.uses), USE)
        count = keep_used(mesh, work.uses, kept)
        room = max(len(kept), _LEAST_USES, 2 * (count + wanted))
        if len(mesh.vertices) != len(self.mesh.vertices) or room != len(kept):
            work = workshop(len(mesh.vertices), room)
            work.progress[:] = self._work.progress
            work.gone[: len(kept)] = self._work.gone
            work.to_do[["mark", "touched"]][: len(self._work.to_do)] = self._work.to_do[["mark", "touched"]]
            # The ring buffer is put in order, as it does not grow where it is.
            waiting = np.roll(self._work.to_do["waiting"], -int(work.progress["head"][0]))
            work.to_do["waiting"][: len(waiting)] = waiting
            work.progress["head"] = 0
        work.uses[: len(kept)] = kept
        work.progress["uses"] = count
        self._set(mesh, work)

    def _rebuild(self) -> None:
        """The mesh anew, with all obstacles that are in it, in arrays twice as large."""
        room = 2 * len(self.mesh.vertices)
        self._set(resized(self._base, room), workshop(room, 2 * len(self._work.uses)))
        for number, slot in enumerate(self._slots):
            if slot.ids is not None and not self._edit(point_kernels.INSERT, number, slot):
                raise GeometryError(f"obstacle {number} cannot be put into the mesh again; simplify or repair it")
