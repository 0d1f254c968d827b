"""The environment of a recording as colored meshes, and when each of them is present."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.choice import Choice
from crowdsim.playback.scenery import FlatMesh, floor_mesh, meshes_mesh, solids_mesh
from crowdsim.playback.surfaces import vertex_normals
from crowdsim.recording.header import SolidRecord
from crowdsim.recording.reader import Recording

TALL = 1.1
"""Height above which solids are glass, so that they do not hide agents behind them [m]."""


class Paint(NamedTuple):
    """A color with a name: sRGB from 0 to 1, and opacity, 1 for no transparency."""

    name: str
    red: float
    green: float
    blue: float
    opacity: float = 1.0

    @property
    def linear(self) -> tuple[float, float, float]:
        """Return red, green and blue as linear light, to four digits."""
        red, green, blue = (
            round(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4, 4)
            for value in (self.red, self.green, self.blue)
        )
        return red, green, blue


FLOOR = Paint("floor", 0.94, 0.92, 0.88)
LOW = Paint("low things", 0.79, 0.70, 0.58)
GLASS = Paint("tall things", 0.62, 0.69, 0.74, 0.35)
MOVABLE = Paint("movables", 0.72, 0.47, 0.29)
MESH = Paint("meshes", 0.72, 0.74, 0.76)


class PlacePart(NamedTuple):
    """A mesh of the environment.

    Attributes
    ----------
    name : str
        Name.
    paint : Paint
        Color.
    points, normals : (V, 3) float32
        Vertices [m] and unit normals.
    triangles : (F, 3) uint32
        Indices of vertices.
    shown : tuple of int or None
        Frames of the choice at which it appears and disappears, in turn; None if it is always present.
    """

    name: str
    paint: Paint
    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    shown: tuple[int, ...] | None = None


def place_parts(recording: Recording, choice: Choice) -> list[PlacePart]:
    """Return all parts that have triangles: floor, solids, meshes, and movables at each of their positions."""
    header = recording.header
    tall = [solid for solid in header.solids if solid.top > TALL]
    low = [solid for solid in header.solids if solid.top <= TALL]
    meshes = [
        ("floor", FLOOR, floor_mesh(header)),
        ("low things", LOW, solids_mesh(low)),
        ("meshes", MESH, meshes_mesh(header.meshes)),
        ("tall things", GLASS, solids_mesh(tall)),
    ]
    parts = [_part(name, paint, mesh) for name, paint, mesh in meshes]
    parts += [_part(solid.name, MOVABLE, solids_mesh([solid]), shown) for solid, shown in _stands(recording, choice)]
    return [part for part in parts if len(part.triangles)]


def _part(name: str, paint: Paint, mesh: FlatMesh, shown: tuple[int, ...] | None = None) -> PlacePart:
    """Return a mesh as a part of the environment, with smooth normals; an empty mesh has none."""
    normals = vertex_normals(mesh.points, mesh.triangles) if len(mesh.triangles) else mesh.points
    points = mesh.points.astype(np.float32)
    return PlacePart(name, paint, points, normals.astype(np.float32), mesh.triangles.astype(np.uint32), shown)


def _stands(recording: Recording, choice: Choice) -> list[tuple[SolidRecord, tuple[int, ...]]]:
    """Return each movable at each of its positions, and the frames at which it appears and disappears there.

    Positions are left out at which it is in no frame of the choice.
    """
    steps = choice.steps
    # Frames at which each movable appears and disappears, in turn, by its footprint; and the present footprint of each.
    stands: dict[tuple[int, str], list[int]] = {}
    standing: dict[int, str] = {}
    for change in recording.changes:
        # The first frame in or after the step of the change.
        frame = int(np.searchsorted(steps, change.step))
        before = standing.pop(change.movable, None)
        if before is not None:
            stands[change.movable, before].append(frame)
        if change.footprint is not None:
            standing[change.movable] = change.footprint
            stands.setdefault((change.movable, change.footprint), []).append(frame)
    found = []
    for (movable, footprint), frames in stands.items():
        solid = recording.header.movables[movable]
        shown = tuple(_merged(frames, len(steps)))
        if shown:
            found.append((SolidRecord(solid.name, footprint, solid.bottom, solid.top), shown))
    return found


def _merged(frames: list[int], count: int) -> list[int]:
    """Return ``frames``, at which something appears and disappears in turn, without empty spans.

    Frames from ``count`` on, which lie after the end, are left out.
    """
    merged: list[int] = []
    for frame in frames:
        if merged and merged[-1] == frame:  # it goes in the frame in which it came, or comes again when it goes
            merged.pop()
        else:
            merged.append(frame)
    return [frame for frame in merged if frame < count]
