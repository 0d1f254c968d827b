import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError, PathNotFound
from crowdsim.jit import kernel
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import Planner
from crowdsim.steering.guidance.field import SIDEWAYS, asked_of, guide, solve_field, way_end, ways
from crowdsim.steering.guidance.field_kernels import eighth_of
from crowdsim.steering.guidance.ground import NOBODY
from crowdsim.steering.guidance.ground_kernels import BOX, PACE, line_cost, pin_of
from crowdsim.steering.guidance.guidance import solve_fields
from crowdsim.steering.guidance.sample_kernels import CLEAR, is_clear
from crowdsim.steering.guidance.solve_kernels import SEEDS
from tests.reference import guidance_reference, weighted_region
from tests.support.guided import BEHAVIORS, NEED, follow, free_places, ground_of, rows_at
from tests.support.small_scenes import scene

FRONTAL = float(NEED.radii[-1].max())


def test_in_the_open_a_way_is_the_straight_line():
    area = shapely.box(0.0, 0.0, 30.0, 20.0)
    goal = np.array([27.3, 3.1])
    ground = ground_of([area, area])
    places = free_places([area, area], 300, 1, FRONTAL)
    told = ways(ground, solve_field(ground, goal), places)
    apart = np.hypot(*(goal - places).T)
    assert told.length == pytest.approx(apart, abs=2e-5)
    assert told.cost == pytest.approx(apart, abs=2e-5)
    assert told.direction == pytest.approx((goal - places) / apart[:, None], abs=1e-6)
    assert (told.behavior == 2).all()


