"""Components agree with the search and with a flood from side to side."""

from unittest.mock import patch

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowdsim.errors import GeometryError, PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.path_search import PathSearch
from crowdsim.navmesh.paths.component_kernels import label_sides
from crowdsim.navmesh.paths.paths import FOUND, NO_PASSAGE, OPTIMALITIES
from crowdsim.navmesh.paths.reachability import ComponentCache
from tests.reference.components import side_components
from tests.reference.navmesh_reference import random_area
from tests.support.areas import areas

TWO_ROOMS = shapely.box(0, 0, 10, 10).difference(
    shapely.union_all([shapely.box(4, 0, 5, 4.7), shapely.box(4, 5.3, 5, 10)])
)
"""Joined by a gap of 0.6 m."""


def _finds(mesh, start, goal, radius) -> bool:
    """Whether the search finds a path that does not ask for components first."""
    try:
        with patch.object(PathSearch, "are_apart", lambda self, starts, *_: np.zeros(len(starts), np.bool_)):
            mesh.find_path(start, goal, radius)
    except PathNotFound:
        return False
    return True


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(5))
def test_a_path_is_found_exactly_within_a_component(kind, seed):
    rng = np.random.default_rng(1000 + seed)
    mesh = NavMesh(random_area(rng, kind, count=40))
    if seed % 2:
        mesh = mesh.with_points(rng.uniform(0.5, 11.5, (40, 2)))
    for radius in (0.05, 0.15, 0.3, 0.45, 0.6, 0.8):
        points = rng.uniform(0.0, 12.0, (80, 2))
        points = np.concatenate([points, points[:40] + rng.normal(0.0, 0.3 * radius + 0.1, (40, 2))])
        components = mesh.components(points, radius)
        for i in range(80):
            k = i + 80 if i < 40 else i - 40
            together = bool(components[i] == components[k] and components[i] >= 0)
            assert together == _finds(mesh, points[i], points[k], radius), (points[i], points[k], radius)
            assert together == mesh.reachable(points[i], points[k], radius)


AREAS = areas(8, 4, 10)
places = st.tuples(st.integers(1, 31), st.integers(1, 31)).map(lambda place: (0.25 * place[0], 0.25 * place[1]))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(AREAS, st.lists(places, min_size=2, max_size=8), st.sampled_from([0.1, 0.25, 0.45, 0.5]))
def test_a_path_is_found_exactly_within_a_component_of_touching_boxes(area, points, radius):
    assume(area.area > 0.0)
    mesh = NavMesh(area)
    components = mesh.components(points, radius)
    for i, start in enumerate(points):
        for k in range(i):
            together = components[i] == components[k] and components[i] >= 0
            assert together == _finds(mesh, start, points[k], radius)


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_labels_are_those_of_a_flood(kind):
    mesh = NavMesh(random_area(np.random.default_rng(7), kind, count=40)).arrays
    for width in (0.1, 0.31, 0.77, 1.3):
        labels = np.empty(len(mesh.sides), np.int32)
        count = label_sides(mesh, width, labels)
        labels = labels[: 3 * mesh.frame["triangles"][0]]
        sides = mesh.sides[: len(labels)]
        twins, closed = sides["twin"], sides["constraints"] != 0
        blocked = np.repeat(mesh.cover != 0, 3)[: len(labels)]
        np.testing.assert_array_equal(labels < 0, closed | blocked)
        inner = labels >= 0
        np.testing.assert_array_equal(labels[inner], labels[twins[inner]])
        ends = np.sort(np.column_stack([sides["org"], sides["org"][twins]]), axis=1)
        parts = {frozenset(map(tuple, ends[labels == k].tolist())) for k in range(count)}
        assert parts == set(side_components(mesh, width))


def test_a_gap_joins_two_rooms_up_to_its_width():
    mesh = NavMesh(TWO_ROOMS)
    assert mesh.reachable((2, 2), (8, 8), 0.0)
    assert mesh.reachable((2, 2), (8, 8), 0.3)
    assert not mesh.reachable((2, 2), (8, 8), 0.3001)
    assert mesh.components([(2, 2), (3, 8), (8, 8), (4.5, 2), (0.1, 5), (99, 5)], 0.5).tolist()[3:] == [-1, -1, -1]
    one, same, other = mesh.components([(2, 2), (3, 8), (8, 8)], 0.5)
    assert one == same != other


