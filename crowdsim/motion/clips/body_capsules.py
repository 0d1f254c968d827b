"""A body as capsules about its bones: the shape for collision tests in 3D."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.clips.clearance import joint_flesh
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, end_positions, forward_kinematics
from crowdsim.motion.clips.skeleton import below_hips
from crowdsim.motion.clips.tracks import track_of

_TIP = 0.03
"""Radius of flesh about the end of a bone that ends at the skin [m]."""


class Capsules(NamedTuple):
    """Capsules of a body in every frame, relative to its track.

    ends: (F, K, 2, 3) both ends of each axis: ahead, left, and height above the floor [m]. radii: (K,) [m]. legs: (K,)
    bool, True below the hips.
    """

    ends: Floats
    radii: Floats
    legs: NDArray[np.bool_]


def body_capsules(clip: Clip, first: int, last: int) -> Capsules:
    """Return the body of a clip from frame ``first`` to before ``last``, one capsule per bone.

    Each is as thick as the thinner end of its bone: thighs with the flesh of the hips would be wider than the body.
    """
    skeleton = clip.skeleton
    positions, world = forward_kinematics(skeleton, clip.root_positions, clip.rotations)
    tips = end_positions(skeleton, positions, world)
    flesh = joint_flesh(skeleton)
    bones = [(parent, joint) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    starts = [*(positions[:, parent] for parent, _ in bones), *(positions[:, joint] for joint in skeleton.end_parents)]
    ends = [*(positions[:, joint] for _, joint in bones), *(tips[:, k] for k in range(len(skeleton.end_parents)))]
    radii = [min(flesh[parent], flesh[joint]) for parent, joint in bones] + [_TIP] * len(skeleton.end_parents)
    axes = np.stack([np.stack(starts, axis=1), np.stack(ends, axis=1)], axis=2)[first:last]
    track = track_of(clip)[first:last]
    offset = axes[..., :2] - track[:, None, None, :2]
    c, s = cos(track[:, 2])[:, None, None], sin(track[:, 2])[:, None, None]
    relative = np.stack(
        [c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0], axes[..., 2]],
        axis=-1,
    )
    below = below_hips(skeleton)
    legs = below[[parent for parent, _ in bones] + list(skeleton.end_parents)]
    return Capsules(relative, np.array(radii), legs)
