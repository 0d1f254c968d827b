"""A body around a skeleton, posed as a mesh.

The body is modeled once (:mod:`~crowdsim.playback.bodies.sculptor`). A vertex follows a joint, or a blend of two near
waist, shoulders, elbows, hips, knees and the ball of the foot (linear blend skinning). Posing a crowd moves vertices;
triangles never change.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Tissue(IntEnum):
    """What a vertex is part of; decides its color."""

    SHIRT = 0
    TROUSERS = 1
    SKIN = 2
    HAIR = 3
    SHOES = 4


@dataclass(frozen=True)
class BodyMesh:
    """One body of V vertices and F triangles.

    Attributes
    ----------
    triangles : (F, 3) int64
        Indices of vertices.
    tissue : (V,) int8
        A :class:`Tissue` per vertex.
    joints : (V, 2) int32
        The two joints that a vertex follows.
    weights : (V, 2) float32
        Their weights, which sum to 1.
    places : (V, 2, 3) float32
        The vertex in the frame of each of the two joints [m].
    normals : (V, 2, 3) float32
        Unit normals in the frame of each of the two joints.
    fullness : (V,) float32
        Share of a build's girth by which the vertex moves along its normal, from 0 to 1.
    """

    triangles: NDArray[np.int64]
    tissue: NDArray[np.int8]
    joints: NDArray[np.int32]
    weights: NDArray[np.float32]
    places: NDArray[np.float32]
    normals: NDArray[np.float32]
    fullness: NDArray[np.float32]

    @property
    def vertex_count(self) -> int:
        """Return the number of vertices."""
        return len(self.tissue)

    def place(
        self, positions: ArrayLike, rotations: ArrayLike, builds: ArrayLike | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return vertices [m] and unit normals (A, V, 3) of A bodies with joint positions and rotations.

        ``positions`` (A, J, 3) [m] and ``rotations`` (A, J, 4), unit quaternions (w, x, y, z), are those of joints in
        the world. ``builds`` (A, 2) holds stature and girth, see
        :func:`~crowdsim.playback.bodies.builds.builds_of`; by default, bodies are as the skeleton is.
        """
        places, weights, directions = self._by_joint
        joints = len(weights)  # later joints move no vertex
        positions = np.asarray(positions, np.float32)[:, :joints]
        count = len(positions)
        # Each coordinate of a vertex is a sum over joints of weighted places times the joint's turn, and of its shifts:
        # for all bodies together, these are products of matrices.
        turns = _matrices(np.asarray(rotations, np.float32)[:, :joints])
        turns = turns.transpose(0, 2, 1, 3).reshape(3 * count, 3 * joints)
        shifts = positions.transpose(0, 2, 1).reshape(3 * count, joints)
        # One coordinate of all vertices after the other (A, 3, V): numpy is many times faster along them than across.
        vertices = (turns @ places + shifts @ weights).reshape(count, 3, -1)
        normals = (turns @ directions).reshape(count, 3, -1)
        normals /= np.maximum(np.sqrt(np.sum(normals * normals, axis=1, keepdims=True)), np.float32(1e-9))
        if builds is not None:
            # Girth moves vertices along their normals; then stature stretches the body upward from the floor.
            stature, girth = np.asarray(builds, np.float32).T
            vertices += (girth[:, None] * self.fullness)[:, None] * normals
            vertices[:, 2] *= stature[:, None]
        return np.ascontiguousarray(vertices.transpose(0, 2, 1)), np.ascontiguousarray(normals.transpose(0, 2, 1))

    @cached_property
    def _by_joint(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Return weighted places (3J, V), weights (J, V) and weighted normals (3J, V).

        J is the number of joints up to the last that moves a vertex; all is 0 for joints that a vertex does not follow.
        """
        joints = int(self.joints.max()) + 1
        vertex = np.arange(self.vertex_count)
        spread = np.zeros((joints, 7, self.vertex_count), np.float32)  # 7: place, weight, normal
        for slot in (0, 1):
            weight = self.weights[:, slot, None]
            each = np.concatenate([weight * self.places[:, slot], weight, weight * self.normals[:, slot]], axis=1)
            spread[self.joints[:, slot], :, vertex] += each
        places, weights, normals = spread[:, :3], spread[:, 3], spread[:, 4:]
        return places.reshape(3 * joints, -1), weights.copy(), normals.reshape(3 * joints, -1)


def _matrices(q: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rotation matrices (..., 3, 3) of unit quaternions (..., 4), which are (w, x, y, z)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
