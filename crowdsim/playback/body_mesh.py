"""A body with limbs around a skeleton, and all bodies of a crowd as one mesh.

The body is modeled once around the skeleton's rest pose. Each vertex follows one joint, or a blend of two near the
waist and the ball of the foot (linear blend skinning). Posing a crowd moves vertices; triangles never change.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.surfaces import COARSE, Floats, Surface, ellipsoid, limb, loft, unit, vertex_normals

_LEG_LENGTH = 0.84
"""Distance from hip to ankle of the adult for whom the sizes below are given [m]; other bodies are scaled."""

X, Y, Z = np.eye(3)


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
    normals : (V, 3) float32
        Unit normals in the frame of the first joint.
    """

    triangles: NDArray[np.int64]
    tissue: NDArray[np.int8]
    joints: NDArray[np.int32]
    weights: NDArray[np.float32]
    places: NDArray[np.float32]
    normals: NDArray[np.float32]

    @property
    def vertex_count(self) -> int:
        """Return the number of vertices."""
        return len(self.tissue)

    def place(self, positions: ArrayLike, rotations: ArrayLike) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return vertices and normals (A, V, 3) of bodies with joint positions (A, J, 3) and rotations (A, J, 4)."""
        matrices = _matrices(np.asarray(rotations, np.float32))
        positions = np.asarray(positions, np.float32)
        vertices = np.zeros((len(positions), self.vertex_count, 3), np.float32)
        normals = np.empty_like(vertices)
        for joint in np.unique(self.joints):
            turned = matrices[:, joint].transpose(0, 2, 1)
            for slot in (0, 1):
                rows = np.flatnonzero((self.joints[:, slot] == joint) & (self.weights[:, slot] > 0.0))
                moved = self.places[rows, slot] @ turned + positions[:, joint, None]
                vertices[:, rows] += self.weights[rows, slot, None] * moved
            rows = np.flatnonzero(self.joints[:, 0] == joint)
            normals[:, rows] = self.normals[rows] @ turned
        return vertices, normals


def _matrices(q: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def build_body(skeleton: Skeleton, sides: int = 16) -> BodyMesh:
    """Return the body of ``skeleton`` with cross-sections of ``sides`` corners.

    Raises
    ------
    MotionError
        If the skeleton lacks a joint role.
    """
    return _Sculptor(skeleton, sides).build()


class _Sculptor:
    """Builds the parts of one body in rest pose and joins them."""

    def __init__(self, skeleton: Skeleton, sides: int) -> None:
        self.skeleton = skeleton
        self.sides = sides
        identity = np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1))
        self.rest = forward_kinematics(skeleton, np.zeros((1, 3)), identity)[0][0]
        leg = np.linalg.norm(self.at("left_hip") - self.at("left_knee")) + np.linalg.norm(
            self.at("left_knee") - self.at("left_ankle")
        )
        self.scale = float(leg) / _LEG_LENGTH
        self.points: list[Floats] = []
        self.triangles: list[NDArray[np.int64]] = []
        self.tissue: list[NDArray[np.int8]] = []
        self.joints: list[NDArray[np.int32]] = []
        self.weights: list[Floats] = []

    def at(self, role: str) -> Floats:
        """Return the rest position of the joint with ``role``."""
        place: Floats = self.rest[self.skeleton.joint(role)]
        return place

    def end_of(self, role: str) -> Floats | None:
        """Return the rest position of the end site at the joint with ``role``, if any."""
        rows = np.flatnonzero(self.skeleton.end_parents == self.skeleton.joint(role))
        return self.at(role) + self.skeleton.end_offsets[rows[0]] if rows.size else None

    def add(
        self,
        surface: Surface,
        tissue: Tissue | NDArray[np.int8],
        joints: NDArray[np.int32] | int,
        weights: Floats | None = None,
    ) -> None:
        """Add a surface with its tissue, and the joints and weights that its vertices follow."""
        count = len(surface.points)
        self.triangles.append(surface.triangles + sum(len(points) for points in self.points))
        self.points.append(surface.points)
        self.tissue.append(np.broadcast_to(np.asarray(tissue, np.int8), count))
        self.joints.append(np.broadcast_to(np.asarray(joints, np.int32), (count, 2)))
        self.weights.append(np.tile([1.0, 0.0], (count, 1)) if weights is None else weights)

    def build(self) -> BodyMesh:
        """Build all parts and return the body."""
        self.torso()
        self.head()
        for side in ("left", "right"):
            self.arm(side)
            self.leg(side)
            self.foot(side)
        points, triangles = np.concatenate(self.points), np.concatenate(self.triangles)
        joints = np.concatenate(self.joints)
        return BodyMesh(
            triangles=triangles,
            tissue=np.concatenate(self.tissue),
            joints=joints,
            weights=np.concatenate(self.weights).astype(np.float32),
            places=(points[:, None] - self.rest[joints]).astype(np.float32),
            normals=vertex_normals(points, triangles).astype(np.float32),
        )

    def torso(self) -> None:
        """Add rings from crotch to neck, as wide as hips and shoulders, bending with the spine."""
        k = self.scale
        hips = (self.at("left_hip") + self.at("right_hip")) / 2.0
        shoulders = (self.at("left_shoulder") + self.at("right_shoulder")) / 2.0
        neck = self.at("neck")
        hip_half = np.linalg.norm(self.at("left_hip") - self.at("right_hip")) / 2.0
        shoulder_half = np.linalg.norm(self.at("left_shoulder") - self.at("right_shoulder")) / 2.0
        height = shoulders - hips
        # Each ring: position on the line from hips (0) to shoulders (1), half breadth, half depth, shift forward.
        rings = np.array(
            [
                [-0.17, 0.30 * hip_half, 0.040 * k, 0.0],
                [-0.14, 0.70 * hip_half + 0.03 * k, 0.085 * k, -0.005 * k],
                [-0.04, hip_half + 0.070 * k, 0.112 * k, -0.012 * k],
                [0.10, hip_half + 0.068 * k, 0.112 * k, -0.008 * k],
                [0.24, hip_half + 0.052 * k, 0.102 * k, 0.004 * k],
                [0.40, 0.5 * (hip_half + shoulder_half) + 0.012 * k, 0.098 * k, 0.010 * k],
                [0.60, 0.80 * shoulder_half + 0.010 * k, 0.110 * k, 0.012 * k],
                [0.78, 0.92 * shoulder_half, 0.114 * k, 0.006 * k],
                [0.92, 0.98 * shoulder_half, 0.100 * k, -0.004 * k],
                [1.02, 0.95 * shoulder_half, 0.082 * k, -0.010 * k],
                [1.08, 0.80 * shoulder_half, 0.070 * k, -0.012 * k],
                [1.13, 0.52 * shoulder_half, 0.064 * k, -0.012 * k],
                [1.17, 0.36 * shoulder_half, 0.058 * k, -0.006 * k],
            ]
        )
        centers = hips + rings[:, :1] * height + rings[:, 3:] * X
        centers[-1, 2] = max(centers[-1, 2], neck[2] - 0.01 * k)
        surface = loft(centers, rings[:, 2:3] * X, rings[:, 1:2] * Y, self.sides + 4, squareness=2.4)
        joints, weights = self.along_spine(surface.points)
        belt = hips[2] + 0.16 * height[2]
        tissue = np.where(surface.points[:, 2] < belt, Tissue.TROUSERS, Tissue.SHIRT).astype(np.int8)
        self.add(surface, tissue, joints, weights)

    def along_spine(self, points: Floats) -> tuple[NDArray[np.int32], Floats]:
        """Return joints (V, 2) and weights (V, 2) by which points bend with the bones between hips and neck.

        A point follows the two bones whose middles are next to it in height, with linear weights.
        """
        chain = [self.skeleton.joint("neck")]
        while chain[-1] != self.skeleton.joint("hips") and chain[-1] >= 0:
            chain.append(int(self.skeleton.parents[chain[-1]]))
        heights = [(self.rest[low, 2], self.rest[high, 2], low) for high, low in pairwise(chain) if low >= 0]
        bones = [
            (0.5 * (low + high), joint) for low, high, joint in reversed(heights) if high - low > 0.01 * self.scale
        ]
        middle = np.array([place for place, _ in bones])
        joint = np.array([joint for _, joint in bones], np.int32)
        if len(bones) == 1:
            return np.broadcast_to(joint, (len(points), 2)).astype(np.int32), np.tile([1.0, 0.0], (len(points), 1))
        below = np.clip(np.searchsorted(middle, points[:, 2]) - 1, 0, len(bones) - 2)
        share = np.clip((points[:, 2] - middle[below]) / (middle[below + 1] - middle[below]), 0.0, 1.0)
        near = np.where(share > 0.5, below + 1, below)
        far = np.where(share > 0.5, below, below + 1)
        weight = np.where(share > 0.5, share, 1.0 - share)
        return np.stack([joint[near], joint[far]], axis=1), np.stack([weight, 1.0 - weight], axis=1)

    def head(self) -> None:
        """Add neck, skull with hair, and a nose that shows where the face is."""
        k = self.scale
        skull, neck = self.at("head"), self.at("neck")
        top = self.end_of("head")
        up = unit(top - skull) if top is not None and np.linalg.norm(top - skull) > 0.01 * k else Z
        head, base = self.skeleton.joint("head"), self.skeleton.joint("neck")
        self.add(
            limb(neck - 0.03 * k * Z, skull + 0.05 * k * up, [0.064 * k, 0.057 * k, 0.056 * k], self.sides),
            Tissue.SKIN,
            base,
        )
        center = skull + 0.085 * k * up + 0.018 * k * X
        ahead = unit(X - np.dot(X, up) * up)
        axes = np.array([0.098 * k * ahead, 0.077 * k * np.cross(up, ahead), 0.122 * k * up])
        surface = ellipsoid(center, axes, self.sides + 4)
        local = (surface.points - center) @ unit(axes).T / np.linalg.norm(axes, axis=1)
        # Chin and jaw are narrower than the brow.
        jaw = np.clip(-local[:, 2], 0.0, 1.0)[:, None]
        shaped = (
            surface.points - jaw * 0.28 * local[:, 1:2] * axes[1] - jaw * 0.15 * np.minimum(local[:, :1], 0.0) * axes[0]
        )
        hair = (local[:, 2] > 0.48) | ((local[:, 0] < 0.12) & (local[:, 2] > -0.42))
        self.add(Surface(shaped, surface.triangles), np.where(hair, Tissue.HAIR, Tissue.SKIN).astype(np.int8), head)
        if self.sides <= COARSE:
            return
        nose = center + 0.092 * k * ahead - 0.012 * k * up
        self.add(
            limb(
                nose + 0.02 * k * up - 0.006 * k * ahead,
                nose - 0.012 * k * up + 0.004 * k * ahead,
                [0.009 * k, 0.013 * k],
                8,
            ),
            Tissue.SKIN,
            head,
        )

    def arm(self, side: str) -> None:
        """Add upper arm, forearm and hand."""
        k = self.scale
        shoulder, elbow, wrist = (self.at(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        upper, lower, hand = (self.skeleton.joint(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        self.add(limb(shoulder, elbow, np.array([0.062, 0.058, 0.051, 0.045]) * k, self.sides), Tissue.SHIRT, upper)
        self.add(limb(elbow, wrist, np.array([0.045, 0.046, 0.040, 0.032]) * k, self.sides), Tissue.SHIRT, lower)
        along = unit(wrist - elbow)
        wide = unit(X - np.dot(X, along) * along)
        flat = np.cross(along, wide)
        palm = wrist + 0.075 * k * along
        self.add(
            ellipsoid(palm, np.array([0.042 * wide, 0.021 * flat, 0.095 * along]) * k, self.sides), Tissue.SKIN, hand
        )
        if self.sides <= COARSE:
            return
        thumb = wrist + (0.03 * along + 0.026 * wide) * k
        self.add(limb(thumb, thumb + (0.05 * along + 0.022 * wide) * k, [0.014 * k, 0.011 * k], 8), Tissue.SKIN, hand)

    def leg(self, side: str) -> None:
        """Add thigh and shank with its calf."""
        k = self.scale
        hip, knee, ankle = (self.at(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        upper, lower = self.skeleton.joint(f"{side}_hip"), self.skeleton.joint(f"{side}_knee")
        thigh = np.array([0.092, 0.090, 0.082, 0.070, 0.060]) * k
        shank = np.array([0.060, 0.062, 0.058, 0.049, 0.044]) * k
        self.add(limb(hip, knee, thigh, self.sides), Tissue.TROUSERS, upper)
        self.add(limb(knee, ankle, shank, self.sides), Tissue.TROUSERS, lower)

    def foot(self, side: str) -> None:
        """Add a shoe with a flat sole that bends at the ball."""
        k = self.scale
        ankle, ball = self.at(f"{side}_ankle"), self.at(f"{side}_toe")
        tip = self.end_of(f"{side}_toe")
        reach = (ball - ankle) * [1.0, 1.0, 0.0]
        ahead = unit(reach) if np.linalg.norm(reach) > 0.02 * k else X
        heel_to_ball = max(float(np.dot(ball - ankle, ahead)), 0.08 * k)
        to_tip = 0.06 * k if tip is None else float(np.clip(np.dot(tip - ball, ahead), 0.05 * k, 0.08 * k))
        sole = ball[2] - 0.028 * k
        rise = max(ankle[2] - sole, 0.06 * k)
        # Each ring: position along the foot from the ankle, half breadth, height above the sole.
        rings = np.array(
            [
                [-0.068 * k, 0.020 * k, 0.5 * rise],
                [-0.060 * k, 0.034 * k, 0.85 * rise],
                [-0.030 * k, 0.040 * k, 1.08 * rise],
                [0.020 * k, 0.041 * k, 1.10 * rise],
                [0.45 * heel_to_ball, 0.042 * k, 0.80 * rise],
                [heel_to_ball, 0.050 * k, 0.056 * k],
                [heel_to_ball + 0.55 * to_tip, 0.046 * k, 0.047 * k],
                [heel_to_ball + 0.92 * to_tip, 0.032 * k, 0.040 * k],
                [heel_to_ball + to_tip, 0.016 * k, 0.026 * k],
            ]
        )
        half = rings[:, 2:3] / 2.0
        centers = np.array([ankle[0], ankle[1], sole]) + rings[:, :1] * ahead + half * Z
        surface = loft(centers, rings[:, 1:2] * np.cross(ahead, Z)[None] * -1.0, half * Z, self.sides, squareness=3.0)
        along = (surface.points - ankle) @ ahead
        share = np.clip((along - heel_to_ball) / (0.25 * to_tip) + 0.5, 0.0, 1.0)
        foot, toe = self.skeleton.joint(f"{side}_ankle"), self.skeleton.joint(f"{side}_toe")
        first, second = np.where(share > 0.5, toe, foot), np.where(share > 0.5, foot, toe)
        weight = np.maximum(share, 1.0 - share)
        self.add(
            surface,
            Tissue.SHOES,
            np.stack([first, second], axis=1).astype(np.int32),
            np.stack([weight, 1.0 - weight], axis=1),
        )
