"""The bodies of a page: a detailed one for near agents, and one of few vertices for distant agents."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.page.far_body import build_far_body
from crowdsim.export.page.packing import Block, Ints
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.bodies.builds import builds_of
from crowdsim.playback.bodies.sculptor import build_body
from crowdsim.playback.body_mesh import BodyMesh
from crowdsim.playback.crowd_mesh import looks_of, shades_of

LEVELS = 200
"""Number of agents present at once above which distant ones are drawn with few vertices."""

PLACES = 20_000
"""Integer units per meter for positions of vertices."""

_SIDES = ((40, 16), (10**9, 10))
"""Corners of a near body's cross-sections: (largest number of agents present at once, corners)."""


def pack_bodies(block: Block, skeleton: Skeleton, most_present: int) -> dict[str, Any]:
    """Add the bodies to the block; return the number of vertices of each: ``near``, and ``far`` if there is one.

    ``most_present`` is the largest number of agents present at once.
    """
    sides = next(sides for limit, sides in _SIDES if most_present <= limit)
    near = build_body(skeleton, sides)
    _pack(block, "near", near)
    facts = {"near": near.vertex_count}
    if most_present > LEVELS:
        far = build_far_body(skeleton)
        _pack(block, "far", far)
        facts["far"] = far.vertex_count
    return facts


def pack_looks(block: Block, skeleton: Skeleton, agents: Ints) -> None:
    """Add the looks of ``agents`` (n,) to the block: ``looks`` (n, tissues, 3) RGB, and ``builds`` (n, 3).

    The columns of ``builds`` are stature (a multiple of the skeleton's), girth [m], and shade of the shirt.
    """
    count = int(agents.max(initial=-1)) + 1
    block.add("looks", looks_of(count)[agents])
    block.add("builds", np.column_stack([builds_of(count, skeleton), shades_of(count)])[agents].astype(np.float32))


def _pack(block: Block, name: str, body: BodyMesh) -> None:
    """Add a body's mesh to the block, with values rounded to bytes or to whole units of PLACES."""
    block.add(f"{name}_triangles", body.triangles.astype(np.uint16))
    block.add(f"{name}_tissue", body.tissue.astype(np.uint8))
    block.add(f"{name}_joints", body.joints.astype(np.uint8))
    block.add(f"{name}_weights", np.rint(255.0 * body.weights[:, 0]).astype(np.uint8))
    block.add(f"{name}_places", _whole(body.places * PLACES))
    block.add(f"{name}_normals", np.rint(127.0 * body.normals).astype(np.int8))
    block.add(f"{name}_fullness", np.rint(255.0 * body.fullness).astype(np.uint8))


def _whole(values: NDArray[np.float32]) -> NDArray[np.int16]:
    """Return values rounded, and limited to what int16 holds."""
    return np.clip(np.rint(values), -32767, 32767).astype(np.int16)
