"""What a run measures of every step, against plain twins."""

import numpy as np
import pytest
import shapely

from crowdsim.crowd.report.measure_kernels import closest_pair, obstacle_margin
from crowdsim.navmesh.navmesh import NavMesh


@pytest.mark.parametrize("count", [2, 3, 20])
def test_closest_pair_is_the_smallest_of_all_distances(count: int) -> None:
    pose = np.random.default_rng(count).uniform(-5, 5, (count, 3))
    between = np.linalg.norm(pose[:, None, :2] - pose[None, :, :2], axis=-1) + np.diag([np.inf] * count)
    assert closest_pair(pose) == pytest.approx(between.min())


def test_alone_there_is_no_closest_pair() -> None:
    assert closest_pair(np.zeros((1, 3))) == np.inf
    assert closest_pair(np.zeros((0, 3))) == np.inf


def test_obstacle_margin_is_what_shapely_measures() -> None:
    room = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 5, 6))
    mesh = NavMesh(room).arrays
    radii = np.array([0.2, 0.4])
    rng = np.random.default_rng(3)
    for _ in range(20):
        pose = np.column_stack([rng.uniform(0.5, 3.5, (5, 2)), np.zeros(5)])
        behavior = rng.integers(0, 2, 5).astype(np.int32)
        wanted = min(
            room.boundary.distance(shapely.Point(p[:2])) - radii[b] for p, b in zip(pose, behavior, strict=True)
        )
        assert obstacle_margin(pose, behavior, mesh, radii, 1.0) == pytest.approx(min(wanted, 1.0), abs=1e-5)


def test_a_body_in_an_obstacle_has_a_negative_margin() -> None:
    mesh = NavMesh(shapely.box(0, 0, 4, 4)).arrays
    near = np.array([[0.1, 2.0, 0.0]])
    outside = np.array([[-1.0, 2.0, 0.0]])
    assert obstacle_margin(near, np.zeros(1, np.int32), mesh, np.array([0.3]), 1.0) == pytest.approx(-0.2, abs=1e-5)
    assert obstacle_margin(outside, np.zeros(1, np.int32), mesh, np.array([0.3]), 1.0) < -0.3
