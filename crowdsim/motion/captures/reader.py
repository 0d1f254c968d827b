"""Read capture files (BVH, ASF/AMC) as clips: units, axes, rate and bad frames are settled here.

Such a file contains neither its unit nor its up axis, and captures contain calibration poses and spikes. The
:class:`CaptureReport` lists what was assumed and what was removed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowdsim.constants import CAPTURE_PATTERNS, CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import log
from crowdsim.geometry.products import dot
from crowdsim.motion.captures.asf_amc import parse_amc
from crowdsim.motion.captures.bvh import parse_bvh
from crowdsim.motion.captures.cleaning import clean_stretches, resample
from crowdsim.motion.captures.raw_motion import RawMotion
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.joint_roles import find_roles
from crowdsim.motion.clips.kinematics import Floats, end_positions, forward_kinematics
from crowdsim.motion.clips.skeleton import ROLES, Skeleton
from crowdsim.yamlfile.messages import nearest

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "inch": 0.0254, "CMU unit": 0.056444}
"""Meters per file unit, for the units of captures."""

_ADULT_LEG = 0.86
_LEG_RANGES = ((0.7, 1.05), (0.35, 0.7), (1.05, 1.25))
"""Leg lengths of adults, children and giants [m], in the order in which a unit is searched."""
_GIVEN_LEGS = 0.2, 2.0
"""Least and greatest length of legs in a unit that is given [m]: no person's is beyond, whatever the file measures."""


@dataclass(frozen=True)
class CaptureReport:
    """What reading a capture file assumed and removed.

    unit: name of the file's unit of length, "given" if the caller gave it. meters_per_unit: its length [m]. leg_length:
    from hip to ankle along the bones [m] (from the root to the lowest point if the joints have no known names).
    up, facing: signed axes of the file that became +z and +x.
    source_rate: frames per second of the file.
    dropped_first: True if the first frame was a calibration pose.
    glitches: (frame of the file, joint) of every jump that was removed.
    kept_frames: frames of the file in clean stretches.
    assumed: what else the format does not say and was assumed.
    """

    path: Path
    unit: str
    meters_per_unit: float
    leg_length: float
    up: str
    facing: str
    source_rate: float
    dropped_first: bool
    glitches: tuple[tuple[int, str], ...]
    kept_frames: int
    assumed: tuple[str, ...]


@dataclass(frozen=True)
class Capture:
    """The clean stretches of one file, in order, and the report on reading it."""

    clips: tuple[Clip, ...]
    report: CaptureReport


def read_clip(path: str | Path, meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None) -> Clip:
    """Return the longest clean stretch of a capture file; see :func:`read_capture`."""
    clips = read_capture(path, meters_per_unit, joints).clips
    return max(clips, key=lambda clip: clip.frame_count)


def read_capture(
    path: str | Path, meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None
) -> Capture:
    """Read a capture file as clips at 60 Hz, z up, meters, the lowest joint or end site of all clips at z = 0.

    Parameters
    ----------
    path: ends in ``.bvh``, or in ``.amc`` with its ``.asf`` beside it (see :func:`parse_amc`).
    meters_per_unit: overrides the unit found from the leg length [m].
    joints: overrides the joint in a role (see ``ROLES``), such as ``{"left_hip": "LeftThighBone"}``.

    Raises
    ------
    MotionError: for a file that is malformed, not finite, or of no plausible size, or a unit that is no length.
    """
    path = Path(path)
    raw = _parse(path)
    roles = _roles(raw, joints, path)
    file_tree = Skeleton(raw.names, raw.parents, raw.offsets, raw.end_parents, raw.end_offsets, roles)
    positions, world = forward_kinematics(file_tree, raw.root_positions, raw.rotations)
    tips = end_positions(file_tree, positions, world)
    # Find the axes from the pose: rows of the basis are ahead, left and up in those of the file.
    up, left = _axes(file_tree, positions, tips, path)
    basis = np.stack([np.cross(left, up), left, up])

    unit, scale, leg = _unit(raw, roles, basis, meters_per_unit, path)
    skeleton = Skeleton(
        raw.names,
        raw.parents,
        _in_axes(basis, raw.offsets) * scale,
        raw.end_parents,
        _in_axes(basis, raw.end_offsets) * scale,
        roles,
    )
    root = _in_axes(basis, raw.root_positions) * scale
    # The vector part of a quaternion goes over as any vector does, as both frames are right-handed.
    rotations = np.concatenate([raw.rotations[..., :1], _in_axes(basis, raw.rotations[..., 1:])], axis=-1)

    # Clips are the stretches between jumps of joints, on the floor, at the usual rate.
    stretches, dropped_first, jumps = clean_stretches(positions * scale, raw.rate)
    if not stretches:
        raise MotionError(f"{path}: no stretch of 0.3 s without a joint that jumps; {len(jumps)} jumps found")
    root = root - [0.0, 0.0, _floor_height(positions, tips, up * scale, stretches)]
    clips = []
    for number, (first, last) in enumerate(stretches):
        name = path.stem if len(stretches) == 1 else f"{path.stem}.{number + 1}"
        window = slice(first, last + 1)
        clips.append(Clip(name, skeleton, *resample(root[window], rotations[window], raw.rate, CAPTURE_RATE)))
    report = CaptureReport(
        path,
        unit,
        scale,
        leg,
        _axis_name(up),
        _axis_name(basis[0]),
        raw.rate,
        dropped_first,
        tuple((frame, raw.names[joint]) for frame, joint in jumps),
        sum(last - first + 1 for first, last in stretches),
        raw.assumed,
    )
    return Capture(tuple(clips), report)


