"""What a run measures of every step, against plain twins."""

import numpy as np
import pytest
import shapely

from crowdsim.crowd.near.neighbors import sorted_places
from crowdsim.crowd.report.measure_kernels import closest_pair, obstacle_margin
from crowdsim.navmesh.navmesh import NavMesh


@pytest.mark.parametrize("count", [2, 3, 20, 400])
def test_closest_pair_is_the_smallest_of_all_distances(count: int) -> None:
    places = np.random.default_rng(count).uniform(-5, 5, (count, 2))
    between = np.linalg.norm(places[:, None] - places[None], axis=-1) + np.diag([np.inf] * count)
    least = between.min()
    for limit in (np.inf, 1.5 * least, 1.01 * least):
        assert closest_pair(places, *sorted_places(places), limit) == pytest.approx(least)
    assert closest_pair(places, *sorted_places(places), 0.5 * least) >= least * (1.0 - 1e-12)


def test_alone_there_is_no_closest_pair() -> None:
    for count in (0, 1):
        places = np.zeros((count, 2))
        assert closest_pair(places, *sorted_places(places), np.inf) == np.inf


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
