"""Parties start together, keep together, and stop nobody for good."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.parties import HELD_UP, stuck_beside
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.environment.spots import gathered
from crowdsim.errors import ScenarioError
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.crowd_placement import SPARE
from tests.support.steered_scenes import steered_scene

HALL = "{rectangle: [0, 0, 24, 12]}"
EAST = "start: {rectangle: [0.5, 0.5, 8, 11.5]}, goal: {rectangle: [23, 0, 24, 12]}"
CROSS = "{polygon: [[0,5],[5,5],[5,0],[8,0],[8,5],[13,5],[13,8],[8,8],[8,13],[5,13],[5,8],[0,8]]}"
ARMS = {
    "east": ("[0, 5, 4.5, 8]", "[12, 5, 13, 8]"),
    "west": ("[8.5, 5, 13, 8]", "[0, 5, 1, 8]"),
    "north": ("[5, 0, 8, 4.5]", "[5, 12, 8, 13]"),
    "south": ("[5, 8.5, 8, 13]", "[5, 0, 8, 1]"),
}


def run(tmp_path: Path, text: str) -> Recording:
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5"):
        pass
    return Recording.open(tmp_path / "run.h5")


def crossing(count: int, together: int, seed: int) -> str:
    groups = [
        f"name: {name}, count: {count}, together: {together}, start: {{rectangle: {a}}}, goal: {{rectangle: {b}}}"
        for name, (a, b) in ARMS.items()
    ]
    return steered_scene(*groups, floor=CROSS, seed=seed, duration=150)


@pytest.mark.parametrize(("together", "count"), [(2, 40), (4, 40), (3, 32)])
def test_parties_start_beside_each_other_at_one_time(together: int, count: int) -> None:
    group = f"name: a, count: {count}, interval: 0.5, together: {together}, delay: {{uniform: [0, 5]}}, {EAST}"
    cast = place_crowd(parse_scenario(steered_scene(group, floor=HALL)))
    assert cast.first.tolist() == [agent // together * together for agent in range(count)]
    for values in (cast.start_steps, cast.delay_steps, cast.walkers.speeds):
        np.testing.assert_array_equal(values, values[cast.first])
    away = np.hypot(*(cast.starts - cast.starts[cast.first]).T)
    least = cast.walkers.breadths.max() + SPARE
    assert (away <= least * (0.6 + np.sqrt(together))).all()
    assert (away[cast.first != np.arange(count)] >= least).all()
    # As fast as the slowest one would be alone.
    alone = place_crowd(parse_scenario(steered_scene(group.replace(f"together: {together}, ", ""), floor=HALL)))
    for first in np.unique(cast.first):
        assert cast.walkers.speeds[first] == alone.walkers.speeds[cast.first == first].min()


def test_a_dense_start_keeps_parties_in_their_rows() -> None:
    group = f"name: a, count: 150, together: 2, {EAST.replace('[0.5, 0.5, 8, 11.5]', '[0.5, 0.5, 5.5, 6.5]')}"
    cast = place_crowd(parse_scenario(steered_scene(group, floor=HALL)))
    assert not np.isnan(cast.headings).any()
    away = np.hypot(*(cast.starts[1::2] - cast.starts[::2]).T)
    assert (away < 1.0).mean() > 0.8
    spots = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 1.0], [5.0, 1.0], [9.0, 9.0]])
    np.testing.assert_array_equal(gathered(spots, 2), spots[[0, 2, 1, 3, 4]])


@pytest.mark.parametrize("seed", [1, 2])
def test_pairs_are_within_one_meter_and_a_half_at_a_quarter_to_a_square_meter(tmp_path: Path, seed: int) -> None:
    west = "start: {rectangle: [16, 0.5, 23.5, 11.5]}, goal: {rectangle: [0, 0, 1, 12]}"
    groups = (f"name: east, count: 36, together: 2, {EAST}", f"name: west, count: 36, together: 2, {west}")
    with run(tmp_path, steered_scene(*groups, floor=HALL, seed=seed)) as recording:
        summary = recording.summary
        assert summary["arrived"] == 72
        x, y = recording.x[:].astype(float), recording.y[:].astype(float)
        there = recording.state[:] != AgentState.ABSENT
    assert summary["closest_bodies"] >= 0.0
    for name, begin in (("east", 0), ("west", 36)):
        assert summary["together"][name] >= 0.95
        near = both = 0
        for agent in range(begin, begin + 36, 2):
            for step in np.flatnonzero(there[:, agent] & there[:, agent + 1]):
                both += 1
                near += np.hypot(x[step, agent] - x[step, agent + 1], y[step, agent] - y[step, agent + 1]) <= 1.5
        assert summary["together"][name] == pytest.approx(near / both)


@pytest.mark.parametrize(("together", "seed"), [(2, 1), (2, 2), (4, 1)])
def test_parties_that_cross_in_a_throng_all_arrive(tmp_path: Path, together: int, seed: int) -> None:
    with run(tmp_path, crossing(20, together, seed)) as recording:
        assert recording.summary["arrived"] == 80
        assert recording.summary["closest_bodies"] >= 0.0


def walk_apart(steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Speed [m/s] and lead [m] of the first one of a pair whose second one is held fast where it starts."""
    start = "start: {rectangle: [1, 4, 3, 6]}, goal: {rectangle: [23, 0, 24, 12]}"
    group = f"name: a, count: 2, together: 2, speed: 1.3, {start}"
    crowd = SteeredCrowd(parse_scenario(steered_scene(group, floor=HALL)), 1)
    speeds, leads = [], []
    held = None
    for _ in range(steps):
        crowd.advance()
        rows = crowd.world.column("row")
        row = int(np.flatnonzero(crowd.world.column("agent") == 1)[0])
        held = rows[row].copy() if held is None else held
        rows[row] = held
        other = 1 - row
        speeds.append(float(np.hypot(rows["vx"][other], rows["vy"][other])))
        leads.append(float(held["togo"] - rows["togo"][other]))
        crowd.end_step()
    crowd.close()
    return np.array(speeds), np.array(leads)


