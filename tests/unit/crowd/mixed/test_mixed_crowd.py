"""Captured and steered agents in one crowd: all arrive, nobody touches anybody, tracks go on across changes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.mixed.seen import PUSHES_AFTER
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.systems.replan import IMPATIENCE_SECONDS
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from tests.reference.mixed_crowd import core_of, gap_to_piece
from tests.reference.steering_reference import segment_to_segment

SCENE = """\
crowdsim: 1
name: square
seed: {seed}
duration: {duration}
floor: {{rectangle: [0, 0, 16, 12]}}
obstacles:
  - {{name: pillar, cylinder: {{center: [8, 6], radius: 0.4}}, top: 2.5}}
{more}
agents:
  - {{name: east, count: 12, start: {{rectangle: [0.5, 2, 3, 10]}}, goal: {{rectangle: [13, 2, 15.5, 10]}}{keys}}}
  - {{name: west, count: 12, start: {{rectangle: [13, 2, 15.5, 10]}}, goal: {{rectangle: [0.5, 2, 3, 10]}}{keys}}}
{groups}
"""
KINDS = """\
  - {name: played, count: 3, locomotion: captured, start: {rectangle: [4, 0.5, 12, 1.5]}, interval: 2,
     goal: {rectangle: [4, 10.5, 12, 11.5]}}
  - {name: led, count: 8, locomotion: steered, start: {rectangle: [4, 10.5, 12, 11.5]},
     goal: {rectangle: [4, 0.5, 12, 1.5]}}"""


def square(seed: int = 1, duration: float = 120.0, keys: str = "", groups: str = "", more: str = "") -> str:
    return SCENE.format(seed=seed, duration=duration, keys=keys, groups=groups, more=more)


def crowd_of(text: str, workers: int = 2) -> tuple[Simulation, MixedCrowd]:
    simulation = Simulation(parse_scenario(text), workers)
    assert isinstance(simulation.crowd, MixedCrowd)
    return simulation, simulation.crowd


def gaps(crowd: MixedCrowd) -> tuple[float, float]:
    """Least gap between two steered bodies, and between one and a disc that holds a captured one [m]."""
    rows, played = crowd.steered.world.column("row"), crowd.captured.world.view()
    radii = crowd.captured.assets.breadths[played.behavior].sum(axis=1)
    discs = np.column_stack([played.pose[:, :2], played.pose[:, :2], radii])
    steered = [
        segment_to_segment(core_of(a), core_of(b)) - a["radius"] - b["radius"]
        for k, a in enumerate(rows)
        for b in rows[:k]
        if np.hypot(a["x"] - b["x"], a["y"] - b["y"]) < 1.0
    ]
    return min(steered, default=1.0), min((gap_to_piece(a, disc) for a in rows for disc in discs), default=1.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_all_arrive_and_bodies_of_both_levels_never_touch(seed: int) -> None:
    simulation, crowd = crowd_of(square(seed, groups=KINDS))
    with simulation:
        while not simulation.finished:
            simulation.step()
            between, across = gaps(crowd)
            assert between > 0.0
            assert across > 0.0
    assert crowd.arrived == crowd.count == 35
    assert crowd.switches.counts["steered"] > 0


def test_the_number_of_workers_does_not_change_the_run(tmp_path: Path) -> None:
    door = "doors: [{name: gate, box: {min: [7.9, 0], max: [8.1, 3]}, top: 2, initially: open}]\n"
    door += "events: [{at: 2, close: gate}, {at: 8, open: gate}]"
    hashes = []
    for workers in (1, 2, 4):
        simulation, _ = crowd_of(square(4, 30.0, groups=KINDS, more=door), workers)
        with simulation.run(tmp_path / f"{workers}.h5") as recording:
            hashes.append(recording.state_hash[:].tobytes())
    assert hashes[0] == hashes[1] == hashes[2]


def summary_of(text: str, file: Path) -> dict[str, Any]:
    simulation, _ = crowd_of(text)
    with simulation.run(file) as recording:
        return recording.summary


def test_groups_stay_on_the_level_that_they_were_given(tmp_path: Path) -> None:
    simulation, crowd = crowd_of(square(2, groups=KINDS))
    with simulation.run(tmp_path / "run.h5") as recording:
        there = recording.state[:] != AgentState.ABSENT
        steers = np.isfinite(recording.phase[:]) & there
        groups = np.array(recording.header.agents.groups)
    assert there[:, groups == "played"].any()
    assert not steers[:, groups == "played"].any()
    assert (steers == there)[:, groups == "led"].all()
    assert crowd.arrived == 35


def test_tracks_go_on_across_changes_of_level(tmp_path: Path) -> None:
    """To a millimeter in place, and in velocity by what steering may change in a step, or a tenth more than motion."""
    simulation, crowd = crowd_of(square(3))
    with simulation.run(tmp_path / "run.h5") as recording:
        x, y, heading = (values[:].astype(float) for values in (recording.x, recording.y, recording.heading))
        steers = np.isfinite(recording.phase[:])
        there = recording.state[:] != AgentState.ABSENT
    places = np.stack([x, y], axis=2)
    velocities = 10.0 * np.diff(places, axis=0)
    changes = 0
    for step in range(2, len(there) - 1):
        for agent in np.flatnonzero((steers[step] != steers[step - 1]) & there[step - 2 : step + 2].all(axis=0)):
            jump = np.hypot(*(velocities[step - 1, agent] - velocities[step - 2, agent]))
            assert jump < (0.25 + 1e-3 if steers[step, agent] else 0.2)
            turn = (heading[step, agent] - heading[step - 1, agent] + np.pi) % (2 * np.pi) - np.pi
            assert abs(turn) <= 0.25 + 1e-3
            changes += 1
    assert changes >= 10
    assert sum(crowd.switches.counts.values()) >= changes


def test_the_summary_says_who_was_on_which_level(tmp_path: Path) -> None:
    summary = summary_of(square(1, groups=KINDS), tmp_path / "run.h5")
    assert sum(summary["level_share"].values()) == pytest.approx(1.0)
    assert min(summary["level_share"].values()) > 0.05
    assert summary["switches"]["steered"] >= summary["switches"]["captured"]
    assert summary["closest_pair"] > 0.25
    assert min(summary["obstacle_margin"].values()) > -0.01
    assert summary["stance_foot_speed"] < 0.05
    assert summary["unreachable"] == {}


def test_one_alone_is_captured_all_the_way(tmp_path: Path) -> None:
    text = square(1).replace("count: 12", "count: 1").replace("goal: {rectangle: [13, 2", "goal: {rectangle: [13, 9")
    summary = summary_of(text.replace("start: {rectangle: [13, 2", "start: {rectangle: [13, 3"), tmp_path / "run.h5")
    alone = summary_of(text.replace("\n  - {name: west", "\n# {name: west"), tmp_path / "alone.h5")
    assert summary["arrived"] == 2
    assert alone["level_share"] == {"captured": 1.0, "steered": 0.0}


BROAD = """\
crowdsim: 1
name: broad
seed: {seed}
duration: 60
floor: {{rectangle: [0, 0, 40, 12]}}
agents:
  - {{name: many, count: 16, start_time: 0, start: {{rectangle: [17.5, 0.5, 20.5, 3]}},
     goal: {{rectangle: [0.5, 10.5, 39.5, 11.5]}}}}
