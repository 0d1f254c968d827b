"""A timeline that is to be reserved keeps clear of steered bodies as they stand."""

import numpy as np
import pytest

from crowdsim.crowd.state.body_kernels import BODY_ROOM, meets_body
from crowdsim.crowd.state.timelines import NO_BODIES, StandingBodies
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference.crowd import discs_along
from tests.reference.mixed_crowd import gap_to_piece
from tests.support.steered import agents

RADIUS = 0.26


def standing(state):
    walls = build_walls([])
    with Steering(walls, walls, leg_radius=0.125) as steering:
        crowd = steering.sort(state, (0.0, 0.0, 10.0, 10.0))
    return StandingBodies(crowd.rows, crowd.starts, crowd.frame, crowd.broadest)


def meets(agent, timeline, state):
    pieces = zip(timeline, [*timeline[1:], timeline[-1]], strict=True)
    discs = [np.array([*a, *b, RADIUS]) for a, b in pieces]
    return any(gap_to_piece(body, disc) < BODY_ROOM for body in state if body["id"] != agent for disc in discs)


@pytest.mark.parametrize("seed", range(6))
def test_timelines_meet_bodies_as_the_twin_says(seed):
    rng = np.random.default_rng(seed)
    state = agents(rng.uniform(-0.5, 10.5, (60, 2)), rng.uniform(-3, 3, 60), np.zeros(60, int), rng)
    bodies = standing(state)
    answers = set()
    for _ in range(60):
        # It walks, comes to a stand, and stays there; or stands from the beginning.
        steps = rng.normal(0.0, 0.25, (12, 2))
        steps[rng.integers(0, 12) :] = 0.0
        timeline = rng.uniform(0.0, 10.0, 2) + np.cumsum(steps, axis=0)
        agent = int(rng.integers(-1, 60))
        found = bool(meets_body(agent, discs_along(timeline, RADIUS), bodies))
        assert found == meets(agent, timeline, state)
        answers.add(found)
    assert answers == {True, False}


def test_where_nobody_steers_nobody_is_met():
    assert not meets_body(-1, np.zeros((48, 5)), NO_BODIES)
