"""Agents of different goals order themselves along what their ways have in common."""

import math

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.steering.direction_kernels import NEAR
from crowdsim.steering.order_kernels import JOINED, key_of, lead_of, same_way
from crowdsim.steering.row_kernels import ROW
from tests.reference import order_reference as reference


@kernel
def compare(rows, seen, out):
    """Fill ``out`` (n, n, 3) with lead, key and whether the way is the same, of all pairs of ``rows``."""
    for me in range(len(rows)):
        for other in range(len(rows)):
            seen[0].px = rows[other].x - rows[me].x
            seen[0].py = rows[other].y - rows[me].y
            out[me, other, 0] = lead_of(rows[me], seen[0], rows[other])
            out[me, other, 1] = key_of(rows[me], seen[0], rows[other])
            out[me, other, 2] = same_way(rows[me], seen[0], rows[other])


def compared(rows):
    out = np.empty((len(rows), len(rows), 3))
    compare(rows, np.zeros(1, NEAR), out)
    return out[..., 0], out[..., 1], out[..., 2] == 1.0


def row(place, course, ahead, on=(0.0, 0.0), goal=0, togo=20.0):
    """Return a row on a course, with a bend ``ahead`` [m] and the direction from there on."""
    made = np.zeros(1, ROW)
    made["x"], made["y"] = place
    made["cx"], made["cy"] = np.array(course) / max(math.hypot(*course), 1e-9)
    made["ahead"], made["goal"], made["togo"], made["key"] = ahead, goal, togo, togo
    made["onx"], made["ony"] = np.array(on) / max(math.hypot(*on), 1e-9)
    return made


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_order_of_the_slow_twin(seed):
    rng = np.random.default_rng(seed)
    count = 40
    rows = np.zeros(count, ROW)
    rows["x"], rows["y"] = rng.uniform(0.0, 4.0, (2, count))
    course, on = rng.uniform(-math.pi, math.pi, (2, count))
    rows["cx"], rows["cy"], rows["ahead"] = np.cos(course), np.sin(course), rng.uniform(0.0, 4.0, count)
    rows["onx"], rows["ony"] = np.cos(on), np.sin(on)
    rows["goal"] = rng.integers(-2, 6, count)
    rows["togo"] = rng.uniform(0.0, 30.0, count)
    rows["key"] = rows["togo"] - rng.uniform(-0.15, 3.0, count)
    # Some stay, some have no bend, some are at one place.
    for name in ("cx", "cy", "onx", "ony", "ahead"):
        rows[name][::9] = 0.0
    rows["onx"][1::7] = rows["ony"][1::7] = 0.0
    rows["x"][5], rows["y"][5] = rows["x"][6], rows["y"][6]
    lead, key, alike = compared(rows)
    kinds = set()
    for me in range(count):
        for other in range(count):
            expected = reference.lead_of(rows[me], rows[other])
            assert np.isnan(lead[me, other]) == (expected is None)
            if expected is not None:
                assert lead[me, other] == pytest.approx(expected, abs=1e-9)
                # What one is ahead, the other is behind.
                assert lead[other, me] == pytest.approx(-expected, abs=1e-9)
            assert alike[me, other] == reference.same_way(rows[me], rows[other])
            known = reference.key_of(rows[me], rows[other])
            assert key[me, other] == (math.inf if known is None else pytest.approx(known, abs=1e-9))
            kinds.add((expected is None, bool(alike[me, other])))
    assert kinds == {(True, False), (True, True), (False, True)}


def test_at_a_door_from_both_sides_who_is_nearer_goes_first():
    """The door is in a wall along y at x = 0, from y = -1 to 1; one stands straight before it."""
    left = row((-0.3, 3.0), (0.0, -1.0), 2.2, (1.0, 0.2), goal=1)
    right = row((-0.3, -2.0), (0.0, 1.0), 1.2, (1.0, -0.2), goal=2, togo=50.0)
    straight = row((-3.0, 0.2), (1.0, 0.0), 15.0, goal=3)
    inside = row((0.1, 0.0), (1.0, 0.1), 12.0, goal=4)
    lead, _, alike = compared(np.concatenate((left, right, straight, inside)))
    assert alike.all()
    # By its distance to the door, not to its goal: inside, right, left, straight.
    assert lead[0, 1] == pytest.approx(1.0)
    assert lead[2, 0] > 0.4
    assert (lead[:3, 3] > 0.0).all()


def test_those_who_come_through_the_door_the_other_way_do_not_go_the_same_way():
    out = row((-2.0, 0.0), (1.0, 0.0), 10.0, goal=1)
    flank = row((-0.3, 2.0), (0.0, -1.0), 1.2, (1.0, 0.0), goal=2)
    back = row((2.0, 0.1), (-1.0, 0.0), 10.0, goal=3)
    back_flank = row((0.3, -2.0), (0.0, 1.0), 1.2, (-1.0, 0.0), goal=4)
    _, _, alike = compared(np.concatenate((out, flank, back, back_flank)))
    assert alike.tolist() == [
        [True, True, False, False],
        [True, True, False, False],
        [False, False, True, True],
        [False, False, True, True],
    ]


def test_who_crosses_does_not_go_the_same_way():
    across = row((0.0, -2.0), (0.0, 1.0), 8.0, goal=1)
    along = row((-2.0, 0.0), (1.0, 0.0), 8.0, goal=2)
    # It turns into the way of the other, but far from it.
    far = row((-2.0, 4.0 + JOINED), (0.0, -1.0), 1.0, (1.0, 0.0), goal=3)
    _, _, alike = compared(np.concatenate((across, along, far)))
    assert (alike == np.eye(3, dtype=bool)).all()


def test_what_a_neighbor_has_inherited_counts_for_those_of_other_goals_too():
    first = row((0.0, 0.0), (1.0, 0.0), 5.0, goal=1, togo=5.0)
    ahead = row((1.0, 0.5), (1.0, 0.0), 40.0, goal=2, togo=40.0)
    ahead["key"] -= 0.3
    _, key, _ = compared(np.concatenate((first, ahead)))
    # A meter ahead, and 0.3 m nearer by what it has inherited.
    assert key[0, 1] == pytest.approx(5.0 - 1.0 - 0.3)
    assert key[1, 0] == pytest.approx(40.0 + 1.0)
