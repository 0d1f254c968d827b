"""Placing of agents: room around each, apart at one time, the same for one seed."""

import numpy as np
import pytest
import shapely

from crowdsim.environment.spots import pieces_of
from crowdsim.errors import ScenarioError
from crowdsim.scenario.cast import place_agents
from crowdsim.scenario.loader import load_scenario, parse_scenario
from crowdsim.scenario.people.placement import NOMINAL_RADIUS, STAND_ROOM
from crowdsim.scenario.schema.agents import STAND_WITHIN
from tests.unit.scenario.sample import TEXT, change

RADIUS = 0.37


def nearest_pair(points: np.ndarray) -> float:
    apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    return float(apart[np.triu_indices(len(points), 1)].min())


def test_each_has_room_within_its_region():
    # A region that holds an obstacle, a wall and a piece off the floor.
    text = change(("[1, 1, 3, 4]", "[3, -1, 7, 8]"), ("count: 4", "count: 12"))
    scenario = parse_scenario(text)
    placement = place_agents(scenario, RADIUS)
    free = scenario.environment.layers[0].free
    for points, group_region in (
        (placement.starts, scenario.agents[0].start.shape()),
        (np.concatenate(placement.goals), scenario.agents[0].goal.shape()),
    ):
        assert points.shape == (12, 2)
        points_2d = shapely.points(points)
        assert shapely.covers(group_region.buffer(1e-9), points_2d).all()
        assert shapely.covers(free, points_2d).all()
        assert (shapely.distance(free.boundary, points_2d) >= RADIUS - 1e-9).all()
    assert nearest_pair(placement.starts) >= 2.0 * RADIUS
    assert placement.start_steps.tolist() == [0] * 12
    assert placement.start_steps.dtype == np.int64


def test_one_after_another_may_start_at_one_point():
    text = change(("{rectangle: [1, 1, 3, 4]}", "{point: [1, 1]}"), ("on_arrival: leave", "interval: 2.5"))
    placement = place_agents(parse_scenario(text), RADIUS)
    assert placement.starts.tolist() == [[1.0, 1.0]] * 4
    assert placement.start_steps.tolist() == [0, 25, 50, 75]


def test_groups_that_start_at_one_time_keep_apart():
    text = change(
        (
            "    on_arrival: leave\n",
            "  - {name: more, count: 4, start: {rectangle: [1, 1, 3, 4]}, goal: {point: [8, 4]}}\n"
            "  - {name: late, count: 1, start: {point: [2, 2]}, goal: {point: [8, 4]}, start_time: 1}\n",
        )
    )
    placement = place_agents(parse_scenario(text), RADIUS)
    assert list(placement.groups) == ["guests"] * 4 + ["more"] * 4 + ["late"]
    assert nearest_pair(placement.starts[:8]) >= 2.0 * RADIUS
    assert placement.starts[8].tolist() == [2.0, 2.0]


def test_those_that_stay_get_goals_apart():
    larger = ("radius: 1.0", "radius: 1.9")
    together = place_agents(parse_scenario(change(larger, ("count: 4", "count: 8"))), RADIUS)
    assert nearest_pair(np.concatenate(together.goals)) < 2.0 * RADIUS + STAND_ROOM
    apart = place_agents(parse_scenario(change(larger, ("count: 4", "count: 8"), ("leave", "stay"))), RADIUS)
    assert nearest_pair(np.concatenate(apart.goals)) >= 2.0 * RADIUS + STAND_ROOM
    assert not together.stays.any()
    assert apart.stays.tolist() == [True] * 8
    with pytest.raises(ScenarioError, match=r"agents.0.goal: 4 agents cannot stay at one point"):
        parse_scenario(change(("leave", "stay"), ("{circle: {center: [8, 4], radius: 1.0}}", "{point: [8, 4]}")))


def test_the_seed_decides_and_groups_draw_apart():
    def starts(*pairs: tuple[str, str]) -> list[list[float]]:
        return place_agents(parse_scenario(change(*pairs)), RADIUS).starts.tolist()

    assert starts() == starts()
    assert starts() != starts(("seed: 5", "seed: 6"))
    other = (
        "    on_arrival: leave\n",
        "  - {name: b, count: 2, start: {point: [1, 5]}, goal: {point: [8, 4]}, interval: 1}\n",
    )
    assert starts(other)[:4] == starts()


def test_draws_are_uniform_over_an_awkward_region():
    text = change(
        ("{rectangle: [1, 1, 3, 4]}", "{polygon: [[1, 1], [3, 1], [3, 5], [2.8, 1.2], [1, 1.2]]}"),
        ("count: 4", "count: 2000"),
        ("on_arrival: leave", "interval: 0.1"),
        ("duration: 60.0", "duration: 300.0"),
    )
    scenario = parse_scenario(text)
    starts = place_agents(scenario, RADIUS).starts
    region = scenario.agents[0].start.shape()
    upper = shapely.box(0.0, 1.2, 10.0, 10.0)
    share = region.intersection(upper).area / region.area
    assert np.mean(starts[:, 1] > 1.2) == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 2000))