"""


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_who_goes_over_before_a_broad_region_goes_to_its_nearest_part(seed: int) -> None:
    simulation, crowd = crowd_of(BROAD.format(seed=seed))
    with simulation:
        while not simulation.finished:
            steered, played = crowd.steered.world.view(), crowd.captured.world.view()
            to_go = dict(zip(steered.agent.tolist(), steered.row["togo"].tolist(), strict=True))
            before = set(played.agent.tolist())
            simulation.step()
            played = crowd.captured.world.view()
            for agent, pose, goal in zip(played.agent.tolist(), played.pose, played.goal, strict=True):
                if agent not in before and agent in to_go:
                    assert np.hypot(*(goal - pose[:2])) < to_go[agent] + 0.3
    assert crowd.arrived == 16


def test_where_a_camera_looks_more_is_captured(tmp_path: Path) -> None:
    usual = summary_of(square(1), tmp_path / "usual.h5")
    favored = square(1).replace("agents:", "captured_near: {point: [8, 6], radius: 20}\nagents:")
    seen = summary_of(favored, tmp_path / "seen.h5")
    assert seen["arrived"] == 24
    assert seen["level_share"]["captured"] > usual["level_share"]["captured"] + 0.05


def test_a_dense_start_is_steered_and_those_who_get_room_are_captured() -> None:
    text = square(5, keys=", start_time: 0").replace("[0.5, 2, 3, 10]", "[0.5, 5, 2, 7.5]")
    simulation, crowd = crowd_of(text)
    with simulation:
        simulation.step()
        assert crowd.steered.world.count >= 8
        while not simulation.finished:
            simulation.step()
    assert crowd.arrived == 24
    assert crowd.switches.counts["captured"] > 0


@pytest.mark.parametrize("seed", [1, 2])
def test_goals_in_turn_are_all_visited_whatever_level_one_is_on(seed: int, tmp_path: Path) -> None:
    """Rounds, waits and a place to stay, while others cross."""
    rounds = """\
  - {name: rounds, count: 4, start: {rectangle: [4, 1, 12, 2]}, repeat: 2, wait: 1,
     goals: [{rectangle: [2, 2, 5, 4]}, {rectangle: [11, 8, 14, 10]}]}
  - {name: stays, count: 2, start: {rectangle: [6, 9, 10, 11]}, goal: {rectangle: [6, 2, 10, 4], heading: 90},
     on_arrival: stay}"""
    simulation, crowd = crowd_of(square(seed, groups=rounds))
    with simulation.run(tmp_path / "run.h5") as recording:
        summary = recording.summary
    assert summary["arrived"] == summary["characters"] == 30
    assert summary["laps"] == {"rounds": 8}
    assert summary["stands"]["stood"] >= 2 + 4
    staying = crowd.captured.world.column("state") == AgentState.ARRIVED
    assert staying.sum() + (crowd.steered.world.column("errand") == Errand.STAYS).sum() == 2


def test_nothing_comes_to_where_anybody_is_on_either_level() -> None:
    crates = "events:\n" + "\n".join(
        f"  - {{at: {at}, insert: {{name: crate{at}, box: {{center: [{x}, 6], size: [1, 1]}}, top: 1.5}}}}"
        for at, x in ((2, 4), (3, 10), (4, 6), (5, 12))
    )
    simulation, crowd = crowd_of(square(6, more=crates))
    with simulation:
        while not simulation.finished:
            simulation.step()
            assert crowd.steered.steering.crowded == 0
    outcomes = [event["outcome"] for event in crowd.summary()["events"]]
    assert outcomes.count("happened") >= 3
    assert crowd.arrived == 24


DOOR = """\
crowdsim: 1
name: door
seed: {seed}
duration: 60
floor: {{rectangle: [0, 0, 10.2, 5]}}
obstacles:
  - {{name: below, box: {{min: [5, 0], max: [5.2, 2.05]}}, top: 2.5}}
  - {{name: above, box: {{min: [5, 2.95], max: [5.2, 5]}}, top: 2.5}}
agents:
  - {{name: one, locomotion: captured, count: 1, start: {{rectangle: [0.6, 0.6, 3.6, 4.4]}},
     goal: {{rectangle: [6.6, 0.6, 9.6, 4.4]}}}}
  - {{name: four, locomotion: steered, count: 4, start: {{rectangle: [6.6, 0.6, 9.6, 4.4]}},
     goal: {{rectangle: [0.6, 0.6, 3.6, 4.4]}}}}
"""


@pytest.mark.parametrize("seed", [3, 10, 30])
def test_the_only_captured_one_does_not_stop_in_a_door_of_steered_ones(seed: int) -> None:
    simulation, crowd = crowd_of(DOOR.format(seed=seed))
    with simulation:
        while not simulation.finished:
            simulation.step()
    assert crowd.arrived == 5


def test_who_looks_for_a_way_around_others_does_not_push_meanwhile() -> None:
    assert PUSHES_AFTER > IMPATIENCE_SECONDS
