"""Slow, obvious twins of the steering kernels: everyone against everyone, and every candidate tried."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Lines = NDArray[np.float64]


def core_ends(place: NDArray[np.float64], heading: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Both ends of a core, float64[2, 2]; ``heading`` is a unit vector."""
    across = np.array([-heading[1], heading[0]])
    return np.array([place - half * across, place + half * across])


def point_to_segment(point: NDArray[np.float64], ends: NDArray[np.float64]) -> float:
    along = ends[1] - ends[0]
    square = along @ along
    s = 0.0 if square == 0.0 else float(np.clip((point - ends[0]) @ along / square, 0.0, 1.0))
    return float(np.hypot(*(point - ends[0] - s * along)))


def segments_cross(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    def side(ends: NDArray[np.float64], point: NDArray[np.float64]) -> float:
        a, b = ends
        return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])

    return (
        side(first, second[0]) * side(first, second[1]) < 0.0 and side(second, first[0]) * side(second, first[1]) < 0.0
    )


def segment_to_segment(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Distance of two segments: 0 if they cross, else from one of the four ends [m]."""
    if segments_cross(first, second):
        return 0.0
    return min(
        *(point_to_segment(point, second) for point in first), *(point_to_segment(point, first) for point in second)
    )


def gap(state: NDArray[np.void], i: int, j: int) -> float:
    """Gap between the bodies of two agents [m]."""
    ends = [
        core_ends(np.array([row["x"], row["y"]]), np.array([row["hx"], row["hy"]]), row["half"])
        for row in (state[i], state[j])
    ]
    return segment_to_segment(*ends) - state[i]["radius"] - state[j]["radius"]


def nearest_agents(state: NDArray[np.void], me: int, reach: float, most: int) -> list[int]:
    """Whom an agent heeds, the most important first."""
    mine = state[me]
    weights = []
    for other, row in enumerate(state):
        px, py = row["x"] - mine["x"], row["y"] - mine["y"]
        distance = math.sqrt(px * px + py * py)
        if other != me and px * px + py * py <= reach * reach:
            weights.append((1.25 * distance - 0.5 * (px * mine["gx"] + py * mine["gy"]), other))
    return [other for _, other in sorted(weights)[:most]]


def nearest_feasible(wanted: NDArray[np.float64], lines: Lines) -> NDArray[np.float64]:
    """The move nearest to ``wanted`` that crosses no line: among itself, its feet on all lines, and all crossings."""
    candidates = [wanted]
    candidates.extend(wanted - (n[:2] @ wanted - n[2]) * n[:2] for n in lines)
    for a, b in combinations(lines, 2):
        normals = np.array([a[:2], b[:2]])
        if abs(np.linalg.det(normals)) > 1e-9:
            candidates.append(np.linalg.solve(normals, [a[2], b[2]]))
    feasible = [each for each in candidates if all(n[:2] @ each <= n[2] + 1e-9 for n in lines)]
    return min(feasible, key=lambda each: float(np.hypot(*(each - wanted))), default=np.zeros(2))


def free_way(
    state: NDArray[np.void], me: int, direction: NDArray[np.float64], width: float, horizon: float, tick: float = 1e-3
) -> float:
    """Way until an agent meets another who keeps its velocity, by small ticks of time [m]."""
    mine = state[me]
    velocity = mine["speed"] * direction
    for count in range(int(horizon / mine["speed"] / tick) + 1):
        time = count * tick
        for other, row in enumerate(state):
            if other == me:
                continue
            relative = velocity - np.array([row["vx"], row["vy"]])
            apart = np.array([row["x"] - mine["x"], row["y"] - mine["y"]])
            if apart @ relative <= 0.0:
                continue
            across = abs(row["hx"] * relative[0] + row["hy"] * relative[1]) / np.hypot(*relative)
            if np.hypot(*(apart - time * relative)) < width + row["radius"] + row["half"] * across:
                return mine["speed"] * time
    return horizon


def wall_distance(segments: NDArray[np.float64], x: float, y: float) -> float:
    """Distance from a place to the nearest segment [m]."""
    return min((point_to_segment(np.array([x, y]), each.reshape(2, 2)) for each in segments), default=math.inf)


def smallest_gaps(
    before: NDArray[np.void], after: NDArray[np.void], walls: NDArray[np.float64], leg_radius: float, times: int = 5
) -> tuple[float, float]:
    """Smallest gap between any two bodies, and to any wall, at several times of a step [m].

    Places and headings are interpolated between two states, as a recording is shown.
    """
    turned = (after["heading"] - before["heading"] + math.pi) % (2.0 * math.pi) - math.pi
    people, to_walls = math.inf, math.inf
    for share in np.linspace(0.0, 1.0, times + 1)[1:]:
        state = after.copy()
        for name in ("x", "y", "half"):
            state[name] = before[name] + share * (after[name] - before[name])
        state["heading"] = before["heading"] + share * turned
        state["hx"], state["hy"] = np.cos(state["heading"]), np.sin(state["heading"])
        places = np.column_stack((state["x"], state["y"]))
        for i in range(len(state)):
            near = np.flatnonzero(np.hypot(*(places[i + 1 :] - places[i]).T) < 1.2) + i + 1
            people = min([people, *(gap(state, i, j) for j in near)])
            ends = core_ends(places[i], np.array([state["hx"][i], state["hy"][i]]), state["half"][i])
            for wall in walls:
                to_walls = min(to_walls, segment_to_segment(ends, wall.reshape(2, 2)) - state["radius"][i])
                to_walls = min(to_walls, point_to_segment(places[i], wall.reshape(2, 2)) - leg_radius)
    return people, to_walls
