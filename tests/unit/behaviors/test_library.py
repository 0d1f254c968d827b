import shutil

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.constants import NONE
from crowdsim.errors import BehaviorError
from crowdsim.library import library_folder

BANDS = ((0.1, 2.0), (0.8, 1.5))
DEFAULT = ("frontal", "lateral", "arm_constrained")


@pytest.fixture(scope="module")
def default():
    return load_behavior_set(DEFAULT, BANDS)


@pytest.fixture
def library(tmp_path):
    """A copy of the built-in library that a test may spoil."""
    return shutil.copytree(library_folder("behaviors"), tmp_path / "behaviors")


def replace(library, name, old, new):
    path = library / name / "behavior.yaml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_default_set_is_ordered_by_width_whatever_the_order_asked_for(default):
    assert [behavior.name for behavior in default.behaviors] == ["lateral", "arm_constrained", "frontal"]
    legs, torso = np.array([behavior.radii for behavior in default.behaviors]).T
    assert (np.diff(torso) > 0.03).all()
    assert torso == pytest.approx([0.15, 0.26, 0.31], abs=0.03)
    assert legs == pytest.approx(np.full(3, 0.17), abs=0.03)


def test_default_set_is_one_graph_of_all_behaviors(default):
    graph = default.graph.arrays
    source = np.repeat(np.arange(len(graph.node_frames)), np.diff(graph.edge_start))
    edges = csr_array((np.ones(len(source)), (source, graph.edge_target)), shape=(len(graph.node_frames),) * 2)
    assert connected_components(edges, directed=True, connection="strong")[0] == 1
    assert default.graph.report.dropped == ()
    assert set(graph.node_behavior.tolist()) == {0, 1, 2}
    assert set(graph.node_behavior[graph.node_idle].tolist()) == {0, 1, 2}


def test_everyone_in_the_default_set_can_stop(default):
    graph = default.graph.arrays
    for node in range(len(graph.node_frames)):
        for _ in range(4):
            if graph.node_ends_standing[node]:
                break
            assert graph.stop_edge[node] != NONE
            node = graph.edge_target[graph.stop_edge[node]]
        assert graph.node_ends_standing[node]


def test_transition_carries_the_wider_behavior(default):
    names = [behavior.name for behavior in default.behaviors]
    labels = zip(default.graph.node_names, default.graph.arrays.node_behavior, strict=True)
    of_clip = {node.partition(":")[0]: names[index] for node, index in labels}
    assert of_clip["arms_in_walking"] == "frontal"
    assert of_clip["walk_to_side_left"] == "frontal"


def test_one_behavior_alone():
    alone = load_behavior_set(["frontal"], BANDS)
    assert [behavior.name for behavior in alone.behaviors] == ["frontal"]
    assert not any("arms" in name for name in alone.graph.node_names)


def test_lowest_layer_leaves_hanging_hands_to_the_next(default):
    low, high = load_behavior_set(["frontal"], ((0.1, 0.6), (0.6, 1.0))).behaviors[0].radii
    assert low == default.behaviors[-1].radii[0]
    assert high > low + 0.05


def test_unknown_behavior_names_the_nearest():
    with pytest.raises(BehaviorError, match=r"no behavior 'frontl' .*did you mean 'frontal'"):
        load_behavior_set(["lateral", "frontl"], BANDS)


def test_wider_behavior_must_be_cheaper(library):
    replace(library, "arm_constrained", "cost_per_meter: 1.1", "cost_per_meter: 0.9")
    with pytest.raises(
        BehaviorError, match=r"'arm_constrained' is narrower than 'frontal' \(0.257 m, .*raise cost_per_"
    ):
        load_behavior_set(["arm_constrained", "frontal"], BANDS, library)


def test_behavior_that_nothing_leads_to():
    with pytest.raises(BehaviorError, match=r"no motion leads from 'arm_constrained' to 'lateral' and back; add trans"):
        load_behavior_set(["lateral", "arm_constrained"], BANDS)
