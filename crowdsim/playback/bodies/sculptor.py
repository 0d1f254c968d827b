"""The body around a skeleton: clothes, head, hands and shoes, modeled where it stands with hanging arms.

Arms hang nearly all the time that people walk, so this is the pose in which shoulders must look right. Shirt with
sleeves, and trousers, are parts that overlap; :mod:`~crowdsim.playback.bodies.skin_field` makes one skin of them.

Numbers in the code are lengths of an adult [m], times the body's ``scale`` (``k``), and shares. They give parts their
shape and mean nothing else. X points ahead, Y to the left, Z up. The two joints that each vertex follows are joints
(V, 2) and weights (V, 2), the greater weight first.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.kinematics import conjugate, rotate
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.bodies.bare_parts import BodyParts
from crowdsim.playback.bodies.skin_field import Skin, Trunk, Tube, smoothstep
from crowdsim.playback.body_mesh import BodyMesh, Tissue
from crowdsim.playback.surfaces import COARSE, Floats, Surface, loft, unit, vertex_normals

_BLEND, _REACH = 0.014, 0.07
"""Width of the fillets between limbs and trunk, and depth below the skin from which parts are hidden [m]."""

_SHIRT = np.array(
    [
        [0.04, 0.094, 0.136, -0.010],
        [0.12, 0.088, 0.131, -0.008],
        [0.24, 0.062, 0.113, 0.002],
        [0.42, 0.046, 0.106, 0.008],
        [0.60, 0.046, 0.115, 0.010],
        [0.76, 0.042, 0.120, 0.006],
        [0.88, 0.036, 0.110, -0.002],
        [0.98, 0.016, 0.090, -0.010],
        [1.05, -0.020, 0.078, -0.015],
        [1.10, -0.062, 0.070, -0.016],
        [1.14, -0.106, 0.062, -0.014],
        [1.18, -0.120, 0.058, -0.010],
    ]
)
"""Rings of the shirt, from bottom to top: share of the way from hips to shoulders, half breadth beyond that of the
bones, half depth, and shift ahead [m]. The breadth of the bones goes over from that of the hips to that of the
shoulders."""
_TROUSERS = np.array(
    [
        [-0.20, -0.055, 0.030, 0.0],
        [-0.16, -0.015, 0.075, -0.006],
        [-0.06, 0.062, 0.108, -0.012],
        [0.05, 0.074, 0.114, -0.010],
        [0.16, 0.064, 0.108, -0.004],
        [0.20, 0.040, 0.080, -0.002],
    ]
)
"""Rings of the trousers above the legs, with the same columns; they end inside the shirt."""

_BREADTHS = "hip", "shoulder"
_GIRTH = (0.0, 0.24, 0.42, 0.76, 1.05, 1.18), (0.8, 1.0, 1.0, 0.8, 0.3, 0.0)
"""Fullness of a shirt, by the share of the way from hips to shoulders: most at the belly."""

X, Y, Z = np.eye(3)


def build_body(skeleton: Skeleton, sides: int = 16) -> BodyMesh:
    """Return the body of ``skeleton`` with cross-sections of ``sides`` corners.

    Raises
    ------
    MotionError
        If the skeleton lacks a joint role.
    """
    return _Sculptor(skeleton, sides).build()


class _Sculptor(BodyParts):
    """Builds the parts of one body and joins them."""

    def build(self) -> BodyMesh:
        """Build all parts and return the body."""
        self.trousers()
        self.shirt()
        self.head()
        for side in ("left", "right"):
            self.hand(side)
            self.foot(side)
        points, joints = np.concatenate(self.points), np.concatenate(self.joints)
        normals = np.concatenate(self.normals)[:, None]
        # From the world into the frame of each joint.
        back = conjugate(self.turns[joints])
        return BodyMesh(
            triangles=np.concatenate(self.triangles),
            tissue=np.concatenate(self.tissue),
            joints=joints,
            weights=np.concatenate(self.weights).astype(np.float32),
            places=rotate(back, points[:, None] - self.places[joints]).astype(np.float32),
            normals=rotate(back, np.broadcast_to(normals, back.shape[:2] + (3,))).astype(np.float32),
            fullness=np.concatenate(self.fullness).astype(np.float32),
        )

    def trunk(self, rings: Floats) -> tuple[Trunk, Surface]:
        """Return the trunk with ``rings`` (K, 4) around the spine, see _SHIRT: as a signed distance and a surface [m].

        The sections of both are superellipses of exponent 2.3, a little fuller than ellipses.
        """
        k = self.scale
        hips = (self.at("left_hip") + self.at("right_hip")) / 2.0
        height = (self.at("left_shoulder") + self.at("right_shoulder")) / 2.0 - hips
        halves = [0.5 * float(np.linalg.norm(self.at(f"left_{part}") - self.at(f"right_{part}"))) for part in _BREADTHS]
        bones = np.interp(rings[:, 0], [0.1, 0.8], halves)
        # Never less than 4 cm in all, as the hips or shoulders of odd skeletons may be at one place.
        breadth = np.maximum(bones + rings[:, 1] * k, 0.02 * k)
        centers = hips + rings[:, :1] * height + rings[:, 3:] * k * X
        depth = rings[:, 2] * k
        surface = loft(centers, depth[:, None] * X, breadth[:, None] * Y, self.sides + 4, squareness=2.3)
        return Trunk(centers[:, 2], centers[:, :2], depth, breadth, 2.3), surface

    def tube(self, points: Floats, radii: Floats) -> Surface:
        """Return a tube of ``radii`` (K,) along ``points`` (K, 3) [m] with round ends.

        One axis of its sections is as near to X as can be, so no piece of it may run along X.
        """
        # As `surfaces.limb`, but with a direction at each point: the mean of those of the pieces before and after it.
        ways = np.diff(points, axis=0)
        along = unit(np.concatenate([ways[:1], unit(ways[:-1]) + unit(ways[1:]), ways[-1:]]))
        bulge = np.radians([75.0, 45.0, 20.0] if self.sides > COARSE else [50.0])
        centers = np.concatenate(
            [
                points[0] - (radii[0] * np.sin(bulge))[:, None] * along[0],
                points,
                points[-1] + (radii[-1] * np.sin(bulge[::-1]))[:, None] * along[-1],
            ]
        )
        width = np.concatenate([radii[0] * np.cos(bulge), radii, radii[-1] * np.cos(bulge[::-1])])[:, None]
        along = np.concatenate([np.tile(along[0], (len(bulge), 1)), along, np.tile(along[-1], (len(bulge), 1))])
        u = unit(X - (along @ X)[:, None] * along)
        return loft(centers, width * u, width * np.cross(along, u), self.sides)

    def dress(self, trunk: tuple[Trunk, Surface], limbs: list[tuple[Floats, Floats]]) -> tuple[Skin, list[Surface]]:
        """Return the skin over a trunk and limbs, and the surfaces of all parts, the trunk's first.

        :meth:`wear` moves the surfaces to the skin.
        Each of the ``limbs`` is given by points (K, 3) and radii (K,) [m].
        """
        tubes = [self.tube(points, radii) for points, radii in limbs]
        skin = Skin([trunk[0], *(Tube(points, radii) for points, radii in limbs)], _BLEND * self.scale)
        return skin, [trunk[1], *tubes]

    def wear(
        self,
        skin: Skin,
        surface: Surface,
        tissue: Tissue,
        joints: NDArray[np.int32],
        weights: Floats,
        fullness: Floats,
    ) -> None:
        """Add a part of clothes, moved to the skin unless the body is coarse.

        ``joints``, ``weights`` and ``fullness`` of its vertices are as of :meth:`BodyParts.add`.
        """
        if self.sides <= COARSE:
            self.add(surface, tissue, joints, weights, fullness)
            return
        points, share = skin.shrink(surface.points, _REACH * self.scale)
        normals = vertex_normals(points, surface.triangles)
        normals = unit(normals + share[:, None] * (skin.normals(points) - normals))
        self.add(Surface(points, surface.triangles), tissue, joints, weights, fullness, normals)

    def shirt(self) -> None:
        """Add the trunk and its sleeves, which go over into each other at the shoulders."""
        k = self.scale
        trunk = self.trunk(_SHIRT)
        limbs = []
        for side in ("left", "right"):
            shoulder, elbow, wrist = (self.at(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
            top = shoulder - 0.020 * k * Z
            if self.sides <= COARSE:
                points, radii = [top, elbow, wrist], [0.062, 0.049, 0.034]
            else:
                points = [top, *_between(top, elbow, (0.3, 0.62, 0.88)), elbow]
                points += [*_between(elbow, wrist, (0.15, 0.45, 0.78)), wrist]
                radii = [0.059, 0.057, 0.053, 0.049, 0.048, 0.048, 0.047, 0.042, 0.037]
            limbs.append((np.array(points), np.array(radii) * k))
        skin, (body, *sleeves) = self.dress(trunk, limbs)
        joints, weights = self.along_spine(body.points)
        for side, (line, thick), sleeve in zip(("left", "right"), limbs, sleeves, strict=True):
            tube = Tube(line, thick)
            upper, lower = self.skeleton.joint(f"{side}_shoulder"), self.skeleton.joint(f"{side}_elbow")
            shoulder, elbow = self.at(f"{side}_shoulder"), self.at(f"{side}_elbow")
            # On the trunk: the nearer the sleeve, the more a vertex follows the arm, but not below the armpit.
            arm = self.at_shoulder(trunk[0], tube, body.points) * (
                1.0 - smoothstep(0.05 * k, 0.13 * k, shoulder[2] - body.points[:, 2])
            )
            joints, weights = _follow(joints, weights, upper, arm)
            # On the sleeve: below the armpit, nothing but the arm, then the forearm.
            down = (sleeve.points - shoulder) @ unit(elbow - shoulder)
            arm = np.maximum(self.at_shoulder(trunk[0], tube, sleeve.points), smoothstep(0.03 * k, 0.10 * k, down))
            # `of` and `by` are the joints and weights of the sleeve.
            first, share = self.along_spine(sleeve.points)
            of, by = _follow(first, share, upper, arm)
            # `line` ends at the wrist.
            bent = smoothstep(-0.05 * k, 0.05 * k, (sleeve.points - elbow) @ unit(line[-1] - elbow))
            of, by = _follow(of, by, lower, bent)
            fuller = 0.75 - 0.3 * bent
            self.wear(skin, sleeve, Tissue.SHIRT, of, by, fuller)
        # The fullness of the trunk by height; _GIRTH gives it by the shares of the rings.
        rings = np.interp(body.points[:, 2], trunk[0].heights, np.interp(_SHIRT[:, 0], *_GIRTH))
        self.wear(skin, body, Tissue.SHIRT, joints, weights, rings)

    def at_shoulder(self, trunk: Trunk, sleeve: Tube, points: Floats) -> Floats:
        """Return by how much, 0 to 1, points (V, 3) [m] near a shoulder follow the arm, as (V,).

        The deeper a point is in the sleeve, compared with its depth in the trunk, the more it follows. So trunk and
        sleeve move together at the shoulder.
        """
        return smoothstep(-0.05 * self.scale, 0.05 * self.scale, trunk(points) - sleeve(points))

    def trousers(self) -> None:
        """Add hips and legs, which go over into each other."""
        k = self.scale
        trunk = self.trunk(_TROUSERS)
        limbs = []
        for side in ("left", "right"):
            hip, knee, ankle = (self.at(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
            if self.sides <= COARSE:
                points, radii = [hip, knee, ankle], [0.093, 0.066, 0.052]
            else:
                points = [hip, *_between(hip, knee, (0.3, 0.6, 0.88)), knee]
                points += [*_between(knee, ankle, (0.14, 0.4, 0.75)), ankle]
                radii = [0.090, 0.088, 0.081, 0.070, 0.066, 0.065, 0.064, 0.057, 0.053]
            limbs.append((np.array(points), np.array(radii) * k))
        skin, (body, *legs) = self.dress(trunk, limbs)
        joints, weights = self.along_spine(body.points)
        for side, (line, _), leg in zip(("left", "right"), limbs, legs, strict=True):
            upper, lower = self.skeleton.joint(f"{side}_hip"), self.skeleton.joint(f"{side}_knee")
            knee = self.at(f"{side}_knee")
            joints, weights = _follow(joints, weights, upper, self.at_hip(side, body.points))
            # `of` and `by` are the joints and weights of the leg.
            of, by = self.along_spine(leg.points)
            of, by = _follow(of, by, upper, self.at_hip(side, leg.points))
            # Below the knee, a vertex follows the shin; `line` ends at the ankle.
            bent = smoothstep(-0.06 * k, 0.06 * k, (leg.points - knee) @ unit(line[-1] - knee))
            of, by = _follow(of, by, lower, bent)
            self.wear(skin, leg, Tissue.TROUSERS, of, by, 0.8 - 0.5 * bent)
        self.wear(skin, body, Tissue.TROUSERS, joints, weights, np.full(len(body.points), 0.8))

    def at_hip(self, side: str, points: Floats) -> Floats:
        """Return by how much, 0 to 1, points (V, 3) [m] follow the thigh of ``side``, as (V,).

        It is more below the hip joint, and less near the middle of the body. Far below the joint all points of this leg
        follow it, also those beyond the middle of the body by up to 3 cm times the scale.
        """
        k, hip = self.scale, self.at(f"{side}_hip")
        sign = 1.0 if hip[1] > 0.0 else -1.0
        below = smoothstep(-0.07 * k, 0.09 * k, hip[2] - points[:, 2])
        far = smoothstep(0.10 * k, 0.16 * k, hip[2] - points[:, 2])
        aside = smoothstep(-0.02 * k, 0.045 * k, sign * points[:, 1])
        thigh: Floats = below * np.maximum(aside, far * (sign * points[:, 1] > -0.03 * k))
        return thigh

    def along_spine(self, points: Floats) -> tuple[NDArray[np.int32], Floats]:
        """Return joints (V, 2) and weights (V, 2) by which points (V, 3) [m] bend with the bones from hips to neck.

        A point follows the two bones whose middles are next to it in height, with linear weights; above or below all
        middles, it follows the nearest bone alone. A bone moves with its lower joint. Bones without height, as between
        joints at one place, are left out.
        """
        chain = [self.skeleton.joint("neck")]
        # From the neck down to the hips, or to the root (-1 is its parent) if the hips are not below the neck.
        while chain[-1] != self.skeleton.joint("hips") and chain[-1] >= 0:
            chain.append(int(self.skeleton.parents[chain[-1]]))
        heights = [(self.places[low, 2], self.places[high, 2], low) for high, low in pairwise(chain) if low >= 0]
        bones = [
            (0.5 * (low + high), joint) for low, high, joint in reversed(heights) if high - low > 0.01 * self.scale
        ]
        middle = np.array([place for place, _ in bones])
        joint = np.array([joint for _, joint in bones], np.int32)
        # With a single bone, all points follow it.
        if len(bones) == 1:
            return np.broadcast_to(joint, (len(points), 2)).astype(np.int32), np.tile([1.0, 0.0], (len(points), 1))
        below = np.clip(np.searchsorted(middle, points[:, 2]) - 1, 0, len(bones) - 2)
        share = np.clip((points[:, 2] - middle[below]) / (middle[below + 1] - middle[below]), 0.0, 1.0)
        near = np.where(share > 0.5, below + 1, below)
        far = np.where(share > 0.5, below, below + 1)
        weight = np.where(share > 0.5, share, 1.0 - share)
        return np.stack([joint[near], joint[far]], axis=1), np.stack([weight, 1.0 - weight], axis=1)


def _between(start: Floats, end: Floats, shares: tuple[float, ...]) -> list[Floats]:
    """Return the points (3,) at ``shares``, from 0 to 1, of the way from ``start`` to ``end`` (3,)."""
    return [start + share * (end - start) for share in shares]


def _follow(joints: NDArray[np.int32], weights: Floats, joint: int, share: Floats) -> tuple[NDArray[np.int32], Floats]:
    """Return joints and weights (V, 2) of vertices that follow ``joint`` by ``share`` (V,), 0 to 1.

    For the rest they follow the first of their former joints; the second gives way. A share of up to 0.001 counts as 0:
    it changes neither joints nor weights. The greater weight comes first.
    """
    near = np.where(share > 0.5, joint, joints[:, 0])
    far = np.where(share > 0.5, joints[:, 0], joint)
    weight = np.maximum(share, 1.0 - share)
    some = share > 1e-3
    chosen = np.where(some[:, None], np.stack([near, far], axis=1), joints).astype(np.int32)
    return chosen, np.where(some[:, None], np.stack([weight, 1.0 - weight], axis=1), weights)
