"""Paths keep their radius, exist where they should, are short, and obstacles can be added to a copy."""

import itertools
import math
import threading

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError, PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths import path_kernels
from crowdsim.navmesh.paths.paths import FOUND, TANGLED
from tests.reference.navmesh_reference import mesh_faults, part_of, random_area, reachable_parts
from tests.support.oracle_maps import MAPS, load_map

CLOSE = 1e-5
"""Meters by which a path may come closer than its radius."""


def _find(mesh, start, goal, radius):
    try:
        return mesh.find_path(start, goal, radius)
    except PathNotFound:
        return None


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(6))
def test_paths_exist_exactly_where_the_disc_fits(kind, seed):
    rng = np.random.default_rng(100 + seed)
    area = random_area(rng, kind, count=40)
    mesh = NavMesh(area)
    for radius in (0.15, 0.3, 0.5, 0.8):
        surely, perhaps = reachable_parts(area, radius * (1 + 5e-4)), reachable_parts(area, radius * (1 - 5e-4))
        if len(surely) == 0:
            continue
        # Half of the points next to the edge of where the disc fits: the ends of a path are its critical places.
        rim = shapely.union_all(surely).boundary
        near = shapely.line_interpolate_point(rim, rng.uniform(0.0, 1.0, 60), normalized=True)
        near = shapely.get_coordinates(near) + rng.normal(0.0, 0.1 * radius, (60, 2))
        points = rng.permutation(np.concatenate([near, rng.uniform(0.0, 12.0, (60, 2))]))
        points = points[part_of(surely, points) >= 0]
        surely, perhaps = part_of(surely, points), part_of(perhaps, points)
        for i in range(0, len(points) - 1, 2):
            path = _find(mesh, points[i], points[i + 1], radius)
            if path is None:
                assert surely[i] != surely[i + 1], (points[i], points[i + 1], radius)
                continue
            assert perhaps[i] == perhaps[i + 1], (points[i], points[i + 1], radius)
            line = shapely.LineString(path.points)
            assert line.distance(area.boundary) >= radius - CLOSE
            assert shapely.contains_properly(area, line)
            assert path.length == pytest.approx(line.length)
            np.testing.assert_array_equal(path.points[[0, -1]], points[i : i + 2])
            assert mesh.first_violation(path.points, radius) == math.inf


@pytest.mark.parametrize("name", MAPS)
def test_oracle_maps(shared, name):
    world = load_map(shared, name)
    paths = NavMesh(world.area).find_paths(world.starts, world.goals, world.radius)
    possible = np.isfinite(world.optimum_r)
    assert (paths.status[possible] == FOUND).all()
    assert (paths.lengths >= world.optimum_r0 * (1 - 1e-6))[possible].all()
    ratios = (paths.lengths / world.optimum_r)[possible]
    assert ratios.mean() < 1.003
    assert ratios.max() < 1.08
    walls = world.area.boundary
    shapely.prepare(walls)
    for path in itertools.islice(paths, 200):
        assert shapely.LineString(path.points).distance(walls) >= world.radius - CLOSE


def test_a_gap_of_exactly_the_diameter_is_passed():
    wall = shapely.union_all([shapely.box(4, 0, 5, 4.7), shapely.box(4, 5.3, 5, 10)])
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(wall))
    path = mesh.find_path((2, 2), (8, 8), 0.3)
    assert shapely.LineString(path.points).distance(wall) >= 0.3 - CLOSE
    with pytest.raises(PathNotFound, match="no passage"):
        mesh.find_path((2, 2), (8, 8), 0.3001)


def test_a_corner_is_rounded_within_a_millimeter():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 5)))
    path = mesh.find_path((2, 2), (8, 2), 0.5)
    corner = shapely.MultiPoint([(4, 5), (6, 5)])
    bends = shapely.points(path.points[1:-1])
    assert shapely.distance(bends, corner).max() < 0.5 + 1e-3
    turn = math.atan2(3, 2) + math.asin(0.5 / math.sqrt(13))
    assert path.length == pytest.approx(2 * (math.sqrt(13 - 0.25) + 0.5 * turn) + 2, abs=3e-3)


def test_around_pillars_corners_stay_coarse():
    """Many corners close by ask for no finer polyline: what stands off their arcs does so away from them."""
    rng = np.random.default_rng(2)
    solid = shapely.union_all(
        [shapely.Point(*center).buffer(0.6, quad_segs=24) for center in rng.uniform(2.0, 8.0, (6, 2))]
    )
    mesh = NavMesh(shapely.box(0.0, 0.0, 10.0, 10.0).difference(solid))
    bent = points = expected = 0
    for start, goal in rng.uniform(0.3, 9.7, (60, 2, 2)):
        path = _find(mesh, start, goal, 0.23)
        if path is None or len(path.points) == 2:
            continue
        bent += 1
        assert shapely.LineString(path.points).distance(solid) >= 0.23 - CLOSE
        shortest = mesh.find_path(start, goal, 0.23, "best").length
        assert path.length <= 1.05 * shortest
        turns = np.diff(np.unwrap(np.arctan2(*np.diff(path.points, axis=0).T)))
        # A corner of the polyline turns by 0.19 at most where it stands a millimeter off, those of a pillar by 0.065.
        points += len(path.points)
        expected += 4 + np.abs(turns).sum() / 0.06
    assert points <= expected
    assert bent > 20


