"""Looks of characters in scene files: a shared body, and the materials of its parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.scenes.place import Paint
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.body_mesh import BodyMesh, Tissue, build_body
from crowdsim.playback.crowd_mesh import looks_of

VARIETY = 30
"""Number of looks; characters whose numbers differ by a multiple of it look the same."""

_SIDES = 10
"""Corners of a body's cross-sections; all characters share one body, but each is drawn."""


def paints(variety: int) -> list[list[Paint]]:
    """Return, for each look, the paint of each :class:`Tissue`."""
    colors = looks_of(variety) / 255.0
    return [
        [Paint(f"{tissue.name.lower()} {number}", *colors[number, tissue].tolist()) for tissue in Tissue]
        for number in range(variety)
    ]


def body_of(skeleton: Skeleton) -> BodyMesh:
    """Return the body that all characters share."""
    return build_body(skeleton, _SIDES)


def rest_points(body: BodyMesh, skeleton: Skeleton) -> NDArray[np.float32]:
    """Return the vertices (V, 3) in rest pose, with the root joint at the origin [m]."""
    rest = skeleton.rest_positions()[body.joints[:, 0]]
    points: NDArray[np.float32] = (rest + body.places[:, 0]).astype(np.float32)
    return points


def tissue_triangles(body: BodyMesh) -> list[tuple[Tissue, NDArray[np.int64]]]:
    """Return the triangles of each tissue; one between two tissues belongs to that of its first corner."""
    of = body.tissue[body.triangles[:, 0]]
    return [(tissue, body.triangles[of == tissue]) for tissue in Tissue if (of == tissue).any()]