def test_who_is_ahead_waits_for_who_is_behind_but_not_for_ever() -> None:
    speeds, leads = walk_apart(200)
    waits = np.flatnonzero(speeds < 0.1)
    waits = waits[waits > 10]
    assert len(waits) > 20
    assert 0.5 < leads[waits[0]] < 1.3
    # After some seconds it goes on without the other one.
    assert speeds[-20:].min() > 1.2
    assert leads[-1] > 3.0


def test_who_walks_alone_is_left_alone() -> None:
    crowd = SteeredCrowd(parse_scenario(steered_scene(f"name: a, count: 5, {EAST}", floor=HALL)), 1)
    assert not crowd.parties
    assert crowd.cast.first.tolist() == list(range(5))
    crowd.advance()
    view = crowd.world.view()
    before = view.row.copy()
    crowd.parties.keep_together(view)
    np.testing.assert_array_equal(view.row, before)
    crowd.close()


def test_a_party_leaves_through_the_exit_of_its_first_one(tmp_path: Path) -> None:
    exits = "exits:\n  - {name: west, rectangle: [0, 5, 0.3, 7]}\n  - {name: east, rectangle: [23.7, 5, 24, 7]}\n"
    group = "name: a, count: {count}, together: {size}, start: {{rectangle: [8, 1, 16, 11]}}, exits: {how}"
    for how in ("all", "{west: 1, east: 1}", "all, choice: quickest"):
        text = steered_scene(group.format(count=40, size=4, how=how), floor=HALL, rest=exits)
        crowd = SteeredCrowd(parse_scenario(text), 1)
        for _ in range(300):
            crowd.advance()
            agents = crowd.world.column("agent")
            there = np.zeros(40, bool)
            there[agents] = True
            goals, first = crowd.exits.goals[agents], crowd.cast.first[agents]
            kept = there[first]
            assert (goals[kept] == crowd.exits.goals[first[kept]]).all()
            assert (goals != NONE).all()
            crowd.end_step()
        crowd.close()


def test_captured_characters_do_not_walk_together() -> None:
    text = steered_scene(f"name: a, count: 2, together: 2, {EAST}", floor=HALL)
    with pytest.raises(
        ScenarioError, match=r"agents\.0: parties that walk 'together' are steered; give 'locomotion: auto'"
    ):
        parse_scenario(text.replace("locomotion: steered", "locomotion: captured"))
    auto = parse_scenario(text.replace("locomotion: steered", "locomotion: auto"))
    assert auto.locomotions() == {"steered"}


@pytest.mark.parametrize("seed", range(5))
def test_stuck_agents_beside_are_those_that_a_look_at_all_pairs_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 120
    places = rng.uniform(0.0, 6.0, (count, 2))
    places[5] = places[4]
    first = np.arange(count) // 8 * 8
    # Whole parties in one place, whose own members are the nearest.
    places[16:24] = places[16] + rng.uniform(-0.1, 0.1, (8, 2))
    rows, stuck = np.flatnonzero(rng.random(count) < 0.5), np.flatnonzero(rng.random(count) < 0.4 + 0.15 * seed)
    expected = [any(first[a] != first[b] and np.hypot(*(places[a] - places[b])) < HELD_UP for b in stuck) for a in rows]
    assert stuck_beside(places, first, rows, stuck).tolist() == expected
    assert any(expected)
    nobody = np.zeros(0, np.int64)
    assert not stuck_beside(places, first, rows, nobody).any()
    assert len(stuck_beside(places, first, nobody, stuck)) == 0
