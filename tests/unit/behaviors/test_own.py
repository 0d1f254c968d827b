"""Behaviors of folders of captures beside a scenario: what they become, and what is told of those that cannot."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.behaviors.made_walks import find_maker
from crowdsim.errors import ScenarioError
from crowdsim.library import library_folder
from crowdsim.motion.captures.other_joints import on_joints_of
from crowdsim.motion.captures.reader import read_capture, read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import about_axis
from crowdsim.motion.synthesis.body import default_skeleton
from crowdsim.scenario.loader import parse_scenario

BANDS = ((0.1, 2.0), (0.65, 1.5))
HEAD = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 9, 4]}\n"
AGENTS = "agents: [{name: a, count: 1, start: {point: [1, 2]}, goal: {point: [8, 2]}}]\n"
LIBRARY = library_folder("behaviors")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "stroll").mkdir()
    shutil.copy(LIBRARY / "frontal" / "clips" / "walk_slow.bvh", tmp_path / "stroll")
    (tmp_path / "stroll" / "behavior.yaml").write_text("cost_per_meter: 0.9\n")
    return tmp_path


def complaints(folder: Path, keys: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(HEAD + keys + AGENTS, folder / "a.yaml")
    return str(caught.value)


def test_the_cheapest_is_the_preferred_one_however_they_are_listed(folder):
    for names in (["./stroll", "frontal"], ["frontal", "stroll/"]):
        found = load_behavior_set(names, BANDS, beside=folder)
        assert [behavior.name for behavior in found.behaviors] == ["frontal", "stroll"]
        own = found.behaviors[1]
        assert own.color == "#2ca02c"
        assert own.folder == folder / "stroll"
        assert 0.1 < own.radii[0] <= own.radii[1] < 0.5
        assert own.speed == pytest.approx(find_maker(found.clips[1].clips[:1]).speed, abs=0.05)
        assert any("'stroll' reaches" in note for note in found.notes)
        used = set(found.graph.arrays.node_behavior[found.graph.arrays.node_idle].tolist())
        assert used == {0, 1}


def test_planted_feet_stand_where_one_walk_goes_over_into_another(folder):
    found = load_behavior_set(["./stroll", "frontal"], BANDS, beside=folder)
    for clip, _, _ in found.clips[1].transitions:
        for side in ("left", "right"):
            ball = clip.joint_positions[:, clip.skeleton.joint(f"{side}_toe")]
            speed = np.linalg.norm(np.diff(ball, axis=0), axis=1) * 120.0
            assert np.quantile(speed, 0.25) < 0.005


def test_a_capture_with_other_joints_moves_the_bones_of_the_library(shared):
    walk = read_capture(shared / "mocap" / "16_15_walk_straight_slow_a.bvh").clips[0]
    skeleton = read_clip(LIBRARY / "frontal" / "clips" / "walk.bvh").skeleton
    moved = on_joints_of(walk, skeleton)
    assert moved.skeleton is skeleton
    scale = skeleton.leg_length() / walk.skeleton.leg_length()
    for role in ("left_ankle", "right_ankle", "left_knee", "head", "chest"):
        before = walk.joint_positions[:, walk.skeleton.joint(role)] * scale
        after = moved.joint_positions[:, skeleton.joint(role)]
        assert np.abs(before - after).mean() < 0.03, role
    assert moved.joint_positions[..., 2].min() == pytest.approx(walk.joint_positions[..., 2].min())


def test_hips_below_a_root_of_their_own_do_not_bend_with_the_chest():
    body = default_skeleton()
    skeleton = replace(
        body,
        names=("Root", *body.names),
        parents=np.concatenate([[-1], body.parents + 1]).astype(np.int32),
        offsets=np.concatenate([[[0.0, 0.0, 0.0]], body.offsets]),
        end_parents=body.end_parents + 1,
        roles={role: joint + 1 for role, joint in body.roles.items()},
    )
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (3, body.joint_count, 1))
    rotations[:, body.joint("chest")] = about_axis(np.array([0.0, 1.0, 0.0]), 0.8)
    moved = on_joints_of(Clip("bow", body, np.zeros((3, 3)), rotations), skeleton)
    hips, spine = skeleton.joint("hips"), skeleton.joint("chest") - 1
    assert np.allclose(moved.rotations[:, hips], [1.0, 0.0, 0.0, 0.0])
    assert np.allclose(moved.rotations[:, spine], about_axis(np.array([0.0, 1.0, 0.0]), 0.4))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("cost_per_meter: 0", "behavior.yaml:1:17: cost_per_meter: must be greater than 0"),
        ("speed: 1", "cost_per_meter: this key is required and missing"),
        ("cost_per_meter: 1\ncolour: red", "behavior.yaml:2:1: colour: unknown key; did you mean 'color'?"),
        (
            "cost_per_meter: 1\nname: crouch",
            "behavior.yaml:2:7: name: 'crouch' is not the name of its folder, 'stroll'",
        ),
        ("cost_per_meter: 1\nclips: [{file: a.bvh}]", "behavior.yaml:2:16: clips.0.file: 'a.bvh' is missing in"),
        ("cost_per_meter: 1\nfacing: [90]", "behavior.yaml:2:9: facing: captures give behaviors that go ahead"),
        ("cost_per_meter: 1\nidle: [{file: walk_slow.bvh}]", "'speed' is missing, which goes with 'idle'"),
    ],
)
def test_what_is_wrong_with_the_file_is_told_with_both_places(folder, text, told):
    (folder / "stroll" / "behavior.yaml").write_text(text)
    message = complaints(folder, "behaviors: [frontal, ./stroll]\n")
    assert message.startswith(f"{folder / 'a.yaml'}:6:22: behaviors.1: {folder / 'stroll' / 'behavior.yaml'}")
    assert told in message


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("behaviors: [./strol]\n", "a.yaml:6:13: behaviors.0: there is no "),
        ("behaviors: [stroll]\n", "unknown behavior 'stroll'; for the folder beside this file write ./stroll"),
        ("behaviors: [./stroll, frontal, stroll/]\n", "a.yaml:6:32: behaviors.2: 'stroll' is named twice"),
        ("behaviors: [./stroll]\nplanner: collision3d\n", "'collision3d' knows the bodies of the library"),
        ("behaviors: [./stroll]\nmotion: {captures: stroll}\n", "own behaviors go with a built-in 'motion' set"),
    ],
)
def test_entries_that_cannot_be(folder, keys, told):
    assert told in complaints(folder, keys)


def test_a_saved_scenario_names_the_folder_from_where_it_is(folder, tmp_path_factory):
    loaded = parse_scenario(HEAD + "behaviors: [./stroll, frontal]\n" + AGENTS, folder / "a.yaml")
    (folder / "deeper").mkdir()
    loaded.save(folder / "deeper" / "b.yaml")
    assert "../stroll" in (folder / "deeper" / "b.yaml").read_text()
    loaded.save(folder / "stroll.yaml")
    assert "./stroll" in (folder / "stroll.yaml").read_text()
