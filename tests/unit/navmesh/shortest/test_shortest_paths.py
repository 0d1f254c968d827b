"""Shortest paths of discs against exact lengths of others, brute force, and themselves."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.shortest.tangent_graph import RadiusGraph
from tests.reference.navmesh_reference import random_area
from tests.reference.shortest_reference import shortest_length
from tests.support.oracle_maps import MAPS, arena, load_map

ROOM = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6))


def test_all_lengths_of_the_arena_are_the_exact_ones(shared):
    area, starts, goals, lengths = arena(shared)
    paths = NavMesh(area).find_paths(starts, goals, 0.0, "best")
    assert len(lengths) == 130
    np.testing.assert_allclose(paths.lengths, lengths, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", MAPS)
def test_lengths_of_points_are_the_exact_ones(shared, name):
    world = load_map(shared, name)
    paths = NavMesh(world.area).find_paths(world.starts, world.goals, 0.0, "best")
    np.testing.assert_allclose(paths.lengths, world.optimum_r0, rtol=0.0, atol=1e-4)
    solid = world.area.convex_hull.difference(world.area).buffer(-1e-5)  # a point may touch; the grid rounds corners
    shapely.prepare(solid)
    assert not shapely.intersects(solid, [shapely.LineString(path.points) for path in paths]).any()


@pytest.mark.parametrize("name", MAPS)
def test_discs_keep_their_radius_on_paths_as_short_as_the_best_known(shared, name):
    world = load_map(shared, name)
    mesh = NavMesh(world.area)
    best = mesh.find_paths(world.starts, world.goals, world.radius, "best")
    fast = mesh.find_paths(world.starts, world.goals, world.radius)
    assert (best.lengths <= fast.lengths + 1e-9).all()
    # The reference has 8 segments a quarter circle: its obstacles are smaller by up to 0.5 % of the radius, so that it
    # passes a few gaps that the disc does not, and where gaps of exactly the disc's width are closed it is longer.
    assert np.mean(best.lengths / world.optimum_r) == pytest.approx(1.0, abs=2e-4)
    assert np.quantile(np.abs(best.lengths / world.optimum_r - 1.0), 0.98) < 1e-3
    boundary = world.area.boundary
    for path in list(best)[::7]:
        line = shapely.LineString(path.points)
        assert line.distance(boundary) >= world.radius - 1e-5
        # The polyline runs around arcs, by a millimeter at most.
        assert path.length <= line.length <= 1.003 * path.length


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_no_shorter_path_is_found_by_brute_force(kind):
    rng = np.random.default_rng(["boxes", "walls", "lattice"].index(kind))
    found = 0
    for _ in range(12):
        area = random_area(rng, kind, size=6.0, count=int(rng.integers(2, 8)))
        obstacles = np.round(64.0 * rng.uniform(0.0, 6.0, (int(rng.integers(0, 4)), 2))) / 64.0
        mesh = NavMesh(area).with_points(obstacles) if len(obstacles) else NavMesh(area)
        radius = float(rng.choice([0.0, 0.07, 0.23, 0.41]))
        starts, goals = rng.uniform(0.0, 6.0, (2, 4, 2))
        paths = mesh.find_paths(starts, goals, radius, "best")
        for start, goal, length in zip(starts, goals, paths.lengths, strict=True):
            expected = shortest_length(area, obstacles, start, goal, radius, 2.0 * mesh.tolerance(radius))
            assert (math.isnan(length) and expected == math.inf) or length == pytest.approx(expected, abs=1e-5)
            found += not math.isnan(length)
    assert found > 10


def test_a_point_leaves_and_meets_walls_and_corners():
    paths = NavMesh(ROOM).find_paths(
        [(4, 4), (4, 4), (5, 4), (4, 5), (0, 0), (4, 5), (0, 3)],
        [(6, 6), (6, 4), (5, 6), (6, 5), (10, 10), (0, 5), (0, 7)],
        0.0,
        "best",
    )
    around = 2.0 + 2.0 * math.hypot(1.0, 0.0)
    expected = [4.0, 2.0, around, around, 2.0 * math.hypot(6.0, 4.0), 4.0, 4.0]
    np.testing.assert_allclose(paths.lengths, expected, atol=1e-6)


def test_a_wall_without_thickness_is_walked_around():
    mesh = NavMesh(shapely.box(0, 0, 10, 10)).with_points([(5.0, 5.0)])
    path = mesh.find_path((2.0, 5.0), (8.0, 5.0), 1.0, "best")
    turn = 2.0 * math.asin(1.0 / 3.0)
    assert path.length == pytest.approx(2.0 * math.sqrt(8.0) + turn, abs=2.0 * mesh.tolerance(1.0))


def test_no_length_falls_as_the_radius_grows():
    area = random_area(np.random.default_rng(5), "boxes")
    mesh = NavMesh(area)
    starts, goals = np.random.default_rng(6).uniform(0.0, 12.0, (2, 40, 2))
    before = np.zeros(40)
    for radius in (0.0, 0.05, 0.1, 0.2, 0.3, 0.4):
        paths = mesh.find_paths(starts, goals, radius, "best")
        lengths = np.where(np.isnan(paths.lengths), math.inf, paths.lengths)
        assert (lengths >= before - 1e-9).all()
        before = lengths


def test_results_are_the_same_for_any_number_of_workers(shared):
    world = load_map(shared, "clutter_200")
    mesh = NavMesh(world.area)
    radii = np.resize([0.3, 0.2], len(world.starts))
    one, two = (mesh.find_paths(world.starts, world.goals, radii, "best", workers=count) for count in (1, 2))
    for name in ("status", "lengths", "offsets", "points"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    alone = mesh.find_path(world.starts[1], world.goals[1], 0.2, "best")
    np.testing.assert_array_equal(alone.points, one[1].points)
    one, two = (RadiusGraph(mesh.arrays, 0.3, 0.299, count).arrays for count in (1, 2))
    for here, there in zip(one, two, strict=True):
        np.testing.assert_array_equal(here, there)


def test_what_is_not_reached_is_said():
    halves = shapely.box(0, 0, 10, 10).difference(shapely.box(4.9, 0, 5.1, 9.5))
    mesh = NavMesh(halves)
    assert mesh.find_path((1, 1), (9, 1), 0.2, "best").length > 19.0
    with pytest.raises(PathNotFound, match="wide enough"):
        mesh.find_path((1, 1), (9, 1), 0.26, "best")
    with pytest.raises(PathNotFound, match="start blocked"):
        mesh.find_path((5, 5), (9, 1), 0.0, "best")
    with pytest.raises(PathNotFound, match="goal blocked"):
        mesh.find_path((1, 1), (9.9, 9.9), 0.2, "best")


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_a_disc_that_touches_obstacles_takes_the_shortest_way_too(kind):
    rng = np.random.default_rng(["boxes", "walls", "lattice"].index(kind))
    found = 0
    for _ in range(6):
        mesh = NavMesh(random_area(rng, kind, size=6.0, count=int(rng.integers(2, 8))))
        for radius in (0.07, 0.23):
            places = [mesh.nearest_free(point, radius) for point in rng.uniform(0.0, 6.0, (20, 2))]
            starts, goals = np.array([place for place in places if place]).reshape(-1, 2), rng.uniform(0.0, 6.0, 2)
            for ends in ((starts, np.resize(goals, starts.shape)), (starts, starts[::-1])):
                best, fast = (mesh.find_paths(*ends, radius, optimality) for optimality in ("best", "fast"))
                np.testing.assert_array_equal(best.status, fast.status)
                there = best.status == 0
                assert (best.lengths[there] <= fast.lengths[there] + 1e-6).all()
                found += int(there.sum())
    assert found > 100


def test_a_disc_on_a_side_of_the_mesh_sees_what_is_on_either_hand():
    # The middle of a side is where two triangles meet; the view from there is that of both.
    mesh = NavMesh(random_area(np.random.default_rng(3), "boxes"))
    org, twin = mesh.arrays.sides["org"], mesh.arrays.sides["twin"]
    sides = np.flatnonzero(
        (mesh.arrays.sides["constraints"] == 0) & (twin >= 0) & (np.repeat(mesh.arrays.cover, 3) == 0)
    )
    place = np.column_stack([mesh.arrays.vertices["x"], mesh.arrays.vertices["y"]])
    starts = 0.5 * (place[org[sides]] + place[org[twin[sides]]])
    goals = np.random.default_rng(4).permutation(starts)
    best, aside = (mesh.find_paths(starts + off, goals, 0.05, "best") for off in (0.0, 1e-4))
    both = (best.status == 0) & (aside.status == 0)
    assert both.sum() > 50
    np.testing.assert_allclose(best.lengths[both], aside.lengths[both], atol=3e-4)


@pytest.mark.parametrize(("size", "radius"), [(8.0, 0.25), (8.0, 0.3), (16.0, 0.3)])
def test_a_lattice_with_gaps_as_wide_as_the_disc_is_crossed(size, radius):
    # Half of all ways between two crossings are equally long, and every place on them is as narrow as allowed.
    corners = np.arange(1.0, size - 1.0, 1.0 + 2.0 * radius)
    holes = [shapely.box(x, y, x + 1.0, y + 1.0) for x in corners for y in corners]
    mesh = NavMesh(shapely.box(0.0, 0.0, size, size).difference(shapely.union_all(holes)))
    rng = np.random.default_rng(int(100.0 * radius))
    places = [mesh.nearest_free(point, radius) for point in rng.uniform(0.0, size, (400, 2))]
    starts, goals = np.split(np.array([place for place in places if place][: len(places) // 2 * 2]), 2)
    best, fast = (mesh.find_paths(starts, goals, radius, optimality) for optimality in ("best", "fast"))
    reached = [mesh.reachable(start, goal, radius) for start, goal in zip(starts, goals, strict=True)]
    np.testing.assert_array_equal(best.status == 0, reached)
    np.testing.assert_array_equal(fast.status == 0, reached)
    assert sum(reached) > 100
    assert (best.lengths[reached] <= fast.lengths[reached] + 1e-5).all()


@pytest.mark.parametrize(
    ("obstacle", "post", "radius", "start", "goal"),
    [
        ([(8.0, 11.5), (9.0, 12.5), (9.0, 11.5)], (8.1, 10.6), 0.45, (5.25, 14.25), (9.0, 9.75)),
        ([(13.2, 13.6), (12.2, 13.6), (12.2, 14.6)], (12.0, 14.5), 0.1, (11.5, 11.65), (12.15, 15.35)),
    ],
)
def test_a_gap_as_wide_as_the_disc_is_on_the_shortest_way(obstacle, post, radius, start, goal):
    # Corners move to the grid, and tangents through a gap of exactly the width turn by much more than by rounding.
    area = shapely.box(0, 0, 16, 16).difference(shapely.Polygon(obstacle))
    mesh = NavMesh(area).with_points([post])
    best, fast = (mesh.find_path(start, goal, radius, optimality) for optimality in ("best", "fast"))
    assert best.length <= fast.length + 1e-9
    tight = radius - mesh.tolerance(radius)
    assert best.length == pytest.approx(shortest_length(area, np.array([post]), start, goal, tight, 1e-6), abs=1e-5)


def test_a_dearer_arrival_that_turned_less_is_not_lost():
    # Where the shortest way leaves an arc, the cheapest arrival there has passed already.
    corners = (1.0, 2.6, 4.2)
    holes = [shapely.box(x, y, x + 1.0, y + 1.0) for x in corners for y in corners]
    mesh = NavMesh(shapely.box(0.0, 0.0, 6.0, 6.0).difference(shapely.union_all(holes)))
    start, goal = (5.499999659265137, 3.5134702634944808), (2.265319689449507, 5.34001872265038)
    assert mesh.find_path(start, goal, 0.3, "best").length == pytest.approx(4.774682, abs=1e-5)


def test_a_path_turns_by_more_than_half_a_circle_around_a_post():
    # From the niche between a box and a post that it touches, over the post and down to the other side of the box.
    mesh = NavMesh(shapely.box(0, 0, 8, 8).difference(shapely.box(2.5, 2.5, 3.5, 3.5))).with_points([(3.4, 4.3)])
    best, fast = (mesh.find_path((3.0, 4.0), (4.0, 3.0), 0.5, optimality) for optimality in ("best", "fast"))
    post = shapely.Point(3.4, 4.3)
    assert best.length <= fast.length + 1e-9
    assert best.length < 3.5
    assert shapely.LineString(best.points).distance(post) >= 0.5 - 1e-5


def test_a_post_on_a_wall_ends_the_view_along_it():
    # The view past vertices that are off by rounding once went round them for ever.
    wall = shapely.Polygon([(3.5, 2.5), (2.5, 4.0), (5.0, 2.0)])
    mesh = NavMesh(shapely.box(0, 0, 8, 8).difference(wall)).with_points([(3.1, 3.1)])
    best, fast = (mesh.find_path((7.5, 0.5), (0.5, 7.5), 0.3, optimality) for optimality in ("best", "fast"))
    assert best.length <= fast.length + 1e-9


def test_only_shortest_paths_of_points_stand_on_walls():
    mesh = NavMesh(ROOM)
    assert mesh.find_path((4.0, 5.0), (6.0, 5.0), 0.0, "best").length == pytest.approx(4.0)
    assert not mesh.is_free((4.0, 5.0), 0.0)
    assert not mesh.reachable((4.0, 5.0), (6.0, 5.0), 0.0)
    assert mesh.reachable((3.9, 5.0), (6.1, 5.0), 0.0)


@pytest.mark.parametrize("corner", [(-0.5, -0.5), (10.5, -0.5), (10.5, 10.5), (-0.5, 10.5)])
def test_a_point_on_a_corner_of_the_box_is_blocked(corner):
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(3, 3, 5, 5)))
    with pytest.raises(PathNotFound, match="start blocked"):
        mesh.find_path(corner, (6.0, 0.5), 0.0, "best")
    with pytest.raises(PathNotFound, match="goal blocked"):
        mesh.find_path((6.0, 0.5), corner, 0.0, "best")
