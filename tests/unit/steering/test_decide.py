"""What agents want, against the rules written down one by one."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.steering import wall_kernels
from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR
from crowdsim.steering.rules import Rules
from crowdsim.steering.stuck_kernels import STEP_BACK, WEDGED_AFTER, to_where_room_is
from crowdsim.steering.walls import build_walls
from tests.reference import steering_reference as reference
from tests.support.decisions import decide, near_rows
from tests.support.steered import State, agents, scatter


@kernel
def _free_ahead(walls, x, y, ux, uy, width, farthest):
    return wall_kernels.free_ahead(walls, x, y, ux, uy, width, farthest)


def _busy(seed: int) -> State:
    """A crowd in the midst of all that the rules speak of."""
    rng = np.random.default_rng(seed)
    # In pairs, so near each other that some could touch in a step.
    places = scatter(rng, 12, (0, 0), (4.5, 4.5)).repeat(2, axis=0)
    places[1::2] += [0.3, 0.0]
    state = agents(places, rng.normal(0.0, 0.1, 24), rng.integers(0, 3, 24), rng)
    way = rng.uniform(-math.pi, math.pi, 24)
    state["gx"], state["gy"] = np.cos(way), np.sin(way)
    intent = way + rng.normal(0.0, 0.3, 24)
    state["ix"], state["iy"] = np.cos(intent), np.sin(intent)
    pace = rng.uniform(0.0, 1.3, 24) * rng.integers(0, 2, 24)
    state["vx"], state["vy"] = pace * np.cos(way), pace * np.sin(way)
    state["togo"] = rng.uniform(0.0, 6.0, 24)
    state["key"] = state["togo"] + Rules().identity * state["share"]
    state["stuck"] = rng.uniform(-3.0, 6.0, 24).clip(0.0)
    state["rank"] = state["stuck"] + 0.001 * state["share"]
    state["opposed"] = rng.random(24) * rng.integers(0, 2, 24)
    stays = rng.random(24) < 0.15
    # Ways with a bend within some meters, as a rule.
    course, on = way + rng.normal(0.0, 0.3, 24), rng.uniform(-math.pi, math.pi, 24)
    state["cx"], state["cy"], state["ahead"] = np.cos(course), np.sin(course), rng.uniform(0.0, 3.0, 24)
    state["onx"], state["ony"] = np.cos(on), np.sin(on)
    ends = rng.random(24) < 0.2
    state["onx"][ends] = state["ony"][ends] = 0.0
    for name in ("gx", "gy", "ix", "iy", "cx", "cy", "onx", "ony", "ahead"):
        state[name][stays] = 0.0
    return state


def _jammed(seed: int) -> tuple[State, np.ndarray]:
    """A busy crowd of whom half have long been stuck, some of high rank, between walls through the midst of it."""
    rng = np.random.default_rng(seed)
    state = _busy(seed)
    state["stuck"] = np.where(rng.random(24) < 0.5, rng.uniform(10.0, 30.0, 24), state["stuck"])
    state["rank"] = state["stuck"] + 0.001 * state["share"]
    lasting = rng.random(24) < 0.3
    state["rank"][lasting] = 100.0 + 20.0 * rng.random(lasting.sum())
    ends = rng.uniform(0.0, 4.5, (12, 1, 2)) + rng.normal(0.0, 0.3, (12, 2, 2))
    return state, ends.reshape(-1, 4)


def test_the_right_of_way_in_a_jam_is_that_of_the_slow_twin() -> None:
    seen = dict.fromkeys(("lasting by itself", "pushed on", "gave way"), 0)
    alike = 0
    for seed in range(8):
        state, segments = _jammed(seed)
        heeded, near = near_rows(state)
        wanted = decide(state, near, segments)
        for me in range(len(state)):
            walls = build_walls(segments)
            expected = reference.Decision(state, me, heeded[me], Rules(), segments, partial(_free_ahead, walls))
            # The slow twin measures distances to walls exactly, kernels on a grid: some places are narrow for one only.
            alike += abs(wanted["rank"][me] - expected.rank) < 1e-9
            by_itself = 100.0 + 20.0 * state["share"][me]
            seen["lasting by itself"] += wanted["rank"][me] == by_itself
            seen["pushed on"] += expected.goes and max(expected.pressing(), default=0.0) == wanted["rank"][me]
            seen["gave way"] += wanted["rank"][me] > 31.0 and expected.give_way() is not None
    assert alike >= 0.93 * 8 * 24
    assert min(seen.values()) > 0, seen


@pytest.mark.parametrize("seed", range(6))
def test_decisions_follow_the_rules(seed):
    state = _busy(seed)
    heeded, near = near_rows(state)
    wanted = decide(state, near)
    alike = 0
    for me in range(len(state)):
        expected = reference.Decision(state, me, heeded[me], Rules())
        assert wanted["opposed"][me] == pytest.approx(expected.opposed, abs=1e-9)
        found = np.array([wanted["vx"][me], wanted["vy"][me]])
        alike += bool(np.allclose(found, expected.velocity, atol=2e-3))
    # Two directions may score the same but for the ticks of the slow twin.
    assert alike >= len(state) - 1


def test_rules_that_need_a_certain_place():
    seen = {"gave way": 0, "merged": 0}
    for seed in range(6):
        state = _busy(seed)
        heeded, near = near_rows(state)
        wanted = decide(state, near)
        for me in range(len(state)):
            decision = reference.Decision(state, me, heeded[me], Rules())
            gave_way = decision.give_way() is not None
            merged = not gave_way and decision.goes and decision.let_merge() is not None
            seen["gave way"] += gave_way
            seen["merged"] += merged
            # What is inherited: rank of whom it gives way to, key of whom it lets merge.
            if gave_way:
                assert wanted["rank"][me] > Rules().yield_after - 0.01
            elif merged:
                assert wanted["key"][me] < decision.key
                assert wanted["turn"][me] == pytest.approx(_turn_across(state[me], decision.across), abs=1e-9)
            else:
                assert wanted["rank"][me] == state["stuck"][me] + 0.001 * state["share"][me]
                assert wanted["key"][me] == decision.key
    assert seen["gave way"] > 0
    assert seen["merged"] > 0


def _turn_across(row: np.void, way: np.ndarray) -> float:
    """Turn in a step of a body that turns narrow across a way, to the side that is nearer [rad]."""
    heading = math.atan2(row["hy"], row["hx"])
    sides = [math.atan2(way[0], -way[1]) - heading, math.atan2(-way[0], way[1]) - heading]
    nearer = min(((side + math.pi) % (2.0 * math.pi) - math.pi for side in sides), key=abs)
    most = Rules().turn_rate * Rules().step
    return float(np.clip(nearer, -most, most))


def test_who_walks_does_not_turn_sideways():
    """From ``sideways_below`` on, shoulders turn by 60 degrees at most; slower agents turn them by up to 75."""
    tried = {False: set(), True: set()}
    for seed in range(40):
        state = _busy(seed)
        state["stuck"] = state["rank"] = 0.0  # nobody gives way or lets others merge, which turns shoulders fully
        wanted = decide(state, near_rows(state)[1])
        walks = np.hypot(state["vx"], state["vy"]) >= Rules().sideways_below
        for pace in (False, True):
            tried[pace] |= set(np.degrees(np.arccos(wanted["turn_cos"][walks == pace])).round().tolist())
    assert tried[True] == {0.0, 40.0, 60.0}
    assert tried[False] == {0.0, 40.0, 60.0, 75.0}


def test_a_follower_keeps_a_time_gap():
    rng = np.random.default_rng(1)
    state = agents(np.array([[0.0, 0.0], [0.8, 0.0]]), np.zeros(2), np.zeros(2, int), rng)
    state["key"] = state["togo"] = [10.0, 9.0]
    state["vx"] = [1.0, 0.4]
    state["ix"] = 1.0
    heeded, near = near_rows(state)
    rules = Rules()
    gap = 0.8 - 2 * 0.125
    allowed = (gap - rules.standoff) / rules.headway + rules.leader * 0.4 * min(1.0, gap / rules.leader_gap)
    assert reference.Decision(state, 0, heeded[0], rules).speed(np.array([1.0, 0.0])) == pytest.approx(allowed)
    wanted = decide(state, near)
    # Nobody slows down, or speeds up, faster than people do.
    assert abs(wanted["vx"][0] - 1.0) <= rules.acceleration * rules.step + 1e-12


def _file(seed: int, opposed: float) -> State:
    """People one behind the other on the x axis, as they may be in a lane of 0.8 m, some of them stuck."""
    rng = np.random.default_rng(seed)
    count = 12
    places = np.column_stack((np.cumsum(rng.uniform(0.35, 1.0, count)), rng.uniform(-0.1, 0.1, count)))
    state = agents(places, rng.normal(0.0, 0.05, count), np.zeros(count, int), rng)
    state["gx"], state["gy"], state["ix"], state["iy"] = 1.0, 0.0, 1.0, 0.0
    state["vx"] = rng.uniform(0.0, 0.8, count)
    state["togo"] = 30.0 - state["x"]
    state["key"] = state["togo"] + Rules().identity * state["share"]
    state["stuck"] = rng.choice([0.0, 0.1, 0.8], count)
    state["opposed"] = opposed
    return state


@pytest.mark.parametrize(("width", "opposed"), [(0.8, 0.0), (0.8, 0.5), (1.0, 0.0)])
def test_in_a_lane_people_of_one_way_walk_in_file(width, opposed):
    walls = np.array([[-9.0, -0.5 * width, 30.0, -0.5 * width], [-9.0, 0.5 * width, 30.0, 0.5 * width]])
    alike = turned = 0
    for seed in range(4):
        state = _file(seed, opposed)
        heeded, near = near_rows(state)
        wanted = decide(state, near, walls)
        for me in range(len(state)):
            expected = reference.Decision(
                state, me, heeded[me], Rules(), walls, partial(_free_ahead, build_walls(walls))
            )
            # All but the first one, and those who have waited too long.
            follows = me < len(state) - 1 and state["stuck"][me] < 0.5
            assert expected.in_file() == (follows and width == 0.8 and opposed == 0.0)
            assert wanted["turn_sin"][me] == 0.0 or not expected.in_file()
            turned += wanted["turn_sin"][me] > 0.0
            found = np.array([wanted["vx"][me], wanted["vy"][me]])
            alike += bool(np.allclose(found, expected.velocity, atol=2e-3))
    # Two directions may score the same but for the ticks of the slow twin.
    assert alike >= 47
    assert turned > 0


@pytest.mark.parametrize("goals", [(0, 0), (0, 1)])
def test_in_a_file_the_leader_goes_first_whichever_is_nearer_to_its_goal(goals: tuple[int, int]) -> None:
    """A leader that has just reached one goal, and has the longest way to the next, still limits the speed."""
    walls = np.array([[-9.0, -0.4, 30.0, -0.4], [-9.0, 0.4, 30.0, 0.4]])
    speeds = []
    for leader_key in (4.0, 14.0):
        state = agents(np.array([[0.0, 0.0], [0.75, 0.02]]), np.zeros(2), np.array(goals), np.random.default_rng(3))
        state["gx"], state["gy"], state["ix"], state["iy"] = 1.0, 0.0, 1.0, 0.0
        state["key"] = 9.0, leader_key
        speeds.append(decide(state, near_rows(state)[1], walls)["vx"][0])
    alone = decide(state[:1].copy(), near_rows(state[:1].copy())[1], walls)["vx"][0]
    assert speeds[0] == speeds[1] < 0.5 * alone


def _bend(width: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Walls of a lane that comes along the x axis and turns left half way round, as segments; its middle, (n, 4)."""
    angles = np.radians(np.arange(-90.0, 91.0, 6.0))
    arc = np.column_stack((np.cos(angles), np.sin(angles)))
    segments = []
    for off in (-0.5 * width, 0.5 * width):
        line = (radius + off) * arc + (0.0, radius)
        line = np.concatenate(([[-9.0, line[0, 1]]], line, [[-9.0, line[-1, 1]]]))
        segments.append(np.column_stack((line[:-1], line[1:])))
    middle = np.column_stack((radius * arc + (0.0, radius), -arc[:, 1], arc[:, 0]))
    return np.concatenate(segments), middle


