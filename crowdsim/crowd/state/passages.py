"""Narrow passages, in which two bodies cannot pass each other, so that no agent should stop there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.navmesh import NavMesh


def narrow_passages(mesh: NavMesh, width: float) -> NDArray[np.float64]:
    """Find the free edges of a mesh that are shorter than ``width`` [m]; return (S, 4) x and y of both ends.

    All vertices are on obstacles, so an agent that crosses an edge passes between two of them. Edges that only lead
    into a corner, or another narrow dead end, are left out.
    """
    arrays = mesh.arrays
    triangles = int(arrays.frame[0]["triangles"])
    sides, vertices = arrays.sides[: 3 * triangles], arrays.vertices
    origin = sides["org"].reshape(-1, 3)
    ends = np.stack([vertices["x"][origin], vertices["y"][origin]], axis=-1)
    across = np.roll(ends, -1, axis=1)
    # Open sides: no constraint, and a free triangle on both sides.
    free = np.asarray(arrays.cover[:triangles]) == 0
    twin = sides["twin"].reshape(-1, 3)
    opened = (sides["constraints"].reshape(-1, 3) == 0) & free[:, None] & (twin >= 0)
    opened &= free[np.where(twin >= 0, twin // 3, 0)]
    narrow = opened & (hypot(across[..., 0] - ends[..., 0], across[..., 1] - ends[..., 1]) < width)
    while True:
        # A triangle whose only open side is narrow is a dead end: close that side, which may make another one.
        dead = np.flatnonzero((opened.sum(axis=1) == 1) & (opened & narrow).any(axis=1))
        if not len(dead):
            break
        triangle, side = np.nonzero(opened[dead])
        triangle = dead[triangle]
        opened[triangle, side] = False
        other = twin[triangle, side]
        opened[other // 3, other % 3] = False
    # Each edge once, from the half-edge with the lower number of both.
    kept = opened & narrow & (np.arange(3 * triangles).reshape(-1, 3) < twin)
    return np.concatenate([ends[kept], across[kept]], axis=1)
