"""Steered agents start beside each other, however many there are."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from crowdsim.errors import ScenarioError
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.crowd_placement import BODY_DEPTH, SPARE
from tests.support.steered_scenes import steered_scene

FLOOR = "{rectangle: [0, 0, 60, 60]}"
GOAL = "goal: {rectangle: [50, 50, 55, 55]}"


def placed(group: str, *more: str, seed: int = 1):
    return place_crowd(parse_scenario(steered_scene(group, *more, floor=FLOOR, seed=seed)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_few_start_at_random_and_face_their_way(seed: int) -> None:
    cast = placed(f"name: g, count: 400, start: {{rectangle: [1, 1, 21, 21]}}, {GOAL}", seed=seed)
    apart = cKDTree(cast.starts).query(cast.starts, k=2)[0][:, 1]
    assert apart.min() >= cast.walkers.breadths.max() + SPARE
    assert np.isnan(cast.headings).all()
    assert cast.starts.min() >= 1.0
    assert cast.starts.max() <= 21.0


@pytest.mark.parametrize("density", [3.0, 4.5, 6.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_many_start_in_rows_that_leave_every_body_its_room(density: float, seed: int) -> None:
    side = 12.0
    count = int(density * side * side)
    cast = placed(f"name: g, count: {count}, start: {{rectangle: [4, 4, {4 + side}, {4 + side}]}}, {GOAL}", seed=seed)
    heading = cast.headings[0]
    assert (cast.headings == heading).all()
    along = np.array([np.cos(heading), np.sin(heading)])
    for pair in cKDTree(cast.starts).query_pairs(0.6):
        between = cast.starts[pair[1]] - cast.starts[pair[0]]
        behind, beside = abs(between @ along), abs(between @ np.array([-along[1], along[0]]))
        broad = cast.walkers.breadths[list(pair)].mean()
        # Cores lie across the heading: what is between two boxes around the bodies.
        assert behind >= BODY_DEPTH or beside >= broad


def test_too_many_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"agents\.0\.start: only \d+ of 2000 agents found a place"):
        placed(f"name: g, count: 2000, start: {{rectangle: [1, 1, 11, 11]}}, {GOAL}")


def test_a_party_without_any_place_is_refused() -> None:
    first = f"name: first, count: 1, start: {{rectangle: [1, 1, 1.2, 1.2]}}, {GOAL}"
    with pytest.raises(ScenarioError, match=r"agents\.1\.start: only 0 of 2 agents found a place"):
        placed(first, first.replace("first, count: 1", "pair, count: 2, together: 2"))


def test_a_floor_beyond_what_steering_can_sort_is_refused() -> None:
    group = f"name: g, count: 1, start: {{point: [5, 5]}}, {GOAL}"
    with pytest.raises(ScenarioError, match=r"floor: .*2 km by 2 km; this one takes 3,000 m by 1,500 m; cut it"):
        parse_scenario(steered_scene(group, floor="{rectangle: [0, 0, 3000, 1500]}"))
    parse_scenario(steered_scene(group, floor="{rectangle: [0, 0, 1990, 1990]}"))


def test_two_cannot_start_at_one_point_at_once_but_one_after_the_other() -> None:
    with pytest.raises(ScenarioError, match="2 agents cannot start at once at one point"):
        placed(f"name: g, count: 2, start: {{point: [5, 5]}}, {GOAL}")
    cast = placed(f"name: g, count: 2, interval: 1, start: {{point: [5, 5]}}, {GOAL}")
    np.testing.assert_array_equal(cast.starts, [[5, 5], [5, 5]])


def test_groups_that_start_together_keep_apart_and_share_goals() -> None:
    group = f"start: {{rectangle: [1, 1, 9, 9]}}, {GOAL}"
    cast = placed(f"name: a, count: 30, {group}", f"name: b, count: 30, {group}")
    for pair in cKDTree(cast.starts).query_pairs(0.7):
        first, second = cast.starts[list(pair)]
        # However both are turned.
        assert np.hypot(*(second - first)) > cast.walkers.breadths[list(pair)].mean() + 0.5 * SPARE
    assert len(cast.goals) == 1
    assert cast.names == ("a", "b")
    assert cast.group.tolist() == [0] * 30 + [1] * 30


def test_a_change_to_one_group_leaves_the_others_alone() -> None:
    a = f"name: a, count: 30, start: {{rectangle: [1, 1, 9, 9]}}, {GOAL}"
    b = f"start: {{rectangle: [20, 1, 29, 9]}}, {GOAL}"
    few, more = placed(a, f"name: b, count: 10, {b}"), placed(a, f"name: b, count: 20, {b}")
    np.testing.assert_array_equal(few.starts[:30], more.starts[:30])
    np.testing.assert_array_equal(few.walkers.speeds[:30], more.walkers.speeds[:30])


def test_who_stays_has_a_spot_of_its_own() -> None:
    stay = f"name: g, count: 20, start: {{rectangle: [1, 1, 21, 21]}}, {GOAL}, on_arrival: stay"
    spots = placed(stay).spots[:, 0]
    assert cKDTree(spots).query(spots, k=2)[0][:, 1].min() > 0.8
    assert (spots >= 50.0).all()
    assert (spots <= 55.0).all()
    assert np.isnan(placed(stay.replace("stay", "leave")).spots).all()


@pytest.mark.parametrize(
    ("start", "message"),
    [("{point: [5, 0.1]}", "no spot with"), ("{point: [90, 5]}", "lies off the floor")],
)
def test_starts_without_room_are_refused(start: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=rf"agents\.0\.start: .*{message}"):
        placed(f"name: g, count: 1, start: {start}, {GOAL}")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("count: 1, start: {point: [5, 0.29]}, " + GOAL, r"start: no spot with 0\.30 m of free floor around it"),
        ("count: 2000, start: {rectangle: [1, 1, 11, 11]}, " + GOAL, r"start: only \d+ of .* with 0\.30 m around each"),
        (
            "count: 90, interval: 1, start: {point: [5, 5]}, on_arrival: stay, goal: {rectangle: [50, 50, 55, 55]}",
            r"goal: only \d+ of .* with 0\.30 m around each",
        ),
    ],
)
def test_captured_ones_among_steered_ones_are_told_the_room_that_they_need(keys: str, message: str) -> None:
    steered = f"name: s, count: 1, start: {{point: [30, 30]}}, {GOAL}"
    text = steered_scene(steered, f"name: c, {keys}", floor=FLOOR, duration=200)
    with pytest.raises(ScenarioError, match=rf"agents\.1\.{message}"):
        parse_scenario(text.replace("locomotion: steered, name: c", "locomotion: captured, name: c"))
