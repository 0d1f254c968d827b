"""Wedged agents: turns between walls, and a place that nobody left before."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.steering import turn_kernels
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference import steering_reference as reference
from tests.support.steered import agents


@kernel
def _turn_between_walls(walls, body, half, keep, turn):
    return turn_kernels.turn_between_walls(walls, body, half, keep, turn)


@kernel
def _turn_wedged(mine, walls, keep, turn, half, lines, spans):
    return turn_kernels.turn_wedged(mine, walls, keep, turn, half, lines, spans)


@pytest.mark.parametrize("seed", range(60))
def test_a_body_turns_as_far_as_the_walls_allow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-0.45, 0.45, (4, 2))
    walls = np.column_stack((ends, ends + rng.uniform(-0.3, 0.3, (4, 2))))
    state = agents(np.zeros((1, 2)), rng.uniform(-math.pi, math.pi, 1), np.zeros(1, int), rng)
    half, turn = float(state["half"][0]), float(rng.uniform(-0.6, 0.6))
    heading = float(state["heading"][0])
    core = half * np.outer([-1.0, 1.0], [-math.sin(heading), math.cos(heading)])
    # As near to a wall as a body can be, or a little away from it.
    least = min(reference.segment_to_segment(core, wall.reshape(2, 2)) for wall in walls)
    keep = max(least - rng.choice([5e-7, 1e-3, 0.05]), 0.0)
    found = _turn_between_walls(build_walls(walls), state[0], half, keep, turn)
    expected = reference.turn_between(walls, np.zeros(2), heading, half, keep, turn)
    assert abs(found) <= abs(expected) + 1e-3
    # Where the body grazes a wall, advances get too short to pass it. A millimeter more room is enough for them.
    enough = reference.turn_between(walls, np.zeros(2), heading, half, keep + 1e-3, turn)
    assert abs(found) >= abs(enough) - 1e-3


@pytest.mark.parametrize("degrees", [-1.0, -0.3, 0.2, 0.5, 2.0])
def test_a_body_that_cannot_turn_past_a_right_angle_to_a_wall_turns_to_the_other_side(degrees: float) -> None:
    """Two shoulders that leaned on each other and on both walls of a neck of 0.8 m held up 64 people for good."""
    rng = np.random.default_rng(1)
    state = agents(np.zeros((1, 2)), np.radians([degrees]), np.zeros(1, int), rng)
    body, sign = state[0], math.copysign(1.0, degrees)
    # The wall beside the shoulder leaves half a micrometer: to a right angle, the core would need 0.7 um or more.
    wall = np.array([[-2.0, 1.0, 2.0, 1.0]])
    wall[:, 1::2] = body["half"] * math.cos(body["heading"]) + 5e-7
    walls, lines, spans = build_walls(wall), np.empty((4, 4)), (0, 0, 0)
    for _ in range(30):
        # The facing is a little to the side on which the heading is, so the turn aims past the right angle.
        turn = -sign * 0.25
        assert abs(_turn_between_walls(walls, body, body["half"], 0.0, turn)) <= abs(body["heading"])
        body["heading"], body["hx"], body["hy"], _ = _turn_wedged(body, walls, 0.0, turn, body["half"], lines, spans)
        if sign * body["heading"] > 0.2:
            break
    assert sign * body["heading"] > 0.2


BOX = [(6.132, 2.052), (6.808, 2.705), (6.148, 3.388), (5.472, 2.735)]
"""A box that stands across the edge of a door (6.47, 1.84), 0.38 m from it."""


@pytest.mark.parametrize(
    ("place", "heading", "half"),
    [((6.341, 1.948), -3.114, 0.12), ((6.286, 1.936), 1.557, 0.1), ((6.261, 1.9), 1.197, 0.085)],
)
def test_nobody_stays_wedged_between_a_box_and_the_edge_of_a_door(
    place: tuple[float, float], heading: float, half: float
) -> None:
    """Three who stood in this gap for good: no half plane let them turn, and none of their turns let them pass."""
    rng = np.random.default_rng(1)
    corners = np.array(BOX)
    walls = np.vstack(
        (
            np.column_stack((corners, np.roll(corners, -1, axis=0))),
            [(6.47, 0.0, 6.47, 1.84), (6.47, 1.84, 6.67, 1.84), (6.67, 1.84, 6.67, 0.0)],
        )
    )
    state = agents(np.array([place]), np.array([heading]), np.zeros(1, int), rng)
    state["half"] = state["rest"] = half
    steering = Steering(build_walls(walls), build_walls(walls), leg_radius=0.1)
    smallest = np.full(3, math.inf)
    for _ in range(600):
        # Guidance leads to the right, through the gap.
        state["gx"], state["gy"] = 0.86, 0.51
        state["togo"] = 9.0
        before = state.copy()
        steering.step(state)
        smallest = np.minimum(smallest, reference.smallest_gaps(before, state, walls, walls, 0.1))
        if state["x"][0] > 7.0:
            break
    assert state["x"][0] > 7.0
    assert (smallest >= 0.0).all()
