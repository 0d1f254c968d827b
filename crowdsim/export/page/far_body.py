"""A body of few vertices for distant agents: a prism per bone, each vertex follows one joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.body_mesh import BodyMesh, Tissue
from crowdsim.playback.surfaces import Floats, loft, sideways, unit, vertex_normals

MOST_VERTICES = 120
"""Largest number of vertices of a body for distant agents."""

_SIDES = 4
"""Corners of a prism's cross-section."""
_ADULT_LEG = 0.84
"""Distance from hip to ankle of the adult for whom the sizes below are given [m]."""


def build_far_body(skeleton: Skeleton) -> BodyMesh:
    """Return the body of ``skeleton`` with at most MOST_VERTICES vertices; raise MotionError if it lacks a role."""
    rest = skeleton.rest_positions()
    # Lengths below are those of an adult [m], scaled by the length of the legs.
    k = skeleton.leg_length() / _ADULT_LEG
    parts = _Parts(skeleton, rest)
    at = parts.at
    hips = 0.5 * (at("left_hip") + at("right_hip"))
    shoulders = 0.5 * (at("left_shoulder") + at("right_shoulder"))
    half = 0.5 * float(np.linalg.norm(at("left_shoulder") - at("right_shoulder")))
    belt = hips + 0.2 * (shoulders - hips)
    parts.trunk("hips", hips - [0.0, 0.0, 0.08 * k], belt, (0.13 * k, 0.15 * k), 0.11 * k, Tissue.TROUSERS)
    parts.trunk("chest", belt, shoulders + [0.0, 0.0, 0.05 * k], (0.15 * k, 0.95 * half), 0.10 * k, Tissue.SHIRT)
    skull = at("head")
    parts.limb("head", at("neck"), skull + [0.015 * k, 0.0, 0.19 * k], (0.055 * k, 0.085 * k, 0.05 * k), Tissue.HAIR)
    parts.tissue[-1][:_SIDES] = Tissue.SKIN  # the lowest ring of the head is the neck
    for side in ("left", "right"):
        shoulder, elbow, wrist = (f"{side}_{part}" for part in ("shoulder", "elbow", "wrist"))
        hip, knee, ankle, toe = (f"{side}_{part}" for part in ("hip", "knee", "ankle", "toe"))
        parts.limb(shoulder, at(shoulder), at(elbow), (0.062 * k, 0.048 * k), Tissue.SHIRT)
        hand = at(wrist) + 0.13 * k * unit(at(wrist) - at(elbow))
        parts.limb(elbow, at(elbow), hand, (0.048 * k, 0.03 * k), Tissue.SHIRT)
        parts.limb(hip, at(hip), at(knee), (0.095 * k, 0.062 * k), Tissue.TROUSERS)
        parts.limb(knee, at(knee), at(ankle), (0.062 * k, 0.045 * k), Tissue.TROUSERS)
        # The shoe, from behind the ankle to ahead of the toe. Its axis rises by 0.03 k from the tip to the heel; the
        # sole is 0.03 k below the tip.
        tip_height = min(at(toe)[2], at(ankle)[2]) - 0.005 * k
        heel, tip = at(ankle) + [-0.05 * k, 0.0, 0.0], at(toe) + [0.06 * k, 0.0, 0.0]
        parts.limb(
            ankle, [*heel[:2], tip_height + 0.03 * k], [*tip[:2], tip_height], (0.05 * k, 0.042 * k), Tissue.SHOES
        )
    return parts.body()


class _Parts:
    """Collects prisms."""

    def __init__(self, skeleton: Skeleton, rest: Floats) -> None:
        self._skeleton = skeleton
        self._rest = rest
        self._points: list[Floats] = []
        self._triangles: list[NDArray[np.int64]] = []
        self._joints: list[NDArray[np.int32]] = []
        self.tissue: list[NDArray[np.int8]] = []

    def at(self, role: str) -> Floats:
        """Return the rest position (3,) of the joint with ``role`` [m]."""
        place: Floats = self._rest[self._skeleton.joint(role)]
        return place

    def trunk(self, role: str, low: Floats, high: Floats, widths: tuple[float, float], depth: float, what: int) -> None:
        """Add a box of tissue ``what`` between the points ``low`` and ``high`` (3,) [m], to the joint of ``role``.

        ``widths``, to the sides at the lower and the upper end, and ``depth``, ahead, are the half axes of the ellipses
        through its corners [m].
        """
        across = np.array([[depth, 0.0, 0.0]] * 2)
        beside = np.array([[0.0, width, 0.0] for width in widths])
        self._add(role, np.array([low, high]), across, beside, what)

    def limb(self, role: str, start: ArrayLike, end: ArrayLike, radii: tuple[float, ...], what: int) -> None:
        """Add prisms of tissue ``what`` from ``start`` to ``end`` (3,) [m] to the joint of ``role``.

        radii: half axes of the circles through the corners of cross-sections at even distances [m].
        """
        start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
        u, v = sideways(unit(end - start))
        width = np.array(radii)[:, None]
        self._add(role, np.linspace(start, end, len(radii)), width * u, width * v, what)

    def _add(self, role: str, centers: Floats, across: Floats, beside: Floats, what: int) -> None:
        """Add a square limb along ``centers`` (n, 3) [m] to the joint of ``role``, with flat ends, of tissue ``what``.

        ``across`` and ``beside`` (n, 3) are the half axes of ellipses through the corners of its cross-sections [m].
        """
        # Rotate the square section by 45 degrees, so that its sides, not its corners, face ahead and aside.
        turned = np.sqrt(0.5) * (across + beside), np.sqrt(0.5) * (beside - across)
        surface = loft(centers, *turned, _SIDES)
        # The surface closes its ends around vertices in the middle, its last two. Use two triangles on the four corners
        # of the ring at each end instead.
        corners = len(centers) * _SIDES
        faces = surface.triangles
        capped = np.isin(faces, (corners, corners + 1)).any(axis=1)
        low, high = np.arange(_SIDES), corners - _SIDES + np.arange(_SIDES)
        caps = [
            [low[0], low[2], low[1]],
            [low[0], low[3], low[2]],
            [high[0], high[1], high[2]],
            [high[0], high[2], high[3]],
        ]
        first = sum(len(points) for points in self._points)
        self._triangles.append(np.concatenate([faces[~capped], np.array(caps)]) + first)
        self._points.append(surface.points[:corners])
        self._joints.append(np.full(corners, self._skeleton.joint(role), np.int32))
        self.tissue.append(np.full(corners, what, np.int8))

    def body(self) -> BodyMesh:
        """Return the collected prisms as one body."""
        points, triangles = np.concatenate(self._points), np.concatenate(self._triangles)
        joint = np.concatenate(self._joints)
        tissue = np.concatenate(self.tissue)
        return BodyMesh(
            triangles=triangles,
            tissue=tissue,
            joints=np.stack([joint, joint], axis=1),
            weights=np.tile(np.array([1.0, 0.0], np.float32), (len(points), 1)),
            places=np.repeat((points - self._rest[joint])[:, None], 2, axis=1).astype(np.float32),
            normals=np.repeat(vertex_normals(points, triangles)[:, None], 2, axis=1).astype(np.float32),
            fullness=np.isin(tissue, (Tissue.SHIRT, Tissue.TROUSERS)).astype(np.float32),
        )
