"""Slow, obvious twins of the kernels by which captured and steered agents notice each other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from tests.reference.steering_reference import core_ends, segment_to_segment


def core_of(row: Any) -> np.ndarray:
    """Return both ends of the core segment of a record (ROW)."""
    return core_ends(np.array([row["x"], row["y"]]), np.array([row["hx"], row["hy"]]), row["half"])


def gap_to_piece(row: Any, piece: np.ndarray) -> float:
    """Return the gap between a body and a disc anywhere along a piece of a way: x, y of both ends, radius [m]."""
    return segment_to_segment(core_of(row), piece[:4].reshape(2, 2)) - row["radius"] - piece[4]


def gaps_to_pieces(rows: np.ndarray, pieces: np.ndarray) -> np.ndarray:
    """Return (n, m) the gap of each body to each piece of (m, 5) ways, as :func:`gap_to_piece` [m]."""
    cores = shapely.linestrings([core_of(row) for row in rows])
    ways = shapely.linestrings(pieces[:, :4].reshape(-1, 2, 2))
    return shapely.distance(cores[:, None], ways) - rows["radius"][:, None] - pieces[:, 4]


def company(rows: np.ndarray, reach: tuple[float, float], narrow: float, wide: float) -> list[tuple[int, float, float]]:
    """Return for each record: the number of others near, and when one comes within ``narrow`` and ``wide`` [s]."""
    found = []
    for me, mine in enumerate(rows):
        near, soon, soon_wide = 0, math.inf, math.inf
        way = np.array([mine["ix"], mine["iy"]])
        for number, other in enumerate(rows):
            if number == me:
                continue
            apart = np.array([other["x"] - mine["x"], other["y"] - mine["y"]])
            if np.hypot(*apart) > reach[1]:
                continue
            near += np.hypot(*apart) < reach[0]
            same_way = way @ [other["ix"], other["iy"]] > 0.3
            # Only others ahead that come nearer count; ``time`` is that of the closest approach.
            if way.any() and apart @ way <= 0.0:
                continue
            relative = np.array([mine["vx"] - other["vx"], mine["vy"] - other["vy"]])
            if np.hypot(*relative) < 0.15 or apart @ relative <= 0.0:
                continue
            time = float(apart @ relative / (relative @ relative))
            least = float(np.hypot(*(apart - time * relative)))
            if least < wide:
                soon_wide = min(soon_wide, time)
            if least < narrow and not same_way:
                soon = min(soon, time)
        found.append((near, soon, soon_wide))
    return found
