"""Agents leave through the nearest exit, the quickest one, or that assigned to them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import box

from crowdsim.constants import NONE
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered import exits as rules
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.exits import FLOW, LEAST_FLOW, exits_summary, flow_through
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.environment.layers import polygons_only
from crowdsim.errors import ScenarioError
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.steering.guidance.field import ways
from tests.support.steered_scenes import steered_scene

HALL = "{polygon: [[0,0],[20,0],[20,4],[21,4],[21,5],[20,5],[20,10],[0,10],[0,5],[-1,5],[-1,4],[0,4]]}"
EXITS = """\
exits:
  - {name: west, rectangle: [-1, 4, -0.7, 5]}
  - {name: east, rectangle: [20.7, 4, 21, 5]}
"""
GROUP = "name: people, count: {count}, start: {{rectangle: [0.5, 0.5, {to}, 9.5]}}, "


def hall(how: str, count: int = 120, to: float = 12.0, rest: str = EXITS, **keys: Any) -> str:
    return steered_scene(GROUP.format(count=count, to=to) + how, floor=HALL, rest=rest, **keys)


def summary_of(text: str, tmp_path: Path) -> dict[str, Any]:
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5") as recording:
        return recording.summary


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
def test_who_goes_to_the_nearest_exit_leaves_there(tmp_path: Path, locomotion: str) -> None:
    text = hall("exits: all", duration=120).replace("locomotion: steered", f"locomotion: {locomotion}")
    starts = place_crowd(parse_scenario(text)).starts
    summary = summary_of(text, tmp_path)
    assert summary["arrived"] == 120
    near_west = int((starts[:, 0] < 10.0).sum())
    left = {name: used["left"] for name, used in summary["exits"].items()}
    assert left["west"] + left["east"] == 120
    # Those in the middle may be pushed to where the other exit is the nearer one by far.
    assert abs(left["west"] - near_west) <= 6


def test_the_quickest_exits_are_as_quick_as_the_best_split(tmp_path: Path) -> None:
    last = {}
    for how in ("{west: 1, east: 1}", "{west: 3, east: 2}", "all, choice: quickest", "all"):
        summary = summary_of(hall(f"exits: {how}", duration=200), tmp_path)
        assert summary["arrived"] == 120
        last[how] = max(used["last"] for used in summary["exits"].values())
        assert min(used["left"] for used in summary["exits"].values()) >= 20, "both are used"
    best = min(last["{west: 1, east: 1}"], last["{west: 3, east: 2}"])
    assert last["all, choice: quickest"] <= 1.15 * best
    assert last["all"] > 1.15 * best, "here the nearest exit is not the quickest"


def test_the_number_of_workers_does_not_change_choices() -> None:
    hashes = set()
    for workers in (1, 2):
        with Simulation(parse_scenario(hall("exits: all, choice: quickest")), workers) as simulation:
            for _ in range(100):
                simulation.step()
            hashes.add(simulation.crowd.hash)
    assert len(hashes) == 1


def test_each_exit_gets_its_share_of_those_assigned(tmp_path: Path) -> None:
    summary = summary_of(hall("exits: {west: 1, east: 2}", count=40, duration=120), tmp_path)
    assert {name: used["left"] for name, used in summary["exits"].items()} == {"west": 13, "east": 27}
    one = summary_of(hall("exits: [east]", count=10, duration=120), tmp_path)
    assert {name: used["left"] for name, used in one["exits"].items()} == {"east": 10}


def test_exits_with_one_region_count_apart(tmp_path: Path) -> None:
    exits = EXITS + "  - {name: east too, rectangle: [20.7, 4, 21, 5]}\n"
    summary = summary_of(hall("exits: {east: 1, east too: 3}", count=8, duration=120, rest=exits), tmp_path)
    left = {name: used["left"] for name, used in summary["exits"].items()}
    assert left == {"east": 2, "east too": 6}


def test_who_is_assigned_where_depends_on_the_seed_and_the_group_alone() -> None:
    def goals(seed: int, others: int) -> list[int]:
        more = GROUP.format(count=others, to=12).replace("people", "others") + "exits: all"
        first = GROUP.format(count=20, to=12) + "exits: {east: 1, west: 1}"
        cast = place_crowd(parse_scenario(steered_scene(first, more, floor=HALL, rest=EXITS, seed=seed)))
        return [int(goal) for goal in cast.assigned[:20]]

    assert goals(1, 5) == goals(1, 9)
    assert goals(1, 5) != goals(2, 5)


def test_a_shut_exit_is_left_for_the_other_one_and_assigned_ones_wait(tmp_path: Path) -> None:
    doors = EXITS + "doors:\n  - {name: leaf, box: {min: [-0.4, 4], max: [-0.2, 5]}, top: 2}\n"
    doors += "events:\n  - {at: 4, close: leaf}\n"
    free = summary_of(hall("exits: all", count=30, to=6, rest=doors, duration=60), tmp_path)
    assert free["arrived"] == 30
    assert free["exits"]["east"]["left"] >= 10
    held = summary_of(hall("exits: {west: 1, east: 0}", count=30, to=6, rest=doors, duration=40), tmp_path)
    assert held["exits"]["east"]["left"] == 0
    assert held["arrived"] < 30


def test_an_exit_too_shallow_to_stand_in_is_reached_from_before_it(tmp_path: Path) -> None:
    strip = EXITS.replace("[20.7, 4, 21, 5]", "[20.95, 4, 21, 5]")
    summary = summary_of(hall("exits: [east]", count=20, to=6, rest=strip, duration=60), tmp_path)
    assert summary["exits"]["east"]["left"] == 20


@pytest.mark.parametrize("depth", [0.02, 0.15, 0.2, 0.25])
def test_a_way_leads_to_an_exit_of_any_depth_and_it_is_chosen(tmp_path: Path, depth: float) -> None:
    strips = f"exits:\n  - {{name: west, rectangle: [-1, 4, {depth - 1.0}, 5]}}\n"
    strips += f"  - {{name: east, rectangle: [{21.0 - depth}, 4, 21, 5]}}\n"
    text = hall("exits: all", count=30, to=19.5, rest=strips, duration=60)
    starts = place_crowd(parse_scenario(text)).starts
    used = summary_of(text, tmp_path)["exits"]
    assert used["west"]["left"] + used["east"]["left"] == 30
    assert abs(used["west"]["left"] - int((starts[:, 0] < 10.0).sum())) <= 2


def test_those_whose_turn_it_is_choose_as_a_slow_count_has_it() -> None:
    scenario = parse_scenario(hall("exits: all, choice: quickest", count=150, to=8))
    with Simulation(scenario) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        changed = 0
        for step in range(60):
            simulation.step()
            view, choice = crowd.world.view(), crowd.exits
            rows, agents = view.row.copy(), view.agent.copy()
            before, flows = view.goal.copy(), choice._flows.copy()
            walks = view.errand == Errand.WALKS
            state = view.following.copy()
            choice.consider(view, step + 1)
            flows = flows if (step + 1) % 10 else choice._flows
            for k, agent in enumerate(agents.tolist()):
                wanted = before[k]
                if walks[k] and (agent + step + 1) % 20 == 0:
                    times = []
                    for goal in crowd.cast.itineraries[0].exits.tolist():
                        field = crowd.place.guidance._fields[goal][min(crowd.place.guidance._fields[goal])]
                        place = np.array([[rows["x"][k], rows["y"][k]]])
                        length = float(ways(crowd.place.guidance.ground, field, place).length[0])
                        ahead = int(((rows["goal"] == goal) & (rows["togo"] < length - 1e-6)).sum())
                        times.append(max(length / crowd.cast.walkers.speeds[agent], ahead / flows[goal]))
                    exits = crowd.cast.itineraries[0].exits.tolist()
                    own, best = times[exits.index(before[k])], int(np.argmin(times))
                    if times[best] <= 0.8 * own and own - times[best] >= 2.0:
                        wanted = exits[best]
                assert view.goal[k] == view.row["goal"][k] == choice.goals[agent] == wanted
                assert view.following[k] == (state[k] if wanted == before[k] else -1)
                changed += int(wanted != before[k])
    assert changed >= 10, "else nothing was tried"


def test_an_exit_shows_how_many_it_lets_through(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rules, "FLOW", 0.4)
    with Simulation(parse_scenario(hall("exits: [west]", count=80, to=6))) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        assert crowd.exits._flows == pytest.approx([0.4], rel=0.03)
        for _ in range(300):
            simulation.step()
        seen = crowd.arrived / 28.0
        assert crowd.exits._flows[0] == pytest.approx(seen, rel=0.25)


def test_the_flow_expected_is_that_of_the_outline_on_the_floor() -> None:
    free = polygons_only(box(0, 0, 10, 4))
    assert flow_through(box(8, 0, 10, 4), free) == pytest.approx(FLOW * 4.0, rel=0.01), "across the corridor"
    assert flow_through(box(9, 1, 10, 2), free) == pytest.approx(FLOW * 3.0, rel=0.01), "from three sides"
    assert flow_through(box(20, 0, 21, 4), free) == LEAST_FLOW


def test_who_was_sent_elsewhere_before_it_entered_has_no_exit() -> None:
    """Its companion chooses an exit of its own."""
    text = hall("exits: all, together: 2, start_time: 1", count=2)
    with Simulation(parse_scenario(text)) as simulation:
        simulation.set_goal(0, (5.0, 5.0))
        for _ in range(20):
            simulation.step()
        assert simulation.agents.present.tolist() == [0, 1]
        assert (simulation.crowd.exits.goals != NONE).tolist() == [False, True]


def test_exits_are_summed_up() -> None:
    goals, arrived = np.array([3, 3, 5, -1], np.int32), np.array([40, 55, -1, -1])
    found = exits_summary(("a", "b"), np.array([3, 5], np.int32), goals, arrived, 10)
    assert found == {"a": {"left": 2, "last": 5.5}, "b": {"left": 0, "last": None}}


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("exits: [wst]", r"agents\.0\.exits\.0: there is no exit 'wst'; did you mean 'west'\?"),
        ("exits: {wst: 1}", r"agents\.0\.exits\.wst: there is no exit 'wst'; did you mean 'west'\?"),
        ("exits: [west, west]", r"agents\.0\.exits: an exit is named twice"),
        ("exits: none", r"agents\.0\.exits: expected all, a list of names, or names with their shares"),
        ("exits: {west: -1}", r"agents\.0\.exits: the share of 'west' must be a number from 0 to 1e\+06, got -1"),
        ("exits: {west: 0}", r"agents\.0\.exits: one share at least must be above 0"),
        ("exits: {west: 1}, choice: nearest", r"these 'exits' are assigned by their shares; drop 'choice'"),
        ("exits: all, wait: 2", r"agents that go to an exit leave there; drop 'wait'"),
        ("exits: all, on_arrival: stay", r"agents that go to an exit leave there; drop 'on_arrival'"),
        ("goal: {point: [5, 5]}, choice: nearest", r"'choice' is among exits; give 'exits' with it, or drop it"),
        ("goal: {point: [5, 5]}, exits: all", r"give exactly one of goal, goals, exits"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(how: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(hall(how))


def test_exits_need_a_floor_a_name_and_somebody_who_steers() -> None:
    with pytest.raises(ScenarioError, match=r"agents\.0\.exits: this file has no exits; list them under 'exits'"):
        parse_scenario(hall("exits: all", rest=""))
    with pytest.raises(ScenarioError, match=r"exits\.1: an exit needs an extent; give rectangle, circle or polygon"):
        parse_scenario(hall("exits: all", rest=EXITS.replace("rectangle: [20.7, 4, 21, 5]", "point: [20, 5]")))
    with pytest.raises(ScenarioError, match=r"exits\.1\.name: the name 'west' is taken by exits\.0"):
        parse_scenario(hall("exits: all", rest=EXITS.replace("east", "west")))
    with pytest.raises(ScenarioError, match=r"exits\.1: lies off the floor, or inside of an obstacle"):
        parse_scenario(hall("exits: all", rest=EXITS.replace("[20.7, 4, 21, 5]", "[30, 4, 31, 5]")))
    with pytest.raises(ScenarioError, match=r"agents\.0\.exits: captured agents go to a 'goal'"):
        parse_scenario(hall("exits: all").replace("locomotion: steered", "locomotion: captured"))


def test_who_has_to_squeeze_out_of_a_gap_first_goes_to_the_exit_that_is_nearest_straight_on() -> None:
    walls = "obstacles:\n" + "".join(
        f"  - {{name: {name}, box: {{min: [{low}], max: [{high}]}}, top: 2.5}}\n"
        for name, low, high in (
            ("west wall", "15.9, 4", "16, 6"),
            ("south wall", "16, 3.9", "18, 4"),
            ("north wall", "16, 6", "18, 6.1"),
            ("below the gap", "18, 4", "18.1, 4.8"),
            ("above the gap", "18, 5.2", "18.1, 6"),
        )
    )
    scene = steered_scene("name: one, count: 1, start: {point: [17, 5]}, exits: all", floor=HALL, rest=EXITS + walls)
    with Simulation(parse_scenario(scene)) as simulation:
        simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        assert np.isinf(crowd.place.guidance.lengths(0, np.array([[17.0, 5.0]]))).all()
        assert crowd.exits.goals.tolist() == [crowd.cast.exits["east"]]
