"""Write clips as BVH: Y up, centimeters, facing +Z at rest, left toward +X."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import asin, atan2
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.whole_files import whole_file

Floats = NDArray[np.float64]

CENTIMETERS = 100.0


def to_y_up(v: Floats) -> Floats:
    """Return vectors (..., 3) of x ahead, y left, z up in BVH's axes: X left, Y up, Z ahead."""
    return v[..., [1, 2, 0]]


def euler_zxy(q: Floats) -> Floats:
    """Return angles (..., 3) about Z, X, Y [degrees] of quaternions (w, x, y, z), so that R = Rz Rx Ry."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    about_x = asin(np.clip(2.0 * (y * z + w * x), -1.0, 1.0))
    about_z = atan2(-2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z))
    about_y = atan2(-2.0 * (x * z - w * y), 1.0 - 2.0 * (x * x + y * y))
    angles: Floats = np.degrees(np.stack([about_z, about_x, about_y], axis=-1))
    return angles


def joint_angles(rotations: Floats) -> Floats:
    """Return channel values (..., 3) [degrees] of joints turned by quaternions (..., 4) of x ahead, y left, z up."""
    # The vector part changes axes as any vector, see to_y_up.
    return euler_zxy(rotations[..., [0, 2, 3, 1]])


def _number(value: float, decimals: int) -> str:
    """Return a number as short text, without trailing zeros and -0."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def hierarchy(skeleton: Skeleton) -> tuple[list[str], list[int]]:
    """Return the lines of the joint tree, and the joints in the order of these lines."""
    lines = ["HIERARCHY"]
    order: list[int] = []

    def offset(v: Floats) -> str:
        """Return the OFFSET of a joint at ``v`` (3,) [m] from its parent."""
        return "OFFSET " + " ".join(_number(c, 4) for c in to_y_up(v) * CENTIMETERS)

    def visit(joint: int, depth: int) -> None:
        """Write a joint and all below it, depth first: the order in which the file lists the channels."""
        order.append(joint)
        pad, inner = "  " * depth, "  " * (depth + 1)
        is_root = skeleton.parents[joint] < 0
        lines.extend([f"{pad}{'ROOT' if is_root else 'JOINT'} {skeleton.names[joint]}", pad + "{"])
        lines.append(inner + offset(skeleton.offsets[joint]))
        if is_root:
            lines.append(inner + "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        else:
            lines.append(inner + "CHANNELS 3 Zrotation Xrotation Yrotation")
        for child in np.flatnonzero(skeleton.parents == joint):
            visit(int(child), depth + 1)
        for end in np.flatnonzero(skeleton.end_parents == joint):
            lines.extend([inner + "End Site", inner + "{", inner + "  " + offset(skeleton.end_offsets[end])])
            lines.append(inner + "}")
        lines.append(pad + "}")

    visit(0, 0)
    return lines, order


def bvh_text(clip: Clip) -> str:
    """Return the whole BVH file of ``clip``: positions to a micrometer, angles to a thousandth of a degree."""
    if not (np.isfinite(clip.root_positions).all() and np.isfinite(clip.rotations).all()):
        raise MotionError(f"clip '{clip.name}' holds numbers that are not finite and cannot be written")
    lines, order = hierarchy(clip.skeleton)
    positions = to_y_up(clip.root_positions) * CENTIMETERS
    angles = joint_angles(clip.rotations[:, order]).reshape(clip.frame_count, -1)
    lines.extend(["MOTION", f"Frames: {clip.frame_count}", f"Frame Time: {1.0 / CAPTURE_RATE:.8f}"])
    for place, turns in zip(positions.tolist(), angles.tolist(), strict=True):
        lines.append(" ".join([_number(c, 4) for c in place] + [_number(c, 3) for c in turns]))
    return "\n".join(lines) + "\n"


def write_bvh(clip: Clip, path: Path) -> None:
    """Write ``clip`` to ``path``; the file gets its name when it is complete."""
    with whole_file(path, (".bvh",), "clips") as file:
        file.write_bytes(bvh_text(clip).encode("utf-8"))
