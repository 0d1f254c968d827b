"""Whole bodies against whole obstacles in 3D: what layers are compared with (2018 paper, table 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.environment.layers import AnySolid
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.errors import CrowdSimError
from crowdsim.motion.body_capsules import Capsules

Floats = NDArray[np.float64]


def load_fcl() -> Any:
    """The collision library; :class:`CrowdSimError` says how to install it where it is absent."""
    try:
        import fcl
    except ImportError:
        raise CrowdSimError(
            "collision tests in 3D need python-fcl; install it with: pip install 'crowdsim[fcl]'"
        ) from None
    return fcl


class CollisionScene:
    """All solids of a place as surfaces of triangles in one broad-phase tree."""

    def __init__(self, solids: Sequence[AnySolid]) -> None:
        self._fcl = load_fcl()
        self._objects = [self._surface(*_triangles(solid)) for solid in solids]
        self._tree = self._fcl.DynamicAABBTreeCollisionManager()
        self._tree.registerObjects(self._objects)
        self._tree.setup()

    def _surface(self, points: Floats, triangles: NDArray[np.int64]) -> Any:
        model = self._fcl.BVHModel()
        model.beginModel(len(points), len(triangles))
        model.addSubModel(points, triangles)
        model.endModel()
        return self._fcl.CollisionObject(model, self._fcl.Transform())

    def body(self, capsules: Capsules) -> list[Any]:
        """Objects to be placed by :meth:`collides`, one for each capsule."""
        lengths = np.linalg.norm(capsules.ends[0, :, 1] - capsules.ends[0, :, 0], axis=1)
        return [
            self._fcl.CollisionObject(self._fcl.Capsule(float(radius), float(length)), self._fcl.Transform())
            for radius, length in zip(capsules.radii, lengths, strict=True)
        ]

    def collides(self, body: Sequence[Any], ends: Floats) -> bool:
        """Whether any capsule of a body, its axis between ``ends`` (K, 2, 3), meets a surface."""
        for part, (start, end) in zip(body, ends, strict=True):
            part.setTransform(self._fcl.Transform(_turn_to(end - start), 0.5 * (start + end)))
            found = self._fcl.CollisionData()
            self._tree.collide(part, found, self._fcl.defaultCollisionCallback)
            if found.result.is_collision:
                return True
        return False


@dataclass(frozen=True)
class Stride:
    """One cycle of a behavior: its capsules relative to the track, and how far (meters) the cycle leads."""

    capsules: Capsules
    length: float

    def placed(self, arc: float, x: float, y: float, heading: float) -> Floats:
        """Axes (K, 2, 3) of the capsules of a body whose track is there, ``arc`` meters along its way."""
        frame = int(arc / self.length * len(self.capsules.ends)) % len(self.capsules.ends)
        ends = self.capsules.ends[frame]
        cos, sin = np.cos(heading), np.sin(heading)
        turned = ends.copy()
        turned[..., 0] = cos * ends[..., 0] - sin * ends[..., 1] + x
        turned[..., 1] = sin * ends[..., 0] + cos * ends[..., 1] + y
        return turned


def _turn_to(axis: Floats) -> Floats:
    """A rotation (3, 3) that takes the z axis along ``axis``."""
    length = float(np.linalg.norm(axis))
    z = axis / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    other = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _triangles(solid: AnySolid) -> tuple[Floats, NDArray[np.int64]]:
    """Points (V, 3) and triangles (T, 3) of a solid's surface."""
    if isinstance(solid, MeshSolid):
        return solid.vertices, solid.triangles
    import trimesh

    mesh = trimesh.creation.extrude_polygon(solid.footprint, solid.top - solid.bottom, engine="triangle")
    return np.asarray(mesh.vertices) + [0.0, 0.0, solid.bottom], np.asarray(mesh.faces, np.int64)
