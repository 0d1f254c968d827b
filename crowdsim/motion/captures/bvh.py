"""Read BVH files as raw motion, with pybvh."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from contextlib import ExitStack
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.captures.bvh_channels import is_plain, plain_channels
from crowdsim.motion.captures.raw_motion import (
    MOST_JOINTS,
    RawMotion,
    euler_rotations,
    require_unique,
    snap_rate,
    without_flips,
)
from crowdsim.motion.captures.still_root import with_travelling_root, without_still
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.whole_files import require_regular

_MOTION = re.compile(r"\bMOTION\s+Frames:\s*(?P<frames>\S+)\s+Frame\s+Time:\s*(?P<time>\S+)")
_STARTS_LINE = frozenset(("HIERARCHY", "ROOT", "JOINT", "End", "OFFSET", "CHANNELS", "{", "}"))


def parse_bvh(path: Path) -> RawMotion:
    """Read a BVH file; raise MotionError for any error or warning of pybvh."""
    import pybvh

    require_regular(path, MotionError)
    if not path.is_file():
        raise MotionError(f"{path}: no such capture file")
    try:
        with warnings.catch_warnings(), ExitStack() as copies:
            warnings.simplefilter("error")
            # world_up is given only so that pybvh does not look for it: the reader of captures finds all axes.
            file, assumed, still = _in_lines(path, lambda: Path(copies.enter_context(TemporaryDirectory())))
            bvh = pybvh.read_bvh_file(file, world_up="+y", warn_on_world_up_disagreement=False)
        return without_still(_from_pybvh(bvh, assumed), still)
    except MotionError as error:
        raise MotionError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, OSError, Warning) as error:
        raise MotionError(f"{path}: cannot be read as a BVH file: {error}") from error


def _in_lines(path: Path, new_folder: Callable[[], Path]) -> tuple[Path, tuple[str, ...], tuple[str, ...]]:
    """Return a file that pybvh can read, notes on what it assumes, and the names of joints that stand still.

    The file is ``path``, or a copy in a ``new_folder`` if pybvh needs other lines or channels. The joints that stand
    still are those above hips that travel, see :func:`with_travelling_root`: the first of them has the places of the
    hips in the copy.

    Raise MotionError for errors that pybvh accepts: missing parts, unbalanced braces, rows that run into each other,
    and more joints than a body has.
    """
    text = path.read_text(encoding="utf-8-sig")
    head, word, _ = text.partition("HIERARCHY")
    if not word or head.strip():
        raise MotionError("does not begin with HIERARCHY")
    motion = _MOTION.search(text)
    if motion is None:
        raise MotionError("MOTION is not followed by 'Frames:' and 'Frame Time:'")
    lines = _hierarchy_lines(text[: motion.start()].split())
    counts = [int(line[1]) for line in lines if line[0] == "CHANNELS"]
    if len(counts) > MOST_JOINTS:
        raise MotionError(f"{len(counts)} joints with channels, more than the {MOST_JOINTS} supported")
    channels = sum(counts)
    if channels <= 0:
        raise MotionError("no joint has channels")
    rows = [line.split() for line in text[motion.end() :].splitlines() if line and not line.isspace()]
    values = sum(len(row) for row in rows)
    if values % channels:
        raise MotionError(f"MOTION holds {values} values, not a multiple of its {channels} channels")
    if len(rows) > 1:
        # A row may be broken over several lines, but each row must end where a line does, unless all are on one line.
        ends = set(accumulate(len(row) for row in rows))
        short = next((k for k in range(channels, values, channels) if k not in ends), None)
        if short is not None:
            raise MotionError(f"row {short // channels} of MOTION ends within a line; it has {channels} values")
    # pybvh reads line by line: one thing a line in the hierarchy, a frame a line, and 'MOTION', 'Frames: N' and
    # 'Frame Time: T', which are six words on three lines.
    as_usual = len(text[: motion.start()].splitlines()) >= len(lines) and all(len(row) == channels for row in rows)
    as_usual = as_usual and len(motion[0].split()) == 6 and len(motion[0].splitlines()) == 3
    if as_usual and is_plain(lines):
        return path, (), ()
    words = [word for row in rows for word in row]
    assumed: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    if not is_plain(lines):
        try:
            table = np.array(words, np.float64).reshape(-1, channels)
        except ValueError as error:
            raise MotionError(f"MOTION holds a value that is not a number: {error}") from None
        lines, table, still = with_travelling_root(lines, table)
        lines, table, assumed = plain_channels(lines, table)
        channels = table.shape[1]
        words = [repr(float(value)) for value in table.ravel()]
        values = len(words)
    lines += [["MOTION"], ["Frames:", motion["frames"]], ["Frame", "Time:", motion["time"]]]
    lines += [words[k : k + channels] for k in range(0, values, channels)]
    file = new_folder() / path.name
    file.write_text("\n".join(" ".join(line) for line in lines) + "\n")
    return file, assumed, still


def _hierarchy_lines(words: list[str]) -> list[list[str]]:
    """Return the words of a hierarchy, line by line; raise MotionError if its braces do not match."""
    depth = 0
    lines: list[list[str]] = []
    for before, word in zip(["", *words], words, strict=False):
        depth += (word == "{") - (word == "}")
        if depth < 0:
            raise MotionError("a brace closes that was not opened")
        # A word that begins a line does not if it is the name of a joint.
        if not lines or (word in _STARTS_LINE and before not in ("ROOT", "JOINT")):
            lines.append([])
        lines[-1].append(word)
    if depth:
        raise MotionError(f"{depth} braces are not closed before MOTION; is the file cut?")
    return lines


def _from_pybvh(bvh: Any, assumed: tuple[str, ...]) -> RawMotion:
    """Return the raw motion of a file that pybvh has read."""
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
        assumed,
    )
    raw.require_sound()
    return raw


def _quaternions(angles: Floats, orders: list[tuple[str, ...]]) -> Floats:
    """Return quaternions (F, J, 4) of Euler angles (F, J, 3) [rad], each joint in its channel order, without flips."""
    result = np.empty(angles.shape[:2] + (4,))
    for order in sorted(set(orders)):
        chosen = [joint for joint, own in enumerate(orders) if own == order]
        result[:, chosen] = euler_rotations(angles[:, chosen], order)
    return without_flips(result)