def capture_paths(folder: str | Path, patterns: Sequence[str] = CAPTURE_PATTERNS) -> list[Path]:
    """Return the capture files of a folder that match ``patterns``, by name; raise MotionError if there are none.

    Endings match in lower and in upper case.
    """
    folder = Path(folder)
    if not folder.is_dir():
        if folder.is_file():
            raise MotionError(f"{folder} is a file; give the folder that holds the captures")
        raise MotionError(f"there is no folder of captures {folder}")
    try:
        next(folder.iterdir(), None)  # patterns match nothing in a folder that cannot be read
    except OSError as error:
        raise MotionError(f"the folder of captures {folder} cannot be read: {error.strerror}") from None
    either = [_in_either_case(pattern) for pattern in patterns]
    paths = sorted({path for pattern in either for path in folder.glob(pattern) if path.is_file()})
    if not paths:
        below = sorted({path.parent.name for pattern in either for path in folder.glob(f"*/{pattern}")})
        deeper = f"; there are some in its folders {', '.join(below)}: give one of these" if below else ""
        raise MotionError(f"no file in {folder} matches {', '.join(patterns)}{deeper}")
    return paths


def _in_either_case(pattern: str) -> str:
    """Return a pattern of file names whose ending, if it is made of letters, matches in either case."""
    name, dot, ending = pattern.rpartition(".")
    if not ending.isalnum():
        return pattern
    return name + dot + "".join(f"[{c.lower()}{c.upper()}]" if c.isalpha() else c for c in ending)


def _parse(path: Path) -> RawMotion:
    """Read a capture file by its ending."""
    formats = {".bvh": parse_bvh, ".amc": parse_amc}
    if path.suffix.lower() not in formats:
        raise MotionError(f"{path}: captures are read from {' and '.join(formats)} files")
    return formats[path.suffix.lower()](path)


def _roles(raw: RawMotion, joints: Mapping[str, str] | None, path: Path) -> dict[str, int]:
    """Return the joint index of each role; raise MotionError for unknown roles or joints."""
    unknown = sorted(set(joints or ()) - set(ROLES))
    if unknown:
        raise MotionError(f"no joint has a role '{unknown[0]}'; {nearest(unknown[0], ROLES, 'there are')}")
    try:
        return find_roles(raw.names, raw.parents.tolist(), joints)
    except MotionError as error:
        raise MotionError(f"{path}: {error}") from None


def _axes(skeleton: Skeleton, positions: Floats, tips: Floats, path: Path) -> tuple[Floats, Floats]:
    """Return the file's unit axes that point up and to the body's left in rest.

    Without known hip joints these are +y and +x, the usual axes of BVH. positions, tips: (F, J, 3) joints and (F, K, 3)
    end sites, in units and axes of the file.
    """
    roles = skeleton.roles
    if "left_hip" not in roles or "right_hip" not in roles:
        return np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    rest = skeleton.rest_positions()
    hips = (positions[:, roles["left_hip"]] + positions[:, roles["right_hip"]]) / 2.0
    upward = np.mean(hips - _low_points(skeleton, positions, tips).mean(axis=1), axis=0)
    across = rest[roles["left_hip"]] - rest[roles["right_hip"]]
    # Two axes of a file are the same, opposite (dot product 1 or -1) or at right angles (0).
    up, left = _snap_axis(upward), _snap_axis(across)
    if not up.any() or not left.any() or abs(dot(up, left)) > 0.5:
        raise MotionError(
            f"{path}: cannot tell which way is up: the vector between the hips is {across} in rest "
            f"and that from the feet to the hips {upward} on average"
        )
    return up, left


