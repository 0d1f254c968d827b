"""The sets made in other manners: bodies that could be real, graphs that hold together, the mood they are named for."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest

from crowdsim.behaviors.behavior import read_behavior
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
from crowdsim.behaviors.styled import styled_clips
from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import BehaviorError, MotionError
from crowdsim.library import library_folder
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.features import CrossingDetector
from crowdsim.motion.graph.motion_graph import MotionSource, build_motion_graph
from crowdsim.motion.graph.transition_drift import clip_stances, transition_drifts
from crowdsim.motion.synthesis.dance import dance_plans
from crowdsim.motion.synthesis.library import motion_database, synthesize_set
from crowdsim.motion.synthesis.styles import DANCING, HAPPY, MANNERS, PLAIN, Manner, find_manner
from crowdsim.scenario.schema.agents import Motion
from tests.support.gait_figures import LIMITS, angles, body_angles, gait_figures
from tests.unit.motion.synthesis.test_gait_bands import hinge
from tests.unit.motion.synthesis.test_gait_set import SHIPPED, knee_bend, role, soles

STYLED = (HAPPY, DANCING)
BEHAVIORS = ("lateral", "arm_constrained", "frontal")
BANDS = ((0.0, 0.6), (0.6, 2.0))


@cache
def made(manner: Manner) -> dict[str, Clip]:
    return {f"{folder}/{name}": clip for folder, name, clip in synthesize_set(manner)}


@cache
def loaded(name: str) -> BehaviorSet:
    return load_behavior_set(BEHAVIORS, BANDS, motion_set=name)


def names_of(manner: Manner) -> list[str]:
    """Names of the clips of a set, told without making them: those of the default set, and dances."""
    dances = [f"frontal/{plan.name}.bvh" for plan in dance_plans()] if manner is DANCING else []
    return [name.replace("/clips/", "/") for name in SHIPPED] + dances


NAMES = [(manner, name) for manner in STYLED for name in names_of(manner)]


@pytest.mark.parametrize("manner", STYLED, ids=lambda manner: manner.name)
def test_all_clips_of_a_set_are_looked_at(manner: Manner) -> None:
    assert sorted(names_of(manner)) == sorted(made(manner))


@pytest.mark.parametrize(("manner", "name"), NAMES, ids=[f"{manner.name}/{name}" for manner, name in NAMES])
def test_bodies_stay_within_human_limits_on_feet_that_stand(manner: Manner, name: str) -> None:
    """The limits of the default set: no leg over-reaches, no joint goes where a healthy adult's does not."""
    clip = made(manner)[name]
    for side in ("left", "right"):
        assert knee_bend(clip, side).min() > 5.5
        flexion, bend, lift = hinge(clip, side)
        assert -25.0 <= flexion.min() <= flexion.max() <= 120.0
        assert bend.max() <= 140.0
        assert -50.0 <= lift.min() <= lift.max() <= 35.0
        arm = [role(clip, f"{side}_{part}") for part in ("shoulder", "elbow", "wrist")]
        assert angles(arm[1] - arm[0], arm[2] - arm[1]).max() <= 150.0
    for part, degrees in body_angles(clip).items():
        assert LIMITS[part][0] <= degrees.min() <= degrees.max() <= LIMITS[part][1], part
    heights = np.stack([soles(clip, side) for side in ("left", "right")])
    assert heights.min() > -0.01
    assert heights.min(axis=(0, 2)).max() < 0.005
    velocity = np.diff(clip.joint_positions, axis=0) * CAPTURE_RATE
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max() < 2.0
    assert max(stance.drift for stance in clip_stances(clip)) <= 0.01


@pytest.mark.parametrize("manner", STYLED, ids=lambda manner: manner.name)
def test_a_set_forms_one_graph_whose_transitions_do_not_skate(manner: Manner) -> None:
    graph = loaded(manner.name).graph
    assert graph.report.dropped == ()
    assert set(graph.arrays.node_behavior) == {0, 1, 2}
    assert graph.report.branching > 1.9
    assert ((graph.arrays.stop_edge >= 0) == ~graph.arrays.node_ends_standing).all()
    clips = [replace(clip, name=name) for name, clip in made(manner).items() if "/stand." not in name]
    sources = [MotionSource(clip, 0, ("crossing", "standing")) for clip in clips]
    drift = transition_drifts(build_motion_graph(sources), clips)
    assert len(drift.edge) > 1000
    assert drift.played.max() <= 0.01


def walking(manner: Manner) -> tuple[dict[str, float], Clip]:
    """Gait figures of a steady cycle of the straight walk, and its frames."""
    clip = made(manner)["frontal/walk.bvh"]
    cuts = CrossingDetector().cuts(clip).tolist()
    first, last = next((a, b) for a, b in pairwise(cuts) if b - a == manner.normal.cycle)
    rows = slice(first, last + 1)
    return gait_figures(clip, first, last), replace(
        clip, root_positions=clip.root_positions[rows], rotations=clip.rotations[rows]
    )


