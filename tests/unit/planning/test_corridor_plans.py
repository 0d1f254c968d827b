"""Plans through the corridor of the scenario library, with the bodies of the default set."""

import numpy as np
import pytest

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.library import library_folder
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import Planner
from crowdsim.scenario.loader import load_scenario

WALLS = {"arm_constrained": (5.5, 8.0), "lateral": (16.5, 18.0)}


@pytest.fixture(scope="module")
def scenario():
    return load_scenario(library_folder("scenarios") / "corridor.yaml")


@pytest.fixture(scope="module")
def plan(scenario):
    layers = scenario.environment.layers
    behaviors = load_behavior_set(scenario.behaviors, [(layer.low, layer.high) for layer in layers]).behaviors
    planner = Planner([NavMesh(layer.free) for layer in layers], behaviors)

    def call(start, goal):
        """The path, and (name, x where it begins, x where it ends) of each section."""
        path = planner.plan(start, goal)
        return path, [
            (behaviors[section.behavior].name, *path.at(np.array(section[1:]))[:, 0]) for section in path.sections
        ]

    return call


def places(region, count, seed):
    xmin, ymin, xmax, ymax = region.rectangle
    return np.random.default_rng(seed).uniform((xmin, ymin), (xmax, ymax), (count, 2))


def test_every_walker_changes_its_behavior_where_it_must(scenario, plan):
    walkers = scenario.agents[0]
    for start, goal in zip(places(walkers.start, 12, 1), places(walkers.goal, 12, 2), strict=True):
        path, sections = plan(start, goal)
        assert [name for name, _, _ in sections] == ["frontal", "arm_constrained", "frontal", "lateral", "frontal"]
        for name, begin, end in sections[1::2]:
            low, high = WALLS[name]
            assert low - 0.4 < begin < low
            assert high < end < high + 0.4
        inside = path.at(np.linspace(0.0, path.length, 400))
        for low, high in ((5.5, 8.0), (11.0, 13.5), (16.5, 18.0)):
            assert np.abs(inside[(inside[:, 0] > low) & (inside[:, 0] < high)][:, 1]).max() < 0.07


@pytest.mark.parametrize(
    ("start", "names"),
    [
        ((5.2, 0.0), ["arm_constrained", "frontal", "lateral", "frontal"]),
        ((5.0, 0.6), ["arm_constrained", "frontal", "lateral", "frontal"]),
        ((5.2, -0.7), ["arm_constrained", "frontal", "lateral", "frontal"]),
        ((6.5, 0.06), ["arm_constrained", "frontal", "lateral", "frontal"]),
        ((12.2, 0.1), ["frontal", "lateral", "frontal"]),
        ((17.2, 0.1), ["lateral", "frontal"]),
    ],
)
def test_plans_from_where_someone_came_to_rest(plan, start, names):
    path, sections = plan(start, (20.5, 0.0))
    assert path.points[0] == pytest.approx(start)
    assert [name for name, _, _ in sections] == names
