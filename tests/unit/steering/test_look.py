"""Cells, neighbors, walls and free ways against their slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.steering import direction_kernels, wall_kernels
from crowdsim.steering.direction_kernels import NEAR
from crowdsim.steering.look_kernels import MOST_NEAR, look_rows
from crowdsim.steering.row_kernels import ROW, gather_rows, measure_rows, sort_rows
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import build_walls
from tests.reference import steering_reference as reference
from tests.reference.steering_room import passage_width
from tests.support.steered import agents


@kernel
def _free_way(near, count, ux, uy, speed, width, floor, horizon):
    return direction_kernels.free_way(near, count, ux, uy, speed, width, floor, horizon)


@kernel
def _distance_at(walls, x, y):
    return wall_kernels.distance_at(walls, x, y)


@kernel
def _free_ahead(walls, x, y, ux, uy, width, farthest):
    return wall_kernels.free_ahead(walls, x, y, ux, uy, width, farthest)


@kernel
def _is_lane(walls, x, y, ux, uy, width):
    return wall_kernels.is_lane(walls, x, y, ux, uy, width)


@kernel
def _is_in_sight(walls, x, y, px, py):
    return wall_kernels.is_in_sight(walls, x, y, px, py)


def _crowd(rng, count, side):
    state = agents(rng.uniform(0, side, (count, 2)), rng.uniform(-3, 3, count), np.arange(count) % 3, rng)
    speed = rng.uniform(0, 1.5, count)
    state["vx"], state["vy"] = speed * state["hx"], speed * state["hy"]
    return state


@pytest.mark.parametrize(("count", "side"), [(1, 5.0), (40, 30.0), (200, 9.0), (300, 9.0), (30, 0.4)])
def test_cells_and_neighbors(count, side):
    rng = np.random.default_rng(count)
    state = _crowd(rng, count, side)
    places = np.column_stack((state["x"], state["y"]))
    columns = rows_up = int(side) + 1
    starts = np.empty(columns * rows_up + 1, np.int64)
    order = np.empty(count, np.int32)
    sort_rows(places, (0.0, 0.0, columns, rows_up), starts, order, np.empty(count, np.int32))
    cells = places[:, 1].astype(int) * columns + places[:, 0].astype(int)
    assert order.tolist() == sorted(range(count), key=lambda each: (cells[each], each))
    assert starts.tolist() == [int((cells < cell).sum()) for cell in range(columns * rows_up + 1)]

    rows = np.empty(count, ROW)
    gather_rows(state, order, rows, places)
    near = np.full((count, MOST_NEAR), -2, np.int32)
    look_rows(rows, places, starts, (0.0, 0.0, columns, rows_up), 0, count, order, count, Rules(), near)
    for me in range(count):
        around = np.abs(np.floor(places) - np.floor(places[me])).max(axis=1) <= 2
        reach = Rules().reach_in_crowd if around.sum() > Rules().crowd else Rules().reach
        expected = reference.nearest_agents(rows, me, reach, MOST_NEAR)
        assert near[me, : len(expected)].tolist() == expected
        assert len(expected) == MOST_NEAR or near[me, len(expected)] == -1


@pytest.mark.parametrize("count", [0, 1, 50])
def test_agents_are_measured(count):
    state = _crowd(np.random.default_rng(count), count, 9.0)
    expected = np.column_stack((state["x"], state["y"]))
    places = np.empty((count, 2))
    wrong, *corners, broadest = measure_rows(state, places)
    assert wrong == -1
    assert np.array_equal(places, expected)
    assert np.array_equal(corners[:2], expected.min(axis=0, initial=np.inf))
    assert np.array_equal(corners[2:], expected.max(axis=0, initial=-np.inf))
    assert broadest == (state["half"] + state["radius"]).max(initial=0.0)


@pytest.mark.parametrize("name", ["x", "y", "heading", "vx", "vy", "half", "speed", "gx", "gy", "togo"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_the_first_agent_that_is_not_finite_is_found(name, value):
    state = _crowd(np.random.default_rng(1), 9, 9.0)
    state[name][[4, 7]] = value
    assert measure_rows(state, np.empty((9, 2)))[0] == 4


@pytest.mark.parametrize("seed", range(5))
def test_the_free_way_ends_at_the_first_collision(seed):
    rng = np.random.default_rng(seed)
    state = _crowd(rng, 8, 5.0)
    others = np.arange(1, 8)
    near = np.zeros(7, NEAR)
    for seen, other in zip(near, state[others], strict=True):
        seen["px"], seen["py"] = other["x"] - state["x"][0], other["y"] - state["y"][0]
        for name in ("vx", "vy", "hx", "hy", "half", "radius"):
            seen[name] = other[name]
    for angle in np.linspace(-math.pi, math.pi, 13):
        direction = np.array([math.cos(angle), math.sin(angle)])
        way = _free_way(near, 7, *direction, state["speed"][0], 0.2, -1.0, 4.0)
        assert way == pytest.approx(reference.free_way(state, 0, direction, 0.2, 4.0), abs=6e-3)
        # It may stop early only with a way that is too short anyway.
        early = _free_way(near, 7, *direction, state["speed"][0], 0.2, 1.5, 4.0)
        assert early == way if way > 1.5 else early <= 1.5


SEGMENTS = np.array([(0.0, 0.0, 4.0, 0.0), (4.0, 0.0, 4.0, 3.0), (1.0, 2.0, 1.0, 2.0), (2.0, 1.0, 3.3, 2.2)])


def test_walls_list_every_segment_that_a_cell_could_meet():
    walls = build_walls(SEGMENTS)
    rng = np.random.default_rng(2)
    for x, y in rng.uniform(-1, 5, (300, 2)):
        column, row = (int((x - walls.left) / 0.5), int((y - walls.bottom) / 0.5))
        cell = row * walls.columns + column
        listed = set(walls.lists[walls.starts[cell] : walls.starts[cell + 1]].tolist())
        for number, segment in enumerate(SEGMENTS):
            if reference.wall_distance(segment[None], x, y) < 0.8:
                assert number in listed


def test_distances_to_walls():
    walls = build_walls(SEGMENTS)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform(-0.5, 4.5, (300, 2)):
        true = min(reference.wall_distance(SEGMENTS, x, y), wall_kernels.FARTHEST)
        # Between points of a grid of 0.1 m: too small by half its diagonal, too large by a few hundredths.
        assert _distance_at(walls, x, y) == pytest.approx(true, abs=0.075 if true < 0.8 else 0.15)
    assert _distance_at(build_walls([]), 3.0, 2.0) == wall_kernels.FARTHEST


def test_the_way_ahead_ends_at_walls():
    walls = build_walls(np.array([(3.0, -5.0, 3.0, 5.0)]))
    assert _free_ahead(walls, 0.0, 0.0, 1.0, 0.0, 0.3, 1.6) == 1.6
    assert _free_ahead(walls, 2.0, 0.0, 1.0, 0.0, 0.3, 1.6) == pytest.approx(0.7, abs=0.06)
    assert _free_ahead(walls, 2.0, 0.0, -1.0, 0.0, 0.3, 1.6) == 1.6
    for near in (2.69, 2.685, 2.68):
        assert _free_ahead(walls, near, 0.0, -1.0, 0.0, 0.3, 1.6) == 1.6
        assert _free_ahead(walls, near, 0.0, 0.0, 1.0, 0.3, 1.6) == 1.6
    # Whoever stands too near may walk away or along, not nearer.
    assert _free_ahead(walls, 2.85, 0.0, 1.0, 0.0, 0.3, 1.6) == 0.0
    assert _free_ahead(walls, 2.85, 0.0, -1.0, 0.0, 0.3, 1.6) == 1.6
    assert _free_ahead(walls, 2.85, 0.0, 0.0, 1.0, 0.3, 1.6) == 1.6


@pytest.mark.parametrize("seed", range(5))
def test_lanes_are_too_narrow_for_two(seed):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-math.pi, math.pi)
    way, across = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
    for width in (0.6, 0.8, 0.83, 1.0, 1.2, 3.0):
        ends = [side * 0.5 * width * across + end * way for side in (-1, 1) for end in (-9, 9)]
        segments = np.reshape(ends, (2, 4))
        walls = build_walls(segments)
        for _ in range(40):
            place = rng.uniform(-3.0, 3.0) * way + rng.uniform(-0.5, 0.5) * (width - 0.3) * across
            room = passage_width(segments, place, way)
            assert room == pytest.approx(width)
            assert _is_lane(walls, *place, *way, 0.9) == (room < 0.85)
    one_wall = build_walls([[-9.0, 0.0, 9.0, 0.0]])
    assert not _is_lane(one_wall, 0.0, 0.2, 1.0, 0.0, 0.9)


@pytest.mark.parametrize("seed", range(6))
def test_nobody_sees_through_walls(seed):
    rng = np.random.default_rng(seed)
    # Walls of any direction, besides one between the points of the grid and one along them.
    segments = rng.uniform(0.0, 8.0, (8, 4))
    segments[:2] = [(0.0, 2.05, 8.0, 2.05), (0.0, 6.0, 8.0, 6.0)]
    walls = build_walls(segments)
    blocked = clear = 0
    for x, y in rng.uniform(-1.0, 9.0, (400, 2)):
        angle, far = rng.uniform(-math.pi, math.pi), rng.choice([0.0, 0.3, rng.uniform(0.3, 3.0), 3.0])
        px, py = far * math.cos(angle), far * math.sin(angle)
        line = shapely.LineString([(x, y), (x + px, y + py)])
        room = min(line.distance(shapely.LineString(each.reshape(2, 2))) for each in segments)
        if far > 0.0 and room == 0.0 and reference.wall_distance(segments, x + px, y + py) > 0.1:
            assert not _is_in_sight(walls, x, y, px, py)
            blocked += 1
        elif room > 0.14:
            assert _is_in_sight(walls, x, y, px, py)
            clear += 1
    assert blocked > 30
    assert clear > 30
    assert _is_in_sight(build_walls([]), 0.0, 0.0, 3.0, 0.0)