@pytest.mark.parametrize(("width", "radius"), [(0.8, 1.48), (0.7, 1.0), (1.0, 1.48)])
def test_files_go_on_around_a_bend_whatever_goals_lie_ahead(width: float, radius: float) -> None:
    walls, middle = _bend(width, radius)
    rng = np.random.default_rng(1)
    followed = 0
    for at in range(2, len(middle) - 6, 3):
        pair = middle[[at, at + round(0.7 / radius / math.radians(6.0))]]
        state = agents(pair[:, :2], np.arctan2(pair[:, 3], pair[:, 2]), np.array([0, 1]), rng)
        state["gx"], state["gy"] = state["ix"], state["iy"] = pair[:, 2], pair[:, 3]
        state["vx"], state["vy"] = 0.5 * pair[:, 2], 0.5 * pair[:, 3]
        heeded, near = near_rows(state)
        expected = reference.Decision(state, 0, heeded[0], Rules(), walls, partial(_free_ahead, build_walls(walls)))
        assert expected.in_file() == (width < 0.85)
        followed += expected.in_file()
        found = decide(state, near, walls)[0]
        np.testing.assert_allclose([found["vx"], found["vy"]], expected.velocity, atol=5e-3)
    assert (followed > 3) == (width < 0.85)


@pytest.mark.parametrize(("wall", "told"), [(1.0, False), (4.0, True)])
def test_people_behind_walls_are_no_opposing_traffic(wall: float, told: bool) -> None:
    """Neither is seen one who comes, nor heard one who knows of others, nor made way for one who is stuck."""
    walls = np.array([[wall, -3.0, wall, 3.0]])
    rng = np.random.default_rng(5)
    for along, knows, stuck in ((-1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 0.0, 3.0)):
        far = 1.3 if stuck else 2.0
        state = agents(np.array([[0.0, 0.0], [far, 0.1]]), np.zeros(2), np.array([0, 1]), rng)
        state["gx"] = state["ix"] = 1.0, along
        state["gy"] = state["iy"] = 0.0
        state["opposed"] = 0.0, knows
        state["stuck"] = state["rank"] = 0.0, stuck
        state["togo"] = state["key"] = 9.0
        heeded, near = near_rows(state)
        expected = reference.Decision(state, 0, heeded[0], Rules(), walls, partial(_free_ahead, build_walls(walls)))
        wanted = decide(state, near, walls)
        assert wanted["opposed"][0] == pytest.approx(expected.opposed, abs=1e-9)
        assert (wanted["opposed"][0] > 0.0) == told
        gives_way = expected.give_way() is not None
        assert gives_way == (told and stuck > 0.0)
        assert (wanted["rank"][0] > 2.0) == gives_way


