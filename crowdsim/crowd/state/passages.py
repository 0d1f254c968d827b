"""Narrow passages, in which two bodies cannot pass each other, so that no agent should stop there."""

from __future__ import annotations

from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.navmesh import NavMesh


class Passages(NamedTuple):
    """S segments across narrow passages, those of the C short ones first, one passage after the other.

    A passage is short if triangles connect all its segments, like those on both faces of a door. The two mouths of a
    corridor are not connected, and so are no short passages.
    """

    segments: NDArray[np.float64]
    """(S, 4) x and y of both ends [m]. Those of a passage are crossed from the right to the left, or all the other way
    round."""
    begin: NDArray[np.int64]
    """(C + 1,): short passage c has segments ``begin[c]:begin[c + 1]``."""

    @classmethod
    def none(cls) -> Passages:
        """Return no passages."""
        return cls(np.empty((0, 4)), np.zeros(1, np.int64))


def narrow_passages(mesh: NavMesh, width: float) -> Passages:
    """Find the free edges of a mesh that are shorter than ``width`` [m], and the passages that they are across.

    All vertices are on obstacles, so an agent that crosses an edge passes between two of them. Edges that only lead
    into a corner, or another narrow dead end, are left out. Edges belong to one short passage if a triangle connects
    two of them, and no third one: where passages fork, each branch is a passage of its own.
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
    kept = opened & narrow
    found, begin = _chains(kept, twin)
    return Passages(np.concatenate([ends.reshape(-1, 2)[found], across.reshape(-1, 2)[found]], axis=1), begin)


def _chains(kept: NDArray[np.bool_], twin: NDArray[np.int32]) -> tuple[list[int], NDArray[np.int64]]:
    """Follow kept sides (T, 3) from triangle to triangle; return one half-edge of each, and where each chain begins.

    Sides without another one in a chain come last.

    All half-edges of a chain lead the same way: each belongs to the triangle that is left across it.
    """
    flat, twins = kept.reshape(-1), twin.reshape(-1)
    # The other kept side of the same triangle, if there are just two.
    mates = np.full(len(flat), -1)
    pairs = np.nonzero(kept[kept.sum(axis=1) == 2])[1].reshape(-1, 2)
    both = pairs + 3 * np.flatnonzero(kept.sum(axis=1) == 2)[:, None]
    mates[both[:, 0]], mates[both[:, 1]] = both[:, 1], both[:, 0]
    chained = np.zeros(len(flat), np.bool_)
    chains: list[list[int]] = []
    for first in np.flatnonzero(flat).tolist():
        found: list[int] = []
        half = first
        while half >= 0 and not chained[half]:
            chained[[half, twins[half]]] = True
            found.append(half)
            half = int(mates[twins[half]])  # forwards: out of the triangle behind this side
        half = int(mates[first])
        while half >= 0 and not chained[half]:
            chained[[half, twins[half]]] = True
            found.append(int(twins[half]))  # backwards: into the triangle before this side
            half = int(mates[twins[half]])
        chains.append(found)
    short = [found for found in chains if len(found) > 1]
    single = [found[0] for found in chains if len(found) == 1]
    return [*chain.from_iterable(short), *single], np.cumsum([0, *map(len, short)])
