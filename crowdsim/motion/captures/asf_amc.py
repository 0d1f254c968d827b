"""Read Acclaim's ASF (skeleton) and AMC (motion) files as raw motion.

Joints are placed where bones begin, as in BVH: a bone's direction and length lead to the joints of its children. A
bone's angles turn about its own axes C, so its rotation relative to its parent's bone is C M C^-1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.captures.raw_motion import MOST_JOINTS, RawMotion, euler_rotations, require_unique, without_flips
from crowdsim.motion.clips.kinematics import Floats, conjugate, multiply
from crowdsim.whole_files import require_regular

ASSUMED_RATE = 120.0
"""Frame rate of an AMC file, which does not contain it [1/s]: that of the CMU captures."""

_MOST_FRAMES = 1_000_000

_ANGLE_UNITS = {"deg": True, "degree": True, "degrees": True, "rad": False, "radian": False, "radians": False}
"""True for the words of an ASF file that mean degrees."""


@dataclass(frozen=True)
class _Bone:
    """Bone of an ASF file.

    axes: order of the turns of its own axes, as XYZ; turns: order of its angles, as RX (and TX of the root). Both name
    first what is applied first.

    offset: (3,) from its begin to its end, in file units. axis: (3,) angles that turn its own axes, in the file's unit
    of angles.
    """

    name: str
    offset: Floats
    axis: Floats
    axes: str
    turns: tuple[str, ...]


def parse_amc(path: Path) -> RawMotion:
    """Read an AMC file on the skeleton beside it.

    The skeleton is the ASF file of the same name, or of the name up to the last underscore (``16.asf`` for
    ``16_27.amc``), or the only one in the folder. Raise MotionError with file and line of an error.
    """
    if not path.is_file():
        raise MotionError(f"{path}: no such capture file")
    skeleton = _skeleton_path(path)
    bones, children, degrees = _parse_asf(skeleton)
    root, values, marked = _parse_amc(path, bones)
    names, parents = _tree(children, skeleton)
    require_unique(names)
    # Units of the axes of bones and of the angles of frames [rad]; the skeleton's holds unless the motion has its own.
    scale, unit = (np.pi / 180.0 if of else 1.0 for of in (degrees, degrees or marked))
    rotations = [_root_rotations(bones["root"], root[:, 3:] * unit, scale)]
    rotations += [_rotations(bones[name], values[name] * unit, scale) for name in names[1:]]
    # A joint is at the end of its parent's bone; children of the root are at the root.
    offsets = [np.zeros(3) if parent <= 0 else bones[names[parent]].offset for parent in parents]
    ends = [index for index in range(1, len(names)) if index not in parents]
    raw = RawMotion(
        tuple(names),
        np.array(parents, np.int32),
        np.array(offsets),
        np.array(ends, np.int32),
        np.array([bones[names[index]].offset for index in ends]).reshape(-1, 3),
        root[:, :3],
        without_flips(np.stack(rotations, axis=1)),
        ASSUMED_RATE,
        (f"{ASSUMED_RATE:g} frames a second", f"the skeleton is {skeleton.name}"),
    )
    try:
        raw.require_sound()
    except MotionError as error:
        raise MotionError(f"{path}: {error}") from None
    return raw


def _skeleton_path(path: Path) -> Path:
    """Return the ASF file for an AMC file, see :func:`parse_amc`; raise MotionError if it is missing or ambiguous."""
    for stem in (path.stem, path.stem.rpartition("_")[0]):
        if stem and (path.parent / f"{stem}.asf").is_file():
            return path.parent / f"{stem}.asf"
    found = sorted(path.parent.glob("*.asf"))
    if len(found) != 1:
        raise MotionError(
            f"{path}: no skeleton for it: put {path.stem}.asf beside it "
            f"(there {'is none' if not found else 'are ' + ', '.join(f.name for f in found)})"
        )
    return found[0]


def _lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield (place, words) of each line that is not empty or a comment; the place is ``file:number``.

    Raise MotionError if the file cannot be read or is no ASCII text.
    """
    require_regular(path, MotionError)
    try:
        text = path.read_text(encoding="ascii")
    except (UnicodeDecodeError, OSError) as error:
        raise MotionError(f"{path}: cannot be read as text: {error}") from None
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if words:
            yield f"{path}:{number}", words


