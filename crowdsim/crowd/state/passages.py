"""Narrow passages, in which two bodies cannot pass each other, so that no agent should stop there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.navmesh import NavMesh

_STRIDE = 0.25  # largest distance between two places of an edge at which its clearance is measured, in widths


def narrow_passages(mesh: NavMesh, least: float, width: float) -> NDArray[np.float64]:
    """Find the free edges of a mesh along which there is nowhere room for two; return (S, 4) x, y of both ends [m].

    All vertices are on obstacles, so an agent that crosses an edge passes between two of them. Room for two is a
    clearance of half of ``width`` [m]: no edge shorter than ``width`` has it, nor has one that goes slantwise through a
    long narrow passage (clearances are measured every _STRIDE widths). Nobody passes through edges shorter than
    ``least`` [m]. These, and edges that only lead into a corner, or another narrow dead end, are left out.
    """
    arrays = mesh.arrays
    triangles = int(arrays.frame[0]["triangles"])
    sides, vertices = arrays.sides[: 3 * triangles], arrays.vertices
    origin = sides["org"].reshape(-1, 3)
    ends = np.stack([vertices["x"][origin], vertices["y"][origin]], axis=-1)
    across = np.roll(ends, -1, axis=1)
    # Open sides: no constraint, and a free triangle on both sides. A side at the border has no twin (-1).
    free = np.asarray(arrays.cover[:triangles]) == 0
    twin = sides["twin"].reshape(-1, 3)
    opened = (sides["constraints"].reshape(-1, 3) == 0) & free[:, None] & (twin >= 0)
    opened &= free[np.where(twin >= 0, twin // 3, 0)]
    opened &= hypot(across[..., 0] - ends[..., 0], across[..., 1] - ends[..., 1]) >= least
    narrow = np.zeros_like(opened)
    narrow[opened] = _are_narrow(mesh, ends[opened], across[opened], width)
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


def _are_narrow(
    mesh: NavMesh, begins: NDArray[np.float64], ends: NDArray[np.float64], width: float
) -> NDArray[np.bool_]:
    """Return which edges (k,) have nowhere a clearance of half of ``width`` [m], as far as it is measured.

    ``begins`` and ``ends`` (k, 2) are their ends [m].
    """
    lengths = hypot(*(ends - begins).T)
    narrow = np.asarray(lengths < width)
    # Look in the middle of the others, then in the middle of both halves, and so on: most have room in the middle.
    left = np.flatnonzero(~narrow)
    parts = 1
    while len(left):
        shares = (np.arange(parts) + 0.5) / parts
        places = begins[left, None] + shares[:, None] * (ends - begins)[left, None]
        clear = mesh.clearances(places.reshape(-1, 2), width / 2).reshape(-1, parts).max(axis=1)
        left = left[clear < width / 2]
        parts *= 2
        # Places are dense enough: room for two that lies between them could exceed the width only a little.
        near = lengths[left] / parts < _STRIDE * width
        narrow[left[near]] = True
        left = left[~near]
    return narrow
