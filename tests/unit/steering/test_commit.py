"""Steps that touch nobody: distances, the nearest feasible move, and whole crowds between walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.jit import kernel
from crowdsim.steering import capsule_kernels, commit_kernels
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference import steering_reference as reference
from tests.support.steered import agents, scatter


@kernel
def _core_to_core(px, py, ux, uy, a, wx, wy, b):
    return capsule_kernels.core_to_core(px, py, ux, uy, a, wx, wy, b)


@kernel
def _nearest_feasible(wx, wy, lines, count):
    return commit_kernels.nearest_feasible(wx, wy, lines, count)


@kernel
def _reach_of_turn(hx, hy, ex, ey, nx, ny):
    return commit_kernels.reach_of_turn(hx, hy, ex, ey, nx, ny)


ANGLE = st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 2, math.pi, 1e-9, -1e-7])
SHORT = st.floats(-1.0, 1.0) | st.sampled_from([0.0, 1e-9])
HALF = st.floats(0.0, 0.3)


@settings(max_examples=300, deadline=None)
@given(SHORT, SHORT, ANGLE, HALF, ANGLE, HALF)
def test_the_vector_between_cores_is_the_shortest(px, py, angle, a, other, b):
    u = np.array([math.cos(angle), math.sin(angle)])
    w = np.array([math.cos(other), math.sin(other)])
    dx, dy, distance = _core_to_core(px, py, *u, a, *w, b)
    center = np.array([px, py])
    expected = reference.segment_to_segment(np.array([-a * u, a * u]), np.array([center - b * w, center + b * w]))
    assert distance == pytest.approx(expected, abs=1e-8)
    assert math.hypot(dx, dy) == pytest.approx(distance, abs=1e-12)


LINE = st.tuples(ANGLE, st.floats(0.0, 0.3) | st.just(0.0))


@settings(max_examples=300, deadline=None)
@given(SHORT, SHORT, st.lists(LINE, max_size=8))
def test_the_nearest_feasible_move_is_found(wx, wy, drawn):
    lines = np.array([(math.cos(angle), math.sin(angle), room) for angle, room in drawn]).reshape(-1, 3)
    move = np.array(_nearest_feasible(wx, wy, lines, len(lines)))
    wanted = np.array([wx, wy])
    assert all(n[:2] @ move <= n[2] + 2e-9 for n in lines)
    assert np.hypot(*move) <= np.hypot(*wanted) + 1e-9
    # Standing is taken only if rounding spoils the best, which nearly parallel lines can do.
    expected = reference.nearest_feasible(wanted, lines)
    if np.hypot(*move) > 0.0:
        assert np.hypot(*(move - wanted)) == pytest.approx(np.hypot(*(expected - wanted)), abs=1e-5)


@settings(max_examples=200, deadline=None)
@given(ANGLE, st.floats(-0.25, 0.25), ANGLE)
def test_the_reach_of_a_turning_core_is_the_largest_on_the_way(heading, turn, normal):
    end = heading + turn
    found = _reach_of_turn(
        math.cos(heading), math.sin(heading), math.cos(end), math.sin(end), math.cos(normal), math.sin(normal)
    )
    on_the_way = np.abs(np.sin(heading + turn * np.linspace(0.0, 1.0, 200) - normal))
    assert on_the_way.max() - 1e-12 <= found <= on_the_way.max() + 1e-4


@pytest.mark.parametrize(("count", "side"), [(80, 9.0), (80, 5.2)], ids=["1 a square meter", "3 a square meter"])
def test_nobody_touches_anybody_or_a_wall_at_any_time(count, side):
    rng = np.random.default_rng(count)
    # A square with two walls in it, crossed in all directions; agents begin in rows, where 3 a square meter fit.
    walls = np.array(
        [
            (0, 0, side, 0),
            (side, 0, side, side),
            (side, side, 0, side),
            (0, side, 0, 0),
            (side / 3, side / 2, side / 2, side / 2),
            (side * 0.7, side * 0.2, side * 0.7, side * 0.5),
        ]
    )
    each_way = math.ceil(math.sqrt(count * 1.25))
    grid = (np.arange(each_way) + 0.5) * (side - 0.1) / each_way + 0.05
    places = np.array([(x, y) for x in grid for y in grid])
    clear = [reference.wall_distance(walls, *place) > 0.29 for place in places]
    places = rng.permutation(places[clear])[:count]
    headings = rng.uniform(-math.pi, math.pi, len(places)) if side > 10 else np.zeros(len(places))
    state = agents(places, headings, np.arange(len(places)) % 16, rng)
    steering = Steering(build_walls(walls), build_walls(walls[:5]), leg_radius=0.1)
    people, to_walls = math.inf, math.inf
    for step in range(30):
        if step % 10 == 0:
            state["gx"], state["gy"] = np.cos(way := rng.uniform(-math.pi, math.pi, len(state))), np.sin(way)
        before = state.copy()
        steering.step(state)
        between, torso = reference.smallest_gaps(before, state, walls[:5], 0.1)
        _, legs = reference.smallest_gaps(before[:1], state[:1], walls, 0.1)
        people, to_walls = min(people, between), min(to_walls, torso, legs)
    assert people >= 0.0
    assert to_walls >= 0.0
    assert np.hypot(state["vx"], state["vy"]).mean() > 0.1


def test_who_is_walled_in_stands():
    rng = np.random.default_rng(1)
    box = np.array([(-0.2, -0.3, 0.2, -0.3), (0.2, -0.3, 0.2, 0.3), (0.2, 0.3, -0.2, 0.3), (-0.2, 0.3, -0.2, -0.3)])
    state = agents(np.zeros((1, 2)), np.zeros(1), np.zeros(1, int), rng)
    steering = Steering(build_walls(box), build_walls(box), leg_radius=0.1)
    for _ in range(100):
        steering.step(state)
    assert abs(state["x"][0]) < 0.2 - 0.125
    assert state["stuck"][0] > 5.0


@pytest.mark.parametrize("threads", [2, 3, 4])
def test_threads_change_no_bit(threads):
    runs = []
    for each in (1, threads):
        rng = np.random.default_rng(3)
        state = agents(scatter(rng, 120, (0, 0), (11, 11)), rng.uniform(-3, 3, 120), np.arange(120) % 5, rng)
        with Steering(build_walls([]), build_walls([]), leg_radius=0.1, threads=each) as steering:
            for _ in range(40):
                steering.step(state)
        runs.append(state.tobytes())
    assert runs[0] == runs[1]
