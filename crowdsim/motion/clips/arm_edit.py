"""Arms held close to the body, on any clip: regular walking with modified arm trajectories (2018 paper, section 4).

Upper arms hang at the sides and forearms fold in front of the belly, as people make themselves narrow without turning.
Only the shoulder and elbow joints change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.geometry.products import dot
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, conjugate, forward_kinematics, multiply, slerp, unit

Direction = tuple[float, float, float]
"""Ahead, left and up in the frame of the shoulders; need not be a unit vector."""

_HANGING_UPPER: Direction = (0.0, 0.0, -1.0)
_HANGING_FOREARM: Direction = (0.35, 0.0, -0.94)
"""Directions of arms that hang without swinging: a clip's own direction less these is the swing of its arms."""
_HELD_UPPER: dict[str, Direction] = {"left": (0.04, -0.02, -1.0), "right": (0.06, 0.02, -1.0)}
_HELD_FOREARM: dict[str, Direction] = {"left": (0.62, -0.74, 0.22), "right": (0.70, 0.70, -0.10)}
"""Directions of held arms. The left hand lies above the right one, so that they do not touch."""
_SWING_LEFT = 0.08
"""Share of the arms' own swing that held arms keep; nothing on a living body is rigid. 0 makes held arms rigid."""


def edit_arms(clip: Clip, weight: Floats) -> Clip:
    """Return ``clip`` with both arms held close to the body.

    Parameters
    ----------
    weight: (F,) share of holding in each frame, from 0 (frame unchanged) to 1 (arms fully held).

    Raises
    ------
    MotionError: for weights of another length or range, and for skeletons without arms or neck.
    """
    weight = np.asarray(weight, np.float64)
    if weight.shape != (clip.frame_count,) or not ((weight >= 0.0) & (weight <= 1.0)).all():
        raise MotionError(
            f"clip '{clip.name}' has {clip.frame_count} frames; held arms need one weight in [0, 1] for each of them"
        )
    skeleton = clip.skeleton
    held = clip.rotations.copy()
    # The upper arm before the forearm, as the direction of the forearm depends on it.
    for side in ("left", "right"):
        shoulder, elbow, wrist = (skeleton.joint(f"{side}_{part}") for part in ("shoulder", "elbow", "wrist"))
        held[:, shoulder] = _pointed(clip, held, shoulder, elbow, _HANGING_UPPER, _HELD_UPPER[side])
        held[:, elbow] = _pointed(clip, held, elbow, wrist, _HANGING_FOREARM, _HELD_FOREARM[side])
    # Blend from the clip to held arms; frames of weight 0 keep their very numbers.
    rotations = clip.rotations.copy()
    edited = weight > 0.0
    for joint in (skeleton.joint(f"{side}_{part}") for side in ("left", "right") for part in ("shoulder", "elbow")):
        rotations[edited, joint] = slerp(clip.rotations[edited, joint], held[edited, joint], weight[edited])
    return replace(clip, rotations=rotations)


def _shoulder_frame(clip: Clip) -> Floats:
    """Return axes (F, 3, 3) ahead, left and up of the shoulders, as columns in the world; up leans as the spine."""
    skeleton, joints = clip.skeleton, clip.joint_positions
    left = unit(joints[:, skeleton.joint("left_shoulder")] - joints[:, skeleton.joint("right_shoulder")])
    spine = unit(joints[:, skeleton.joint("neck")] - joints[:, skeleton.joint("hips")])
    ahead = unit(np.cross(left, spine))
    return np.stack([ahead, left, np.cross(ahead, left)], axis=-1)


def _pointed(clip: Clip, rotations: Floats, joint: int, tip: int, hanging: Direction, held: Direction) -> Floats:
    """Return local rotations (F, 4) of ``joint`` with which the limb from ``joint`` to ``tip`` points along ``held``.

    Directions ``hanging`` and ``held`` are in the frame of the shoulders. The direction of the limb in the clip less
    ``hanging`` is its swing, of which the share _SWING_LEFT is added to ``held``. rotations: (F, J, 4) of the clip;
    joints above ``joint`` in the arm are already edited.
    """
    positions, world = forward_kinematics(clip.skeleton, clip.root_positions, rotations)
    frame = _shoulder_frame(clip)
    # The swing of the clip's limb, in the frame of the shoulders; then the wanted direction of the limb, in the world.
    own = unit(clip.joint_positions[:, tip] - clip.joint_positions[:, joint])
    swing = dot(np.swapaxes(frame, 1, 2), own[:, None]) - unit(np.array(hanging))
    wanted = dot(frame, unit(unit(np.array(held)) + _SWING_LEFT * swing)[:, None])
    # Turn the limb from where it points now, with the edited joints above it.
    now = unit(positions[:, tip] - positions[:, joint])
    turned = multiply(_between(now, wanted), world[:, joint])
    parent = clip.skeleton.parents[joint]
    return multiply(conjugate(world[:, parent]), turned) if parent >= 0 else turned


def _between(a: Floats, b: Floats) -> Floats:
    """Return the shortest rotations (F, 4) from unit vectors a to unit vectors b (F, 3), not opposite ones."""
    q = np.concatenate([1.0 + dot(a, b)[:, None], np.cross(a, b)], axis=-1)
    return unit(q)