def arm_reach(clip: Clip) -> float:
    """Meters that a wrist moves back and forth beside the body."""
    return float(np.ptp(role(clip, "left_wrist")[:, 0] - clip.root_positions[:, 0]))


def test_happy_walking_is_quicker_springier_and_swings_its_arms() -> None:
    (plain, plain_clip), (happy, happy_clip) = walking(PLAIN), walking(HAPPY)
    assert happy["cadence_steps_min"] > plain["cadence_steps_min"] + 8.0
    assert happy["vertical_cm"] > plain["vertical_cm"] + 1.0
    assert happy["left_knee_swing_deg"] > plain["left_knee_swing_deg"] + 4.0
    assert arm_reach(happy_clip) > 1.4 * arm_reach(plain_clip)
    nose = [role(clip, "head") - role(clip, "neck") for clip in (plain_clip, happy_clip)]
    assert (nose[1][:, 0] / nose[1][:, 2]).mean() < (nose[0][:, 0] / nose[0][:, 2]).mean()


def test_dancers_sway_with_raised_arms_and_get_around() -> None:
    (plain, _), (dance, clip) = walking(PLAIN), walking(DANCING)
    assert dance["lateral_cm"] > 1.5 * plain["lateral_cm"]
    for side in ("left", "right"):
        assert (role(clip, f"{side}_wrist")[:, 2] > role(clip, f"{side}_elbow")[:, 2]).all()
    around = made(DANCING)["frontal/dance_around_left.bvh"]
    hips = role(around, "left_hip") - role(around, "right_hip")
    assert np.ptp(np.unwrap(np.arctan2(hips[:, 1], hips[:, 0]))) > np.radians(355.0)


def test_a_database_names_each_clip_once_and_edits_none() -> None:
    clips = motion_database(PLAIN)
    names = [clip.name for clip in clips]
    assert len(set(names)) == len(names)
    assert {"walk", "side_left", "walk_to_side_left", "stand"} <= set(names)
    assert not [name for name in names if name.startswith("arms_")]


def test_a_database_is_unedited_whatever_other_behaviors_have(monkeypatch: pytest.MonkeyPatch) -> None:
    made_clips = synthesize_set(PLAIN)
    held = next(clip for folder, name, clip in made_clips if (folder, name) == ("arm_constrained", "walk.bvh"))
    more = [
        ("another", name, Clip(name.removesuffix(".bvh"), held.skeleton, held.root_positions, held.rotations))
        for name in ("walk.bvh", "stroll.bvh")
    ]
    monkeypatch.setattr("crowdsim.motion.synthesis.library.synthesize_set", lambda manner: [*more, *made_clips, *more])
    clips = {clip.name: clip for clip in motion_database(PLAIN)}
    assert "stroll" not in clips
    walk = next(clip for folder, name, clip in made_clips if (folder, name) == ("frontal", "walk.bvh"))
    np.testing.assert_array_equal(clips["walk"].rotations, walk.rotations)
    assert (walk.rotations != held.rotations).any()


def test_styled_clips_are_the_behaviors_own_and_more() -> None:
    files = {name: read_behavior(name, library_folder("behaviors")) for name in ("frontal", "lateral")}
    clips = styled_clips("dance", files)
    listed = [entry.file.removeprefix("clips/").removesuffix(".bvh") for entry in files["frontal"].clips]
    names = [clip.name for clip in clips["frontal"].clips]
    assert names[: len(listed)] == listed
    assert sorted(names[len(listed) :]) == sorted(
        f"dance_{step}_{way}" for step in ("sway", "square", "around") for way in ("left", "right")
    )
    assert {(a, b) for _, a, b in clips["lateral"].transitions} == {("frontal", "lateral"), ("lateral", "frontal")}
    assert [clip.name for clip in clips["lateral"].idle] == ["stand"]


def test_a_behavior_that_a_set_does_not_have_is_named() -> None:
    file = read_behavior("frontal", library_folder("behaviors"))
    with pytest.raises(BehaviorError, match=r"'happy' has no 'clips/walk\.bvh' for 'crawling'"):
        styled_clips("happy", {"crawling": file.model_copy(update={"name": "crawling"})})


def test_scenarios_can_name_every_set_and_no_other() -> None:
    allowed = get_args(get_args(Motion.model_fields["set"].annotation)[0])
    assert allowed == tuple(MANNERS)
    with pytest.raises(MotionError, match="'hapy'; there are default, happy, dance"):
        find_manner("hapy")
