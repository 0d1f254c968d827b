"""On a periodic floor, who leaves at one end comes in at the other, and nobody notices where the ends meet."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.periodic_boundary import AHEAD
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.errors import ScenarioError
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario, parse_scenario
from tests.support.steered_scenes import steered_scene

SPAN = 20.0
FLOOR = "{rectangle: [-3, 0, 17, 3], periodic: x}"
EAST = "name: east, count: {count}, start: {{rectangle: [-3, 0, 17, 3]}}, goal: {{along: +x}}"
WEST = "name: west, count: {count}, start: {{rectangle: [-3, 0, 17, 3]}}, goal: {{along: -x}}"
PLACES = """\
areas:
  - {name: middle, rectangle: [5, 0, 9, 3], start_time: 5}
  - {name: all, rectangle: [-3, 0, 17, 3], start_time: 5}
lines:
  - {name: middle, points: [[7, 0], [7, 3]]}
"""


def scene(*groups: str, floor: str = FLOOR, **keys: float) -> str:
    return steered_scene(*groups, floor=floor, rest=PLACES, **keys)


def run(text: str, tmp_path: Path, workers: int = 2) -> Recording:
    return Simulation(parse_scenario(text), workers).run(tmp_path / f"run{workers}.h5")


def test_characters_go_round_and_touch_nobody_across_the_ends(tmp_path: Path) -> None:
    text = scene(EAST.format(count=30), WEST.format(count=10), duration=40)
    with run(text, tmp_path) as recording:
        x, y, present = recording.x[:], recording.y[:], recording.state[:] != AgentState.ABSENT
        summary, line = recording.summary, recording.measured.lines["middle"]
    assert summary["arrived"] == 0
    assert summary["closest_bodies"] > 0.0
    assert min(summary["obstacle_margin"].values()) > 0.0
    assert ((x[present] >= -3.0) & (x[present] <= 17.0)).all()
    # Who leaves at one end is at the other one in the same step.
    jumps = np.abs(np.diff(x, axis=0)) > SPAN / 2.0
    assert jumps.sum() >= 40
    assert present.all()
    np.testing.assert_allclose(np.diff(x, axis=0)[jumps], np.where(x[:-1][jumps] > 0.0, -SPAN, SPAN), atol=0.3)
    assert np.abs(np.diff(y, axis=0)).max() < 0.3
    # Rounds, counted by steps, are the passages at the line.
    way = np.diff(x, axis=0) - SPAN * np.rint(np.diff(x, axis=0) / SPAN)
    for agent in range(40):
        at = x[0, agent] + np.concatenate([[0.0], np.cumsum(way[:, agent])])
        rounds = np.floor((at[-1] - 7.0) / SPAN) - np.floor((at[0] - 7.0) / SPAN)
        passages = line.to_left[line.agent == agent]
        assert abs(int((~passages).sum()) - int(passages.sum())) == abs(rounds)


def test_bodies_are_shown_going_on_across_the_ends(tmp_path: Path) -> None:
    with run(scene(EAST.format(count=6), duration=40), tmp_path) as recording:
        assert recording.header.ends == (0, -3.0, 17.0)
        jumps = np.argwhere(np.abs(np.diff(recording.x[:].astype(float), axis=0)) > SPAN / 2.0)
        assert len(jumps) >= 6
        for step, agent in jumps[:6].tolist():
            times = (step + np.arange(-5, 16) / 5.0) / 10.0
            tracks = np.array([recording.at_time(time).x[agent] for time in times])
            roots = np.array([recording.poses_at(time, [agent])[0][0, 0] for time in times], np.float64)
            assert np.isfinite(roots).all()
            assert ((roots[:, 0] >= -3.0) & (roots[:, 0] <= 17.0)).all()
            for places in (tracks, roots[:, 0]):
                moved = np.diff(places)
                moved -= SPAN * np.rint(moved / SPAN)
                assert (moved >= -0.005).all()
                assert moved.max() < 0.06
            off = roots[:, 0] - tracks
            assert np.abs(off - SPAN * np.rint(off / SPAN)).max() < 0.2


def test_it_is_as_quick_at_the_ends_as_in_the_middle(tmp_path: Path) -> None:
    at_ends = PLACES.replace("[5, 0, 9, 3]", "[-3, 0, 1, 3]")
    text = steered_scene(EAST.format(count=60), floor=FLOOR, rest=at_ends, duration=60)
    with run(text, tmp_path) as recording:
        speeds = [recording.summary["areas"][name] for name in ("middle", "all")]
    assert speeds[0]["speed"] == pytest.approx(speeds[1]["speed"], rel=0.08)
    assert speeds[0]["density"] == pytest.approx(1.0, rel=0.15)


def test_the_number_of_workers_does_not_change_the_run(tmp_path: Path) -> None:
    text = scene(EAST.format(count=30), WEST.format(count=30), duration=20)
    with run(text, tmp_path, 1) as one, run(text, tmp_path, 2) as two:
        np.testing.assert_array_equal(one.state_hash[:], two.state_hash[:])


def test_copies_are_those_within_sight_of_an_end_as_a_slow_count_has_it() -> None:
    with Simulation(parse_scenario(scene(EAST.format(count=30), WEST.format(count=15)))) as simulation:
        for _ in range(30):
            simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        rows = crowd.world.column("row").copy()
        found = crowd.boundary.with_copies(rows)
        np.testing.assert_array_equal(found[: len(rows)], rows)
        wanted = [
            (row["x"] + by, row["y"], row["vx"], row["togo"] - (by if row["gx"] > 0 else -by))
            for row in rows
            for by in (SPAN, -SPAN)
            if -3.0 - AHEAD <= row["x"] + by < 17.0 + AHEAD
        ]
        copies = found[len(rows) :]
        assert len(set(found["id"].tolist())) == len(found)
        got = [(copy["x"], copy["y"], copy["vx"], copy["togo"]) for copy in copies]
        np.testing.assert_allclose(sorted(got), sorted(wanted), atol=0.25)
        # The order in which they go is as far ahead as they are.
        keys = {(row["y"], row["vx"]): row["key"] - row["togo"] for row in rows}
        for copy in copies:
            assert copy["key"] - copy["togo"] == pytest.approx(keys[(copy["y"], copy["vx"])])


def test_bodies_are_shown_without_a_leap(tmp_path: Path) -> None:
    with run(scene(EAST.format(count=5), duration=25), tmp_path) as recording:
        present = recording.state[:] != AgentState.ABSENT
        leaps, rounds = [], 0
        for step in range(1, 240):
            both = np.flatnonzero(present[step] & present[step - 1])
            before, after = (recording.poses_at(time / 10.0, both)[0] for time in (step - 1, step))
            moved = (after - before).astype(np.float64)
            over = np.rint(moved[..., 0] / SPAN)
            # A body goes over as a whole.
            assert (over == over[:, :1]).all()
            rounds += int(np.abs(over[:, 0]).sum())
            moved[..., 0] -= SPAN * over
            leaps.append(float(np.linalg.norm(moved, axis=-1).max()))
    assert rounds >= 5, "somebody has gone round"
    assert max(leaps) < 1.0


def test_a_periodic_floor_along_y_with_an_obstacle(tmp_path: Path) -> None:
    wall = "obstacles:\n  - {name: pillar, box: {min: [1, 6], max: [2, 7]}, top: 2}\n"
    text = steered_scene(
        "name: north, count: 12, start: {rectangle: [0, 0, 3, 12]}, goal: {along: +y}",
        floor="{rectangle: [0, 0, 3, 12], periodic: y}",
        rest=wall,
        duration=40,
    )
    with run(text, tmp_path) as recording:
        y = recording.y[:]
        assert recording.summary["closest_bodies"] > 0.0
    assert ((np.diff(y, axis=0) < -6.0).sum(axis=0) >= 2).all(), "everybody goes round twice"


def test_commands_about_agents_are_saved_and_run_again(tmp_path: Path) -> None:
    late = "name: late, count: 2, on_call: true, start: {rectangle: [-3, 0, 17, 3]}, goal: {along: -x}"
    with Simulation(parse_scenario(scene(EAST.format(count=6), late, duration=6)), 1) as simulation:
        for _ in range(20):
            simulation.step()
        simulation.set_speed([0], 0.5)
        simulation.remove([1])
        simulation.add("late")
        while not simulation.finished:
            simulation.step()
        simulation.save_scenario(tmp_path / "saved.yaml")
    with Simulation(load_scenario(tmp_path / "saved.yaml"), 1) as again:
        while not again.finished:
            again.step()
    assert again.state_hash == simulation.state_hash


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ((", periodic: x", ""), r"agents\.0\.goal\.along: the floor ends along x; give it 'periodic: x', or name"),
        (("along: +x", "along: +y"), r"agents\.0\.goal\.along: the floor ends along y"),
        (("along: +x", "along: x"), r"agents\.0\.goal\.along: unknown value 'x'"),
        (
            ("along: +x}", "along: +x}, on_arrival: stay"),
            r"agents never arrive on an endless way; drop 'on_arrival'",
        ),
        (
            ("goal: {along: +x}", "goals: [{along: +x}, {point: [1, 1]}]"),
            r"a way 'along' an axis is endless; give it as",
        ),
        (("along: +x", "along: +x, point: [1, 1]"), r"give exactly one of rectangle, point, circle, polygon, along"),
        (("locomotion: steered", "locomotion: captured"), r"agents\.0: captured agents go to a region; give 'loc"),
        (("[-3, 0, 17, 3], p", "[-3, 0, 5, 3], p"), r"floor: a periodic floor is 10 m long at least, this one 8 m"),
        (
            ("rectangle: [-3, 0, 17, 3], p", "derive: true, p"),
            r"floor: 'periodic' is of a floor that the scenario draws",
        ),
        (("areas:", "events:\n  - {at: 1, remove: a}\nareas:"), r"events: a periodic floor has no 'events'; drop them"),
        (
            ("areas:", "commands:\n  - {at: 1, insert: {name: a, box: {min: [1, 1], max: [2, 2]}, top: 1}}\nareas:"),
            r"commands\.0: a periodic floor cannot be changed; drop this command, or 'periodic'",
        ),
        (
            ("areas:", "commands:\n  - {at: 1, set_goal: {agents: [0], goal: {point: [1, 1]}}}\nareas:"),
            r"commands\.0\.set_goal\.goal: on a periodic floor goals cannot change",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(changes: tuple[str, str], message: str) -> None:
    text = scene(EAST.format(count=5))
    assert text.count(changes[0]) == 1 or changes[0] == "locomotion: steered"
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(text.replace(*changes))


def test_captured_characters_need_a_floor_with_ends() -> None:
    text = scene("name: a, count: 1, start: {point: [1, 1]}, goal: {point: [5, 1]}")
    with pytest.raises(ScenarioError, match=r"agents\.0\.locomotion: captured agents need a floor with ends"):
        parse_scenario(text.replace("locomotion: steered", "locomotion: captured"))


def test_auto_characters_steer_on_a_periodic_floor() -> None:
    text = scene(EAST.format(count=5)).replace("locomotion: steered", "locomotion: auto")
    assert parse_scenario(text).locomotions() == {"steered"}
