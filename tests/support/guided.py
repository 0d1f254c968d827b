"""Bodies, grounds and followed paths of the guidance tests."""

from pathlib import Path

import numpy as np
import shapely

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.planning.query.requirements import Requirements
from crowdsim.steering.guidance.field import ways
from crowdsim.steering.guidance.ground import build_ground
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.row_kernels import ROW


def behavior(name, legs, torso, cost, facings=(0.0,)):
    """Return a behavior with two radii and a cost per meter."""
    radii = np.array([legs, torso])
    return Behavior(name, "", facings, ("walking",), cost, 1.0, "#000000", radii, Path())


BEHAVIORS = (
    behavior("lateral", 0.153, 0.154, 3.0, (-np.pi / 2.0, np.pi / 2.0)),
    behavior("arm_constrained", 0.171, 0.257, 1.1),
    behavior("frontal", 0.180, 0.302, 1.0),
)
NEED = Requirements.of(BEHAVIORS, 2, TRACKING_MARGIN)


def ground_of(areas, **more):
    """Return the ground of free areas, that of the legs first."""
    return build_ground([outline_segments(area) for area in areas], NEED, **more)


def follow(ground, field, places, step=0.08, most=1500):
    """Return tracks (steps, n, 2) of followers of a field, their lengths and whether they arrived."""
    at = np.array(places, np.float64)
    length = np.zeros(len(at))
    arrived = np.zeros(len(at), bool)
    trace = [at.copy()]
    for _ in range(most):
        told = ways(ground, field, at)
        stands = np.abs(told.direction).sum(axis=1) == 0.0
        arrived |= stands & (told.length == 0.0)
        go = ~arrived & ~stands
        if not go.any():
            break
        pace = np.minimum(step, told.length)
        at[go] += told.direction[go] * pace[go, None]
        length[go] += pace[go]
        arrived |= go & (told.length <= step)
        trace.append(at.copy())
    return np.array(trace), length, arrived


def free_places(areas, count, seed, clear=0.155):
    """Return random places that keep ``clear`` from the walls of all layers [m]."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = areas[0].bounds
    places = np.column_stack([rng.uniform(x0, x1, 40 * count), rng.uniform(y0, y1, 40 * count)])
    points = shapely.points(places)
    free = shapely.contains_xy(areas[0], places)
    for area in areas:
        free &= shapely.distance(points, area.boundary) >= clear
    return places[free][:count]


def rows_at(places, goal=0):
    """Return rows of agents that stand at places."""
    state = np.zeros(len(places), ROW)
    state["x"], state["y"] = np.asarray(places, np.float64).reshape(-1, 2).T
    state["goal"] = goal
    state["half"] = state["rest"] = 0.105
    state["radius"] = 0.125
    return state
