"""Obstacles that come and go: their handles, and how their shapes get into a mesh and out of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import BoundExceeded, GeometryError, StaleHandle
from crowdsim.navmesh.editing import edit_kernels, outline_kernels, point_kernels
from crowdsim.navmesh.editing.point_kernels import INSERT, NO_ROOM, REMOVE, SETTLE, UNSETTLED
from crowdsim.navmesh.editing.shapes import (
    NOTHING,
    Dots,
    Integers,
    Shape,
    as_dots,
    as_geometry,
    chains,
    moved,
    rings_of,
    shape_of,
)
from crowdsim.navmesh.mesh.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import USE, MeshArrays, Workshop, resized, workshop
from crowdsim.navmesh.paths.paths import as_numbers
from crowdsim.navmesh.triangulation.use_kernels import keep_used

_LEAST_USES = 4096
"""Least room in the pool of uses. Each edit needs about one; a full pool is cleared of uses without half-edges."""


class Handle(NamedTuple):
    """An obstacle that was inserted. No two obstacles of a mesh ever have the same handle.

    slot: number of the obstacle, which another one gets after its removal. generation: how many had the slot before.
    """

    slot: int
    generation: int


@dataclass
class _Slot:
    """The state of one obstacle."""

    generation: int = 0
    shape: Dots | Shape = NOTHING
    """The shape as it was inserted."""
    snapped: Shape = NOTHING
    """The part of the shape inside the box, on the grid; empty for points, which the kernel snaps itself."""
    ids: Integers | list[int] | None = None
    """Vertices of the corners of ``snapped``, or of points (-1 outside of the box).

    None if the obstacle is not in the mesh.
    """


class Obstacles:
    """The obstacles that were inserted into one mesh, and that mesh.

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
        # A quarter more than there are, and some: edits begin without growing the arrays.
        room = len(mesh.vertices) + len(mesh.vertices) // 4 + 256
        self._set(resized(mesh, room), workshop(room, _LEAST_USES))

    def _set(self, mesh: MeshArrays, work: Workshop) -> None:
        """Replace the arrays. No other method may, as kernels use their addresses."""
        self.mesh, self._work = mesh, work
        self._places = places_of(mesh, work)

    @property
    def places(self) -> Integers:
        """Return the current addresses (12, 2) of the arrays, for kernels that insert and remove points."""
        return self._places

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # The arrays of an unpickled copy have other addresses.
        self._set(self.mesh, self._work)

    def copy(self) -> Obstacles:
        """Return a copy that can be edited on its own, with the same handles."""
        other = object.__new__(Obstacles)
        other._base = self._base
        other._slots = [replace(slot) for slot in self._slots]
        other._free = list(self._free)
        # Between edits only the uses and the state of the workshop matter.
        work = workshop(len(self.mesh.vertices), len(self._work.uses))
        work.uses[:], work.progress[:] = self._work.uses, self._work.progress
        other._set(resized(self.mesh, len(self.mesh.vertices)), work)
        return other

    def insert(self, geometry: Any) -> Handle:
        """Insert an obstacle and return its handle (see :meth:`crowdsim.navmesh.navmesh.NavMesh.insert_obstacle`)."""
        shape, snapped = self._read(geometry)
        if not self._free:
            self._free.append(len(self._slots))
            self._slots.append(_Slot())
        number = self._free[-1]
        # If the obstacle cannot be put in, this raises an error and the slot stays free.
        self._put(number, shape, snapped)
        self._free.pop()
        return Handle(number, self._slots[number].generation)

    def remove(self, handle: Handle) -> None:
        """Remove an obstacle; its handle becomes stale, even if GeometryError is raised for another obstacle."""
        number, slot = self._find(handle)
        try:
            self._take(number)
        finally:
            slot.generation += 1
            slot.shape = slot.snapped = NOTHING
            self._free.append(number)

    def move(self, handle: Handle, *place: Any) -> None:
        """Move an obstacle by (dx, dy) [m], or to a new geometry; after a GeometryError it stays where it was."""
        number, slot = self._find(handle)
        if len(place) == 2:
            offset = as_numbers(place, "move: dx and dy")
            if offset.shape != (2,):
                raise GeometryError(f"move: expected dx and dy in meters, got arrays of shape {offset.shape[1:]}")
            dx, dy = offset.tolist()
            if not (math.isfinite(dx) and math.isfinite(dy)):
                raise GeometryError(f"move: dx and dy must be finite meters, got ({dx}, {dy})")
            shape = moved(slot.shape, dx, dy)
            snapped = self._cut(shape)
        elif len(place) == 1:
            shape, snapped = self._read(place[0])
        else:
            raise GeometryError(f"move: expected dx and dy, or a geometry, got {len(place)} values")
        before = slot.shape, slot.snapped
        try:
            self._take(number)
            self._put(number, shape, snapped)
        except GeometryError:
            self._put(number, *before)
            raise

    def _find(self, handle: Handle) -> tuple[int, _Slot]:
        """Return the number and the slot of a handle, or raise StaleHandle."""
        if isinstance(handle, tuple) and len(handle) == 2 and handle[0] in range(len(self._slots)):
            number = int(handle[0])  # a float may be equal to a number
            slot = self._slots[number]
            if slot.generation == handle[1] and slot.ids is not None:
                return number, slot
        name = tuple(handle) if isinstance(handle, tuple) else handle
        raise StaleHandle(f"obstacle {name!r} is not in the mesh; was it removed, or is it another mesh's?")

    def _read(self, geometry: Any) -> tuple[Dots | Shape, Shape]:
        """Return the shape of ``geometry``, and its part inside the box on the grid, which is empty for points."""
        if isinstance(geometry, shapely.Point) and not geometry.is_empty:
            return as_dots([(geometry.x, geometry.y)]), NOTHING
        # Outlines of few corners take a short cut around shapely, unless the check is unsure or fails.
        if not isinstance(geometry, BaseGeometry):
            geometry = as_numbers(geometry, "obstacle")
            if geometry.shape == (2,):
                return as_dots([tuple(geometry.tolist())]), NOTHING
            if geometry.ndim == 2 and geometry.shape[1] == 2:
                snapped = np.empty_like(geometry)
                status = outline_kernels.check_outline(self.mesh, geometry, snapped)
                ends = np.array([len(geometry)])
                if status == outline_kernels.OK:
                    return Shape(geometry.copy(), ends, 1), Shape(snapped, ends, 1)
                if status == outline_kernels.BACKWARD:
                    backward = np.ascontiguousarray(snapped[::-1])
                    return Shape(geometry[::-1].copy(), ends, 1), Shape(backward, ends, 1)
        shape = shape_of(geometry)
        return shape, self._cut(shape)

    def _cut(self, shape: Dots | Shape) -> Shape:
        """Return the part of ``shape`` inside the box that the mesh fills, with coordinates on the mesh's grid.

        It is empty for points, which the kernel snaps itself.

        Raises
        ------
        GeometryError
            If a coordinate is not finite.
        """
        if not isinstance(shape, Shape):
            return NOTHING
        points = np.ascontiguousarray(shape.points)
        snapped = np.empty_like(points)
        status = outline_kernels.snap_inside(self.mesh, points, snapped)
        if status == outline_kernels.NOT_FINITE:
            raise GeometryError("obstacle: coordinates must be finite")
        if status == outline_kernels.OUTSIDE:
            # Intersect with the box less two cells: snapping moves a corner by half a cell, and corners have to stay
            # one cell off the border.
            cell, *box = self.mesh.frame[["cell", "x0", "y0", "x1", "y1"]][0].item()
            inner = shapely.box(box[0] + 2 * cell, box[1] + 2 * cell, box[2] - 2 * cell, box[3] - 2 * cell)
            geometry = shapely.intersection(as_geometry(shape), inner)
            # Winding 0: lines, which enclose nothing. Otherwise rings; what is left of them without area is dropped.
            if shape.winding == 0:
                parts = [part for part in shapely.get_parts(geometry) if not part.is_empty]
                inside = chains([shapely.get_coordinates(part) for part in parts], 0)
            else:
                # Twice, as collections may hold multipolygons.
                parts = shapely.get_parts(shapely.get_parts(geometry))
                parts = parts[shapely.area(parts) > 0.0]
                inside = rings_of(shapely.MultiPolygon(list(parts))) if len(parts) else NOTHING
            points = np.ascontiguousarray(inside.points)
            snapped = np.empty_like(points)
            outline_kernels.snap_inside(self.mesh, points, snapped)
            shape = inside
        return Shape(snapped, shape.ends, shape.winding)

    def _put(self, number: int, shape: Dots | Shape, snapped: Shape) -> None:
        """Insert ``shape`` as slot ``number``; if that fails, leave the obstacle out and raise GeometryError.

        A mesh that became useless is built again, for which see :meth:`rebuild`.
        """
        slot = self._slots[number]
        slot.shape, slot.snapped = shape, snapped
        # If that fails the mesh is useless: build it again without this obstacle (``ids`` None), and try once more.
        if not self._enter(number, slot):
            slot.ids = None
            self.rebuild()
            if not self._enter(number, slot):
                slot.ids = None
                self.rebuild()
                count = len(shape) if isinstance(shape, list) else len(snapped.points)
                raise GeometryError(
                    f"the obstacle of {count} corners cannot be put into the mesh; simplify or repair it"
                )

    def _take(self, number: int) -> None:
        """Remove slot ``number`` from the mesh; raise GeometryError if another obstacle cannot be put in again."""
        slot = self._slots[number]
        done = self._change(REMOVE, number, slot)
        slot.ids = None
        if not done:
            self.rebuild()

    def _enter(self, number: int, slot: _Slot) -> bool:
        """Insert slot ``number``; return False if the mesh is useless afterwards."""
        if isinstance(slot.shape, list):
            slot.ids = [-1] * len(slot.shape)
        else:
            slot.ids = np.empty(len(slot.snapped.points), np.int64)
        return self._change(INSERT, number, slot)

    def _change(self, what: int, number: int, slot: _Slot) -> bool:
        """Insert or remove slot ``number``; return False if that left the mesh useless."""
        try:
            if isinstance(slot.shape, list) and isinstance(slot.ids, list):
                return self._edit_points(what, slot.shape, slot.ids)
            return self._edit(what, number, slot)
        except BoundExceeded:
            return False

    def _edit_points(self, what: int, points: Dots, ids: list[int]) -> bool:
        """Insert each of ``points`` and fill in its vertex in ``ids``, or remove it.

        Return False if the mesh is useless afterwards.
        """
        for i, (x, y) in enumerate(points):
            # Vertices and uses to add room for if the kernel finds none: 128, more than `has_room` wants for a point,
            # and twice as many each time. For repairs as many vertices as there is room for now.
            job, wanted = what, 128
            while (v := point_kernels.edit_point(self._places, job, x, y, ids[i])) < -1:
                if v == UNSETTLED:
                    job, wanted = SETTLE, len(self.mesh.vertices)
                elif v != NO_ROOM:
                    return False
                self._grow(wanted)
                wanted *= 2
            ids[i] = v
        return True

    def _edit(self, what: int, number: int, slot: _Slot) -> bool:
        """Run the kernel of edits, in larger arrays if it needs them.

        Return False if the mesh is useless afterwards.
        """
        # Vertices and uses to add room for if the kernel finds none: what `has_room` wants, and twice as many each
        # time. For repairs as many vertices as there is room for now.
        shape, wanted = slot.snapped, 8 * len(slot.snapped.points) + 64
        while True:
            status = edit_kernels.edit(self._places, what, shape.points, shape.ends, shape.winding, number, slot.ids)
            if status == UNSETTLED:
                what, wanted = SETTLE, len(self.mesh.vertices)
            elif status != NO_ROOM:
                return bool(status == 0)
            self._grow(wanted)
            wanted *= 2

    def _grow(self, wanted: int) -> None:
        """Make room for ``wanted`` more vertices and uses."""
        mesh, work = self.mesh, self._work
        # ``present``: vertices in use, from the number of triangles as in `has_room`; ``filled`` counts removed ones.
        filled, present = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0]) // 2 + 3
        # Room for more than the wanted ones, so that the next edits find some, too.
        if present + wanted >= len(mesh.vertices):
            mesh = resized(mesh, filled + filled // 4 + 2 * wanted)
        # Clear the pool of uses; it gets room for twice those left and wanted. The workshop grows with the mesh, too.
        kept = np.zeros(len(work.uses), USE)
        count = keep_used(mesh, work.uses, kept)
        room = max(len(kept), _LEAST_USES, 2 * (count + wanted))
        if len(mesh.vertices) != len(self.mesh.vertices) or room != len(kept):
            work = workshop(len(mesh.vertices), room)
            work.progress[:] = self._work.progress
            work.gone[: len(kept)] = self._work.gone
            work.to_do[["mark", "touched"]][: len(self._work.to_do)] = self._work.to_do[["mark", "touched"]]
            # An edit that is not settled yet goes on with its marks and lists. The ring buffer is put in order, so that
            # it starts at 0 in the larger array.
            waiting = np.roll(self._work.to_do["waiting"], -int(work.progress["head"][0]))
            work.to_do["waiting"][: len(waiting)] = waiting
            work.progress["head"] = 0
        work.uses[: len(kept)] = kept
        work.progress["uses"] = count
        self._set(mesh, work)

    def rebuild(self) -> None:
        """Build the mesh anew, with all obstacles that are in it, in arrays twice as large.

        Raise GeometryError if one cannot be put in again; the mesh is then without it.
        """
        room = 2 * len(self.mesh.vertices)
        self._set(resized(self._base, room), workshop(room, 2 * len(self._work.uses)))
        for number, slot in enumerate(self._slots):
            if slot.ids is not None and not self._enter(number, slot):
                # Without this obstacle, so that the mesh is never left half edited.
                slot.ids = None
                self.rebuild()
                raise GeometryError(f"obstacle {number} cannot be put into the mesh again; simplify or repair it")
