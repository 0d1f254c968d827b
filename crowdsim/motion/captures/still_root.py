"""BVH files whose first joint stands still above hips that travel, as 'Reference' or 'Armature' of many exporters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from crowdsim.geometry.products import dot
from crowdsim.motion.captures.raw_motion import RawMotion, euler_rotations
from crowdsim.motion.clips.kinematics import Floats, multiply, rotate

PLACES = ("Xposition", "Yposition", "Zposition")

_STILL = 1e-3
"""Share of the longest bone by which a joint may move and stand still."""
_STILL_ANGLE = np.radians(0.1)
"""Angle by which a joint may turn and stand still [rad]."""


class _Joint(NamedTuple):
    """Parent (-1 for none), offset (3,) in file units, first column of its values, line and names of its channels.

    The line is an index into the lines of the hierarchy.
    """

    name: str
    parent: int
    offset: Floats
    column: int
    line: int = 0
    channels: tuple[str, ...] = ()


def with_travelling_root(
    lines: Sequence[Sequence[str]], values: Floats
) -> tuple[list[list[str]], Floats, tuple[str, ...]]:
    """Return hierarchy, rows (F, C) in which the first joint has the places of the hips, and names of the still joints.

    lines: words of the hierarchy, line by line. values: (F, c) of all its channels, in their order, in file units and
    degrees. The still joints are those from the first one to the parent of the first that travels. If one of them
    moves, turns or has no channels of rotation, or if no joint travels, there are none, and everything is returned as
    given. Still joints keep their turns; :func:`without_still` removes the joints.
    """
    given = [list(line) for line in lines]
    joints = _joints(lines)
    # Joints from the first one down, as long as each has one child: the hips are the first with several.
    chain = [0]
    while len(below := [index for index, joint in enumerate(joints) if joint.parent == chain[-1]]) == 1:
        chain.append(below[0])
    longest = _longest_bone(joints, chain, values)
    place, turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for number, index in enumerate(chain):
        joint = joints[index]
        own = _places(joint, values)
        # The one that travels: it goes farther than the longest bone is long. A first joint that does is a usual root.
        if own is not None and number and np.ptp(own, axis=0).max() > longest:
            break
        moved = 0.0 if own is None else np.ptp(own, axis=0).max()
        turns = _turns(joint, values)
        # A joint that cannot turn is refused with its channels later, by :func:`plain_channels`.
        if not turns.shape[1]:
            return given, values, ()
        # Whatever moves or turns above the hips is a part of the body.
        if moved > _STILL * longest or np.ptp(turns, axis=0).max(initial=0.0) > _STILL_ANGLE:
            return given, values, ()
        place = place + rotate(turn, joint.offset if own is None else own[0])
        turn = multiply(turn, euler_rotations(turns[0], [name[0] for name in joint.channels if name not in PLACES]))
    else:
        # None travels.
        return given, values, ()
    # The first joint takes the places of the one that travels; those between have none.
    there = place + rotate(turn, own)
    above = chain[:number]
    kept: list[Floats] = [there]
    for index, joint in enumerate(joints):
        names = [name for name in joint.channels if name not in PLACES or index not in (*above, chain[number])]
        kept.append(values[:, [joint.column + joint.channels.index(name) for name in names]])
        names = names if index else [*PLACES, *names]
        given[joint.line] = ["CHANNELS", str(len(names)), *names]
    return given, np.concatenate(kept, axis=1), tuple(joints[index].name for index in above)


def without_still(raw: RawMotion, still: Sequence[str]) -> RawMotion:
    """Return the motion without its first joints ``still``, a chain, whose turns the next joint takes over."""
    count = len(still)
    if not count:
        return raw
    turned = raw.rotations[:, 0]
    for joint in range(1, count + 1):
        turned = multiply(turned, raw.rotations[:, joint])
    rotations = np.concatenate([turned[:, None], raw.rotations[:, count + 1 :]], axis=1)
    # An end site of a still joint, too, is no part of the body.
    ends = raw.end_parents >= count
    reason = f"'{raw.names[count]}' is the root, as nothing above it moves ({', '.join(still)})"
    return replace(
        raw,
        names=raw.names[count:],
        parents=np.maximum(raw.parents[count:] - count, -1).astype(np.int32),
        offsets=raw.offsets[count:],
        end_parents=(raw.end_parents[ends] - count).astype(np.int32),
        end_offsets=raw.end_offsets[ends],
        rotations=rotations,
        assumed=(reason, *raw.assumed),
    )


def _joints(lines: Sequence[Sequence[str]]) -> list[_Joint]:
    """Return the joints of a hierarchy in its order."""
    found: list[_Joint] = []
    # Joints whose braces are open; -1 for an end site.
    open_joints: list[int] = []
    column, current = 0, -1
    for number, line in enumerate(lines):
        if line[0] in ("ROOT", "JOINT", "End"):
            current = -1 if line[0] == "End" else len(found)
            if current >= 0:
                parent = open_joints[-1] if open_joints else -1
                found.append(_Joint("_".join(line[1:]), parent, np.zeros(3), column))
        elif line[0] == "{":
            open_joints.append(current)
        elif line[0] == "}":
            open_joints.pop()
        elif line[0] == "OFFSET" and current >= 0:
            offset = np.array([float(word) for word in line[1:4]])
            found[current] = found[current]._replace(offset=offset)
        elif line[0] == "CHANNELS" and current >= 0:
            found[current] = found[current]._replace(column=column, line=number, channels=tuple(line[2:]))
            column += len(line) - 2
    return found


def _longest_bone(joints: Sequence[_Joint], chain: Sequence[int], values: Floats) -> float:
    """Return the length of the longest bone below the joints ``chain``, in file units; ``values`` (F, c) are rows."""
    lengths = [0.0]
    for index, joint in enumerate(joints):
        own = _places(joint, values)
        if index not in chain:
            # Channels of places stand for an offset, which is then often given as zero.
            bone = joint.offset if own is None or joint.offset.any() else own.mean(axis=0)
            lengths.append(float(np.sqrt(dot(bone, bone))))
    return max(lengths)


def _places(joint: _Joint, values: Floats) -> Floats | None:
    """Return the places (F, 3) of a joint in file units; None if it has no such channels."""
    if any(name not in joint.channels for name in PLACES):
        return None
    return values[:, [joint.column + joint.channels.index(name) for name in PLACES]]


def _turns(joint: _Joint, values: Floats) -> Floats:
    """Return the angles (F, n) of a joint, in the order of its n channels of rotation [rad]."""
    columns = [joint.column + k for k, name in enumerate(joint.channels) if name not in PLACES]
    return np.radians(values[:, columns])
