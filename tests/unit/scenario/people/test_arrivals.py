"""Sources: how many come, and when."""

import numpy as np
import pytest

from crowdsim.errors import ScenarioError
from crowdsim.scenario.cast import place_agents
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.arrivals import start_times
from tests.unit.scenario.sample import change


def source(keys: str, *pairs: tuple[str, str]) -> str:
    return change(("    count: 4\n", f"    {keys}\n"), *pairs)


def times(keys: str, *pairs: tuple[str, str]) -> np.ndarray:
    return start_times(parse_scenario(source(keys, *pairs)), 0)


def test_a_count_starts_in_equal_steps():
    text = change(("on_arrival: leave", "interval: 2.5\n    start_time: 1"))
    assert start_times(parse_scenario(text), 0).tolist() == [1.0, 3.5, 6.0, 8.5]


def test_regular_arrivals_fill_their_time():
    assert times("rate: 0.5\n    arrivals: regular").tolist() == [2.0 * k for k in range(30)]
    found = times("rate: 0.5\n    arrivals: regular\n    start_time: 3\n    until: 10").tolist()
    assert found == [3.0, 5.0, 7.0, 9.0]
    assert times("rate: 0.5\n    arrivals: regular\n    count: 7").tolist() == [2.0 * k for k in range(7)]


def test_poisson_arrivals_have_their_rate_and_their_spread():
    found = times("rate: 2.0\n    start_time: 10", ("duration: 60.0", "duration: 5010.0"))
    assert len(found) == pytest.approx(10_000, abs=4 * 100)
    gaps = np.diff(found)
    assert (gaps > 0.0).all()
    assert gaps.std() == pytest.approx(gaps.mean(), rel=0.05)
    assert found[0] >= 10.0
    assert found[-1] < 5010.0


def test_the_seed_decides_and_a_cap_only_cuts():
    free = times("rate: 0.5")
    assert times("rate: 0.5").tolist() == free.tolist() != times("rate: 0.5", ("seed: 5", "seed: 6")).tolist()
    assert times("rate: 0.5\n    count: 6").tolist() == free[:6].tolist()


def test_everyone_from_a_source_is_placed():
    scenario = parse_scenario(source("rate: 0.5"))
    cast = place_agents(scenario, 0.35)
    assert len(cast.starts) == len(cast.goals) == len(cast.groups) == len(start_times(scenario, 0))
    assert (np.diff(cast.start_steps) >= 0).all()


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ("rate: 0", "16:11: agents.0.rate: must be greater than 0"),
        ("rate: 0.0001", "16:11: agents.0.rate: no agent comes at this rate"),
        ("rate: 900\n    until: 600", "16:11: agents.0.rate: more than 100000 agents come at this rate"),
        ("rate: 1\n    interval: 2", "15:5: agents.0: a source has a 'rate', not an 'interval'"),
        ("rate: 1\n    start_time: 5\n    until: 5", "15:5: agents.0: 'until' (5 s) must lie after 'start_time' (5 s)"),
        (
            "rate: 1\n    until: 700",
            "17:12: agents.0.until: the run ends at 600 s, too early for a source that ends at 700 s",
        ),
        (
            "rate: 1\n    start_time: 600",
            "17:17: agents.0.start_time: the run ends at 600 s, too early for a source that begins at 600 s",
        ),
        ("count: 2\n    until: 5", "15:5: agents.0: 'until' is about a source; give 'rate' with it, or drop it"),
        ("count: 2\n    arrivals: regular", "15:5: agents.0: 'arrivals' is about a source"),
        ("rate: 1\n    arrivals: poison", "17:15: agents.0.arrivals: unknown value 'poison'; did you mean 'poisson'?"),
        ("count: 2\n    repeat: 2", "15:5: agents.0: 'repeat' goes round among several places; give 'goals'"),
        (
            "count: 2\n    stand_within: 0.05",
            "15:5: agents.0: 'stand_within' is about goals to stand at; give 'on_arrival: stay', or drop it",
        ),
        (
            "count: 2\n    on_arrival: stay\n    stand_within: 0.001",
            "18:19: agents.0.stand_within: ",
        ),
        (
            "count: 2\n    repeat: always",
            "17:13: agents.0.repeat: expected a whole number from 1 to 100000, or forever",
        ),
        ("count: 2\n    repeat: 0", "17:13: agents.0.repeat: expected a whole number from 1"),
        (
            "count: 2\n    goals: [{point: [1, 1]}]",
            "15:5: agents.0: give exactly one of goal, goals, exits; found 'goal' and",
        ),
    ],
)
def test_a_source_or_sequence_that_cannot_be_is_refused_with_its_line(keys, line):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(source(keys, ("duration: 60.0", "duration: 600.0")))
    problems = [str(problem) for problem in caught.value.problems]
    assert any(problem.startswith(f"<text>:{line}") for problem in problems), problems


def test_each_goal_of_a_sequence_is_checked_in_its_place():
    text = change(("goal: {circle: {center: [8, 4], radius: 1.0}}", "goals: [{point: [8, 4]}, {point: [6, 3]}]"))
    with pytest.raises(ScenarioError, match=r"18:30: agents.0.goals.1: lies inside 'pole'; nobody can stand there"):
        parse_scenario(text)


@pytest.mark.parametrize(
    ("keys", "goals", "complaint"),
    [
        ("", "goal: {point: [4, 4], heading: 90}", "at goal to face its 'heading'; give 'on_arrival: stay'"),
        ("wait: 1", "goal: {point: [4, 4], heading: 90}", "at goal to face"),
        ("wait: 1", "goal: {point: [4, 4]}", "agents 'wait' between goals; give 'goals' with at least two, or drop it"),
        ("on_arrival: stay", "goals: [{point: [4, 4], heading: 90}, {point: [6, 4]}]", "at goals.0 .* give 'wait'"),
        ("wait: 1", "goals: [{point: [4, 4]}, {point: [6, 4], heading: 9}]", "at goals.1 .* give 'on_arrival: stay'"),
        ("on_arrival: stay", "goal: {point: [4, 4], heading: 400}", "heading: .*360"),
    ],
)
def test_headings_and_waits_are_for_those_who_stand(keys: str, goals: str, complaint: str) -> None:
    with pytest.raises(ScenarioError, match=complaint):
        parse_scenario(standing(keys, goals))


@pytest.mark.parametrize(
    ("keys", "goals"),
    [
        ("on_arrival: stay", "goal: {point: [4, 4], heading: 90}"),
        ("wait: 1", "goals: [{point: [4, 4], heading: 90}, {point: [6, 4]}]"),
        ("wait: 1\n    repeat: 2", "goals: [{point: [4, 4]}, {point: [6, 4], heading: -90}]"),
    ],
)
def test_headings_of_those_who_stand_are_taken(keys: str, goals: str) -> None:
    (group,) = parse_scenario(standing(keys, goals)).agents
    assert any(goal.heading is not None for _, goal in group.regions())


def standing(keys: str, goals: str) -> str:
    """A scenario with one group that has these keys and goals."""
    lines = ["- name: all", "  count: 1", "  start: {point: [1, 1]}", f"  {goals}"]
    lines += ["  " + line.strip() for line in keys.splitlines()]
    head = "crowdsim: 1\nname: stands\nseed: 1\nduration: 9\nfloor: {rectangle: [0, 0, 8, 8]}\nagents:\n"
    return head + "\n".join("  " + line for line in lines) + "\n"