def test_reasons_are_told():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 10)))
    with pytest.raises(PathNotFound, match=r"start blocked.*not in free space"):
        mesh.find_path((5, 5), (1, 1), 0.3)
    with pytest.raises(PathNotFound, match=r"goal blocked.*0\.1 m"):
        mesh.find_path((1, 1), (0.1, 5), 0.3)
    with pytest.raises(PathNotFound, match="no passage"):
        mesh.find_path((1, 1), (9, 9), 0.3)
    with pytest.raises(PathNotFound, match="start blocked"):
        mesh.find_path((500, 5), (1, 1), 0.3)
    for start, radius in (((math.nan, 1), 0.3), ((1, 1), math.nan), ((1, 1), -1.0), ((1, 1), 0.0), ((1, 1, 1), 0.3)):
        with pytest.raises(GeometryError):
            mesh.find_path(start, (2, 2), radius)


def test_tangled_strings_are_found_as_shortest_paths(monkeypatch):
    mesh = NavMesh(random_area(np.random.default_rng(49), "walls", count=40))
    starts, goals = np.random.default_rng(1).uniform(0.0, 12.0, (2, 60, 2))
    before = mesh.find_paths(starts, goals, 0.2)
    best = mesh.find_paths(starts, goals, 0.2, "best")
    plan_paths = path_kernels.plan_paths

    def tangle(*arguments):
        """Forget some of the paths."""
        points = plan_paths(*arguments)
        batch = arguments[-1]
        status, lengths, counts, pieces = batch.status, batch.lengths, batch.counts, batch.pieces(points)
        for i in np.flatnonzero(status == FOUND)[::3]:
            status[i], lengths[i], counts[i], pieces[i] = TANGLED, math.nan, 0, np.empty((0, 2))
        return np.concatenate(pieces)

    monkeypatch.setattr(path_kernels, "plan_paths", tangle)
    after = mesh.find_paths(starts, goals, 0.2)
    np.testing.assert_array_equal(after.status, before.status)
    found = np.flatnonzero(before.status == FOUND)
    assert len(found) > 15
    for place, i in enumerate(found.tolist()):
        np.testing.assert_array_equal(after[i].points, (best if place % 3 == 0 else before)[i].points)
        assert after[i].length == pytest.approx(shapely.LineString(after[i].points).length)


def test_with_points_blocks_a_gap_in_the_copy_only():
    wall = shapely.union_all([shapely.box(4, 0, 5, 4.5), shapely.box(4, 5.5, 5, 10)])
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(wall))
    before = [column.copy() for column in mesh.arrays]
    blocked = mesh.with_points([(4.5, 5.0), (8.0, 8.0)])
    assert mesh_faults(blocked.arrays) == []
    assert blocked.clearance((8.0, 8.5)) == pytest.approx(0.5, abs=1e-5)
    assert blocked.find_path((2, 2), (8, 2), 0.2).length < 10.0
    with pytest.raises(PathNotFound, match="no passage"):
        blocked.find_path((2, 2), (8, 2), 0.3)
    mesh.find_path((2, 2), (8, 2), 0.3)
    for column, old in zip(mesh.arrays, before, strict=True):
        np.testing.assert_array_equal(column, old)
    with pytest.raises(GeometryError, match="outside"):
        mesh.with_points([(500.0, 0.0)])


def test_with_many_points_stays_exact():
    rng = np.random.default_rng(8)
    area = random_area(rng, "boxes", count=15)
    posts = rng.uniform(0.5, 11.5, (40, 2))
    mesh = NavMesh(area).with_points(posts)
    assert mesh_faults(mesh.arrays) == []
    solid = shapely.union_all([area.boundary, shapely.MultiPoint(posts)])
    parts = reachable_parts(area.difference(shapely.MultiPoint(posts).buffer(1e-6)), 0.4)
    points = rng.uniform(0.0, 12.0, (120, 2))
    part = part_of(parts, points)
    points, part = points[part >= 0], part[part >= 0]
    for i in range(len(points) - 1):
        path = _find(mesh, points[i], points[i + 1], 0.4 - 1e-3)
        assert (path is not None) or part[i] != part[i + 1]
        if path is not None:
            assert shapely.LineString(path.points).distance(solid) >= 0.4 - 1e-3 - CLOSE


def _in_time(call, seconds=60.0):
    """The result of ``call``, which may raise; AssertionError where it does not return (kernels release the GIL)."""
    results: list = []
    thread = threading.Thread(target=lambda: results.append(call()), daemon=True)
    thread.start()
    thread.join(seconds)
    assert not thread.is_alive(), "the call does not return"
    assert results, "the call failed, see above"
    return results[0]


