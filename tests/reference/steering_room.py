"""Walls around an agent: what it sees past them, and where it has room to step aside."""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray


def in_sight(walls: NDArray[np.float64], one: np.void, other: np.void) -> bool:
    """Return whether no wall, float64[n, 4] [m], comes within 0.06 m of the line between two agents."""
    line = shapely.LineString([(one["x"], one["y"]), (other["x"], other["y"])])
    return all(line.distance(shapely.LineString(wall.reshape(2, 2))) >= 0.06 for wall in walls)


def has_less_room(mine: np.void, free_ahead: Callable[..., float] | None, aside: NDArray[np.float64]) -> bool:
    """Return whether an agent stuck for over 5 s has less room towards a side than opposite, looking 0.5 m far.

    All walls stand in both layers, and its legs are as broad as a torso with turned shoulders.
    """
    if mine["stuck"] <= 5.0 or free_ahead is None:
        return False
    there, back = (free_ahead(mine["x"], mine["y"], *way, mine["radius"], 0.5) for way in (aside, -aside))
    return there < back
