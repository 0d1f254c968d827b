"""Folders as people bring them: whatever is missing or strange in them, six people walk down a corridor."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crowdsim
from crowdsim.crowd.search.plans import Found
from crowdsim.crowd.systems.replan import Replanning
from crowdsim.ecs.world import View
from crowdsim.errors import MotionError
from crowdsim.motion.captures.bvh_writer import write_bvh
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph import motion_graph
from crowdsim.recording.shown.foot_drift import shown_stances
from tests.support.capture_conventions import CONVENTIONS, VARIANTS, rewritten

CORRIDOR = """\
crowdsim: 1
name: brought
seed: 3
duration: 90.0
floor: {{rectangle: [0.0, -1.2, 14.0, 1.2]}}
motion: {{captures: {folder}}}
obstacles:
  - {{name: north, box: {{min: [6.0, 0.6], max: [7.0, 1.2]}}, top: 1.9}}
  - {{name: south, box: {{min: [6.0, -1.2], max: [7.0, -0.6]}}, top: 1.9}}
agents:
  - name: walkers
    count: 6
    start: {{rectangle: [0.8, -0.5, 1.6, 0.5]}}
    goal: {{rectangle: [12.4, -0.5, 13.2, 0.5]}}
    interval: 4.0
    locomotion: captured
"""

SLOW = ("16_15*", "16_16*")
STANDS = (*SLOW, "16_31*")


def copied(mocap: Path, folder: Path, *patterns: str) -> None:
    for pattern in patterns:
        for path in mocap.glob(pattern):
            shutil.copy(path, folder)


def standing(mocap: Path) -> Clip:
    return read_clip(mocap / "16_31_walk_straight_from_standstill.bvh")


def no_stand(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *SLOW, "16_1[7-9]*", "16_47*")


def no_turn_left(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *STANDS, "16_19*")


def no_straight_walk(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, "16_1[1-4]*", "16_1[7-9]*")


def one_clip(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, "16_15*")


def t_poses(mocap: Path, folder: Path) -> None:
    """A second of calibration before a walk, and nobody who stands otherwise."""
    walk = read_clip(mocap / "16_15_walk_straight_slow_a.bvh")
    rest = np.zeros((60, *walk.rotations.shape[1:]))
    rest[..., 0] = 1.0
    roots = np.concatenate([np.repeat(walk.root_positions[:1], 60, axis=0), walk.root_positions])
    write_bvh(Clip("posed", walk.skeleton, roots, np.concatenate([rest, walk.rotations])), folder / "posed.bvh")
    copied(mocap, folder, "16_16*")


def mixed_skeletons(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *STANDS, "09_12*")
    walk = mocap / "16_47_walk_straight_normal_a.bvh"
    rewritten(walk, folder / "mixamo.bvh", CONVENTIONS["mixamo"], VARIANTS["cm, y up"])


def mixed_rates(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *STANDS)
    file = folder / "16_16_walk_straight_slow_b.bvh"
    head, _, motion = file.read_text().partition("Frames:")
    rows = motion.splitlines()[2:][::4]
    file.write_text("\n".join([f"{head}Frames: {len(rows)}", "Frame Time: 0.0333333", *rows, ""]))


def mixed_units(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, "16_15*", "16_31*")
    for number, variant in enumerate(VARIANTS.values()):
        walk = mocap / "16_16_walk_straight_slow_b.bvh"
        rewritten(walk, folder / f"variant{number}.bvh", CONVENTIONS["cmu"], variant)


def a_silent_clip(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *SLOW)
    clip = standing(mocap)
    roots, rotations = (np.repeat(part[:1], 120, axis=0) for part in (clip.root_positions, clip.rotations))
    write_bvh(Clip("silent", clip.skeleton, roots, rotations), folder / "silent.bvh")


def a_hopping_clip(mocap: Path, folder: Path) -> None:
    copied(mocap, folder, *STANDS)
    clip = standing(mocap)
    roots, rotations = (np.repeat(part[:1], 180, axis=0) for part in (clip.root_positions, clip.rotations))
    roots[:, 2] += 0.25 * np.abs(np.sin(np.arange(180) * np.pi / 30.0))
    write_bvh(Clip("hop", clip.skeleton, roots, rotations), folder / "hop.bvh")


FOLDERS: dict[Callable[[Path, Path], None], str] = {
    no_stand: "standing, setting off and stopping",
    no_turn_left: "walking turns to the left",
    no_straight_walk: "turns on the spot",
    one_clip: "steps to the side",
    t_poses: "standing, setting off and stopping",
    mixed_skeletons: "clip 'mixamo' is left out: its joints differ from those",
    mixed_rates: "turns on the spot",
    mixed_units: "turns on the spot",
    a_silent_clip: "clip 'silent' is left out: it contains no whole stride",
    a_hopping_clip: "clip 'hop' is left out: it contains no whole stride",
}
"""What each is said to lack, among other things."""


@pytest.mark.parametrize("make", FOLDERS, ids=lambda make: make.__name__)
def test_everybody_arrives(shared: Path, tmp_path: Path, make: Callable[[Path, Path], None]) -> None:
    folder = tmp_path / "captures"
    folder.mkdir()
    make(shared / "mocap", folder)
    file = tmp_path / "brought.yaml"
    file.write_text(CORRIDOR.format(folder=folder))
    simulation = crowdsim.Simulation(crowdsim.load_scenario(file))
    assert any(FOLDERS[make] in note for note in simulation.notes), simulation.notes
    with simulation.run(tmp_path / "brought.h5") as recording:
        summary = recording.summary
    assert summary["arrived"] == summary["characters"] == 6
    assert min(summary["obstacle_margin"].values()) >= -0.01


QUEUE = """\
crowdsim: 1
name: queue
seed: 3
duration: 120.0
floor: {{rectangle: [0.0, -2.0, 14.0, 2.0]}}
motion: {{captures: {folder}}}
behaviors: [frontal]
obstacles:
  - {{name: north, box: {{min: [6.5, 0.6], max: [7.5, 2.0]}}, top: 2.5}}
  - {{name: south, box: {{min: [6.5, -2.0], max: [7.5, -0.6]}}, top: 2.5}}
