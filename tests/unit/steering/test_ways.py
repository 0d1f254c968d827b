"""Steered agents keep clear of the ways that others have reserved, along their whole length."""

import numpy as np
import pytest

from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering, frame_of
from crowdsim.steering.walls import build_walls
from crowdsim.steering.way_kernels import list_ways
from crowdsim.steering.ways import NOBODY_ELSE, Others, clear_of, listed
from tests.reference.mixed_crowd import gap_to_piece, gaps_to_pieces
from tests.support.steered import agents, scatter

NO_WALLS = build_walls([])


def reserved(rng, count, side):
    """Ways of a few pieces, one after another, each with its own disc; some are points."""
    segments, owners = [], []
    for owner in range(count):
        at = rng.uniform(0.0, side, 2)
        for _ in range(rng.integers(1, 5)):
            to = at if rng.random() < 0.2 else at + rng.normal(0.0, 0.25, 2)
            segments.append([*at, *to, rng.uniform(0.2, 0.3)])
            owners.append(owner)
            at = to
    return np.array(segments), np.array(owners)


def seen_at(segments, owners):
    """Records of those who own the ways, where these begin."""
    rows = np.zeros(owners.max() + 1, ROW)
    first = np.searchsorted(owners, np.arange(len(rows)))
    rows["x"], rows["y"] = segments[first, :2].T
    rows["hx"], rows["radius"], rows["id"] = 1.0, segments[first, 4], 1000 + np.arange(len(rows))
    rows["turn"] = rows["held"] = -1.0
    return rows


@pytest.mark.parametrize("seed", range(5))
def test_bodies_are_clear_of_ways_as_the_twin_says(seed):
    rng = np.random.default_rng(seed)
    segments, owners = reserved(rng, 30, 12.0)
    bodies = agents(rng.uniform(0.0, 12.0, (80, 2)), rng.uniform(-3, 3, 80), np.zeros(80, int), rng)
    frame = frame_of((0.0, 0.0, 12.0, 12.0))
    ways = listed(Others(seen_at(segments, owners), segments, owners), frame, 0.4)
    own = rng.integers(-1, 30, 80)
    ignored = rng.random(30) < 0.3
    for room in (0.0, 0.05):
        clear = clear_of(ways, frame, bodies, room, own, ignored)
        for k, body in enumerate(bodies):
            counts = (owners != own[k]) & ~ignored[owners]
            gaps = [gap_to_piece(body, piece) for piece in segments[counts]]
            assert clear[k] == (min(gaps, default=1.0) >= room)


def test_nobody_is_in_the_way_of_nobody():
    rng = np.random.default_rng(1)
    bodies = agents(np.ones((1, 2)), np.zeros(1), np.zeros(1, int), rng)
    frame = frame_of((0.0, 0.0, 2.0, 2.0))
    ways = listed(NOBODY_ELSE, frame, 1.0)
    assert clear_of(ways, frame, bodies, 0.0).all()
    assert list_ways(NOBODY_ELSE.segments, frame, 1.0, ways.starts, ways.lists) == 0


def test_ways_outside_of_the_cells_are_listed_nowhere():
    frame = frame_of((0.0, 0.0, 2.0, 2.0))
    far = np.array([[50.0, 50.0, 51.0, 50.0, 0.3]])
    assert len(listed(Others(np.zeros(1, ROW), far, np.zeros(1, int)), frame, 1.0).lists) == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_crowd_never_touches_what_others_have_reserved(seed):
    """In continuous time: five times in each step, whatever everybody wants."""
    rng = np.random.default_rng(seed)
    side = 9.0
    segments, owners = reserved(rng, 8, side)
    places = scatter(rng, 60, (0.0, 0.0), (side, side))
    state = agents(places, rng.uniform(-np.pi, np.pi, 60), rng.integers(0, 3, 60), rng)
    state = state[gaps_to_pieces(state, segments).min(axis=1) > 0.01].copy()
    others = Others(seen_at(segments, owners), segments, owners)
    least = 1.0
    with Steering(NO_WALLS, NO_WALLS, leg_radius=0.125) as steering:
        for _ in range(40):
            before = state.copy()
            steering.step(state, others)
            for share in (0.25, 0.5, 0.75, 1.0):
                between = state.copy()
                for name in ("x", "y", "half"):
                    between[name] = before[name] + share * (state[name] - before[name])
                turned = (state["heading"] - before["heading"] + np.pi) % (2 * np.pi) - np.pi
                heading = before["heading"] + share * turned
                between["hx"], between["hy"] = np.cos(heading), np.sin(heading)
                least = min(least, gaps_to_pieces(between, segments).min())
    assert least > 0.0
    assert np.hypot(state["x"] - before["x"], state["y"] - before["y"]).max() > 0.01


def test_threads_do_not_change_what_a_crowd_does_beside_reserved_ways():
    rng = np.random.default_rng(3)
    segments, owners = reserved(rng, 8, 9.0)
    start = agents(scatter(rng, 50, (0.0, 0.0), (9.0, 9.0)), rng.uniform(-3, 3, 50), np.zeros(50, int), rng)
    ends = []
    for threads in (1, 2, 4):
        state = start.copy()
        with Steering(NO_WALLS, NO_WALLS, leg_radius=0.125, threads=threads) as steering:
            for _ in range(20):
                steering.step(state, Others(seen_at(segments, owners), segments, owners))
        ends.append(state.tobytes())
    assert ends[0] == ends[1] == ends[2]