# Two standing people as twelve points each, one point inside of the other ring left out. The distance from a piece of
# an arc to sides that turn away from it was less by rounding than to the point they share.
_TWO_RINGS = """
    5.008736731995443 2.1624221616669246  4.949223870184268 2.3845271856500556  4.786631708012312 2.5471193478220115
    4.34242166004605 2.5471193478220115   4.179829497874094 2.3845271856500556  4.120316636062919 2.1624221616669246
    4.179829497874094 1.9403171376837938  4.34242166004605 1.7777249755118378   4.564526684029181 1.7182121137006625
    4.786631708012312 1.7777249755118376  4.949223870184268 1.9403171376837933  5.800528575609228 1.5037546272315632
    5.741015713798053 1.7258596512146942  5.578423551626097 1.88845181338665    5.356318527642966 1.947964675197825
    5.134213503659835 1.8884518133866501  4.971621341487879 1.7258596512146942  4.912108479676704 1.5037546272315632
    4.971621341487879 1.2816496032484324  5.134213503659835 1.1190574410764764  5.356318527642966 1.0595445792653013
    5.578423551626097 1.1190574410764764  5.741015713798053 1.281649603248432
"""


def _room_with_a_pillar():
    """A room of 14 x 6 m with a box from one wall and a round pillar that its polygon surrounds."""
    pillar = shapely.Point(9.0, 2.2).buffer(0.5 / math.cos(math.pi / 36), quad_segs=9)
    return shapely.box(0, 0, 14, 6).difference(shapely.box(4.5, 2.6, 5.5, 6)).difference(pillar)


def test_no_walk_circles_around_a_point_obstacle():
    area = _room_with_a_pillar()
    posts = np.array(_TWO_RINGS.split(), float).reshape(-1, 2)
    start, goal, radius = (
        (4.383769383603178, 1.2752928694129848),
        (6.386999051807728, 0.880988029830405),
        0.4522972101765478,
    )
    mesh = NavMesh(area).with_points(posts)
    path = _in_time(lambda: mesh.find_path(start, goal, radius))
    solid = shapely.union_all([area.boundary, shapely.MultiPoint(posts)])
    assert shapely.LineString(path.points).distance(solid) >= radius - CLOSE
    assert 2.1 < path.length < 2.4


@pytest.mark.parametrize("seed", range(4))
def test_paths_around_standing_people(seed):
    rng = np.random.default_rng(200 + seed)
    area = _room_with_a_pillar() if seed % 2 else random_area(rng, "boxes", size=6.0, count=5)
    empty = NavMesh(area)
    low, high = np.reshape(area.bounds, (2, 2))
    bearings = np.arange(12) * math.pi / 6
    ring = 0.44 * np.column_stack([np.cos(bearings), np.sin(bearings)])
    found = 0
    for people in (1, 2, 3, 4, 5) * 2:
        places = rng.uniform(low, high, (people, 2))
        places[1:2] = places[0] + rng.normal(0.0, 0.3, 2)  # two of them overlap
        posts = (places[:, None] + ring).reshape(-1, 2)
        posts = posts[((posts > low) & (posts < high)).all(axis=1)]
        mesh = empty.with_points(posts)
        solid = shapely.union_all([area.boundary, shapely.MultiPoint(posts)])
        radius = rng.uniform(0.15, 0.5)
        # Polygons around the posts, like those of the walls, are inside of the true discs by up to 1e-4 of the radius.
        taken = shapely.MultiPoint(posts).buffer(radius * (1 + 5e-4), quad_segs=64)
        surely = shapely.get_parts(area.buffer(-radius * (1 + 5e-4), quad_segs=64).difference(taken))
        points = rng.uniform(low, high, (40, 2))
        part = part_of(surely, points)
        points, part = points[part >= 0], part[part >= 0]
        for i in range(len(points) - 1):
            path = _in_time(lambda a=points[i], b=points[i + 1]: [_find(mesh, a, b, radius)])[0]  # noqa: B023
            assert path is not None or part[i] != part[i + 1], (posts.tolist(), points[i : i + 2].tolist(), radius)
            if path is not None:
                found += 1
                assert shapely.LineString(path.points).distance(solid) >= radius - CLOSE
    assert found > 40


def test_threads_give_the_same_paths_as_one():
    mesh = NavMesh(random_area(np.random.default_rng(3), "boxes"))
    rng = np.random.default_rng(0)
    points = rng.uniform(0.0, 12.0, (80, 2))
    points = points[mesh.clearances(points) > 0.25]
    pairs = list(itertools.pairwise(points))
    alone = [_find(mesh, a, b, 0.2) for a, b in pairs]
    together: list = [None, None]

    def work(k):
        together[k] = [_find(mesh, a, b, 0.2) for a, b in pairs]

    threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for found in together:
        for one, two in zip(alone, found, strict=True):
            assert (one is None) == (two is None)
            if one is not None:
                np.testing.assert_array_equal(one.points, two.points)