def _numbers(place: str, words: list[str]) -> Floats:
    """Return words as numbers; raise MotionError with the place if they are not."""
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        raise MotionError(f"{place}: '{' '.join(words)}' are not numbers") from None


def _parse_asf(path: Path) -> tuple[dict[str, _Bone], dict[str, list[str]], bool]:
    """Return bones by name (with "root"), the children of each, and True if angles are in degrees."""
    section, degrees = "", True
    bones: dict[str, _Bone] = {}
    children: dict[str, list[str]] = {}
    root: dict[str, list[str]] = {}
    bone: dict[str, list[str]] = {}
    for place, words in _lines(path):
        key, rest = words[0].lower(), words[1:]
        if key.startswith(":"):
            section = key
        elif section == ":units" and key == "angle":
            word = " ".join(rest[:1])
            if word.lower() not in _ANGLE_UNITS:
                raise MotionError(f"{place}: the unit of angles is '{word}'; write deg or rad")
            degrees = _ANGLE_UNITS[word.lower()]
        elif section == ":root":
            root[key] = rest
        elif section == ":bonedata":
            if key == "begin":
                bone = {}
            elif key == "end":
                made = _bone(place, bone)
                bones[made.name] = made
            # Further lines of limits count as keys that are never read.
            else:
                bone.setdefault(key, rest)
        elif section == ":hierarchy" and key not in ("begin", "end"):
            children.setdefault(words[0], []).extend(rest)
    if "root" not in children:
        raise MotionError(f"{path}: cannot be read as an ASF file: its hierarchy has no root")
    turns = tuple(word for word in root.get("order", []))
    if sorted(word.upper() for word in turns) != ["RX", "RY", "RZ", "TX", "TY", "TZ"]:
        raise MotionError(f"{path}: the root's order '{' '.join(turns)}' must name TX, TY, TZ, RX, RY and RZ once each")
    axis = _numbers(f"{path}: orientation", root.get("orientation", ["0", "0", "0"]))
    order = "".join(root.get("axis", ["XYZ"])).upper()
    if len(axis) != 3 or sorted(order) != ["X", "Y", "Z"]:
        raise MotionError(
            f"{path}: the root has orientation '{' '.join(root.get('orientation', []))}' and axis '{order}'; it needs "
            "three numbers of orientation, and an axis that orders them, as XYZ"
        )
    bones["root"] = _Bone("root", np.zeros(3), axis, order, tuple(word.upper() for word in turns))
    unknown = sorted({name for names in children.values() for name in names} | set(children) - {"root"} - set(bones))
    unknown = [name for name in unknown if name not in bones]
    if unknown:
        raise MotionError(f"{path}: the hierarchy names bones that are not defined: {', '.join(unknown)}")
    if len(bones) > MOST_JOINTS:
        raise MotionError(f"{path}: {len(bones)} bones, more than the {MOST_JOINTS} supported")
    return bones, children, degrees


def _bone(place: str, words: dict[str, list[str]]) -> _Bone:
    """Return a bone from the words of its block; raise MotionError with the place of an error."""
    missing = [key for key in ("name", "direction", "length", "axis") if not words.get(key)]
    if missing:
        raise MotionError(f"{place}: a bone has no {', '.join(missing)}")
    direction, length = _numbers(place, words["direction"]), _numbers(place, words["length"])
    axis, order = _numbers(place, words["axis"][:3]), "".join(words["axis"][3:]).upper() or "XYZ"
    if len(direction) != 3 or len(length) != 1 or len(axis) != 3 or sorted(order) != ["X", "Y", "Z"]:
        raise MotionError(
            f"{place}: bone '{words['name'][0]}' needs three numbers of direction, one of length, and three of axis "
            "with their order, as XYZ"
        )
    turns = tuple(word.upper() for word in words.get("dof", []))
    if any(turn not in ("RX", "RY", "RZ") for turn in turns):
        raise MotionError(
            f"{place}: bone '{words['name'][0]}' moves in {' '.join(turns)}; only rx, ry and rz are supported"
        )
    return _Bone(words["name"][0], direction * length, axis, order, turns)


