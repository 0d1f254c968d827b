"""Sections of plans keep what they promise: discs swept along them in the layers, bodies posed along them in 3D."""

import numpy as np
import pytest
import shapely

from crowdsim.bench import plan_soundness
from crowdsim.crowd.place import Place
from crowdsim.crowd.setting import prepare
from crowdsim.environment.solids import centered_box
from crowdsim.motion.body_capsules import Capsules
from crowdsim.planning.annotated_path import AnnotatedPath, Section
from crowdsim.planning.requirements import Requirements
from crowdsim.scenario.loader import load_scenario

SECTIONS = 120


@pytest.mark.parametrize(
    ("name", "overrides"),
    [("clutter", ["clutter.density=normal"]), ("clutter", ["clutter.density=dense"]), ("apartment", [])],
)
def test_discs_swept_along_sections_touch_nothing(name, overrides):
    scenario = load_scenario(name, overrides)
    place = Place(prepare(scenario), scenario.changes())
    paths = plan_soundness.random_paths(place, SECTIONS, seed=4)
    assert sum(len(path.sections) for path in paths) >= SECTIONS
    layers = [layer.free for layer in place.setting.layers]
    assert plan_soundness.worst_clearance(layers, place.setting.need, paths) <= 1e-5


def test_a_disc_that_reaches_too_far_is_noticed():
    need = Requirements(np.array([[0.3]]), np.array([[0.3]]), np.array([1.0]), np.array([False]))
    room = shapely.box(0.0, 0.0, 4.0, 1.0)
    points = np.array([[0.5, 0.28], [3.5, 0.28]])
    path = AnnotatedPath(points, np.array([0.0, 3.0]), (Section(0, 0.0, 3.0),), 3.0)
    assert plan_soundness.worst_clearance([room], need, [path]) == pytest.approx(0.02)
    outside = AnnotatedPath(points - [0.0, 0.5], path.arc, path.sections, 3.0)
    assert plan_soundness.worst_clearance([room], need, [outside]) == 0.3


def test_bodies_posed_along_a_path_reach_as_far_into_a_box_as_they_do():
    upright = Capsules(np.array([[[[0.0, 0.2, 0.5], [0.0, 0.2, 1.5]]]]), np.array([0.1]))
    points = np.array([[0.0, 0.0], [4.0, 0.0]])
    path = AnnotatedPath(points, np.array([0.0, 4.0]), (Section(0, 0.0, 4.0),), 4.0)
    stride, facing = np.ones(1), np.zeros(1)
    for bottom, top, depth in ((0.0, 2.0, 0.03), (0.0, 0.05, -0.1), (1.6, 2.0, 0.1 - np.hypot(0.07, 0.1))):
        box = centered_box("box", (2.0, 0.77), (1.0, 1.0), bottom, top, 0.0)
        reached = plan_soundness.worst_penetration([box], [upright], stride, facing, path)
        assert reached == pytest.approx(depth, abs=1e-9)


def test_distances_from_an_upright_solid_are_negative_inside():
    box = centered_box("box", (0.0, 0.0), (2.0, 2.0), 0.0, 1.0, 0.0)
    places = np.array([[0.0, 0.0, 0.5], [0.9, 0.0, 0.5], [1.3, 0.0, 1.4], [0.0, 0.0, 1.2], [2.0, 0.0, 0.5]])
    np.testing.assert_allclose(plan_soundness.distances(box, places), [-0.5, -0.1, 0.5, 0.2, 1.0])
