"""Slow twins of foot sliding: speed of the feet that bodies stand on, one frame or one body at a time."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.foot_contacts import Feet, planted_steps
from crowdsim.motion.planted.planted_rows import PlantedRows

Moment = tuple[dict[int, tuple[int, float]], dict[int, Floats]]
"""Node and frame of each agent, and the points (2, P, 3) of its feet."""


def planted_speed(shown: Feet, own: Feet, rate: float = CAPTURE_RATE) -> Floats:
    """Return (F - 1, 2) horizontal speeds of each foot of F frames as ``shown`` [m/s]; nan if it is not planted.

    A foot counts as planted if it is in ``own``, the same frames in the clip; it stands on its slowest point.
    """
    planted = planted_steps(own, part=True)
    speed = np.full(planted.shape[:2], np.nan)
    for step in range(len(planted)):
        for foot in (0, 1):
            for point in np.flatnonzero(planted[step, foot]):
                way = shown.points[step + 1, foot, point, :2] - shown.points[step, foot, point, :2]
                speed[step, foot] = np.fmin(speed[step, foot], float(np.linalg.norm(way)) * rate)
    return speed


def planted_distances(rows: PlantedRows, before: Moment, after: Moment) -> list[float]:
    """Return how far each foot has moved that stays planted in the clips from one moment to another [m]."""
    table, found = rows.table, []
    for agent in sorted(set(before[0]) & set(after[0])):
        (old, since), (node, frame) = before[0][agent], after[0][agent]
        first, begin = table.node_first[old], int(np.floor(since))
        if node == old and frame >= since:
            steps = [first + step for step in range(begin, int(np.ceil(frame)))]
        else:
            steps = [first + step for step in range(begin, table.node_frames[old])]
            steps += [table.node_first[node] + step for step in range(int(np.ceil(frame)))]
        way = (after[1][agent] - before[1][agent])[..., :2]
        for foot in (0, 1):
            stays = [number for number in range(way.shape[1]) if all(rows.stands[step, foot, number] for step in steps)]
            if stays:
                found.append(min(float(np.hypot(*way[foot, number])) for number in stays))
    return found
