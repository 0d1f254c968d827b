"""Slow twin of stepping to a wall: moves are priced with shapely's distances and tried in the order of cost."""

from __future__ import annotations

import numpy as np
import shapely

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.giving_way.aside_kernels import (
    FARTHER,
    LEFT_COST,
    LEFT_ROOM,
    NARROW_ROOM,
    NEAR,
    NEAR_COST,
    POSTURE_COST,
    ROOM_COST,
    SAME_SIDE_COST,
    WORTH,
)
from crowdsim.crowd.giving_way.give_way_kernels import DETOUR_COST
from crowdsim.crowd.state.components import RADIUS, SLOT_FRAMES
from crowdsim.crowd.state.reservation_kernels import pair_meets
from crowdsim.geometry.planar import compose
from tests.reference.crowd import FOREVER
from tests.reference.giving_way import Scene, is_clear, meets_body, play


def step_to_wall_slow(scene: Scene, row: int) -> int:
    """Return the move by which a row steps to a wall; -1 if there is none."""
    moves, standing, everyone = scene.moves, scene.standing, scene.everyone
    node = int(standing.node[row])
    at = compose(standing.origin[row], scene.graph.node_motion[node])
    own, widest = float(scene.obstacles.breadths[0, 0]), float(scene.obstacles.radii.max())
    away = float(np.hypot(*(standing.goal[row] - at[:2])))
    along = (standing.goal[row] - at[:2]) / away
    others = [k for k in range(len(everyone.timeline)) if k != row]

    # Free room beyond the widest body, cut off where it no longer matters.
    def room_at(place: np.ndarray) -> float:
        point = shapely.Point(place[:2])
        distance = scene.floor.exterior.distance(point) if scene.floor.contains(point) else 0.0
        return min(float(distance) - widest, NARROW_ROOM)

    # How much is missing to pass the nearest others on the line to the goal, and the distance to the nearest of them.
    def beside(place: np.ndarray, radius: float) -> tuple[float, float]:
        lacking, gap = 0.0, NEAR
        for sample in (everyone.timeline[k, -1] for k in others):
            off = sample[:2] - place[:2]
            if np.hypot(*off) < NEAR:
                gap = min(gap, float(np.hypot(*off)))
                lacking = max(lacking, radius + sample[RADIUS] - abs(along[0] * off[1] - along[1] * off[0]))
        return lacking, gap

    room, near = room_at(at), beside(at, 0.0)[1]
    if room >= NARROW_ROOM:
        return -1
    priced = []
    for move in range(int(moves.begin[node]), int(moves.begin[node + 1])):
        end = compose(at, moves.shift[move])
        left, (lacking, gap) = room_at(end), beside(end, own)
        closer, farther = left <= room - WORTH, left <= room and gap >= near + FARTHER
        if left >= LEFT_ROOM and (closer or farther):
            cost = moves.frames[move] / CAPTURE_RATE + ROOM_COST * left + POSTURE_COST * own
            cost += DETOUR_COST * (np.hypot(*(standing.goal[row] - end[:2])) - away)
            cost += SAME_SIDE_COST * lacking + NEAR_COST * (NEAR - gap)
            cost += LEFT_COST if moves.shift[move, 1] > 0.0 else 0.0
            priced.append((cost, move))
    slot = scene.clock // SLOT_FRAMES
    # The cheapest move that meets no timeline, no steered body and no wall.
    for _, move in sorted(priced):
        timeline, poses, ways = play(scene, row, move)
        radii = everyone.body_radius
        meets = (
            pair_meets(timeline, slot, FOREVER, *scene.timeline(k), slot, float(radii[row] + radii[k]), True)
            for k in others
        )
        if not any(meets) and not meets_body(scene, timeline) and is_clear(scene, row, poses, ways, 0.0):
            return move
    return -1
