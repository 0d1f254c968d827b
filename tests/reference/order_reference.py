"""Slow and obvious twin of the order of agents who go the same way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEAR = 2.0
"""Distance up to which two ways lead into one passage [m]."""


def same_goal(mine: NDArray[np.void], other: NDArray[np.void]) -> bool:
    """Return whether two rows have one goal, or both none."""
    return bool(mine["goal"] == other["goal"] or max(mine["goal"], other["goal"]) < 0)


def same_way(mine: NDArray[np.void], other: NDArray[np.void]) -> bool:
    """Return whether two rows go the same way, at least for a while."""
    return same_goal(mine, other) or lead_of(mine, other) is not None


def key_of(mine: NDArray[np.void], other: NDArray[np.void]) -> float | None:
    """Return the key of another row as if it had the goal of the first; None if it does not go the same way."""
    if same_goal(mine, other):
        return float(other["key"])
    lead = lead_of(mine, other)
    return None if lead is None else float(mine["togo"] - lead + (other["key"] - other["togo"]))


def lead_of(mine: NDArray[np.void], other: NDArray[np.void]) -> float | None:
    """Return how much farther another row is on the way that both have in common [m]; None if they have none."""
    if min(mine["goal"], other["goal"]) < 0:
        return None
    places = [np.array([row["x"], row["y"]]) for row in (mine, other)]
    courses = [np.array([row["cx"], row["cy"]]) for row in (mine, other)]
    behind = [np.array([row["onx"], row["ony"]]) for row in (mine, other)]
    lengths = [float(row["ahead"]) for row in (mine, other)]
    bends = [place + length * course for place, length, course in zip(places, lengths, courses, strict=True)]
    if courses[0] @ courses[1] > 0.3:
        mean = courses[0] + courses[1]
        return float((places[1] - places[0]) @ mean / np.linalg.norm(mean))
    if behind[0] @ behind[1] > 0.3 and np.linalg.norm(bends[1] - bends[0]) < NEAR:
        return lengths[0] - lengths[1]
    found = []
    for one, two, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        if behind[one] @ courses[two] <= 0.3:
            continue
        # The bend of one in the frame of the straight way of the other.
        off = bends[one] - places[two]
        along, aside = float(off @ courses[two]), float(courses[two][0] * off[1] - courses[two][1] * off[0])
        if -NEAR <= along <= lengths[two] + NEAR and abs(aside) <= NEAR:
            found.append(sign * (lengths[one] - along))
    return float(np.mean(found)) if found else None