def test_discs_trapped_between_posts_are_a_component_of_their_own():
    posts = [(5 + np.cos(angle), 5 + np.sin(angle)) for angle in (0.0, 2.1, 4.2)]
    mesh = NavMesh(shapely.box(0, 0, 10, 10)).with_points(posts)
    inside, beside, outside = mesh.components([(5, 5), (5.02, 5.0), (1, 1)], 0.9)
    assert inside == beside != outside
    assert mesh.reachable((5, 5), (1, 1), 0.5)


def test_corners_that_touch_let_nothing_through():
    mesh = NavMesh(
        shapely.box(0, 0, 4, 4).difference(shapely.union_all([shapely.box(0, 2, 2, 4), shapely.box(2, 0, 4, 2)]))
    )
    assert not mesh.reachable((1, 1), (3, 3), 0.0)
    assert not mesh.reachable((1, 1), (3, 3), 0.1)


def test_components_are_computed_once_per_radius():
    mesh = NavMesh(TWO_ROOMS).arrays
    cache = ComponentCache()
    labels, count = cache.labels(mesh, 0.5)
    assert cache.labels(mesh, 0.5)[0] is labels
    assert cache.labels(mesh, 0.7)[1] > count
    assert cache.labels(mesh, 0.5)[0] is labels
    for width in np.linspace(0.1, 1.0, 20):
        cache.labels(mesh, width)
    assert len(cache._entries) <= 8


@pytest.mark.parametrize("optimality", OPTIMALITIES)
def test_nothing_is_searched_where_no_way_leads(monkeypatch, optimality):
    """From outside of a closed ring the complete search would look everywhere."""
    ring = shapely.Point(5, 5).buffer(2.0).difference(shapely.Point(5, 5).buffer(1.5))
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(ring))
    ends = np.array([[1.0, 1.0], [5.0, 5.0], [9.0, 9.0]])
    searched = []

    def search(self, batch, workers):
        searched.extend(zip(batch.starts.tolist(), batch.goals.tolist(), strict=True))
        batch.status[:], batch.lengths[:], batch.counts[:] = FOUND, 1.0, 2
        return np.concatenate([np.stack(pair) for pair in zip(batch.starts, batch.goals, strict=True)])

    monkeypatch.setattr(PathSearch, f"_find_{optimality}", search)
    paths = mesh.find_paths(ends[[0, 0, 1, 2]], ends[[1, 2, 2, 0]], 0.3, optimality)
    assert paths.status.tolist() == [NO_PASSAGE, FOUND, NO_PASSAGE, FOUND]
    assert searched == [(ends[0].tolist(), ends[2].tolist()), (ends[2].tolist(), ends[0].tolist())]
    np.testing.assert_array_equal(paths[3].points, ends[[2, 0]])
    assert not mesh.reachable(ends[0], ends[1], 0.3)
    with pytest.raises(PathNotFound, match="no passage"):
        mesh.find_path(ends[0], ends[1], 0.3, optimality)


def test_locate_finds_a_triangle_around_the_point():
    rng = np.random.default_rng(1)
    mesh = NavMesh(TWO_ROOMS)
    place = np.column_stack([mesh.arrays.vertices["x"], mesh.arrays.vertices["y"]])
    for point in rng.uniform(-0.4, 10.4, (200, 2)):
        corners = place[mesh.arrays.sides["org"][3 * mesh.locate(point) :][:3]]
        assert shapely.Polygon(corners).distance(shapely.Point(point)) < 1e-6
        blocked = mesh.arrays.cover[mesh.locate(point)] != 0
        assert blocked == (mesh.clearance(point) == 0.0)
    assert mesh.locate((50, 5)) == -1
    with pytest.raises(GeometryError, match="finite"):
        mesh.locate((np.nan, 5))


def test_wrong_arguments_are_refused():
    mesh = NavMesh(TWO_ROOMS)
    with pytest.raises(GeometryError, match="radius"):
        mesh.components([(1, 1)], -0.1)
    with pytest.raises(GeometryError, match="shape"):
        mesh.components((1, 1), 0.1)
    with pytest.raises(GeometryError, match="finite"):
        mesh.reachable((1, 1), (np.inf, 1), 0.1)
