"""A real walk rewritten as other systems would export it: joint names, units, axes, channels, size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crowdsim.motion.captures.bvh import parse_bvh
from crowdsim.motion.captures.raw_motion import RawMotion
from crowdsim.motion.clips.joint_roles import find_roles
from crowdsim.motion.clips.kinematics import about_axis, multiply, rotate

SIDED = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")


def _table(center: str, clavicle: str, sided: str, name: Callable[[str, str], str]) -> dict[str, str]:
    """Return joint names by role; ``center`` names hips, chest, neck and head, ``sided`` the roles of SIDED."""
    made = dict(zip(("hips", "chest", "neck", "head"), center.split("|"), strict=True))
    for side in ("left", "right"):
        made[f"{side}_clavicle"] = name(side, clavicle)
        made |= {f"{side}_{role}": name(side, part) for role, part in zip(SIDED, sided.split("|"), strict=True)}
    return made


def _before(side: str, part: str) -> str:
    return side.capitalize() + part


CONVENTIONS: dict[str, dict[str, str]] = {
    "cmu": _table("Hips|Spine1|Neck|Head", "Shoulder", "Arm|ForeArm|Hand|UpLeg|Leg|Foot|ToeBase", _before),
    "asf": _table(
        "root|thorax|lowerneck|head",
        "clavicle",
        "humerus|radius|wrist|femur|tibia|foot|toes",
        lambda side, part: side[0] + part,
    ),
    "mixamo": _table(
        "mixamorig:Hips|mixamorig:Spine2|mixamorig:Neck|mixamorig:Head",
        "Shoulder",
        "Arm|ForeArm|Hand|UpLeg|Leg|Foot|ToeBase",
        lambda side, part: f"mixamorig:{side.capitalize()}{part}",
    ),
    "rokoko": _table("Hips|Spine4|Neck|Head", "Shoulder", "Arm|ForeArm|Hand|Thigh|Shin|Foot|Toe", _before),
    "xsens": _table("Hips|Chest4|Neck|Head", "Collar", "Shoulder|Elbow|Wrist|Hip|Knee|Ankle|Toe", _before),
    "unreal": _table(
        "pelvis|spine_03|neck_01|head",
        "clavicle",
        "upperarm|lowerarm|hand|thigh|calf|foot|ball",
        lambda side, part: f"{part}_{side[0]}",
    ),
    "rigify": _table(
        "DEF-spine|DEF-spine.003|DEF-spine.004|DEF-spine.006",
        "shoulder",
        "upper_arm|forearm|hand|thigh|shin|foot|toe",
        lambda side, part: f"DEF-{part}.{side[0].upper()}",
    ),
    "biped": _table(
        "Bip01 Pelvis|Bip01 Spine1|Bip01 Neck|Bip01 Head",
        "Clavicle",
        "UpperArm|Forearm|Hand|Thigh|Calf|Foot|Toe0",
        lambda side, part: f"Bip01 {side[0].upper()} {part}",
    ),
    "motive": _table(
        "Anna_Hip|Anna_Chest|Anna_Neck|Anna_Head",
        "Shoulder",
        "UArm|FArm|Hand|Thigh|Shin|Foot|Toe",
        lambda side, part: f"Anna_{side[0].upper()}{part}",
    ),
    "smpl": _table(
        "Pelvis|Spine3|Neck|Head",
        "Collar",
        "Shoulder|Elbow|Wrist|Hip|Knee|Ankle|Foot",
        lambda side, part: f"{side[0].upper()}_{part}",
    ),
}
"""Joint names by role, as each system writes them."""


class Variant(NamedTuple):
    """A way to write a file: meters per unit, up axis, rotation of the walk [degrees], and positions on every joint."""

    meters: float
    up: str
    yaw: float
    six: bool


VARIANTS = {
    "m, y up": Variant(1.0, "y", 0.0, False),
    "cm, z up, six channels": Variant(0.01, "z", 37.0, True),
    "mm, y up, six channels": Variant(0.001, "y", 120.0, True),
    "ft, z up": Variant(0.3048, "z", -75.0, False),
    "inch, y up": Variant(0.0254, "y", 200.0, False),
    "cm, y up": Variant(0.01, "y", 90.0, False),
}


def rewritten(source: Path, file: Path, names: dict[str, str], variant: Variant, size: float = 1.0) -> None:
    """Write the walk ``source`` (in centimeters, y up) to ``file`` as ``variant``, the body scaled by ``size``."""
    raw = parse_bvh(source)
    scale = 0.01 * size / variant.meters
    turn = about_axis(np.array([0.0, 1.0, 0.0]), np.radians(variant.yaw))
    rotations = raw.rotations.copy()
    rotations[:, 0] = multiply(np.broadcast_to(turn, rotations[:, 0].shape), rotations[:, 0])
    root = rotate(turn, raw.root_positions)
    if variant.up == "z":  # (x, y, z) becomes (x, -z, y)
        basis = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    else:
        basis = np.eye(3)
    rotations[..., 1:] = rotations[..., 1:] @ basis.T
    moved = raw.__class__(
        _renamed(raw, names),
        raw.parents,
        raw.offsets @ basis.T * scale,
        raw.end_parents,
        raw.end_offsets @ basis.T * scale,
        root @ basis.T * scale,
        rotations,
        raw.rate,
    )
    file.write_text(_text(moved, variant.six), encoding="utf-8")


def _renamed(raw: RawMotion, names: dict[str, str]) -> tuple[str, ...]:
    """Return joint names by role; other joints get unknown names, those above the arms that of the clavicle."""
    roles = find_roles(raw.names)
    by_joint = {joint: names[role] for role, joint in roles.items()}
    for side in ("left", "right"):
        by_joint[int(raw.parents[roles[f"{side}_shoulder"]])] = names[f"{side}_clavicle"]
    prefix = next((p for p in ("mixamorig:", "DEF-", "Bip01 ", "Anna_") if names["hips"].startswith(p)), "")
    return tuple(by_joint.get(joint, f"{prefix}Xtra{joint}") for joint in range(len(raw.names)))


def _text(raw: RawMotion, six: bool) -> str:
    lines = ["HIERARCHY"]

    def add(joint: int, depth: int) -> None:
        lines.append(f"{'ROOT' if joint == 0 else 'JOINT'} {raw.names[joint]}")
        lines.append("{")
        lines.append("OFFSET " + " ".join(f"{v:.9g}" for v in raw.offsets[joint]))
        places = "Xposition Yposition Zposition " if six or joint == 0 else ""
        lines.append(f"CHANNELS {6 if places else 3} {places}Zrotation Xrotation Yrotation")
        below = [child for child, parent in enumerate(raw.parents) if parent == joint]
        for child in below:
            add(child, depth + 1)
        for end in np.flatnonzero(raw.end_parents == joint):
            lines.extend(["End Site", "{", "OFFSET " + " ".join(f"{v:.9g}" for v in raw.end_offsets[end]), "}"])
        lines.append("}")
        order.append(joint)

    order: list[int] = []
    add(0, 0)
    angles = np.degrees(_zxy(raw.rotations))
    count = len(raw.root_positions)
    columns = []
    for joint in _written(raw):
        if joint == 0:
            columns.append(raw.root_positions)
        elif six:
            columns.append(np.broadcast_to(raw.offsets[joint], (count, 3)))
        columns.append(angles[:, joint])
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {count}", f"Frame Time: {1.0 / raw.rate:.9g}"]
    lines += [" ".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def _written(raw: RawMotion) -> list[int]:
    """Return the joints in the order in which a hierarchy lists them."""
    listed: list[int] = []

    def add(joint: int) -> None:
        listed.append(joint)
        for child in np.flatnonzero(np.asarray(raw.parents) == joint):
            add(int(child))

    add(0)
    return listed


def _zxy(q: np.ndarray) -> np.ndarray:
    """Return angles about z, x and y [rad] of rotations that rotate about y first, then x, then z."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    about_x = np.arcsin(np.clip(2.0 * (w * x + y * z), -1.0, 1.0))
    about_z = np.arctan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
    about_y = np.arctan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (x * x + y * y))
    return np.stack([about_z, about_x, about_y], axis=-1)