def test_ways_around_corners_are_nearly_as_short_as_the_shortest():
    area = shapely.box(0.0, 0.0, 12.0, 12.0)
    for x, y in ((3.0, 2.5), (6.2, 3.0), (2.7, 7.0), (7.5, 8.0), (5.0, 5.5)):
        area = area.difference(shapely.box(x, y, x + 1.6, y + 1.3))
    goal = np.array([10.7, 10.9])
    ground = ground_of([area, area])
    places = free_places([area, area], 60, 2, FRONTAL + 0.01)
    told = ways(ground, solve_field(ground, goal), places)
    shortest = guidance_reference.shortest_lengths(area, FRONTAL, goal, places)
    known = np.isfinite(shortest)
    assert known.sum() > 40
    longer = told.length[known] / shortest[known] - 1.0
    assert longer.min() > -0.01
    assert longer.mean() < 0.01
    assert longer.max() < 0.04


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_way_ends_in_the_goal_as_far_off_as_it_is_long(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    goal = shapely.Point(*free_places(areas, 1, seed + 50, 0.4)[0]).buffer(1.5)
    field = solve_field(ground, goal)
    places = free_places(areas, 60, seed, 0.26)
    lengths = ways(ground, field, places).length
    ends = np.array([way_end(ground, field, place) for place in places])
    leads = np.isfinite(lengths)
    assert (leads & (lengths > 0.0)).sum() > 20
    assert np.isnan(ends[~leads]).all()
    np.testing.assert_array_equal(ends[lengths == 0.0], places[lengths == 0.0])
    assert shapely.contains_xy(goal, *ends[leads & (lengths > 0.0)].T).all()
    # No way to there is shorter.
    for row in np.flatnonzero(leads)[:6]:
        there = ways(ground, solve_field(ground, ends[row]), places[row]).length[0]
        assert lengths[row] == pytest.approx(there, rel=0.02, abs=0.05)


def test_no_way_ends_nowhere():
    area = shapely.box(0.0, 0.0, 4.0, 4.0)
    ground = ground_of([area, area])
    field = solve_field(ground, np.array([9.0, 9.0]))
    assert np.isnan(way_end(ground, field, (2.0, 2.0))).all()
    assert np.isnan(way_end(ground, field, (9.0, 2.0))).all()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_ways_cost_what_fast_marching_finds(seed):
    areas = scene(seed)
    goal = free_places(areas, 1, seed + 50, 0.4)[0]
    ground = ground_of(areas)._replace(change=0.0)
    field = solve_field(ground, goal)
    rate, first = weighted_region.rates(areas, NEED.radii, NEED.costs)
    reference = weighted_region.costs_to(rate, first, goal)
    places = free_places(areas, 300, seed, 0.26)
    column, row = np.round((places - first) / weighted_region.STEP).astype(int).T
    expected = reference[row, column]
    found = ways(ground, field, places).cost
    both = np.isfinite(expected) & np.isfinite(found) & (expected > 2.0)
    assert both.sum() > 150
    # The reference closes gaps by its spacing, so single ways may be much cheaper.
    dearer = found[both] / expected[both] - 1.0
    assert abs(dearer.mean()) < 0.02
    assert np.quantile(dearer, 0.95) < 0.04
    assert np.isfinite(found[np.isfinite(expected)]).all()


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_who_follows_arrives_and_walks_hardly_farther_than_planned(seed):
    areas = scene(seed)
    goal = free_places(areas, 1, seed + 60, 0.4)[0]
    ground = ground_of(areas)
    field = solve_field(ground, goal)
    places = free_places(areas, 150, seed)
    told = ways(ground, field, places)
    reached = np.isfinite(told.cost)
    trace, length, arrived = follow(ground, field, places[reached])
    assert reached.sum() > 100
    assert arrived.all()
    # Nobody comes nearer to a wall than where it began, or than the capsules of bodies are thick.
    clear = np.min([shapely.distance(shapely.points(trace), area.boundary) for area in areas], axis=0)
    assert (clear.min(axis=0) >= np.minimum(clear[0], 0.125) - 1e-3).all()
    assert shapely.contains_xy(areas[0], trace[..., 0], trace[..., 1]).all()
    planner = Planner([NavMesh(area) for area in areas], BEHAVIORS)
    shares = []
    for place, walked in zip(places[reached][:60], length[:60], strict=True):
        try:
            plan = planner.plan(place, goal, margin=False)
        except PathNotFound:
            continue
        if plan.length > 2.0:
            shares.append(walked / plan.length)
    assert len(shares) > 20
    assert np.mean(shares) < 1.03


@pytest.mark.parametrize("seed", [0, 1])
def test_every_anchor_is_nearer_to_the_goal(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    field = solve_field(ground, shapely.Point(free_places(areas, 1, seed + 70, 0.4)[0]).buffer(0.6))
    reached = np.flatnonzero(np.isfinite(field.cost))
    boxes = len(field.cost)
    anchors = field.anchor[reached]
    own = anchors == reached
    assert (field.cost[reached[own]] == 0.0).all()
    onwards = ~own & (anchors < boxes)
    assert (field.cost[anchors[onwards]] < field.cost[reached[onwards]]).all()
    assert (field.length[anchors[onwards]] < field.length[reached[onwards]]).all()


def corridor(half):
    """A corridor with a gap of 1.5 m."""
    room = shapely.box(0.0, -1.2, 12.0, 1.2)
    gap = shapely.box(6.0, -1.2, 7.5, 1.2).difference(shapely.box(6.0, -half, 7.5, half))
    area = room.difference(gap)
    return [area, area]


@pytest.mark.parametrize(("half", "behavior"), [(0.26, 0), (0.33, 1)])
def test_a_gap_asks_for_its_behavior_from_70_cm_before_it(half, behavior):
    areas = corridor(half)
    ground = ground_of(areas)
    field = solve_field(ground, [11.0, 0.0])
    x = np.array([2.0, 4.5, 5.6, 6.0, 6.7, 7.4, 8.5, 10.0])
    told = ways(ground, field, np.column_stack([x, np.zeros(len(x))]))
    assert told.behavior.tolist() == [2, 2, behavior, behavior, behavior, behavior, 2, 2]
    state = rows_at([[2.0, 0.0], [6.0, 0.0], [11.0, 0.0], [50.0, 0.0]])
    lost = guide(ground, field, asked_of(BEHAVIORS), np.arange(4), state)
    assert lost == 1
    assert state["turn"].tolist() == [-1.0, SIDEWAYS if behavior == 0 else -1.0, -1.0, -1.0]
    assert state["held"] == pytest.approx([-1.0, 0.105, -1.0, -1.0])
    assert state["gx"] == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=0.02)
    assert state["togo"] == pytest.approx([9.0, 5.0, 0.0, 1e9], abs=0.05)


def test_who_walks_along_a_wall_is_asked_for_nothing():
    area = shapely.box(0.0, -2.0, 12.0, 2.0)
    ground = ground_of([area, area])
    told = ways(ground, solve_field(ground, [11.0, -1.4]), [[3.0, -1.75], [5.0, -1.7], [5.0, 1.8]])
    assert told.behavior.tolist() == [2, 2, 2]


def test_arms_held_in_make_bodies_narrower():
    asked = asked_of(BEHAVIORS)
    assert asked == pytest.approx(np.array([[SIDEWAYS, 0.132], [-1.0, 0.132], [-1.0, -1.0]]))


def test_a_region_is_reached_anywhere():
    area = shapely.box(0.0, 0.0, 20.0, 10.0)
    region = shapely.box(15.0, 1.0, 18.0, 9.0)
    ground = ground_of([area, area])
    places = np.array([[3.0, 2.0], [3.0, 8.0], [16.0, 5.0]])
    told = ways(ground, solve_field(ground, region), places)
    assert told.length == pytest.approx([12.0, 12.0, 0.0], abs=0.13)
    assert told.direction == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), abs=0.02)


