"""BVH text to raw motion, by pybvh."""

from __future__ import annotations

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.captures.raw_motion import RawMotion, euler_rotations, require_unique, snap_rate, without_flips
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.whole_files import require_regular

_STARTS_LINE = frozenset(("HIERARCHY", "ROOT", "JOINT", "End", "OFFSET", "CHANNELS", "{", "}"))


def parse_bvh(path: Path) -> RawMotion:
    """The file through pybvh, whose many kinds of error all become one."""
    import pybvh

    require_regular(path, MotionError)
    if not path.is_file():
        raise MotionError(f"{path}: no such capture file")
    try:
        with warnings.catch_warnings(), TemporaryDirectory() as folder:
            warnings.simplefilter("error")
            bvh = pybvh.read_bvh_file(_in_lines(path, Path(folder)), world_up="+y", warn_on_world_up_disagreement=False)
        return _from_pybvh(bvh)
    except MotionError as error:
        raise MotionError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, OSError, Warning) as error:
        raise MotionError(f"{path}: not a BVH file that can be read: {error}") from error


def _in_lines(path: Path, folder: Path) -> Path:
    """``path``, or the same in ``folder`` with the lines that pybvh goes by, if the file has others.

    MotionError where braces do not match, which pybvh does not mind.
    """
    text = path.read_text()
    words = text.split()
    end = words.index("MOTION") if "MOTION" in words else len(words)
    depth = 0
    lines: list[list[str]] = []
    for before, word in zip(["", *words], words[:end], strict=False):
        depth += (word == "{") - (word == "}")
        if depth < 0:
            raise MotionError("a brace closes that was not opened")
        if not lines or (word in _STARTS_LINE and before not in ("ROOT", "JOINT")):
            lines.append([])
        lines[-1].append(word)
    if depth:
        raise MotionError(f"{depth} braces are not closed before MOTION; is the file cut?")
    if len(text.partition("MOTION")[0].splitlines()) >= len(lines):
        return path
    channels = sum(int(line[1]) for line in lines if line[0] == "CHANNELS")
    head, values = words[end : end + 6], words[end + 6 :]
    if head[1:2] != ["Frames:"] or head[3:5] != ["Frame", "Time:"] or channels == 0:
        raise MotionError("MOTION is not followed by 'Frames:' and 'Frame Time:'")
    lines += [head[:1], head[1:3], head[3:6]]
    lines += [values[k : k + channels] for k in range(0, len(values), channels)]
    file = folder / path.name
    file.write_text("\n".join(" ".join(line) for line in lines) + "\n")
    return file


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
