"""Agents that have long been stuck, and walls around them: who goes first, what is in sight, where there is room."""

import math
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray


def in_sight(walls: NDArray[np.float64], one: np.void, other: np.void) -> bool:
    """Return whether no wall, float64[n, 4] [m], comes within 0.06 m of the line between two agents."""
    line = shapely.LineString([(one["x"], one["y"]), (other["x"], other["y"])])
    return all(line.distance(shapely.LineString(wall.reshape(2, 2))) >= 0.06 for wall in walls)


def is_jammed(mine: np.void, walls: NDArray[np.float64]) -> bool:
    """Return whether an agent has been stuck for 10 s where no disc of 1.15 m across its way fits between walls.

    Walls, float64[n, 4] [m], stand in both layers. The disc is tried beside the agent, as far to the left and to the
    right as makes it touch the nearest wall if that is there.
    """
    lines = [shapely.LineString(wall.reshape(2, 2)) for wall in walls]

    def nearest(x: float, y: float) -> float:
        return min(line.distance(shapely.Point(x, y)) for line in lines)

    if mine["stuck"] < 10.0 or not lines:
        return False
    off = 0.6 - nearest(mine["x"], mine["y"])
    if off <= 0.0:
        return False
    return all(nearest(mine["x"] - each * mine["gy"], mine["y"] + each * mine["gx"]) < 0.575 for each in (-off, off))


def rank_of(mine: np.void, walls: NDArray[np.float64]) -> float:
    """Return the right of way of an agent: the time stuck, and what it drew once and for all while it is jammed."""
    return 100.0 + 20.0 * mine["share"] if is_jammed(mine, walls) else mine["stuck"] + 0.001 * mine["share"]


def handed_on(rank: float) -> float:
    """Return the right of way of an agent that takes it over from another one."""
    return rank - 0.05 if rank > 31.0 else rank - 0.001


def where_room_is(
    mine: np.void, free_ahead: Callable[..., float] | None, velocity: NDArray[np.float64], its_way: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a velocity to where there is most room, of 16 directions, looking 1 m far; not against the other.

    Who has been stuck for 5 s or less takes the first direction, that of ``velocity``. All walls stand in both layers,
    and legs are no broader than a torso with turned shoulders.
    """
    if free_ahead is None or mine["stuck"] <= 5.0:
        return velocity
    preferred = velocity / np.hypot(*velocity)
    angles = 2.0 * np.pi * np.arange(16) / 16
    ways = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ preferred for a in angles]
    room = [free_ahead(mine["x"], mine["y"], *way, mine["radius"], 1.0) for way in ways]
    scores = np.array(room) + 0.25 * np.cos(angles)
    scores[[way @ its_way < -0.5 for way in ways]] = -np.inf
    # Of directions alike, the first one.
    return np.hypot(*velocity) * ways[int(np.flatnonzero(scores >= scores.max() - 1e-9)[0])]


def turned(vector: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return a vector rotated counter-clockwise."""
    return np.array(
        [
            vector[0] * math.cos(angle) - vector[1] * math.sin(angle),
            vector[1] * math.cos(angle) + vector[0] * math.sin(angle),
        ]
    )


def sides(segments: NDArray[np.float64], place: NDArray[np.float64], way: NDArray[np.float64]) -> tuple[float, float]:
    """Return the room to the nearest walls straight to the left and to the right of a place [m]."""
    left, right = math.inf, math.inf
    (x, y), (ux, uy) = place.tolist(), way.tolist()
    for ax, ay, bx, by in segments.tolist():
        before, after = (ax - x) * ux + (ay - y) * uy, (bx - x) * ux + (by - y) * uy
        if before * after <= 0.0 and before != after:
            s = before / (before - after)
            # The crossing with the line across the way, seen from the place: what lies to the left is positive.
            off = (ay - y + s * (by - ay)) * ux - (ax - x + s * (bx - ax)) * uy
            left, right = (min(left, off), right) if off > 0.0 else (left, min(right, -off))
    return left, right


def passage_width(segments: NDArray[np.float64], place: NDArray[np.float64], way: NDArray[np.float64]) -> float:
    """Return the distance between the nearest walls straight to the left and to the right of a place [m]."""
    return sum(sides(segments, place, way))


def widest_behind(
    segments: NDArray[np.float64], place: NDArray[np.float64], way: NDArray[np.float64], length: float
) -> float:
    """Return the greatest width of a passage from a place to ``length`` behind it, along its middle, every 5 cm [m]."""
    widest = 0.0
    for _ in range(round(length / 0.05) + 1):
        left, right = sides(segments, place, way)
        widest = max(widest, left + right)
        if math.isinf(widest):
            break
        middle = place + 0.5 * (left - right) * turned(way, math.pi / 2)
        behind = middle - 0.05 * way
        left, right = sides(segments, behind, way)
        if math.isinf(left + right):
            return math.inf
        place = behind + 0.5 * (left - right) * turned(way, math.pi / 2)
        way = (middle - place) / np.hypot(*(middle - place))
    return widest
