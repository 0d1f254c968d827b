"""Put clips of several people on one skeleton, so that they can share a motion graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import Skeleton


def retarget(clip: Clip, skeleton: Skeleton) -> Clip:
    """Return the motion of ``clip`` on the bones of ``skeleton``, which has the same joints.

    Joints keep their rotations. Positions scale with leg length, so that a standing foot stays in place, and the lowest
    joint of all frames is as high as before. Raise MotionError if the joints differ.
    """
    own = clip.skeleton
    if own.names != skeleton.names or not np.array_equal(own.parents, skeleton.parents):
        extra = sorted(set(own.names) ^ set(skeleton.names))
        raise MotionError(
            f"clip '{clip.name}' has other joints than the rest "
            f"({', '.join(extra) if extra else 'the same ones in another order'}); keep it in a folder of its own"
        )
    # The same bones: nothing to scale.
    if np.allclose(own.offsets, skeleton.offsets, rtol=0.0, atol=1e-6):
        return Clip(clip.name, skeleton, clip.root_positions, clip.rotations)
    root = clip.root_positions * (skeleton.leg_length() / own.leg_length())
    moved = Clip(clip.name, skeleton, root, clip.rotations)
    # Proportions differ, so the lowest joint is put as high as it was.
    lift = clip.joint_positions[..., 2].min() - moved.joint_positions[..., 2].min()
    return Clip(clip.name, skeleton, root + np.array([0.0, 0.0, lift]), clip.rotations)


def on_one_skeleton(clips: Sequence[Clip]) -> list[Clip]:
    """Return ``clips`` on the skeleton of the first one."""
    return [retarget(clip, clips[0].skeleton) for clip in clips]