def test_a_region_with_many_corners_is_cut_into_pieces_that_make_it_up():
    combs = [shapely.box(0.1 * k, 0.5 * (k % 7), 0.1 * k + 0.05, 6.0) for k in range(1500)]
    area = shapely.MultiPolygon([shapely.box(0.0, 0.0, 150.0, 8.0).difference(shapely.union_all(combs))])
    pieces = pieces_of(area)
    assert len(pieces) > 1
    assert sum(piece.area for piece in pieces) == pytest.approx(area.area)
    assert shapely.union_all(pieces).symmetric_difference(area).area < 1e-9
    assert pieces_of(pieces[0]) == [pieces[0]]


def test_too_many_for_the_room_end_in_an_error_that_says_how_many_fit():
    scenario = parse_scenario(change(("[1, 1, 3, 4]", "[1, 1, 2.5, 2.5]")))
    with pytest.raises(ScenarioError, match=r"<text>:17:12: agents.0.start: only [1-3] of 4 agents .* 0.80 m around"):
        place_agents(scenario, 0.8)
    with pytest.raises(ScenarioError, match=r"no spot with 3\.50 m of free floor"):
        place_agents(scenario, 3.5)


def test_loading_checks_with_a_body_of_usual_size():
    assert 0.2 < NOMINAL_RADIUS < RADIUS
    assert parse_scenario(TEXT)


@pytest.mark.parametrize("name", ["corridor", "doorway"])
def test_the_built_in_scenarios_have_room_for_their_characters(name):
    scenario = load_scenario(name)
    assert len(place_agents(scenario, RADIUS).starts) == scenario.agents[0].count


def test_goals_in_sequence_are_drawn_apart_and_the_first_as_if_it_were_the_only_one():
    several = (
        "goal: {circle: {center: [8, 4], radius: 1.0}}",
        "goals: [{circle: {center: [8, 4], radius: 1.0}}, {rectangle: [1, 1, 3, 4]}, {point: [6, 1]}]\n"
        "    repeat: 2\n    wait: 1.5",
    )
    one, three = place_agents(parse_scenario(TEXT), RADIUS), place_agents(parse_scenario(change(several)), RADIUS)
    assert np.array_equal(one.starts, three.starts)
    for agent in range(4):
        assert three.goals[agent].shape == (3, 2)
        assert np.array_equal(one.goals[agent][0], three.goals[agent][0])
        assert not np.allclose(three.goals[agent][1], three.starts[agent])
        assert three.goal(agent, 4).tolist() == three.goals[agent][1].tolist()
    assert (one.rounds.tolist(), three.rounds.tolist()) == ([1] * 4, [2] * 4)
    assert [three.is_last(0, reached) for reached in range(6)] == [False] * 5 + [True]
    assert [three.stands(0, reached) for reached in range(6)] == [True] * 5 + [False]
    assert one.is_last(0, 0)
    assert not one.stands(0, 0)


def test_those_who_go_round_forever_have_no_last_goal():
    text = change(
        (
            "goal: {circle: {center: [8, 4], radius: 1.0}}",
            "goals: [{point: [8, 4]}, {point: [1, 5]}]\n    repeat: forever",
        )
    )
    placement = place_agents(parse_scenario(text), RADIUS)
    assert not any(placement.is_last(0, reached) for reached in range(1000))
    assert not placement.stands(0, 7)


def test_places_keep_clear_of_what_comes_later_where_they_can():
    crate = (
        "events: [{at: 5, insert: {name: crate, box: {min: [1, 1], max: [3, 2.5]}, top: 1}}]\nmotion: {set: default}"
    )
    text = change(("motion: {set: default}", crate), ("count: 4", "count: 3"))
    starts = place_agents(parse_scenario(text), RADIUS).starts
    assert (starts[:, 1] >= 2.5 + RADIUS - 1e-6).all()
    inside = ("{rectangle: [1, 1, 3, 4]}", "{rectangle: [1.1, 1.1, 2.9, 2.4]}")
    under = change(("motion: {set: default}", crate), inside, ("count: 4", "count: 1"))
    assert len(place_agents(parse_scenario(under), RADIUS).starts) == 1


def test_headings_and_distances_of_stands_are_those_of_the_group():
    asked = ("goal: {circle", "stand_within: 0.02\n    goal: {heading: -90, circle")
    region = ("radius: 1.0", "radius: 1.5")
    placed = place_agents(parse_scenario(change(asked, region, ("leave", "stay"))), RADIUS)
    assert placed.stand_within.tolist() == [0.02] * 4
    assert [placed.heading(agent, 0) for agent in range(4)] == [-np.pi / 2] * 4
    plain = place_agents(parse_scenario(change()), RADIUS)
    assert plain.heading(0, 0) is None
    assert plain.stand_within.tolist() == [STAND_WITHIN] * 4
