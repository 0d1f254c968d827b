"""BVH files in which every joint has position channels, as motion capture suits and MotionBuilder write them.

In such a file a joint's position channels replace its OFFSET. Bones do not stretch here: each joint keeps its mean
position, and the report says what that leaves out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.geometry.products import dot
from crowdsim.motion.clips.kinematics import Floats

_PLACES = ("Xposition", "Yposition", "Zposition")
_STRETCH = 0.01
"""Share of the longest bone by which positions may differ from their mean without a note."""


def is_plain(lines: Sequence[Sequence[str]]) -> bool:
    """Return True if only the root of a hierarchy has positions, in the order x, y, z, and names have no blanks."""
    channels = [tuple(line[2:]) for line in lines if line[0] == "CHANNELS"]
    return (
        all(len(line) <= 2 for line in lines if line[0] in ("ROOT", "JOINT"))
        and channels[0][:3] == _PLACES
        and not any(name in _PLACES for own in channels[1:] for name in own)
    )


def plain_channels(lines: Sequence[Sequence[str]], values: Floats) -> tuple[list[list[str]], Floats, tuple[str, ...]]:
    """Return hierarchy and rows (F, C) in which only the root has positions, and the assumptions made.

    lines: words of the hierarchy, line by line. values: (F, c) of all its channels, in their order, in file units and
    degrees. Blanks in names become underscores. Raise MotionError for a joint whose channels make no sense.
    """
    made: list[list[str]] = []
    columns: list[int] = []
    begin, offset_line, name, root = 0, 0, "", True
    stretched: dict[str, float] = {}
    longest = 0.0
    # Copy the hierarchy line by line; ``begin`` is the first column of the present joint, ``columns`` those that stay.
    for line in lines:
        made.append(list(line))
        if line[0] in ("ROOT", "JOINT"):
            name = "_".join(line[1:])
            made[-1] = [line[0], name]
        elif line[0] == "OFFSET":
            offset_line = len(made) - 1
        elif line[0] == "CHANNELS":
            own = list(line[2:])
            _require_channels(name, line)
            places = [begin + own.index(axis) for axis in _PLACES if axis in own]
            turns = [begin + k for k, channel in enumerate(own) if channel not in _PLACES]
            kept = [channel for channel in own if channel not in _PLACES]
            # The root keeps its places as x, y, z, whatever their order was; it cannot do without.
            if root:
                if len(places) != 3:
                    raise MotionError(f"the root joint '{name}' has no position: its channels are {' '.join(own)}")
                columns += places
                kept = [*_PLACES, *kept]
            # Places of another joint become a constant offset, and only their largest change is reported.
            elif len(places) == 3:
                offset = np.array([float(word) for word in made[offset_line][1:4]])
                moved, off = _own_offset(offset, values[:, places])
                made[offset_line] = ["OFFSET", *(repr(float(number)) for number in moved)]
                longest = max(longest, float(np.sqrt(dot(moved, moved))))
                stretched[name] = off
            columns += turns
            made[-1] = ["CHANNELS", str(len(kept)), *kept]
            begin, root = begin + len(own), False
    # Noise of a suit is not worth a note; a joint that really moves away from its bone is.
    worst = max(stretched, key=lambda joint: stretched[joint], default="")
    assumed: tuple[str, ...] = ()
    if stretched:
        assumed = ("joints stay at the mean of their own places",)
        if stretched[worst] > _STRETCH * longest:
            assumed = (f"{assumed[0]}, from which '{worst}' is up to {stretched[worst]:.3g} units away",)
    return made, values[:, columns], assumed


def _require_channels(name: str, line: Sequence[str]) -> None:
    """Raise MotionError if a joint has other channels than three rotations, with or without a position."""
    own = list(line[2:])
    places, turns = [c for c in own if c in _PLACES], [c for c in own if c not in _PLACES]
    if len(own) != int(line[1]) or len(set(own)) != len(own) or len(places) not in (0, 3) or len(turns) != 3:
        raise MotionError(
            f"joint '{name}' has the channels {' '.join(line[1:])}; it needs three rotations, a position is optional"
        )


def _own_offset(offset: Floats, places: Floats) -> tuple[Floats, float]:
    """Return a joint's constant place relative to its parent, and its largest distance from there, in file units.

    offset: (3,). places: (F, 3) of its channels. If their mean is shorter than 1 % of the offset, they count from the
    offset, else from the parent.
    """
    mean = places.mean(axis=0)
    away: NDArray[np.float64] = np.linalg.norm(places - mean, axis=1)
    if np.sqrt(dot(mean, mean)) < 0.01 * np.sqrt(dot(offset, offset)):
        mean = mean + offset
    return mean, float(away.max())
