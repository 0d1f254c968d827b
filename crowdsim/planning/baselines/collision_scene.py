"""Whole bodies against whole obstacles in 3D: what layers are compared with (2018 paper, table 1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.environment.layers import AnySolid
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.errors import CrowdSimError
from crowdsim.geometry.elementary import cos, sin
from crowdsim.geometry.products import dot
from crowdsim.motion.clips.body_capsules import Capsules

Floats = NDArray[np.float64]

_RING = (6, 8)
"""Rings along a capsule and points around it: its surface lies within 8 % of its radius of the round one."""


def load_fcl() -> Any:
    """The collision library; CrowdSimError says how to install it where it is absent."""
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
        self._objects = [_surface(*_triangles(solid)) for solid in solids]
        self._tree = self._fcl.DynamicAABBTreeCollisionManager()
        self._tree.registerObjects(self._objects)
        self._tree.setup()

    def collides(self, body: Any, x: float, y: float, heading: float) -> bool:
        """Whether the surface of a posed body (:class:`Stride`) meets one of the scene where its track is so."""
        c, s = cos(heading), sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        body.setTransform(self._fcl.Transform(turn, np.array([x, y, 0.0])))
        found = self._fcl.CollisionData()
        self._tree.collide(body, found, self._fcl.defaultCollisionCallback)
        return bool(found.result.is_collision)


class Stride:
    """One cycle of a behavior: a surface of the whole body for each frame, and how far (meters) the cycle leads."""

    def __init__(self, capsules: Capsules, length: float) -> None:
        import trimesh

        self.length = length
        self._bodies = []
        for frame in capsules.ends:
            axes = zip(frame, capsules.radii.tolist(), strict=True)
            parts = [_capsule(start, end, radius) for (start, end), radius in axes]
            body = trimesh.util.concatenate(parts)
            # Rounded, as trimesh takes sines of the C library.
            points = np.round(np.asarray(body.vertices), 6)
            self._bodies.append(_surface(points, np.asarray(body.faces, np.int64)))

    def body(self, arc: float) -> Any:
        """The body ``arc`` meters along its way."""
        return self._bodies[int(arc / self.length * len(self._bodies)) % len(self._bodies)]


def _surface(points: Floats, triangles: NDArray[np.int64]) -> Any:
    fcl = load_fcl()
    model = fcl.BVHModel()
    model.beginModel(len(points), len(triangles))
    model.addSubModel(points, triangles)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def _capsule(start: Floats, end: Floats, radius: float) -> Any:
    """A trimesh around the axis from ``start`` to ``end``."""
    import trimesh

    axis = end - start
    length = float(np.sqrt(dot(axis, axis)))
    capsule = trimesh.creation.capsule(height=length, radius=radius, count=_RING)
    turn = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis if length > 0.0 else [0.0, 0.0, 1.0])
    turn[:3, 3] = 0.5 * (start + end)
    return capsule.apply_transform(turn)


def _triangles(solid: AnySolid) -> tuple[Floats, NDArray[np.int64]]:
    """Points (V, 3) and triangles (T, 3) of a solid's surface."""
    if isinstance(solid, MeshSolid):
        return solid.vertices, solid.triangles
    import trimesh

    mesh = trimesh.creation.extrude_polygon(solid.footprint, solid.top - solid.bottom, engine="triangle")
    return np.asarray(mesh.vertices) + [0.0, 0.0, solid.bottom], np.asarray(mesh.faces, np.int64)
