"""Looks of agents in scene files: a shared body, and the materials of its parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.scenes.place import Paint
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.bodies.bare_parts import sculpted_pose
from crowdsim.playback.bodies.builds import GIRTHS
from crowdsim.playback.bodies.sculptor import build_body
from crowdsim.playback.body_mesh import BodyMesh, Tissue
from crowdsim.playback.crowd_mesh import looks_of

VARIETY = 30
"""Number of looks; agents whose numbers differ by a multiple of it look the same."""

_SIDES = 10
"""Corners of a body's cross-sections: few, as a viewer draws the shared body for each agent."""


def paints(variety: int) -> list[list[Paint]]:
    """Return, for each look, the paint of each :class:`Tissue`."""
    colors = looks_of(variety) / 255.0
    return [
        [Paint(f"{tissue.name.lower()} {number}", *colors[number, tissue].tolist()) for tissue in Tissue]
        for number in range(variety)
    ]


def body_of(skeleton: Skeleton) -> BodyMesh:
    """Return the body that all agents share; :func:`bound_points` gives its builds."""
    return build_body(skeleton, _SIDES)


def build_of(look: int) -> int:
    """Return which of the builds of GIRTHS the agents of a look have."""
    return look % len(GIRTHS)


def bound_points(body: BodyMesh, skeleton: Skeleton) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the vertices (B, V, 3) [m] of each build and normals (V, 3) in the bind pose, its root at the origin."""
    positions, rotations = sculpted_pose(skeleton)
    builds = np.array([[1.0, girth] for girth in GIRTHS], np.float32)
    count = len(builds)
    points, normals = body.place(np.repeat(positions[None], count, 0), np.repeat(rotations[None], count, 0), builds)
    return points, normals[0]


def tissue_triangles(body: BodyMesh) -> list[tuple[Tissue, NDArray[np.int64]]]:
    """Return the triangles (t, 3) of each tissue; a triangle belongs to the tissue of its first corner."""
    of = body.tissue[body.triangles[:, 0]]
    return [(tissue, body.triangles[of == tissue]) for tissue in Tissue if (of == tissue).any()]
