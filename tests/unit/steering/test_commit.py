"""Steps that touch nobody: distances, the nearest feasible move, and whole crowds between walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from crowdsim.jit import kernel
from crowdsim.steering import capsule_kernels, commit_kernels, turn_kernels
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
    return turn_kernels.reach_of_turn(hx, hy, ex, ey, nx, ny)


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
# Two lines that are almost opposite and leave next to no room between them: whoever crosses one by 1e-9 m goes 1 m.
@example(0.0, 1.0, [(math.pi, 2.2250738585e-313), (1e-9, 0.0)])
@example(0.0, 1.0, [(math.nextafter(math.pi, 0.0), 0.0), (1e-9, 2.343246601572357e-25)])
def test_the_nearest_feasible_move_is_found(wx, wy, drawn):
    lines = np.array([(math.cos(angle), math.sin(angle), room, 1e-9) for angle, room in drawn]).reshape(-1, 4)
    move = np.array(_nearest_feasible(wx, wy, lines, len(lines)))
    wanted = np.array([wx, wy])
    assert all(n[:2] @ move <= n[2] + 2e-9 for n in lines)
    assert np.hypot(*move) <= np.hypot(*wanted) + 1e-9
    # No move that crosses no line is nearer. The one found may be, by any length: it may cross a line by 2e-9, which
    # counts for much between nearly parallel lines. Standing is taken only if rounding spoils the best there.
    expected = reference.nearest_feasible(wanted, lines)
    if np.hypot(*move) > 0.0:
        assert np.hypot(*(move - wanted)) <= np.hypot(*(expected - wanted)) + 1e-5


@settings(max_examples=200, deadline=None)
@given(ANGLE, st.floats(-0.25, 0.25), ANGLE)
def test_the_reach_of_a_turning_core_is_the_largest_on_the_way(heading, turn, normal):
    end = heading + turn
    found = _reach_of_turn(
        math.cos(heading), math.sin(heading), math.cos(end), math.sin(end), math.cos(normal), math.sin(normal)
    )
    on_the_way = np.abs(np.sin(heading + turn * np.linspace(0.0, 1.0, 200) - normal))
    assert on_the_way.max() - 1e-12 <= found <= on_the_way.max() + 1e-4


@pytest.mark.parametrize(("count", "side"), [(80, 9.0), (80, 5.6)], ids=["1 a square meter", "2.5 a square meter"])
def test_nobody_touches_anybody_or_a_wall_at_any_time(count, side):
    rng = np.random.default_rng(count)
    # A square, a wall in it, and a bench that only legs meet. Agents begin in rows, where 3 a square meter fit.
    torso = np.array(
        [
            (0, 0, side, 0),
            (side, 0, side, side),
            (side, side, 0, side),
            (0, side, 0, 0),
            (side / 3, side / 2, side / 2, side / 2),
        ]
    )
    legs = np.vstack((torso, [(side * 0.7, side * 0.1, side * 0.7, side * 0.8)]))
    # Side by side 0.57 m apart, which is more than any body is broad, and nearer one behind the other.
    x = np.arange(0.3, side - 0.29, 0.4 if side < 8.0 else 0.6)
    y = np.arange(0.31, side - 0.3, 0.57)
    places = np.array([(each, other) for each in x for other in y])
    clear = [reference.wall_distance(torso, *place) > 0.29 for place in places]
    clear &= np.array([reference.wall_distance(legs, *place) > 0.11 for place in places])
    places = rng.permutation(places[clear])[:count]
    headings = rng.uniform(-math.pi, math.pi, len(places)) if side > 8.0 else np.zeros(len(places))
    state = agents(places, headings, np.arange(len(places)) % 16, rng)
    steering = Steering(build_walls(legs), build_walls(torso), leg_radius=0.1)
    smallest = np.full(3, math.inf)
    for step in range(30):
        if step % 10 == 0:
            state["gx"], state["gy"] = np.cos(way := rng.uniform(-math.pi, math.pi, len(state))), np.sin(way)
            # Arms are held in, and let go again.
            state["held"] = np.where(rng.random(len(state)) < 0.5, 0.04, -1.0)
        before = state.copy()
        steering.step(state)
        smallest = np.minimum(smallest, reference.smallest_gaps(before, state, legs, torso, 0.1))
    assert (smallest >= 0.0).all()
    # Some come as near to a bench as legs can, and stand across it with their torsos.
    assert smallest[1] < 0.01
    assert steering.crowded == 0
    assert np.hypot(state["vx"], state["vy"]).mean() > 0.1


def test_the_smallest_gap_does_not_shrink_by_rounding():
    rng = np.random.default_rng(1)
    state = agents(np.array([[0.0, 0.0], [0.25 + 5e-10, 0.0]]), np.zeros(2), np.array([0, 1]), rng)
    steering = Steering(build_walls([]), build_walls([]), leg_radius=0.1)
    least = reference.gap(state, 0, 1)
    for step in range(20):
        turn = 4e-8 * (-1) ** step
        state["gx"], state["gy"] = [math.cos(turn), -math.cos(turn)], [math.sin(turn), math.sin(turn)]
        steering.step(state)
        assert reference.gap(state, 0, 1) >= min(least, 5e-10) - 1e-15


def test_who_cuts_a_wall_or_could_reach_beyond_what_is_listed_stands():
    rng = np.random.default_rng(2)
    wall = build_walls(np.array([(1.0, -2.0, 1.0, 2.0)]))
    state = agents(np.array([[1.0, 0.0], [0.2, 4.0], [0.0, 0.0]]), np.zeros(3), np.arange(3), rng)
    state["half"][2] = state["rest"][2] = 0.7
    with Steering(wall, wall, leg_radius=0.1) as steering:
        steering.step(state)
    assert state["x"].tolist() == [1.0, state["x"][1], 0.0]
    assert state["x"][1] > 0.2
    assert steering.crowded == 2


@pytest.mark.parametrize("seed", range(8))
def test_whose_core_crosses_a_wall_or_another_core_stands(seed):
    """Rounding leaves a distance that is hardly ever 0, of a direction that means nothing."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0.0, 2.0 * math.pi, 3)
    angles[1] = angles[0] + rng.uniform(1.0, 2.0)
    state = agents(np.array([[0.0, 0.0], [0.01, 0.02], [5.0, 0.0]]), angles, np.arange(3), rng)
    along = np.array([-state["hy"][2], state["hx"][2]])
    across = np.array([along[0] + 0.3 * along[1], along[1] - 0.3 * along[0]])
    middle = np.array([5.0, 0.0]) + 0.05 * along
    wall = build_walls(np.array([(*(middle - across), *(middle + across))]))
    with Steering(build_walls([]), wall, leg_radius=0.1) as steering:
        steering.step(state)
    assert state["x"].tolist() == [0.0, 0.01, 5.0]
    assert state["y"].tolist() == [0.0, 0.02, 0.0]
    assert steering.crowded == 3


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
