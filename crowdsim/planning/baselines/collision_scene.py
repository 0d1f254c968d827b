"""Whole bodies against whole obstacles in 3D: the test that layers are compared with (2018 paper, table 1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.environment.layers import AnySolid
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.errors import CrowdSimError
from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.body_capsules import Capsules

Floats = NDArray[np.float64]

_RING = (6, 8)
"""Rings along a capsule and points around it. The inscribed surface is up to 12 % of the radius inside the round
one (10 % with trimesh 5.2); more points are slower."""


def load_fcl() -> Any:
    """Return the collision library; raise CrowdSimError with the command that installs it if it is missing."""
    try:
        import fcl
    except ImportError:
        raise CrowdSimError(
            "collision tests in 3D need python-fcl; install it with: pip install 'crowdsim[fcl]'"
        ) from None
    return fcl


class CollisionScene:
    """All solids of a place as triangle surfaces in one broad-phase tree."""

    def __init__(self, solids: Sequence[AnySolid]) -> None:
        self._fcl = load_fcl()
        self._objects = [_surface(*_triangles(solid)) for solid in solids]
        self._tree = self._fcl.DynamicAABBTreeCollisionManager()
        self._tree.registerObjects(self._objects)
        self._tree.setup()

    def collides(self, body: Any, x: float, y: float, heading: float) -> bool:
        """Return True if a body of :class:`Stride` with its track at (x, y, heading) [m, rad] touches the scene."""
        c, s = cos(heading), sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        body.setTransform(self._fcl.Transform(turn, np.array([x, y, 0.0])))
        found = self._fcl.CollisionData()
        self._tree.collide(body, found, self._fcl.defaultCollisionCallback)
        return bool(found.result.is_collision)


class Stride:
    """One cycle of a behavior: the surface of the whole body in each frame, and the length of the cycle [m]."""

    def __init__(self, capsules: Capsules, length: float) -> None:
        self.length = length
        self._points, self._triangles = _surfaces(capsules)
        self._bodies: dict[int, Any] = {}

    def body(self, arc: float) -> Any:
        """Return the body as it is ``arc`` meters along its path, where cycle follows on cycle."""
        frame = int(arc / self.length * len(self._points)) % len(self._points)
        # Made on first use: the tree of a body is costly, and few frames may be needed.
        if frame not in self._bodies:
            self._bodies[frame] = _surface(self._points[frame], self._triangles)
        return self._bodies[frame]


def _surfaces(capsules: Capsules) -> tuple[Floats, NDArray[np.int64]]:
    """Return points (F, V, 3) of all capsules in each frame, relative to the track [m], and their triangles (T, 3)."""
    import trimesh

    # One capsule of radius 1 for all: each of its points goes with one end of the axis.
    capsule = trimesh.creation.capsule(height=2.0, radius=1.0, count=_RING)
    end = (capsule.vertices[:, 2] > 0.0).astype(np.int64)
    directions = capsule.vertices - np.column_stack([np.zeros((len(end), 2)), 2.0 * end - 1.0])
    # Three axes for each capsule; any pair across it will do, as it is round.
    ends = capsules.ends
    along = _unit(ends[:, :, 1] - ends[:, :, 0], (0.0, 0.0, 1.0))
    other = np.where(np.abs(along[..., 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    across = _unit(np.cross(other, along), (1.0, 0.0, 0.0))
    axes = across, np.cross(along, across), along
    offsets = sum(axis[:, :, None] * directions[:, k, None] for k, axis in enumerate(axes))
    points = ends[:, :, end] + capsules.radii[:, None, None] * offsets
    count, vertices = len(capsules.radii), len(end)
    triangles = capsule.faces + vertices * np.arange(count)[:, None, None]
    # Rounded, because trimesh uses the C library's sine, which differs between processors.
    return np.round(points, 6).reshape(len(ends), count * vertices, 3), triangles.reshape(-1, 3).astype(np.int64)


def _unit(vectors: Floats, instead: tuple[float, float, float]) -> Floats:
    """Return vectors (..., 3) divided by their lengths; ``instead`` for those of no length."""
    length = np.sqrt(np.sum(vectors * vectors, axis=-1, keepdims=True))
    units: Floats = np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), instead)
    return units


def _surface(points: Floats, triangles: NDArray[np.int64]) -> Any:
    """Return a collision object of points (V, 3) [m] and triangles (T, 3)."""
    fcl = load_fcl()
    model = fcl.BVHModel()
    model.beginModel(len(points), len(triangles))
    model.addSubModel(points, triangles)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _triangles(solid: AnySolid) -> tuple[Floats, NDArray[np.int64]]:
    """Return points (V, 3) [m] and triangles (T, 3) of a solid's surface."""
    if isinstance(solid, MeshSolid):
        return solid.vertices, solid.triangles
    import trimesh

    mesh = trimesh.creation.extrude_polygon(solid.footprint, solid.top - solid.bottom, engine="triangle")
    return np.asarray(mesh.vertices) + [0.0, 0.0, solid.bottom], np.asarray(mesh.faces, np.int64)
