"""Slow, obvious twins of the measurements of steered crowds and of admission: every pair is compared."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tests.reference.steering_reference import core_ends, gap, point_to_segment, segment_to_segment

Segments = NDArray[np.float64]


def closest_bodies(state: NDArray[np.void], limit: float) -> tuple[float, float]:
    """Return the least gap between two bodies and the least distance between two centers, up to ``limit`` [m]."""
    pairs = list(combinations(range(len(state)), 2))
    gaps = [gap(state, i, j) for i, j in pairs]
    centers = [float(np.hypot(state[i]["x"] - state[j]["x"], state[i]["y"] - state[j]["y"])) for i, j in pairs]
    return min([limit, *gaps]), min([limit, *centers])


def wall_gap(row: np.void, segments: Segments, torso: bool, leg_radius: float) -> float:
    """Return the gap between a body (``torso``) or its legs and the nearest of some segments [m]."""
    place = np.array([row["x"], row["y"]])
    gaps = [np.inf]
    for segment in segments.reshape(-1, 2, 2):
        if torso:
            core = core_ends(place, np.array([row["hx"], row["hy"]]), row["half"])
            gaps.append(segment_to_segment(core, segment) - row["radius"])
        else:
            gaps.append(point_to_segment(place, segment) - leg_radius)
    return min(gaps)


def admitted(
    coming: NDArray[np.void], there: NDArray[np.void], legs: Segments, torso: Segments, leg_radius: float, room: float
) -> list[bool]:
    """Return which of the arriving agents have room, each after the admitted ones before it."""
    crowd = list(there)
    answers = []
    for row in coming:
        pairs = [np.array([row, other]) for other in crowd]
        free = all(gap(pair, 0, 1) >= room for pair in pairs)
        free = free and wall_gap(row, torso, True, leg_radius) >= room
        free = free and wall_gap(row, legs, False, leg_radius) >= room
        answers.append(free)
        if free:
            crowd.append(row)
    return answers


def taken_spots(draws: Segments, distance: float, spots: Segments, most: int) -> Segments:
    """Return ``spots`` with those of ``draws`` added, in order, that keep a distance from all before them.

    Stops after ``most`` failed draws in a row.
    """
    taken = list(spots)
    vain = 0
    for draw in draws:
        if vain == most:
            break
        if all(np.hypot(*(draw - other)) >= distance for other in taken):
            taken.append(draw)
            vain = 0
        else:
            vain += 1
    return np.array(taken).reshape(-1, 2)
