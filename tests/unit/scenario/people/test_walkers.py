"""Speeds, breadths and delays of steered agents are drawn from what the file says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from crowdsim.errors import ScenarioError
from crowdsim.scenario.cast import place_agents
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.draws import draw_spread
from crowdsim.scenario.people.walkers import draw_walkers, mean_speed
from crowdsim.scenario.schema.spreads import Spread
from tests.support.steered_scenes import steered_scene

FLOOR = "{rectangle: [0, 0, 60, 60]}"
HEAD = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 60, 60]}\n"
GROUP = "name: g, count: {count}, start: {{rectangle: [1, 1, 59, 59]}}, goal: {{rectangle: [50, 50, 55, 55]}}"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_values_follow_the_truncated_normal_distribution(seed: int) -> None:
    spread = Spread(mean=1.34, sd=0.26, min=0.8, max=1.9)
    drawn = draw_spread(spread, 10_000, np.random.default_rng(seed))
    low, high = (0.8 - 1.34) / 0.26, (1.9 - 1.34) / 0.26
    asked = stats.truncnorm(low, high, loc=1.34, scale=0.26)
    assert drawn.min() >= 0.8
    assert drawn.max() <= 1.9
    assert abs(drawn.mean() / asked.mean() - 1.0) < 0.01
    assert abs(drawn.std() / asked.std() - 1.0) < 0.03
    # A true null hypothesis is refused at this level once in ten thousand.
    assert stats.kstest(drawn, asked.cdf).pvalue > 1e-4


@given(
    mean=st.floats(-1e3, 1e3),
    sd=st.floats(0.0, 1e3),
    below=st.floats(0.0, 10.0),
    above=st.floats(0.0, 10.0),
    count=st.integers(0, 50),
)
def test_values_stay_within_bounds_however_narrow(
    mean: float, sd: float, below: float, above: float, count: int
) -> None:
    spread = Spread(mean=mean, sd=sd, min=mean - below, max=mean + above)
    drawn = draw_spread(spread, count, np.random.default_rng(1))
    assert drawn.shape == (count,)
    assert ((drawn >= mean - below) & (drawn <= mean + above)).all()


def test_a_number_is_everyones() -> None:
    text = steered_scene(GROUP.format(count=20) + ", speed: 1.2, breadth: 0.5, delay: 3", floor=FLOOR)
    walkers = draw_walkers(parse_scenario(text), 0, 20)
    assert set(walkers.speeds) == {1.2}
    assert set(walkers.breadths) == {0.5}
    assert set(walkers.delays) == {3.0}
    assert len(set(walkers.shares)) == 20


def test_each_quantity_has_a_stream_of_its_own() -> None:
    usual = draw_walkers(parse_scenario(steered_scene(GROUP.format(count=50), floor=FLOOR)), 0, 50)
    other = draw_walkers(
        parse_scenario(steered_scene(GROUP.format(count=50) + ", speed: {mean: 1, sd: 0.5}", floor=FLOOR)), 0, 50
    )
    assert (usual.speeds != other.speeds).any()
    np.testing.assert_array_equal(usual.breadths, other.breadths)
    np.testing.assert_array_equal(usual.shares, other.shares)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("speed: 9", r"agents\.0\.speed: 'mean' must be from 0\.1 to 3, got 9"),
        ("speed: {mean: 1, sd: -1}", r"agents\.0\.speed\.sd: must be at least 0"),
        ("speed: {mean: 1, min: 2}", r"'min' \(2\) must not be above 'mean' \(1\)"),
        ("speed: {mean: 1, max: 0.5}", r"'max' \(0\.5\) must not be below 'mean' \(1\)"),
        ("breadth: {sd: 1}", r"agents\.0\.breadth: give exactly one of mean, uniform, .*; found none"),
        ("delay: {mean: 1, men: 2}", r"agents\.0\.delay\.men: unknown key; did you mean 'mean'\?"),
        (
            "delay: soon",
            r"agents\.0\.delay: expected a mapping with keys among mean, sd, uniform, .* got the text 'soon'",
        ),
        ("delay: {uniform: [9, 1]}", r"'uniform' is \[least, most\], got \[9, 1\]"),
        ("speed: {uniform: [1, 9]}", r"'uniform' must be from 0\.1 to 3, got 9"),
        (
            "speed: {uniform: [0.5, 1.0], min: 1.2}",
            r"agents\.0\.speed: no value is within the bounds, 1\.2 to 3; change 'min' and 'max', or the distribution",
        ),
        ("delay: {uniform: [5, 9], max: 4}", r"agents\.0\.delay: no value is within the bounds"),
        ("speed: {lognormal: {mu: 3, sigma: 0.1}}", r"agents\.0\.speed: no value is within the bounds, 0\.1 to 3"),
        ("delay: {mix: [{share: 1, mean: 5}, {share: 1, uniform: [7, 9]}], max: 4}", r"no value is within the bounds"),
        ("speed: {table: imo_passengers, min: 2}", r"no value is within the bounds, 2 to 3"),
        ("attributes: {age: {mix: [{share: 1, mean: 5, sd: 0.1}], min: 50}}", r"agents\.0\.attributes\.age: no value"),
        ("delay: {uniform: [1, 9], sd: 2}", r"'sd' goes with 'mean', not with 'uniform'"),
        ("delay: {gamma: {shape: 1}}", r"agents\.0\.delay\.gamma\.scale: this key is required and missing"),
        ("speed: {table: imo}", r"there is no table 'imo'; there are: imo_passengers"),
        ("speed: {mix: [{uniform: [1, 2]}]}", r"agents\.0\.speed\.mix\.0\.share: this key is required and missing"),
        ("speed: {mix: [{share: 1, mean: 4}]}", r"'mean' must be from 0\.1 to 3, got 4"),
        ("delay: -1", r"'mean' must be from 0 to 1e\+06, got -1"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(keys: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(steered_scene(f"{GROUP.format(count=3)}, {keys}", floor=FLOOR))


@pytest.mark.parametrize(
    "keys",
    [
        "delay: {uniform: [5, 9], min: 9}",
        "delay: 0",
        "delay: {mean: 2, sd: 1, max: 2}",
        "speed: {table: rimea, max: 1}",
    ],
)
def test_bounds_may_leave_the_end_of_a_distribution(keys: str) -> None:
    parse_scenario(steered_scene(f"{GROUP.format(count=3)}, {keys}", floor=FLOOR))


def test_captured_characters_are_neither_broader_nor_later() -> None:
    for key in ("breadth", "delay"):
        text = steered_scene(GROUP.format(count=3) + f", {key}: 0.5", floor=FLOOR).replace("steered,", "captured,")
        with pytest.raises(
            ScenarioError, match=f"'{key}' is about steered agents; give 'locomotion: auto' or 'steered'"
        ):
            parse_scenario(text)


def test_captured_characters_have_a_speed_if_they_are_given_one() -> None:
    text = steered_scene(GROUP.format(count=3) + ", speed: 1", floor=FLOOR).replace("steered,", "captured,")
    assert place_agents(parse_scenario(text), 0.4).speeds.tolist() == [1.0, 1.0, 1.0]
    assert np.isnan(place_agents(parse_scenario(text.replace(", speed: 1", "")), 0.4).speeds).all()


def test_groups_of_all_kinds_meet_at_the_rate_of_steering() -> None:
    text = steered_scene(GROUP.format(count=3), floor=FLOOR)
    text += "  - {name: h, count: 1, start: {point: [2, 2]}, goal: {point: [9, 9]}, locomotion: captured}\n"
    text += "  - {name: i, count: 1, start: {point: [2, 4]}, goal: {point: [9, 9]}}\n"
    scenario = parse_scenario(text)
    assert scenario.locomotions() == {"auto", "captured", "steered"}
    assert scenario.steps_per_second == 10


def test_a_neighborhood_of_captured_motion_needs_somebody_who_may_change() -> None:
    near = "captured_near: {point: [1, 1], radius: 2}\n"
    text = steered_scene(GROUP.format(count=3), floor=FLOOR, rest=near)
    with pytest.raises(ScenarioError, match="captured_near: no group moves 'auto'"):
        parse_scenario(text)
    scenario = parse_scenario(text.replace("locomotion: steered", "locomotion: auto"))
    assert scenario.captured_near is not None
    assert scenario.captured_near.radius == 2.0


def test_another_rate_is_refused() -> None:
    text = steered_scene(GROUP.format(count=3), floor=FLOOR, rest="steps_per_second: 30\n")
    with pytest.raises(ScenarioError, match="steps_per_second: auto and steered agents take 10 steps a second"):
        parse_scenario(text)


def test_the_mean_speed_is_that_of_the_groups_that_give_one() -> None:
    def mean(*groups: str) -> float | None:
        listed = ", ".join(
            f"{{name: g{number}, start: {{rectangle: [1, 1, 40, 40]}}, goal: {{rectangle: [45, 45, 59, 59]}}, {group}}}"
            for number, group in enumerate(groups)
        )
        return mean_speed(parse_scenario(HEAD + f"agents: [{listed}]\n"))

    assert mean("count: 1") is None
    assert mean("count: 1", "count: 1, speed: 0.9") == 0.9
    assert mean("count: 3, speed: 0.8", "count: 1, speed: 1.6") == pytest.approx(1.0)
    assert mean("count: 1, speed: {uniform: [0.8, 1.2]}") == pytest.approx(1.0)
    assert mean("count: 1, speed: {mean: 1.2, sd: 0.2}") == pytest.approx(1.2)
    # A source lets in 0.1 agents a second for 30 s of 60.
    assert mean("rate: 0.1, until: 30, speed: 0.8", "count: 1, speed: 1.6") == pytest.approx(1.0)
