"""Quaternions and forward kinematics on whole arrays; quaternions are (w, x, y, z)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import acos, atan2, cos, sin
from crowdsim.motion.clips.skeleton import Skeleton

Floats = NDArray[np.float64]


def multiply(a: Floats, b: Floats) -> Floats:
    """Hamilton product of quaternions (..., 4): the rotation ``b`` followed by ``a``."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def unit(vectors: Floats) -> Floats:
    """``vectors`` (..., n) at length one; zero stays zero."""
    scaled: Floats = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return scaled


def conjugate(q: Floats) -> Floats:
    """Inverse of unit quaternions (..., 4)."""
    inverse: Floats = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def rotate(q: Floats, v: Floats) -> Floats:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    vx, vy, vz = np.moveaxis(v, -1, 0)
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    turned = vx + w * tx + (y * tz - z * ty), vy + w * ty + (z * tx - x * tz), vz + w * tz + (x * ty - y * tx)
    return np.stack(turned, axis=-1)


def about_axis(axis: Floats, angle: Floats | float) -> Floats:
    """Quaternions (..., 4) of turns by ``angle`` radians about the unit vector ``axis`` (3,)."""
    half = np.asarray(angle, np.float64) / 2.0
    return np.concatenate([cos(half)[..., None], sin(half)[..., None] * np.asarray(axis, np.float64)], axis=-1)


def rotation_vectors(q: Floats) -> Floats:
    """Axes times angles (..., 3) [rad] of unit quaternions (..., 4), the shorter way round."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    scale = np.where(sine < 1e-9, 2.0, 2.0 * atan2(sine, q[..., :1]) / np.maximum(sine, 1e-9))
    vectors: Floats = scale * q[..., 1:]
    return vectors


def turns_of(vectors: Floats) -> Floats:
    """Unit quaternions (..., 4) of rotation vectors (..., 3), axes times angles [rad]."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    scale = np.where(angle < 1e-9, 0.5, sin(0.5 * angle) / np.maximum(angle, 1e-9))
    return np.concatenate([cos(0.5 * angle), scale * vectors], axis=-1)


def slerp(a: Floats, b: Floats, weight: Floats | float) -> Floats:
    """Spherical interpolation along the shorter arc: ``a`` at weight 0, ``b`` at weight 1."""
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0.0, -b, b)
    angle = acos(np.clip(np.abs(dot), 0.0, 1.0))
    weight = np.asarray(weight, np.float64)[..., None]
    sine = sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    wa = np.where(near, 1.0 - weight, sin((1.0 - weight) * angle) / safe)
    wb = np.where(near, weight, sin(weight * angle) / safe)
    mixed = wa * a + wb * b
    return unit(mixed)


def forward_kinematics(skeleton: Skeleton, root_positions: Floats, rotations: Floats) -> tuple[Floats, Floats]:
    """World positions (F, J, 3) and world rotations (F, J, 4) of all joints."""
    positions = np.empty(rotations.shape[:-1] + (3,))
    world = np.empty_like(rotations)
    for j, parent in enumerate(skeleton.parents):
        if parent < 0:
            world[..., j, :] = rotations[..., j, :]
            positions[..., j, :] = root_positions
        else:
            world[..., j, :] = multiply(world[..., parent, :], rotations[..., j, :])
            positions[..., j, :] = positions[..., parent, :] + rotate(world[..., parent, :], skeleton.offsets[j])
    return positions, world


def end_positions(skeleton: Skeleton, positions: Floats, world: Floats) -> Floats:
    """World positions (F, K, 3) of the end sites, from the results of :func:`forward_kinematics`."""
    parents = skeleton.end_parents
    return positions[..., parents, :] + rotate(world[..., parents, :], skeleton.end_offsets)
