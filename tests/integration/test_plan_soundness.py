"""Sections of plans keep what they promise: discs swept along them in the layers, bodies posed along them in 3D."""

import numpy as np
import pytest
import shapely

from crowdsim.bench.plans import plan_soundness
from crowdsim.bench.plans.planner_comparison import ground_of
from crowdsim.bench.plans.posed_bodies import Obstacles, motions_of, posed_along
from crowdsim.errors import CrowdSimError
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section
from crowdsim.planning.query.requirements import Requirements

SECTIONS = 120


@pytest.mark.parametrize("name", ["normal", "dense", "apartment"])
def test_discs_and_bodies_along_sections_touch_nothing(name):
    ground = ground_of(name)
    paths = plan_soundness.random_paths(ground, SECTIONS, seed=4)
    assert sum(len(path.sections) for path in paths) >= SECTIONS
    assert plan_soundness.worst_clearance(ground.layers, plan_soundness.needs_of(ground), paths) <= 1e-5
    motions, obstacles = motions_of(ground.behaviors), Obstacles(ground.solids)
    # Of both planners, with and without the margin.
    for path in paths[::3]:
        assert obstacles.depths(posed_along(path, motions)).max() <= plan_soundness.DEEP


def test_the_benchmark_has_a_row_for_each_place_that_is_there(monkeypatch, tmp_path):
    monkeypatch.setattr(plan_soundness, "PLACES", ("normal", "small_house"))
    measured = plan_soundness.measure(worlds=tmp_path, sections=6)
    assert [row["place"] for row in measured.rows] == ["normal"]
    assert measured.figures["sections"] >= 3.0
    assert 0.0 <= measured.figures["penetration_worst_m"] <= plan_soundness.DEEP
    assert measured.figures["soundness_worst_m"] <= 1e-5


def test_too_few_sections_for_a_path_are_refused(monkeypatch):
    monkeypatch.setattr(plan_soundness, "PLACES", ("normal",))
    with pytest.raises(CrowdSimError, match="normal: no path was found for 0 sections"):
        plan_soundness.measure(sections=0)


def test_a_disc_that_reaches_too_far_is_noticed():
    alone = np.array([[0.3]])
    need = Requirements(alone, alone, np.array([1.0]), np.array([False]), np.zeros((1, 2, 1)))
    room = shapely.box(0.0, 0.0, 4.0, 1.0)
    points = np.array([[0.5, 0.28], [3.5, 0.28]])
    path = AnnotatedPath(points, np.array([0.0, 3.0]), (Section(0, 0.0, 3.0),), 3.0)
    assert plan_soundness.worst_clearance([room], need, [path]) == pytest.approx(0.02)
    outside = AnnotatedPath(points - [0.0, 0.5], path.arc, path.sections, 3.0)
    assert plan_soundness.worst_clearance([room], need, [outside]) == 0.3
