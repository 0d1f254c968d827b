import shutil

import numpy as np
import pytest

from crowdsim.behaviors.captured import REST_SECONDS, SWAY, captured_clips
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import BehaviorError, MotionError
from crowdsim.motion.clips.tracks import track_of

BANDS = ((0.1, 2.0), (0.8, 1.5))
PATTERNS = ("16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*")
FEW = ("16_15*", "16_31*", "16_33*")


@pytest.fixture(scope="module")
def captures(shared):
    return shared / "mocap"


@pytest.fixture(scope="module")
def both(captures):
    return load_behavior_set(["frontal", "arm_constrained"], BANDS, captures=captures, capture_patterns=PATTERNS)


def node_names(behavior_set, behavior):
    graph = behavior_set.graph
    return [name for i, name in enumerate(graph.node_names) if graph.arrays.node_behavior[i] == behavior]


def assert_all_can_stop(graph):
    assert graph.node_ends_standing[~graph.node_idle].any()
    assert ((graph.stop_edge != NONE) | graph.node_ends_standing).all()


def test_frontal_alone(captures):
    found = load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=PATTERNS)
    assert [behavior.name for behavior in found.behaviors] == ["frontal"]
    assert 0.25 < found.behaviors[0].radii[1] < 0.45
    assert found.graph.report.dropped == ()
    assert not any("arms" in name or "held" in name for name in found.graph.node_names)
    assert_all_can_stop(found.graph.arrays)


def test_held_arms_make_the_same_walks_narrower(both):
    held, free = both.behaviors
    assert (held.name, free.name) == ("arm_constrained", "frontal")
    assert held.radii[1] < free.radii[1] - 0.05
    assert held.radii[0] == pytest.approx(free.radii[0], abs=0.01)
    assert_all_can_stop(both.graph.arrays)


def test_arms_come_in_and_go_out_while_walking(both):
    graph = both.graph.arrays
    assert {name.partition(":")[0].partition("_held")[0] for name in node_names(both, 0)} == {
        name.partition(":")[0] for name in node_names(both, 1) if "_arms_" not in name
    }
    leads = {
        (int(graph.node_behavior[graph.edge_target[edge]]))
        for node, name in enumerate(both.graph.node_names)
        if "_arms_in:" in name
        for edge in range(graph.edge_start[node], graph.edge_start[node + 1])
        if "_arms_" not in both.graph.node_names[graph.edge_target[edge]]
    }
    assert leads == {0}


def test_arm_constrained_alone_has_no_transitions(captures):
    clips = captured_clips(captures, FEW, ["arm_constrained"])
    assert set(clips) == {"arm_constrained"}
    assert clips["arm_constrained"].transitions == ()
    found = load_behavior_set(["arm_constrained"], BANDS, captures=captures, capture_patterns=FEW)
    assert_all_can_stop(found.graph.arrays)


def test_waiting_stays_in_its_place_and_repeats(captures):
    (rest,) = captured_clips(captures, PATTERNS, ["frontal"])["frontal"].idle
    track = track_of(rest)
    assert rest.duration == pytest.approx(REST_SECONDS)
    assert np.hypot(*(track - track[0])[:, :2].T).max() <= SWAY + 1e-3
    assert rest.joint_positions[-1] == pytest.approx(rest.joint_positions[0], abs=1e-9)
    feet = [rest.skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
    speed = np.linalg.norm(np.diff(rest.joint_positions[:, feet], axis=0), axis=-1) * CAPTURE_RATE
    assert speed.max() < 0.05


def test_no_folder(tmp_path):
    with pytest.raises(MotionError, match=r"no folder of captures .*nowhere; correct 'motion.captures'"):
        captured_clips(tmp_path / "nowhere", PATTERNS, ["frontal"])


def test_no_file_matches(tmp_path):
    with pytest.raises(MotionError, match=r"no file in .* matches a\*, b\*; correct 'motion.clips'"):
        captured_clips(tmp_path, ["a*", "b*"], ["frontal"])


def test_nobody_stands(captures):
    with pytest.raises(MotionError, match=r"nobody ever stands still in the captures of .*add a walk that starts from"):
        captured_clips(captures, ["16_15*", "16_47*"], ["frontal"])


def test_walks_give_no_side_steps(captures):
    with pytest.raises(BehaviorError, match="give no 'lateral'; name only frontal and arm_constrained in 'behaviors'"):
        load_behavior_set(["lateral", "frontal"], BANDS, captures=captures)


def test_files_of_different_skeletons(captures, tmp_path):
    for pattern in (*FEW, "17_03*"):
        for path in captures.glob(pattern):
            shutil.copy(path, tmp_path)
    with pytest.raises(MotionError, match=r"'16_15.*' and '17_03.*'.*one graph needs one skeleton"):
        load_behavior_set(["frontal"], BANDS, captures=tmp_path)