@pytest.mark.parametrize("stuck", [3.0, 6.0])
@pytest.mark.parametrize("wall", [-0.14, 0.14])
def test_who_is_stuck_for_long_beside_a_wall_gives_way_to_where_there_is_room(wall: float, stuck: float) -> None:
    """Beside low things, an agent pressed against them for good while the other one waited for it to step aside."""
    walls = np.array([[-5.0, wall, 5.0, wall]])
    state = agents(np.array([[0.0, 0.0], [0.45, 0.0]]), np.zeros(2), np.array([0, 1]), np.random.default_rng(2))
    state["gx"] = state["ix"] = 1.0, -1.0
    state["gy"] = state["iy"] = state["vx"] = state["vy"] = 0.0
    state["stuck"] = state["rank"] = stuck, 30.0
    state["radius"] = 0.125
    heeded, near = near_rows(state)
    expected = reference.Decision(state, 0, heeded[0], Rules(), walls, partial(_free_ahead, build_walls(walls)))
    found = decide(state, near, walls)[0]
    np.testing.assert_allclose([found["vx"], found["vy"]], expected.velocity, atol=1e-9)
    assert found["ix"] < 0.0
    # Its own right, as ever, is at negative y; after long it goes back along a wall there.
    assert (found["iy"] < -0.5) == (wall > 0.0 or stuck < 5.0)


