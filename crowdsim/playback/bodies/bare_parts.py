"""Parts of a body beside its clothes: head, hands and shoes.

Numbers in the code are lengths of an adult [m], times the body's ``scale`` (``k``), and components of directions. They
give parts their shape and mean nothing else. X points ahead, Y to the left, Z up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.kinematics import forward_kinematics, rotate
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.body_mesh import Tissue
from crowdsim.playback.surfaces import COARSE, Floats, Surface, ellipsoid, limb, loft, unit, vertex_normals

_LEG_LENGTH = 0.84
"""Distance from hip to ankle of the adult for whom the sizes below are given [m]; other bodies are scaled."""
_OUTWARD, _AHEAD = 0.156, 0.03
"""Components of the direction of a hanging upper arm, aside and ahead; the component downward is 1."""

_HAIRLINE = (-1.0, -0.55, -0.2, 0.02, 0.16, 0.3, 0.6, 1.0), (-0.72, -0.66, -0.42, -0.36, 0.06, 0.32, 0.5, 0.64)
"""Places along the skull, from its back to its front, and the height of the hairline at each: nape, behind the ear,
temple, forehead. Both are in half axes of the skull, from its center."""
_HAIR_SLOPE, _HAIR_THICK, _HAIR_DEEP = 0.05, 0.013, 0.005
"""How much thicker hair is a half axis above the hairline, its greatest thickness, and how deep it hides below the skin
[m]."""

X, Y, Z = np.eye(3)


def sculpted_pose(skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Return positions (J, 3) [m] and rotations (J, 4) of the joints around which bodies are modeled: the arms hang.

    Both are in the world; rotations are quaternions (w, x, y, z).
    """
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1))
    rest = skeleton.rest_positions()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = skeleton.joint(f"{side}_shoulder")
        way = unit(rest[skeleton.joint(f"{side}_elbow")] - rest[shoulder])
        hanging = unit([_AHEAD, sign * _OUTWARD, -1.0])
        # The rotation from one unit vector to another is (1 + their dot product, their cross product), normalized.
        turns[0, shoulder] = unit(np.concatenate([[1.0 + way @ hanging], np.cross(way, hanging)]))
    positions, rotations = forward_kinematics(skeleton, np.zeros((1, 3)), turns)
    return positions[0], rotations[0]


