"""Properties of edited meshes on degenerate obstacles: on a coarse grid they overlap, touch, nest and line up."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.edits_reference import edit_faults, edited_clearances, edited_parts
from tests.reference.navmesh_reference import part_of, random_area
from tests.support.areas import boxes

SIZE = 8
AREA = shapely.box(0, 0, SIZE, SIZE)

few = settings(max_examples=25, derandomize=True, deadline=None)

numbers = st.integers(-1, SIZE + 1)
corners = st.tuples(numbers, numbers)
shapes = st.one_of(
    boxes(-1, SIZE + 1, 4),
    st.tuples(corners, corners, corners).map(shapely.Polygon).filter(lambda triangle: triangle.area > 0.0),
    st.lists(corners, min_size=2, max_size=4, unique=True).map(shapely.LineString),
    corners.map(shapely.Point),
)
steps = st.lists(st.tuples(shapes, st.integers(0, 5), st.booleans()), min_size=1, max_size=12)
"""Insert a shape; or remove or move to it one of what is there, for a number below 3."""


@few
@given(steps)
def test_edited_meshes_have_no_fault(steps):
    mesh = NavMesh(AREA)
    present = {}
    for shape, which, removes in steps:
        handle = list(present)[which % len(present)] if present and which < 3 else None
        if handle is None:
            present[mesh.insert_obstacle(shape)] = shape
        elif removes:
            mesh.remove(handle)
            del present[handle]
        else:
            mesh.move(handle, shape)
            present[handle] = shape
        assert edit_faults(mesh, AREA, list(present.values())) == []
    places = 0.25 * np.stack(np.meshgrid(np.arange(1, 4 * SIZE), np.arange(1, 4 * SIZE)), axis=-1).reshape(-1, 2) + 0.01
    np.testing.assert_allclose(
        mesh.clearances(places), edited_clearances(AREA, list(present.values()), places), atol=2e-5
    )
    for handle in present:
        mesh.remove(handle)
    assert edit_faults(mesh, AREA, []) == []


@few
@given(st.lists(shapes, min_size=1, max_size=8), st.integers(0, 7), st.sampled_from([0.1, 0.24, 0.45]))
def test_paths_exist_where_the_disc_fits(obstacles, removed, radius):
    mesh = NavMesh(AREA)
    handles = [mesh.insert_obstacle(shape) for shape in obstacles]
    if removed < len(handles):
        mesh.remove(handles[removed])
        obstacles = obstacles[:removed] + obstacles[removed + 1 :]
    parts = edited_parts(AREA, obstacles, radius * (1 + 5e-4))
    assume(len(parts) > 0)
    ends = np.array([(0.6, 0.6), (7.4, 7.3), (0.7, 7.2), (4.4, 4.6)])
    parts_of = part_of(parts, ends)
    for i in range(len(ends)):
        for j in range(i):
            if parts_of[i] < 0 or parts_of[j] < 0:
                continue
            try:
                path = mesh.find_path(ends[i], ends[j], radius)
            except PathNotFound:
                assert parts_of[i] != parts_of[j]
                continue
            assert parts_of[i] == parts_of[j]
            assert mesh.first_violation(path.points, radius) == math.inf


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(3))
def test_random_obstacles_at_any_angle(kind, seed):
    rng = np.random.default_rng(seed)
    area = random_area(rng, kind, count=12)
    mesh = NavMesh(area)
    present = {}
    for step in range(40):
        if present and rng.random() < 0.4:
            handle = list(present)[rng.integers(len(present))]
            mesh.remove(handle)
            del present[handle]
            continue
        x, y = rng.uniform(0.0, 12.0, 2)
        if step % 4 == 3:
            shape = shapely.LineString(np.array([x, y]) + rng.uniform(-3.0, 3.0, (3, 2)))
        else:
            shape = shapely.box(x, y, x + rng.uniform(0.2, 2.5), y + rng.uniform(0.2, 2.5))
            shape = shapely.affinity.rotate(shape, rng.uniform(0.0, 180.0))
        present[mesh.insert_obstacle(shape)] = shape
        assert edit_faults(mesh, area, list(present.values())) == []
    points = rng.uniform(0.0, 12.0, (300, 2))
    np.testing.assert_allclose(
        mesh.clearances(points), edited_clearances(area, list(present.values()), points), atol=2e-5
    )