@kernel
def _to_where_room_is(row, walls, ux, uy, ix, iy):
    return to_where_room_is(row, walls, ux, uy, ix, iy)


@pytest.mark.parametrize("in_the_way", ["legs", "torso"])
def test_room_to_give_way_is_that_for_legs_and_torso(in_the_way: str) -> None:
    """A table beside an agent is no room, nor is a shelf above its legs; to step towards the other is no way out."""
    state = agents(np.zeros((1, 2)), np.zeros(1), np.zeros(1, int), np.random.default_rng(2))
    things = np.array([[-5.0, -0.2, 5.0, -0.2]])
    none = np.empty((0, 4))
    walls = [build_walls(things if name == in_the_way else none) for name in ("legs", "torso")]
    for angle in np.linspace(-math.pi, math.pi, 25):
        way = np.array([math.cos(angle), math.sin(angle)])
        found = np.array(_to_where_room_is(state[0], (*walls, 0.125), 0.0, -1.0, *way))
        assert np.hypot(*found) == pytest.approx(1.0)
        assert found @ way >= -0.5 - 1e-9
        assert found[1] > -0.1
    walls = [build_walls(none), build_walls(none)]
    assert _to_where_room_is(state[0], (*walls, 0.125), 0.0, -1.0, 1.0, 0.0) == (0.0, -1.0)