class BodyParts:
    """Collects the parts of one body, and adds those that are bare.

    ``sides`` is the number of corners of cross-sections; bodies of up to COARSE are coarse. A role is the name of a
    joint that is the same in all skeletons, as ``left_wrist``.

    Attributes
    ----------
    places, turns : (J, 3) and (J, 4) float64
        Positions [m] and rotations of the joints in the modeled pose, see :func:`sculpted_pose`.
    scale : float
        Length of the legs, as a multiple of that of the adult for whom the sizes are given.
    points, normals : list of (V, 3) float64
        An entry for each surface added, of V vertices: their places [m] and unit normals in the modeled pose.
    triangles : list of (F, 3) int64
        Triangles of each surface; they number the vertices of all surfaces together.
    tissue, joints, weights, fullness : list of (V,) int8, (V, 2) int32, (V, 2) float64 and (V,) float64
        An entry for each surface, as in :class:`~crowdsim.playback.body_mesh.BodyMesh`.
    """

    def __init__(self, skeleton: Skeleton, sides: int) -> None:
        self.skeleton = skeleton
        self.sides = sides
        self.places, self.turns = sculpted_pose(skeleton)
        self.scale = skeleton.leg_length() / _LEG_LENGTH
        self.points: list[Floats] = []
        self.normals: list[Floats] = []
        self.triangles: list[NDArray[np.int64]] = []
        self.tissue: list[NDArray[np.int8]] = []
        self.joints: list[NDArray[np.int32]] = []
        self.weights: list[Floats] = []
        self.fullness: list[Floats] = []

    def at(self, role: str) -> Floats:
        """Return the position (3,) of the joint with ``role`` in the modeled pose [m]."""
        place: Floats = self.places[self.skeleton.joint(role)]
        return place

    def end_of(self, role: str) -> Floats | None:
        """Return the position (3,) [m] of the end site at the joint with ``role`` in the modeled pose.

        Return None if that joint has no end site.
        """
        joint = self.skeleton.joint(role)
        rows = np.flatnonzero(self.skeleton.end_parents == joint)
        if not rows.size:
            return None
        end: Floats = self.places[joint] + rotate(self.turns[joint], self.skeleton.end_offsets[rows[0]])
        return end

    def add(
        self,
        surface: Surface,
        tissue: Tissue,
        joints: NDArray[np.int32] | int,
        weights: Floats | None = None,
        fullness: Floats | float = 0.0,
        normals: Floats | None = None,
    ) -> None:
        """Add a surface of V vertices.

        Parameters
        ----------
        surface : Surface
            Points of the modeled pose [m].
        tissue : Tissue
            What all vertices are part of.
        joints : (V, 2) int32 or int
            The two joints that each vertex follows, or one that all follow.
        weights : (V, 2) float64, optional
            Weights of the two joints; by default 1 and 0.
        fullness : (V,) float64 or float
            Shares of a build's girth, see :class:`~crowdsim.playback.body_mesh.BodyMesh`.
        normals : (V, 3) float64, optional
            Unit normals; those of the surface by default.
        """
        count = len(surface.points)
        self.triangles.append(surface.triangles + sum(len(points) for points in self.points))
        self.points.append(surface.points)
        self.normals.append(vertex_normals(surface.points, surface.triangles) if normals is None else normals)
        self.tissue.append(np.full(count, tissue, np.int8))
        self.joints.append(np.broadcast_to(np.asarray(joints, np.int32), (count, 2)))
        self.weights.append(np.tile([1.0, 0.0], (count, 1)) if weights is None else weights)
        self.fullness.append(np.broadcast_to(fullness, count))

    def head(self) -> None:
        """Add neck, skull, hair down to the nape, and, unless the body is coarse, nose, ears, eyes and brows."""
        k = self.scale
        skull, neck = self.at("head"), self.at("neck")
        # The head points to its end site; upward if it has none, or one at the joint.
        top = self.end_of("head")
        up = unit(top - skull) if top is not None and np.linalg.norm(top - skull) > 0.01 * k else Z
        head, base = self.skeleton.joint("head"), self.skeleton.joint("neck")
        self.add(
            limb(neck - 0.06 * k * Z, skull + 0.04 * k * up, [0.066 * k, 0.056 * k, 0.054 * k], self.sides),
            Tissue.SKIN,
            base,
        )
        ahead = unit(X - np.dot(X, up) * up)
        left = np.cross(up, ahead)
        center = skull + 0.085 * k * up + 0.018 * k * ahead
        axes = np.array([0.098 * k * ahead, 0.076 * k * left, 0.118 * k * up])
        surface = ellipsoid(center, axes, self.sides + 4)
        # Places of the vertices ahead, to the left and up, in half axes of the skull.
        local = (surface.points - center) @ unit(axes).T / np.linalg.norm(axes, axis=1)
        # Chin and jaw are narrower than the brow, and the chin lies ahead of the neck.
        jaw = np.clip(-local[:, 2], 0.0, 1.0)[:, None]
        shaped = (
            surface.points - jaw * 0.30 * local[:, 1:2] * axes[1] - jaw * 0.22 * np.minimum(local[:, :1], 0.0) * axes[0]
        )
        self.add(Surface(shaped, surface.triangles), Tissue.SKIN, head)
        self.hair(Surface(shaped, surface.triangles), local, head)
        if self.sides <= COARSE:
            return
        nose = center + 0.092 * k * ahead - 0.014 * k * up
        self.add(
            limb(nose + 0.024 * k * up - 0.006 * k * ahead, nose - 0.010 * k * up + 0.006 * k * ahead,
                 [0.008 * k, 0.013 * k], 8),
            Tissue.SKIN,
            head,
        )  # fmt: skip
        for sign in (1.0, -1.0):
            ear = center + 0.074 * sign * k * left - 0.008 * k * up - 0.012 * k * ahead
            shape = np.array([0.018 * ahead, 0.009 * left, 0.031 * up]) * k
            self.add(ellipsoid(ear, shape, 8), Tissue.SKIN, head)
            # An eye, and the brow above it.
            for height, thick, half in ((0.010, 0.0055, 0.011), (0.031, 0.0038, 0.017)):
                self.on_face(center, axes, (0.030 * sign * k, height * k), np.array([half, thick]) * k, head)

    def hair(self, skull: Surface, local: Floats, head: int) -> None:
        """Add hair: the skull, thicker above the hairline and hidden below it, so that the hairline is smooth.

        ``local`` (V, 3) are the places of the skull's vertices ahead, to the left and up, in its half axes. ``head`` is
        the number of the joint that the hair moves with.
        """
        above = local[:, 2] - np.interp(local[:, 0], *_HAIRLINE)
        thick = self.scale * np.clip(_HAIR_SLOPE * above, -_HAIR_DEEP, _HAIR_THICK)
        around = vertex_normals(skull.points, skull.triangles)
        self.add(Surface(skull.points + thick[:, None] * around, skull.triangles), Tissue.HAIR, head)

    def on_face(self, center: Floats, axes: Floats, place: tuple[float, float], half: Floats, head: int) -> None:
        """Add an eye or a brow, flat on the front of a skull, which is an ellipsoid; both are as dark as hair.

        Parameters
        ----------
        center : (3,) float64
            Center of the skull [m].
        axes : (3, 3) float64
            Its half axes ahead, to the left and up, one a row [m].
        place : (float, float)
            Distances of the part from the center, to the left and up [m].
        half : (2,) float64
            Half of its width and of its height [m].
        head : int
            Number of the joint that the part moves with.
        """
        lengths = np.linalg.norm(axes, axis=1)
        # `local` is the point on the unit sphere of the skull's half axes; `out` the normal of the ellipsoid there.
        aside, up = place[0] / lengths[1], place[1] / lengths[2]
        local = np.array([np.sqrt(1.0 - aside * aside - up * up), aside, up])
        out = unit((local / lengths) @ unit(axes))
        across = unit(np.cross(unit(axes[2]), out))
        shape = np.array([0.004 * self.scale * out, half[0] * across, half[1] * np.cross(out, across)])
        self.add(ellipsoid(center + local @ axes, shape, 6), Tissue.HAIR, head)

    def hand(self, side: str) -> None:
        """Add the hand of ``side``, left or right: palm, bent fingers, thumb; one ellipsoid if the body is coarse."""
        k = self.scale
        elbow, wrist = self.at(f"{side}_elbow"), self.at(f"{side}_wrist")
        hand = self.skeleton.joint(f"{side}_wrist")
        along = unit(wrist - elbow)
        wide = unit(X - np.dot(X, along) * along)
        flat = np.cross(along, wide)
        if self.sides <= COARSE:
            palm = np.array([0.042 * wide, 0.021 * flat, 0.095 * along]) * k
            self.add(ellipsoid(wrist + 0.075 * k * along, palm, self.sides), Tissue.SKIN, hand)
            return
        palm = np.array([0.040 * wide, 0.017 * flat, 0.062 * along]) * k
        self.add(ellipsoid(wrist + 0.042 * k * along, palm, self.sides), Tissue.SKIN, hand)
        inward = -1.0 if side == "left" else 1.0  # along Y: towards the body, so bend the fingers
        bent = unit(along + 0.28 * inward * Y + 0.10 * X)
        fingers = np.array([0.034 * unit(wide - (wide @ bent) * bent), 0.013 * np.cross(bent, wide), 0.058 * bent]) * k
        self.add(ellipsoid(wrist + 0.115 * k * along + 0.012 * k * inward * Y, fingers, self.sides), Tissue.SKIN, hand)
        thumb = wrist + (0.02 * along + 0.028 * wide) * k
        self.add(limb(thumb, thumb + (0.055 * along + 0.020 * wide) * k, [0.013 * k, 0.010 * k], 8), Tissue.SKIN, hand)

    def foot(self, side: str) -> None:
        """Add the shoe of ``side``, left or right, with a flat sole that bends at the ball."""
        k = self.scale
        ankle, ball = self.at(f"{side}_ankle"), self.at(f"{side}_toe")
        tip = self.end_of(f"{side}_toe")
        # Feet of odd skeletons, whose ankle, ball and tip nearly coincide, get the least sizes of a shoe.
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
        # Rings stand on the sole; their half axes are to the left and up, in this order: left x up is ahead.
        half = rings[:, 2:3] / 2.0
        centers = np.array([ankle[0], ankle[1], sole]) + rings[:, :1] * ahead + half * Z
        surface = loft(centers, rings[:, 1:2] * np.cross(ahead, Z)[None] * -1.0, half * Z, self.sides, squareness=3.0)
        # The share by which a point follows the toe: from 0 to 1 over a quarter of the way to the tip, around the ball.
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