def _parse_amc(path: Path, bones: dict[str, _Bone]) -> tuple[Floats, dict[str, Floats], bool]:
    """Return the root's values (F, 6), the angles (F, n) of each bone, and True if the file says that it has degrees.

    Of the root's values its place comes first, then its turns in file order. All are in the units of the file.
    """
    degrees = False
    frames: list[dict[str, Floats]] = []
    for place, words in _lines(path):
        if words[0].startswith(":"):
            if words[0].upper() == ":RADIANS":
                raise MotionError(f"{place}: angles in radians are not supported; convert them to degrees")
            degrees = degrees or words[0].upper() == ":DEGREES"
            continue
        if len(words) == 1 and words[0].isdigit():
            # Compared as text, as Python refuses to read numbers of more than 4300 digits.
            number = words[0].lstrip("0")
            if number != str(len(frames) + 1) or len(frames) >= _MOST_FRAMES:
                raise MotionError(f"{place}: frame {number[:20] or 0} follows frame {len(frames)}")
            frames.append({})
            continue
        if not frames or words[0] not in bones:
            raise MotionError(
                f"{place}: '{words[0]}' is not a bone of the skeleton"
                if frames
                else f"{place}: values before the first frame number"
            )
        values = _numbers(place, words[1:])
        if len(values) != len(bones[words[0]].turns):
            raise MotionError(
                f"{place}: {len(values)} values for '{words[0]}', which has {len(bones[words[0]].turns)} angles"
            )
        frames[-1][words[0]] = values
    if not frames:
        raise MotionError(f"{path}: cannot be read as an AMC file: it has no frames")
    result: dict[str, Floats] = {}
    for name, bone in bones.items():
        given = [frame[name] for frame in frames if name in frame]
        if given and len(given) < len(frames):
            raise MotionError(f"{path}: '{name}' has values in {len(given)} of {len(frames)} frames")
        result[name] = np.array(given) if given else np.zeros((len(frames), len(bone.turns)))
    order = bones["root"].turns
    columns = [order.index(f"T{axis}") for axis in "XYZ"] + [i for i, turn in enumerate(order) if turn[0] == "R"]
    return result.pop("root")[:, columns], result, degrees


def _tree(children: dict[str, list[str]], path: Path) -> tuple[list[str], list[int]]:
    """Return names and parents (-1 for the root) of all joints, each followed by those below it."""
    names: list[str] = []
    parents: list[int] = []
    # Not by recursion, which a chain of a thousand bones would exhaust.
    waiting = [("root", -1)]
    while waiting:
        name, parent = waiting.pop()
        if name in names:
            raise MotionError(f"{path}: bone '{name}' has two parents")
        names.append(name)
        parents.append(parent)
        waiting += [(child, len(names) - 1) for child in reversed(children.get(name, []))]
    return names, parents


def _own_axes(bone: _Bone, scale: float) -> Floats:
    """Return the rotation C (4,) of a bone's own axes; ``scale`` is the file's unit of angles [rad]."""
    # Reversed, as euler_rotations applies the last turn first.
    return euler_rotations((bone.axis * scale)[::-1], bone.axes[::-1])


def _rotations(bone: _Bone, angles: Floats, scale: float) -> Floats:
    """Return rotations (F, 4) relative to the parent's bone, for ``angles`` (F, n) in the order of its turns [rad].

    scale: unit of the angles of its own axes [rad].
    """
    count = len(angles)
    if not bone.turns:
        return np.broadcast_to(np.array([1.0, 0.0, 0.0, 0.0]), (count, 4))
    # C M C^-1. The turns of M are reversed, as euler_rotations applies the last one first.
    own = _own_axes(bone, scale)
    turned = euler_rotations(angles[:, ::-1], [turn[1] for turn in bone.turns[::-1]])
    return multiply(multiply(np.broadcast_to(own, (count, 4)), turned), np.broadcast_to(conjugate(own), (count, 4)))


def _root_rotations(bone: _Bone, angles: Floats, scale: float) -> Floats:
    """Return rotations (F, 4) of the root for ``angles`` (F, 3) [rad], in the order of RX, RY and RZ in ``bone.turns``.

    scale: as of :func:`_rotations`.
    """
    turns = tuple(turn for turn in bone.turns if turn[0] == "R")
    return _rotations(_Bone(bone.name, bone.offset, bone.axis, bone.axes, turns), angles, scale)