@pytest.mark.parametrize("offset", np.linspace(0.0, 1.0, 5))
def test_those_on_the_other_side_of_a_ring_are_no_opposing_traffic(offset: float) -> None:
    """Thirteen people around a ring as in RiMEA 16, who aim to touch its inner wall as the shortest way does."""
    walls, _ = _bend(0.8, 1.48)
    walls = np.concatenate((walls, [-0.1, 0.0, -0.1, 0.0] - walls))
    walls[len(walls) // 2 :, 1::2] += 2 * 1.48
    angles = 2.0 * math.pi * (np.arange(13) + offset) / 13
    places = np.column_stack((1.48 * np.cos(angles), 1.48 * np.sin(angles) + 1.48))
    state = agents(places, angles + 0.5 * math.pi, np.arange(13) % 5, np.random.default_rng(1))
    ways = angles + 0.5 * math.pi + math.radians(25.0)
    state["gx"] = state["ix"] = np.cos(ways)
    state["gy"] = state["iy"] = np.sin(ways)
    heeded, near = near_rows(state)
    for me in range(13):
        assert reference.Decision(state, me, heeded[me], Rules(), walls).opposed == 0.0
    assert not decide(state, near, walls)["opposed"].any()
    # Without walls they would be, but for the bound to the left.
    assert decide(state, near, rules=Rules(opposing_left=Rules().opposing_right))["opposed"].all()


def test_who_stays_wants_nothing():
    rng = np.random.default_rng(2)
    state = agents(np.array([[0.0, 0.0], [0.0, 0.6]]), np.zeros(2), np.zeros(2, int), rng)
    for name in ("gx", "gy", "ix", "iy"):
        state[name] = 0.0
    wanted = decide(state, near_rows(state)[1])
    assert not wanted["vx"].any()
    assert not wanted["vy"].any()
    assert not wanted["turn"].any()


@pytest.mark.parametrize("stuck", [9.0, 20.5, 21.5, 22.5])
@pytest.mark.parametrize("opposed", [0.0, 1.0])
@pytest.mark.parametrize("width", [0.9, 1.6])
def test_jammed_agents_step_back_now_and_then(stuck: float, opposed: float, width: float) -> None:
    """In a narrow passage, from those who come towards them, so that bodies that lean on each other come free."""
    walls = np.array([(-5.0, 0.5 * width, 5.0, 0.5 * width), (-5.0, -0.5 * width, 5.0, -0.5 * width)])
    rng = np.random.default_rng(4)
    state = agents(np.array([(0.0, 0.0), (0.4, 0.0)]), np.zeros(2), np.array([0, 1]), rng)
    state["gx"] = state["ix"] = 1.0
    state["gy"] = state["iy"] = 0.0
    state["stuck"], state["opposed"] = (stuck, 0.0), opposed
    state["togo"] = state["key"] = 9.0
    heeded, near = near_rows(state)
    wanted = decide(state, near, walls)
    expected = reference.Decision(state, 0, heeded[0], Rules(), walls, partial(_free_ahead, build_walls(walls)))
    np.testing.assert_allclose([wanted["vx"][0], wanted["vy"][0]], expected.velocity, atol=5e-3)
    assert (wanted["vx"][0] < 0.0) == (20.0 <= stuck < 22.0 and opposed > 0.0 and width < 1.2)


def test_the_right_of_way_of_a_jammed_agent_lasts_while_it_goes_on() -> None:
    """The time stuck falls as soon as an agent makes progress; the right of way would change to another one then."""
    walls = np.array([(-5.0, 0.45, 5.0, 0.45), (-5.0, -0.45, 5.0, -0.45)])
    state = agents(np.zeros((1, 2)), np.zeros(1), np.zeros(1, int), np.random.default_rng(4))
    ranks = []
    for stuck in (9.9, 10.0, 20.0, 30.0, 12.0):
        state["stuck"] = stuck
        ranks.append(float(decide(state, near_rows(state)[1], walls)["rank"][0]))
    assert ranks[0] < 10.0
    assert ranks[1] >= 100.0
    assert len(set(ranks[1:])) == 1


@pytest.mark.parametrize("off", [0.15, 0.3, 0.5])
@pytest.mark.parametrize("layer", [0, 1])
def test_who_walks_along_a_single_wall_is_not_jammed(off: float, layer: int) -> None:
    state = agents(np.zeros((1, 2)), np.zeros(1), np.zeros(1, int), np.random.default_rng(4))
    state["stuck"] = 20.0
    for sides in (1, 2):
        segments = np.array([(-9.0, off, 9.0, off), (-9.0, -0.4, 9.0, -0.4)])[:sides]
        walls = [np.empty((0, 4))] * 2
        walls[layer] = segments
        wanted = np.zeros(1, WANTED)
        order, near = np.zeros(1, np.int32), np.full((1, MOST_NEAR), -1, np.int32)
        decide_rows(state, near, 0, 1, order, 1, (*map(build_walls, walls), 0.1), Rules(), wanted)
        # A passage is narrow, too, if its walls are in the legs' layer only.
        assert (wanted["rank"][0] >= 100.0) == (sides == 2)


def test_a_right_of_way_ends_with_its_owner() -> None:
    """Two of one goal whose ways meet, each beside the other's, once handed a rank to and fro for three minutes."""
    state = agents(np.array([(0.0, 0.0), (0.45, 0.0)]), np.zeros(2), np.zeros(2, int), np.random.default_rng(4))
    ways = np.radians([60.0, 120.0])
    state["gx"], state["gy"] = np.cos(ways), np.sin(ways)
    state["ix"], state["iy"], state["rank"] = state["gx"], state["gy"], 119.0
    wanted = decide(state, near_rows(state)[1])
    state["rank"] = wanted["rank"]
    assert (decide(state, near_rows(state)[1])["rank"] < 31.0).all()


@pytest.mark.parametrize("stuck", [4.0, 6.0, 10.5, 12.0, 21.5, 25.5])
@pytest.mark.parametrize("beside", [0.4, 1.2])
@pytest.mark.parametrize("wall", [0.18, 0.6])
def test_wedged_agents_turn_and_step_back_as_the_slow_twin(stuck: float, beside: float, wall: float) -> None:
    rng = np.random.default_rng(4)
    walls = np.array([(-5.0, wall, 5.0, wall)])
    state = agents(np.array([(0.0, 0.0), (beside, -0.4)]), np.zeros(2), np.array([0, 1]), rng)
    state["gx"], state["gy"], state["ix"], state["iy"] = 1.0, 0.0, 1.0, 0.0
    state["stuck"] = stuck, 0.0
    state["togo"] = state["key"] = 9.0
    near = np.full((2, MOST_NEAR), -1, np.int32)
    near[0, 0], near[1, 0] = 1, 0
    wanted = decide(state, near, walls)
    free = partial(_free_ahead, build_walls(walls))
    expected = reference.Decision(state, 0, [1], Rules(), walls, free)
    np.testing.assert_allclose([wanted["vx"][0], wanted["vy"][0]], expected.velocity, atol=2e-3)
    assert (wanted["turn_sin"][0] == 1.0) == (stuck > WEDGED_AFTER and wall < 0.2)
    assert wanted["vx"][0] >= -STEP_BACK
    assert (wanted["vx"][0] < 0.0) == (stuck in (10.5, 25.5) and wall < 0.2 and beside > 1.0)
