"""Quaternions and forward kinematics on whole arrays; quaternions are (w, x, y, z)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import acos, atan2, cos, sin
from crowdsim.motion.clips.skeleton import Skeleton

Floats = NDArray[np.float64]


def _together(*parts: Floats) -> Floats:
    """Return the parts (...) as the last axis of one array, as ``np.stack`` does, but faster."""
    joined = np.empty((*np.shape(parts[0]), len(parts)), np.result_type(*parts))
    for number, part in enumerate(parts):
        joined[..., number] = part
    return joined


def multiply(a: Floats, b: Floats) -> Floats:
    """Return the Hamilton product of quaternions (..., 4): the rotation ``b`` followed by ``a``."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    return _together(
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def unit(vectors: Floats) -> Floats:
    """Return ``vectors`` (..., n) scaled to length one; zero stays zero."""
    scaled: Floats = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return scaled


def conjugate(q: Floats) -> Floats:
    """Return the inverse of unit quaternions (..., 4)."""
    inverse: Floats = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def rotate(q: Floats, v: Floats) -> Floats:
    """Return vectors (..., 3) turned by unit quaternions (..., 4)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    vx, vy, vz = v[..., 0], v[..., 1], v[..., 2]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return _together(
        vx + w * tx + (y * tz - z * ty),
        vy + w * ty + (z * tx - x * tz),
        vz + w * tz + (x * ty - y * tx),
    )


def about_axis(axis: Floats, angle: Floats | float) -> Floats:
    """Return quaternions (..., 4) of turns by ``angle`` [rad] about the unit vector ``axis`` (3,)."""
    half = np.asarray(angle, np.float64) / 2.0
    return np.concatenate([cos(half)[..., None], sin(half)[..., None] * np.asarray(axis, np.float64)], axis=-1)


def rotation_vectors(q: Floats) -> Floats:
    """Return rotation vectors (..., 3), axes times angles [rad], of unit quaternions (..., 4), the shorter way."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    scale = np.where(sine < 1e-9, 2.0, 2.0 * atan2(sine, q[..., :1]) / np.maximum(sine, 1e-9))
    vectors: Floats = scale * q[..., 1:]
    return vectors


def turns_of(vectors: Floats) -> Floats:
    """Return unit quaternions (..., 4) of rotation vectors (..., 3), axes times angles [rad]."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    scale = np.where(angle < 1e-9, 0.5, sin(0.5 * angle) / np.maximum(angle, 1e-9))
    return np.concatenate([cos(0.5 * angle), scale * vectors], axis=-1)


def slerp(a: Floats, b: Floats, weight: Floats | float) -> Floats:
    """Interpolate unit quaternions (..., 4) spherically, the shorter way: ``a`` at ``weight`` (...) 0, ``b`` at 1."""
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0.0, -b, b)
    angle = acos(np.clip(np.abs(dot), 0.0, 1.0))
    weight = np.asarray(weight, np.float64)[..., None]
    sine = sin(angle)
    # Nearly equal rotations are mixed linearly, as the sine is too small to divide by.
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    wa = np.where(near, 1.0 - weight, sin((1.0 - weight) * angle) / safe)
    wb = np.where(near, weight, sin(weight * angle) / safe)
    mixed = wa * a + wb * b
    return unit(mixed)


def forward_kinematics(skeleton: Skeleton, root_positions: Floats, rotations: Floats) -> tuple[Floats, Floats]:
    """Return world positions (F, J, 3) [m] and world rotations (F, J, 4) of all joints.

    root_positions: (F, 3) [m]. rotations: (F, J, 4), each joint relative to its parent.
    """
    positions = np.empty(rotations.shape[:-1] + (3,))
    world = np.empty_like(rotations)
    for joints in _generations(skeleton):
        parents = skeleton.parents[joints]
        if parents[0] < 0:
            world[..., joints, :] = rotations[..., joints, :]
            positions[..., joints, :] = root_positions[..., None, :]
        else:
            turned = world[..., parents, :]
            world[..., joints, :] = multiply(turned, rotations[..., joints, :])
            positions[..., joints, :] = positions[..., parents, :] + rotate(turned, skeleton.offsets[joints])
    return positions, world


def _generations(skeleton: Skeleton) -> list[list[int]]:
    """Return the joints grouped by depth in the tree; each group depends only on those before it."""
    depths: list[int] = []
    for parent in skeleton.parents.tolist():
        depths.append(0 if parent < 0 else depths[parent] + 1)
    return [[joint for joint, depth in enumerate(depths) if depth == each] for each in range(max(depths) + 1)]


def end_positions(skeleton: Skeleton, positions: Floats, world: Floats) -> Floats:
    """Return world positions (F, K, 3) of the end sites, from the results of :func:`forward_kinematics` [m]."""
    parents = skeleton.end_parents
    return positions[..., parents, :] + rotate(world[..., parents, :], skeleton.end_offsets)