def _low_points(skeleton: Skeleton, positions: Floats, tips: Floats) -> Floats:
    """Return the ankles (F, n, 3), or the end sites below the hip joints if ankles have no known name.

    Without such end sites, the hip joints and all joints below them. positions, tips: as of :func:`_axes`.
    """
    roles = skeleton.roles
    if "left_ankle" in roles and "right_ankle" in roles:
        return positions[:, [roles["left_ankle"], roles["right_ankle"]]]
    below = {roles["left_hip"], roles["right_hip"]}
    for joint, parent in enumerate(skeleton.parents):
        if parent in below:
            below.add(joint)
    chosen = [k for k, parent in enumerate(skeleton.end_parents) if parent in below]
    return tips[:, chosen] if chosen else positions[:, sorted(below)]


def _in_axes(basis: Floats, vectors: Floats) -> Floats:
    """Return vectors (..., 3) in the axes that are the rows of ``basis`` (3, 3)."""
    return np.stack([dot(vectors, axis) for axis in basis], axis=-1)


def _snap_axis(vector: Floats) -> Floats:
    """Return the signed coordinate axis nearest to a vector; zero for a zero vector."""
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(vector)))
    axis[largest] = np.sign(vector[largest])
    return axis


def _axis_name(axis: Floats) -> str:
    """Return the name of a signed axis, such as ``+y``."""
    largest = int(np.argmax(np.abs(axis)))
    return ("-" if axis[largest] < 0 else "+") + "xyz"[largest]


def _unit(
    raw: RawMotion, roles: dict[str, int], basis: Floats, given: float | None, path: Path
) -> tuple[str, float, float]:
    """Return the name of the unit, meters per unit, and the leg length [m].

    basis: (3, 3), whose last row is the file's axis up. given: meters per unit, if known. Of units that fit, the one
    nearest to an adult's leg is taken.
    """
    rest_tree = Skeleton(raw.names, raw.parents, raw.offsets, raw.end_parents, raw.end_offsets, roles)
    known = all(f"{side}_{part}" in roles for side in ("left", "right") for part in ("hip", "knee", "ankle"))
    if known:
        leg = rest_tree.leg_length()
    else:
        rest = rest_tree.rest_positions()
        # Without leg joints: from the root down to the lowest point.
        points = np.concatenate([rest, rest[raw.end_parents] + raw.end_offsets])
        leg = float(-dot(points, basis[2]).min())
    if given is not None:
        if not 0.0 < given < np.inf:
            raise MotionError(f"meters_per_unit is {given:g}; give a positive number, as {UNITS['cm']} for centimeters")
        if known and not _GIVEN_LEGS[0] <= leg * given <= _GIVEN_LEGS[1]:
            raise MotionError(
                f"{path}: with the unit that is given, the legs are {leg * given:.3g} m long, which fits no person; "
                f"give another unit of {', '.join(UNITS)}, or none"
            )
        return "given", given, leg * given
    if leg > 0.0:
        for low, high in _LEG_RANGES:
            fitting = [name for name in UNITS if low <= leg * UNITS[name] < high]
            if fitting:
                unit = min(fitting, key=lambda name: abs(log(leg * UNITS[name] / _ADULT_LEG)))
                return unit, UNITS[unit], leg * UNITS[unit]
    raise MotionError(
        f"{path}: the legs are {leg:g} units long, which fits no person in any of {', '.join(UNITS)}; give the unit "
        f"with unit: in the scenario, --unit, or meters_per_unit. The joints are {', '.join(raw.names)}"
    )


def _floor_height(positions: Floats, tips: Floats, up: Floats, stretches: list[tuple[int, int]]) -> float:
    """Return the height [m] of the lowest joint or end site in the kept frames, which is a standing sole.

    positions, tips: in units of the file; up: (3,) the file's axis up, times meters per unit.
    """
    height = np.minimum(dot(positions, up).min(axis=1), dot(tips, up).min(axis=1, initial=np.inf))
    return min(float(height[first : last + 1].min()) for first, last in stretches)
