"""Capture files (BVH, ASF/AMC) to clips: units, axes, rate and bad frames are settled here, once.

Such a file says neither its unit nor which way is up, and captures carry calibration poses and spikes. What was
assumed and what was cut out stands in the :class:`CaptureReport`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowdsim.constants import CAPTURE_RATE
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
from crowdsim.motion.clips.skeleton import Skeleton

UNITS = {"m": 1.0, "cm": 0.01, "inch": 0.0254, "CMU unit": 0.056444}
"""Meters a file unit, for the units that captures come in."""

_ADULT_LEG = 0.86
_LEG_RANGE = (0.35, 1.25)


@dataclass(frozen=True)
class CaptureReport:
    """What reading a capture file assumed and removed.

    leg_length: meters from hip to ankle along the bones (to the lowest point where the joints have no known names).
    up, facing: signed axes of the file that became +z and +x.
    source_rate: frames a second of the file.
    dropped_first: whether the first frame was a calibration pose.
    glitches: (frame of the file, joint) of every jump that was cut out.
    assumed: what else the format does not say and was taken for granted.
    """

    path: Path
    unit: str
    meters_per_unit: float
    leg_length: float
    up: str
    facing: str
    source_rate: float
    source_frames: int
    dropped_first: bool
    glitches: tuple[tuple[int, str], ...]
    kept_frames: int
    assumed: tuple[str, ...]


@dataclass(frozen=True)
class Capture:
    """The clean stretches of one file, in order, and what was done to get them."""

    clips: tuple[Clip, ...]
    report: CaptureReport


def read_clip(path: str | Path, meters_per_unit: float | None = None) -> Clip:
    """The longest clean stretch of a capture file; see :func:`read_capture`."""
    clips = read_capture(path, meters_per_unit).clips
    return max(clips, key=lambda clip: clip.frame_count)


def read_capture(path: str | Path, meters_per_unit: float | None = None) -> Capture:
    """Read a capture file as clips at 60 Hz, z up, meters, the lowest point of the feet at z = 0.

    ``path`` ends in ``.bvh``, or in ``.amc`` with its ``.asf`` beside it (see :func:`parse_amc`).

    ``meters_per_unit`` overrides the unit that the leg length suggests. Raises MotionError for a file that is
    malformed, not finite, or of no recognizable size.
    """
    path = Path(path)
    raw = _parse(path)
    roles = find_roles(raw.names)
    file_tree = Skeleton(raw.names, raw.parents, raw.offsets, raw.end_parents, raw.end_offsets, roles)
    positions, world = forward_kinematics(file_tree, raw.root_positions, raw.rotations)
    tips = end_positions(file_tree, positions, world)
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
    rotations = np.concatenate([raw.rotations[..., :1], _in_axes(basis, raw.rotations[..., 1:])], axis=-1)

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
        len(root),
        dropped_first,
        tuple((frame, raw.names[joint]) for frame, joint in jumps),
        sum(last - first + 1 for first, last in stretches),
        raw.assumed,
    )
    return Capture(tuple(clips), report)


def capture_paths(folder: str | Path, patterns: Sequence[str] = ("*.bvh", "*.amc")) -> list[Path]:
    """The capture files of a folder that match one of ``patterns``, by name; MotionError where there are none."""
    folder = Path(folder)
    if not folder.is_dir():
        if folder.is_file():
            raise MotionError(f"{folder} is a file; give the folder that holds the captures")
        raise MotionError(f"there is no folder of captures {folder}")
    paths = sorted({path for pattern in patterns for path in folder.glob(pattern) if path.is_file()})
    if not paths:
        raise MotionError(f"no file in {folder} matches {', '.join(patterns)}")
    return paths


def _parse(path: Path) -> RawMotion:
    formats = {".bvh": parse_bvh, ".amc": parse_amc}
    if path.suffix.lower() not in formats:
        raise MotionError(f"{path}: captures are read from {' and '.join(formats)} files")
    return formats[path.suffix.lower()](path)


def _axes(skeleton: Skeleton, positions: Floats, tips: Floats, path: Path) -> tuple[Floats, Floats]:
    """Unit axes of the file that point up and to the body's left in rest; BVH's own custom (+y, +x) where unnamed."""
    roles = skeleton.roles
    if "left_hip" not in roles or "right_hip" not in roles:
        return np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    rest = skeleton.rest_positions()
    hips = (positions[:, roles["left_hip"]] + positions[:, roles["right_hip"]]) / 2.0
    upward = np.mean(hips - _low_points(skeleton, positions, tips).mean(axis=1), axis=0)
    across = rest[roles["left_hip"]] - rest[roles["right_hip"]]
    up, left = _snap_axis(upward), _snap_axis(across)
    if not up.any() or not left.any() or abs(dot(up, left)) > 0.5:
        raise MotionError(
            f"{path}: cannot tell which way is up: the hips are at {across} from each other in rest "
            f"and {upward} above the feet on average"
        )
    return up, left


def _low_points(skeleton: Skeleton, positions: Floats, tips: Floats) -> Floats:
    """(F, n, 3) ankles, or where these have no known name the end sites below the hip joints."""
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
    """Vectors (..., 3) in the axes that are the rows of ``basis`` (3, 3)."""
    return np.stack([dot(vectors, axis) for axis in basis], axis=-1)


def _snap_axis(vector: Floats) -> Floats:
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(vector)))
    axis[largest] = np.sign(vector[largest])
    return axis


def _axis_name(axis: Floats) -> str:
    largest = int(np.argmax(np.abs(axis)))
    return ("-" if axis[largest] < 0 else "+") + "xyz"[largest]


def _unit(
    raw: RawMotion, roles: dict[str, int], basis: Floats, given: float | None, path: Path
) -> tuple[str, float, float]:
    """Name of the unit, meters a unit, and leg length in meters."""
    rest_tree = Skeleton(raw.names, raw.parents, raw.offsets, raw.end_parents, raw.end_offsets, roles)
    if all(f"{side}_{part}" in roles for side in ("left", "right") for part in ("knee", "ankle")):
        leg = rest_tree.leg_length()
    else:
        rest = rest_tree.rest_positions()
        points = np.concatenate([rest, rest[raw.end_parents] + raw.end_offsets])
        leg = float(-dot(points, basis[2]).min())
    if given is not None:
        return "given", given, leg * given
    if leg > 0.0:
        unit = min(UNITS, key=lambda name: abs(log(leg * UNITS[name] / _ADULT_LEG)))
        if _LEG_RANGE[0] <= leg * UNITS[unit] <= _LEG_RANGE[1]:
            return unit, UNITS[unit], leg * UNITS[unit]
    raise MotionError(
        f"{path}: the legs are {leg:g} units long, which is no person in any of {', '.join(UNITS)}; "
        f"pass meters_per_unit. The joints are {', '.join(raw.names)}"
    )


def _floor_height(positions: Floats, tips: Floats, up: Floats, stretches: list[tuple[int, int]]) -> float:
    """Height of the lowest joint or end site in the frames that are kept: the sole that stands."""
    height = np.minimum(dot(positions, up).min(axis=1), dot(tips, up).min(axis=1, initial=np.inf))
    return min(float(height[first : last + 1].min()) for first, last in stretches)