agents:
  - name: walkers
    count: 6
    start: {{rectangle: [0.8, -1.0, 2.0, 1.0]}}
    goal: {{rectangle: [12.0, -1.0, 13.2, 1.0]}}
    interval: 2.0
    locomotion: captured
"""


def all_left_out(candidates: Any, leave: Any, enter: Any, _: float) -> Any:
    """Candidates without the transitions that skate, also where an agent could rest only by one of them."""
    needed = candidates.needed.copy()
    needed[leave, enter] = np.inf
    return replace(candidates, needed=needed)


@pytest.mark.parametrize("is_kept", [True, False], ids=["rests are kept", "rests are left out"])
def test_those_who_have_stopped_before_a_gap_go_on(
    shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_kept: bool
) -> None:
    """Also if no idle clip may follow the stop. Two of three once stood for good, as transitions to rest skated."""
    if not is_kept:
        monkeypatch.setattr(motion_graph, "_without", all_left_out)
    folder = tmp_path / "captures"
    folder.mkdir()
    copied(shared / "mocap", folder, "16_47*", "16_58*")
    file = tmp_path / "queue.yaml"
    file.write_text(
        QUEUE.format(folder=folder).replace("count: 6", "count: 10").replace("interval: 2.0", "interval: 0.5")
    )
    simulation = crowdsim.Simulation(crowdsim.load_scenario(file))
    assets = simulation.crowd.assets
    ends = np.flatnonzero(assets.graph.node_ends_standing)
    assert all(assets.idle_after(int(node)) >= 0 for node in ends) == is_kept
    # Plans begin where their agents are: of those who went on meanwhile, no search for a way around is left.
    elsewhere = []
    hand_out = Replanning._hand_out

    def watched(replanning: Replanning, view: View, row: int, found: Found) -> None:
        if found.plan is not None and found.first is None:
            elsewhere.append(found.plan.departure_node != view.node[row])
        hand_out(replanning, view, row, found)

    monkeypatch.setattr(Replanning, "_hand_out", watched)
    with simulation.run(tmp_path / "queue.h5") as recording:
        assert recording.summary["arrived"] == 10
    assert elsewhere
    assert not any(elsewhere)


@pytest.mark.parametrize("patterns", [("16_*slow*",), ("16_47*", "16_58*")], ids=["slow walks", "two normal walks"])
def test_those_who_stop_before_a_gap_drag_no_foot(shared: Path, tmp_path: Path, patterns: tuple[str, ...]) -> None:
    """A made stop comes to a moment of rest in a stride before it draws up the other foot: that is no place to stay.

    Agents that stayed there dragged a foot by up to 8.7 cm to the stand, which has both feet side by side.
    """
    folder = tmp_path / "captures"
    folder.mkdir()
    copied(shared / "mocap", folder, *patterns)
    file = tmp_path / "queue.yaml"
    file.write_text(QUEUE.format(folder=folder))
    with crowdsim.Simulation(crowdsim.load_scenario(file)).run(tmp_path / "queue.h5") as recording:
        assert recording.summary["arrived"] == 6
        drift = shown_stances(recording)
    assert len(drift.shown) > 60
    assert (drift.shown - drift.own).max() <= 0.002


SUBJECTS = {
    "05": "walking turns to the left",
    "09": "",
    "16": "",
    "17": "turns on the spot",
    "127": "standing, setting off and stopping",
    "135": "no clip walks ahead for a whole stride",
}
"""Subjects of the captures, and what their captures are refused for; empty if they walk."""

SETS = {
    **{subject: ("mocap", f"{subject}_*.bvh", missing) for subject, missing in SUBJECTS.items()},
    "16 as AMC": ("mocap/asfamc", "*.amc", ""),
    "16 with a T-pose": ("mocap/asfamc", "*.bvh", "standing, setting off and stopping"),
}
"""Folder, pattern of files, and reason."""


def test_all_subjects_are_tried(shared: Path) -> None:
    assert {path.name.partition("_")[0] for path in (shared / "mocap").glob("*.bvh")} == set(SUBJECTS)


@pytest.mark.parametrize("name", SETS)
def test_a_subject_walks_or_is_refused_in_a_sentence(shared: Path, tmp_path: Path, name: str) -> None:
    below, pattern, missing = SETS[name]
    folder = shared / below
    if not list(folder.glob(pattern)):
        pytest.skip(f"no files {pattern} in {folder}")
    file = tmp_path / "brought.yaml"
    file.write_text(CORRIDOR.format(folder=f'{folder}, clips: ["{pattern}"]'))
    scenario = crowdsim.load_scenario(file)
    if missing:
        with pytest.raises(MotionError) as refused:
            crowdsim.Simulation(scenario)
        message = str(refused.value)
        assert missing in message
        assert message.endswith("; add a clip that walks straight on for four steps or more")
        assert "\n" not in message
        assert ". " not in message
    else:
        with crowdsim.Simulation(scenario).run(tmp_path / "brought.h5") as recording:
            summary = recording.summary
        assert summary["arrived"] == summary["characters"] == 6
        assert min(summary["obstacle_margin"].values()) >= -0.01