def test_a_small_region_and_one_without_area_are_goals_too():
    area = shapely.box(0.0, 0.0, 10.0, 10.0)
    ground = ground_of([area, area])
    for goal in (
        shapely.Point(8.03, 5.01).buffer(0.05),
        shapely.Point(8.03, 5.01),
        shapely.LineString([(8, 5), (8, 6)]),
    ):
        told = ways(ground, solve_field(ground, goal), [[2.0, 5.0]])
        assert told.length == pytest.approx([6.0], abs=0.1)


@pytest.mark.parametrize(
    "goal",
    [
        shapely.Polygon(),
        shapely.box(100.0, 100.0, 101.0, 101.0),
        shapely.box(6.1, 6.1, 6.9, 6.9),
        np.array([100.0, 0.0]),
        np.array([6.5, 6.5]),
        np.empty((0, 2)),
    ],
)
def test_no_way_leads_out_of_the_place_or_into_a_wall(goal):
    area = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(6.0, 6.0, 7.0, 7.0))
    ground = ground_of([area, area])
    field = solve_field(ground, goal)
    told = ways(ground, field, [[2.0, 5.0], [6.5, 3.0], [-50.0, 2.0]])
    assert np.isinf(told.cost).all()
    assert np.isinf(told.length).all()
    assert (told.direction == 0.0).all()
    state = rows_at([[2.0, 5.0]])
    assert guide(ground, field, asked_of(BEHAVIORS), np.arange(1), state) == 1


def test_what_is_walled_off_has_no_way():
    area = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(5.0, -1.0, 5.3, 11.0))
    ground = ground_of([area, area])
    told = ways(ground, solve_field(ground, [8.0, 8.0]), [[2.0, 5.0], [8.0, 5.0]])
    assert np.isinf(told.cost[0])
    assert told.length[1] == pytest.approx(3.0, abs=1e-5)


def test_nobody_is_guided():
    area = shapely.box(0.0, 0.0, 5.0, 5.0)
    ground = ground_of([area, area])
    field = solve_field(ground, [2.0, 2.0])
    assert guide(ground, field, asked_of(BEHAVIORS), np.zeros(0, np.int64), rows_at(np.empty((0, 2)))) == 0
    assert len(ways(ground, field, np.empty((0, 2))).cost) == 0


def test_goals_have_finite_coordinates():
    area = shapely.box(0.0, 0.0, 5.0, 5.0)
    ground = ground_of([area, area])
    with pytest.raises(GeometryError, match="finite"):
        solve_field(ground, [np.nan, 1.0])
    with pytest.raises(GeometryError, match="finite"):
        solve_field(ground, shapely.Point(np.inf, 1.0))


