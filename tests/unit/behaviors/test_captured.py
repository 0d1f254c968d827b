import shutil

import numpy as np
import pytest

from crowdsim.behaviors.captured import REST_SECONDS, SWAY
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import MotionError
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


@pytest.fixture(scope="module")
def frontal(captures):
    return load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=PATTERNS)


def node_names(behavior_set, behavior):
    graph = behavior_set.graph
    return [name for i, name in enumerate(graph.node_names) if graph.arrays.node_behavior[i] == behavior]


def assert_all_can_stop(graph):
    assert graph.node_ends_standing[~graph.node_idle].any()
    assert ((graph.stop_edge != NONE) | graph.node_ends_standing).all()


def test_frontal_alone(frontal):
    assert [behavior.name for behavior in frontal.behaviors] == ["frontal"]
    assert 0.25 < frontal.behaviors[0].radii[1] < 0.45
    assert frontal.graph.report.dropped == ()
    assert not any("arms" in name or "held" in name for name in frontal.graph.node_names)
    assert_all_can_stop(frontal.graph.arrays)


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
    found = load_behavior_set(["arm_constrained"], BANDS, captures=captures, capture_patterns=FEW)
    assert found.clips[0].transitions == ()
    assert_all_can_stop(found.graph.arrays)


def test_waiting_stays_in_its_place_and_repeats(frontal):
    (rest,) = frontal.clips[0].idle
    assert rest.name.startswith("16_3")
    track = track_of(rest)
    assert rest.duration == pytest.approx(REST_SECONDS)
    assert np.hypot(*(track - track[0])[:, :2].T).max() <= SWAY + 1e-3
    assert rest.joint_positions[-1] == pytest.approx(rest.joint_positions[0], abs=1e-9)
    feet = [rest.skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
    speed = np.linalg.norm(np.diff(rest.joint_positions[:, feet], axis=0), axis=-1) * CAPTURE_RATE
    assert speed.max() < 0.05


def test_no_folder(tmp_path):
    with pytest.raises(MotionError, match=r"there is no folder of captures .*nowhere"):
        load_behavior_set(["frontal"], BANDS, captures=tmp_path / "nowhere")


def test_no_file_matches(tmp_path):
    with pytest.raises(MotionError, match=r"no file in .* matches a\*, b\*"):
        load_behavior_set(["frontal"], BANDS, captures=tmp_path, capture_patterns=["a*", "b*"])


def linked(captures, folder, *patterns):
    """A folder with the captures that match ``patterns``."""
    for pattern in patterns:
        for path in captures.glob(pattern):
            shutil.copy(path, folder)
    return folder


def test_one_straight_walk_gives_all_behaviors(captures, tmp_path):
    """Nobody stands, turns or steps aside in it: all of that is made of it, and said."""
    found = load_behavior_set(
        ["frontal", "arm_constrained", "lateral"], BANDS, captures=linked(captures, tmp_path, "16_15*")
    )
    assert [behavior.name for behavior in found.behaviors] == ["lateral", "arm_constrained", "frontal"]
    (made,) = [note for note in found.notes if note.startswith("made")]
    for what in ("16_15", "standing", "turns to the left", "turns on the spot to the right", "steps to the side"):
        assert what in made
    graph = found.graph.arrays
    assert_all_can_stop(graph)
    for behavior in range(3):
        assert (graph.node_idle & (graph.node_behavior == behavior)).any()
    assert any(name.startswith("16_15") for name in found.graph.node_names)
    # A made stand keeps its feet, and both are beside each other.
    (rest,) = found.clips[2].idle
    feet = rest.joint_positions[:, [rest.skeleton.joint(f"{side}_ankle") for side in ("left", "right")]]
    assert np.ptp(feet, axis=0).max() < 0.01
    assert np.linalg.norm(feet[0, 0, :2] - feet[0, 1, :2]) < 0.3
    assert found.behaviors[0].radii[1] < found.behaviors[1].radii[1] < found.behaviors[2].radii[1]


def test_what_is_made_is_joined_to_what_is_captured(captures):
    found = load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=["16_47*"])
    graph, names = found.graph.arrays, found.graph.node_names
    own = [node for node, name in enumerate(names) if name.startswith("16_47")]
    targets = [names[graph.edge_target[e]] for n in own for e in range(graph.edge_start[n], graph.edge_start[n + 1])]
    assert len(own) == 2
    assert any(name.startswith("made_halts") for name in targets)


def test_one_lively_clip_makes_nobody_wide(captures, tmp_path):
    """Kicks and a jog beside walks: they are left out by clip and frame, and the walks stay as narrow as alone."""
    walks = ("16_1[1-6]*", "16_47*", "16_58*")
    alone = load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=walks)
    beside = load_behavior_set(["frontal"], BANDS, captures=linked(captures, tmp_path, *walks, "16_43*", "05_14*"))
    assert np.all(beside.behaviors[0].radii <= 1.1 * alone.behaviors[0].radii)
    assert any("16_43_jog" in note and "frames 28 to 81: reaches 0.540 m" in note for note in beside.notes)
    assert any("05_14" in note and "to a side at the torso in frame" in note for note in beside.notes)
    assert not any("16_43" in name for name in beside.graph.node_names)
    assert beside.behaviors[0].widest[0].startswith("clip '16_")


def test_side_steps_are_no_walk_ahead(captures):
    found = load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=["09_12*"])
    assert any("frames 400 to 497" in note and "goes sideways or backwards" in note for note in found.notes)
    assert not any(name.endswith(":400-497") for name in found.graph.node_names)


def test_nobody_walks(captures):
    with pytest.raises(
        MotionError, match=r"no clip walks ahead for a whole stride .*; add a clip that walks straight on"
    ):
        load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=["135_11*"])


def test_nobody_stands_and_no_cycle_to_make_it_of(captures):
    with pytest.raises(
        MotionError, match=r"walks ahead for a whole cycle.*\(standing, .*\); add a clip that walks straight on"
    ):
        load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=["16_3[5-9]*", "16_4[0-4]*"])


def test_no_side_steps_without_a_walk(captures):
    with pytest.raises(
        MotionError, match=r"walks ahead for a whole cycle.*steps to the side\); add a clip that walks straight on"
    ):
        load_behavior_set(["lateral", "frontal"], BANDS, captures=captures, capture_patterns=["05_*"])


def test_people_of_other_size_share_a_skeleton(captures):
    found = load_behavior_set(["frontal"], BANDS, captures=captures, capture_patterns=["16_15*", "16_31*", "09_12*"])
    skeletons = {id(clip.skeleton) for clip in found.clips[0].clips if not clip.name.startswith("made")}
    assert len(skeletons) == 1
    assert any("'09_12" in note and "no motion leads there and back" in note for note in found.notes)


def test_files_of_other_joints_are_left_out(captures):
    found = load_behavior_set(["frontal"], BANDS, captures=captures / "asfamc", capture_patterns=["*.amc", "*.bvh"])
    (note,) = [note for note in found.notes if "cgspeed" in note]
    assert "its joints differ from those of most frames here" in note
    assert "folder of its own" in note
