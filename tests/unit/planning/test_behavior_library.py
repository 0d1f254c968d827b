import shutil

import numpy as np
import pytest

from crowdsim.errors import BehaviorError, MotionError
from crowdsim.library import library_folder
from crowdsim.planning.behavior_library import load_behavior_set

BANDS = [(0.10, 2.0), (0.80, 1.50)]
WALKS = ("16_15_*.bvh", "16_31_*.bvh", "16_33_*.bvh")


@pytest.fixture(scope="module")
def default():
    return load_behavior_set(["frontal", "lateral", "arm_constrained"], BANDS)


def test_least_preferred_comes_first_and_is_narrowest(default):
    assert [behavior.name for behavior in default.behaviors] == ["lateral", "arm_constrained", "frontal"]
    torso = [behavior.radii[1] for behavior in default.behaviors]
    cost = [behavior.cost_per_meter for behavior in default.behaviors]
    assert (np.diff(torso) > 0.02).all()
    assert (np.diff(cost) < 0).all()
    assert all(0.1 < radius < 0.45 for behavior in default.behaviors for radius in behavior.radii)


def test_graph_carries_every_behavior(default):
    arrays = default.graph.arrays
    moving = arrays.node_behavior[~arrays.node_idle]
    assert set(moving.tolist()) == {0, 1, 2}
    assert (np.bincount(moving) > 1).all()
    assert arrays.node_ends_standing.any()


def test_order_of_names_does_not_matter(default):
    again = load_behavior_set(["arm_constrained", "frontal", "lateral"], BANDS)
    assert [b.name for b in again.behaviors] == [b.name for b in default.behaviors]
    assert all((a.radii == b.radii).all() for a, b in zip(again.behaviors, default.behaviors, strict=True))


def test_one_behavior_alone():
    alone = load_behavior_set(["frontal"], BANDS)
    assert [behavior.name for behavior in alone.behaviors] == ["frontal"]
    assert set(alone.graph.arrays.node_behavior.tolist()) == {0}


def test_behaviors_that_contradict_each_other(tmp_path):
    library = tmp_path / "behaviors"
    shutil.copytree(library_folder("behaviors"), library)
    file = library / "lateral" / "behavior.yaml"
    text = file.read_text(encoding="utf-8")
    assert "cost_per_meter: 3" in text
    file.write_text(text.replace("cost_per_meter: 3", "cost_per_meter: 0"), encoding="utf-8")
    with pytest.raises(BehaviorError, match=r"lateral.behavior\.yaml:\d+: cost_per_meter"):
        load_behavior_set(["lateral", "frontal"], BANDS, library)
    lines = [("cost_per_meter: 0.5" if line.startswith("cost_per_meter") else line) for line in text.splitlines()]
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(BehaviorError, match=r"'lateral' is narrower than 'frontal'.*raise cost_per_meter"):
        load_behavior_set(["lateral", "frontal"], BANDS, library)


def test_captured_walks_give_frontal_and_held_arms(shared):
    made = load_behavior_set(["frontal", "arm_constrained"], BANDS, captures=shared / "mocap", capture_patterns=WALKS)
    assert [behavior.name for behavior in made.behaviors] == ["arm_constrained", "frontal"]
    assert made.behaviors[0].radii[1] < made.behaviors[1].radii[1] - 0.02
    arrays = made.graph.arrays
    source = np.repeat(np.arange(len(arrays.node_frames)), np.diff(arrays.edge_start))
    changes = set(
        zip(arrays.node_behavior[source].tolist(), arrays.node_behavior[arrays.edge_target].tolist(), strict=True)
    )
    assert {(0, 1), (1, 0)} <= changes


def test_captured_walks_give_no_side_stepping(shared):
    with pytest.raises(BehaviorError, match=r"no 'lateral'; name only frontal and arm_constrained"):
        load_behavior_set(["lateral", "frontal"], BANDS, captures=shared / "mocap", capture_patterns=WALKS)


def test_no_capture_matches(tmp_path):
    with pytest.raises(MotionError, match=r"no file in .* matches \*\.bvh"):
        load_behavior_set(["frontal"], BANDS, captures=tmp_path)
    with pytest.raises(MotionError, match="no folder of captures"):
        load_behavior_set(["frontal"], BANDS, captures=tmp_path / "absent")