def test_threads_do_not_show():
    areas = scene(0)
    ground = ground_of(areas)
    goals = list(free_places(areas, 5, 9, 0.4))
    for one, other in zip(solve_fields(ground, goals), solve_fields(ground, goals, threads=3), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_who_asks_first_does_not_matter():
    areas = scene(1)
    ground = ground_of(areas)
    goal = free_places(areas, 1, 9, 0.4)[0]
    places = free_places(areas, 400, 3)
    one = ways(ground, solve_field(ground, goal), places)
    other = ways(ground, solve_field(ground, goal), places[::-1])
    assert all(np.array_equal(a, b[::-1]) for a, b in zip(one, other, strict=True))


def test_wider_bodies_keep_farther_off():
    areas = corridor(0.26)
    narrow = ways(ground_of(areas), solve_field(ground_of(areas), [11.0, 0.0]), [[2.0, 0.0]])
    ground = ground_of(areas, wider=0.04)
    assert np.isfinite(narrow.cost).all()
    assert np.isinf(ways(ground, solve_field(ground, [11.0, 0.0]), [[2.0, 0.0]]).cost).all()


@pytest.mark.parametrize("half", [0.4, 0.5])
def test_who_is_pushed_to_the_side_of_a_neck_goes_on_along_it(half):
    room = shapely.box(0.0, -2.0, 14.0, 2.0)
    area = room.difference(shapely.box(5.0, -2.0, 9.0, 2.0).difference(shapely.box(5.0, -half, 9.0, half)))
    ground = ground_of([area, area])
    y = np.linspace(0.2 - half, half - 0.2, 21)
    for x in (5.6, 6.3, 7.0):
        told = ways(ground, solve_field(ground, [13.0, 0.0]), np.column_stack([np.full(len(y), x), y]))
        assert (told.direction[:, 0] > 0.9).all()


@kernel
def line_costs(ground, crowding, points, out):
    for box in range(len(ground.widest)):
        if ground.widest[box] >= 0:
            px, py = pin_of(ground, box)
            for n in range(len(points)):
                x, y = points[n, 0], points[n, 1]
                if max(abs(px - x), abs(py - y)) < (SEEDS - 0.5) * BOX:
                    out[box] = min(out[box], line_cost(ground, crowding, px, py, x, y, np.inf))


@pytest.mark.parametrize("seed", range(8))
def test_no_way_beside_a_point_of_the_goal_costs_more_than_the_line_to_it(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    field = solve_field(ground, free_places(areas, 300, seed, 0.16))
    lines = np.full(len(field.cost), np.inf)
    line_costs(ground, NOBODY, field.points, lines)
    assert np.isfinite(lines).sum() > 100
    assert (field.cost <= lines.astype(np.float32)).all()


@kernel
def clear_lines(ground, starts, ends, out):
    for n in range(len(starts)):
        out[n] = is_clear(ground, starts[n, 0], starts[n, 1], ends[n, 0], ends[n, 1])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_lines_are_clear_that_keep_off_walls(seed):
    areas = scene(seed)
    starts = free_places(areas, 400, seed, CLEAR)
    ends = starts[np.random.default_rng(seed).permutation(len(starts))]
    found = np.zeros(len(starts), np.bool_)
    clear_lines(ground_of(areas), starts, ends, found)
    off = guidance_reference.clearance(areas, starts, ends)
    assert found[off >= CLEAR].all()
    # Places along the line are tested, a pace from each other.
    assert not found[off < np.sqrt(CLEAR**2 - (0.5 * PACE) ** 2) - 1e-9].any()
    assert 0.1 < found.mean() < 0.9


@kernel
def eighths(vectors, out):
    for n in range(len(vectors)):
        out[n] = eighth_of(vectors[n, 0], vectors[n, 1])


def test_eighths_of_the_circle():
    angles = np.radians(np.arange(0.5, 360.0, 1.0))
    found = np.empty(len(angles), np.int64)
    eighths(np.column_stack([np.cos(angles), np.sin(angles)]), found)
    assert found.tolist() == (np.arange(360) // 45).tolist()
