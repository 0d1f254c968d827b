"""BVH text to raw motion, by pybvh."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.captures.raw_motion import RawMotion, euler_rotations, require_unique, snap_rate, without_flips
from crowdsim.motion.clips.kinematics import Floats


def parse_bvh(path: Path) -> RawMotion:
    """The file through pybvh, whose many kinds of error all become one."""
    import pybvh

    if not path.is_file():
        raise MotionError(f"{path}: no such capture file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            bvh = pybvh.read_bvh_file(path, world_up="+y", warn_on_world_up_disagreement=False)
        return _from_pybvh(bvh)
    except MotionError as error:
        raise MotionError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, OSError, Warning) as error:
        raise MotionError(f"{path}: not a BVH file that can be read: {error}") from error


def _from_pybvh(bvh: Any) -> RawMotion:
    joints = [node for node in bvh.nodes if not node.is_end_site()]
    ends = [node for node in bvh.nodes if node.is_end_site()]
    names = tuple(node.name for node in joints)
    require_unique(names)
    place = {name: index for index, name in enumerate(names)}
    raw = RawMotion(
        names,
        np.array([-1 if node.parent is None else place[node.parent.name] for node in joints], np.int32),
        np.array([node.offset for node in joints], np.float64),
        np.array([place[node.parent.name] for node in ends], np.int32),
        np.array([node.offset for node in ends], np.float64).reshape(-1, 3),
        np.asarray(bvh.root_pos, np.float64),
        _quaternions(np.asarray(bvh.joint_angles, np.float64), [tuple(node.rot_channels) for node in joints]),
        snap_rate(1.0 / bvh.frame_time),
    )
    raw.require_sound()
    return raw


def _quaternions(angles: Floats, orders: list[tuple[str, ...]]) -> Floats:
    """Quaternions (F, J, 4) of Euler angles (F, J, 3), each joint in its own channel order, without sign flips."""
    result = np.empty(angles.shape[:2] + (4,))
    for order in sorted(set(orders)):
        chosen = [joint for joint, own in enumerate(orders) if own == order]
        result[:, chosen] = euler_rotations(angles[:, chosen], order)
    return without_flips(result)
