"""Costs of plans beside those of a weighted-region reference, in small rooms with obstacles and doors."""

import numpy as np
import pytest
import shapely

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.behavior_areas import area_polygons
from crowdsim.planning.query.requirements import Requirements
from tests.support.small_scenes import SIZE, scene
from tests.unit.planning.conftest import make_behavior

pytest.importorskip("skfmm", reason="scikit-fmm is not installed")
from tests.reference import weighted_region

BEHAVIORS = (
    make_behavior("lateral", 0.17, 3.0, (-np.pi / 2.0, np.pi / 2.0)),
    make_behavior("arm_constrained", 0.26, 1.1),
    make_behavior("frontal", 0.32, 1.0),
)
STARTS = 4


def excess(seed):
    """By what shares plans to one goal cost more than the reference, and than they are proven to at most (n, 2)."""
    polygons = scene(seed)
    meshes = [NavMesh(polygon) for polygon in polygons]
    rooms = [None if room.is_empty else NavMesh(room) for room in area_polygons(polygons, BEHAVIORS)]
    need = Requirements.of(BEHAVIORS, 2, TRACKING_MARGIN)
    points = np.random.default_rng(seed).uniform(0.3, SIZE - 0.3, (500, 2))
    fits = np.all([mesh.clearances(points, 1.0) > r for mesh, r in zip(meshes, need.radii[2], strict=True)], axis=0)
    goal, *starts = points[fits]
    rate, first = weighted_region.rates(polygons, need.radii, need.costs)
    cost = weighted_region.costs_to(rate, first, goal)
    planner = Planner(meshes, BEHAVIORS, areas=rooms, terms=np.zeros(4))
    found = []
    for start in starts:
        least = weighted_region.cost_at(cost, first, start)
        if np.hypot(*(start - goal)) > 3.0 and np.isfinite(least) and len(found) < STARTS:
            path = planner.plan(start, goal, margin=False)
            found.append((path.cost / least - 1.0, path.gap))
    return found


def test_layered_plans_cost_little_more_than_the_reference():
    more = np.concatenate([excess(seed) for seed in range(8)])
    assert len(more) == 8 * STARTS
    more, gaps = more.T
    assert gaps.mean() <= 0.08
    assert more.mean() <= 0.02
    assert np.quantile(more, 0.95) <= 0.08
    # The reference closes gaps that are not wider than needed by its spacing, but no others.
    assert more.min() > -0.03


def test_the_reference_knows_straight_lines_and_detours():
    room = shapely.box(0.0, 0.0, 6.0, 6.0)
    goal, start = np.array([5.0, 3.0]), np.array([1.0, 3.0])
    open_rate, first = weighted_region.rates([room], np.array([[0.3]]), np.array([1.0]))
    assert weighted_region.cost_at(weighted_region.costs_to(open_rate, first, goal), first, start) == pytest.approx(
        4.0, rel=2e-3
    )
    wall = shapely.box(2.9, 0.0, 3.1, 4.0)
    rate, first = weighted_region.rates([room.difference(wall)], np.array([[0.3]]), np.array([1.0]))
    # Around both corners of the wall: two tangents, and arcs of radius 0.3 m.
    tangent = np.hypot(1.9, 1.0)
    side = np.sqrt(tangent**2 - 0.3**2)
    turn = np.arctan2(1.0, 1.9) + np.arcsin(0.3 / tangent)
    expected = 2.0 * side + 2.0 * 0.3 * turn + 0.2
    cost = weighted_region.costs_to(rate, first, goal)
    assert weighted_region.cost_at(cost, first, start) == pytest.approx(expected, rel=1e-2)
