"""Agents with goals of their own get ways of their own, which lead as fields of the whole place do."""

import numpy as np
import pytest
import shapely

from crowdsim.steering.guidance.field import asked_of, guide, solve_field
from crowdsim.steering.guidance.ground import NOBODY, build_ground
from crowdsim.steering.guidance.ground_kernels import BOX, PIN_UNIT, STEPS
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.guidance.own import own_ways
from crowdsim.steering.guidance.own.own_way_kernels import begin_ways, label_boxes, sample_each
from crowdsim.steering.guidance.own.own_ways import OwnWays
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.guidance.sample_kernels import LOST
from crowdsim.steering.guidance.solve_kernels import LEAST_DETOUR
from tests.reference import guidance_reference
from tests.support.guided import BEHAVIORS, free_places, ground_of, rows_at
from tests.support.small_scenes import scene
from tests.unit.steering.guidance.test_ways_on import HALL, NO_MARGIN, strewn

ASKED = asked_of(BEHAVIORS)
SHOWN = ["gx", "gy", "togo", "turn", "held"]


def sent(places, goals):
    """Rows of agents at places, each of which goes to the goal with its number, and what they follow."""
    state = rows_at(places)
    state["goal"] = np.arange(len(places)) % len(goals)
    return state, np.full(len(places), PLAIN, np.int32)


def guided(ground, goals, places, **more):
    """Return the rows of agents with ways of their own, what they follow, and the ways."""
    ways = OwnWays(ground, ASKED, **more)
    state, following = sent(places, goals)
    ways.write(goals, state, following, np.arange(len(places)))
    return state, following, ways


def goals_in(areas, count, seed):
    """Points, discs and rectangles; some of them out of reach."""
    rng = np.random.default_rng(seed)
    goals = []
    for place in free_places(areas, count, seed, 0.3):
        kind = rng.integers(3)
        if kind == 0:
            goals.append(place)
        else:
            shape = shapely.Point(*place).buffer(0.25) if kind == 1 else shapely.box(*(place - 0.2), *(place + 1.5))
            goals.append(shape.intersection(areas[0]))
    return goals


@pytest.mark.parametrize("seed", range(6))
def test_own_ways_are_those_of_a_field_of_the_whole_place(seed):
    areas = scene(seed) if seed < 3 else strewn(seed)
    ground = ground_of(areas) if seed < 3 else build_ground([outline_segments(a) for a in areas], NO_MARGIN)
    goals = goals_in(areas, 40, seed + 10)
    places = free_places(areas, 120, seed, 0.16)
    state, _, _ = guided(ground, goals, places)
    whole = state.copy()
    for number, goal in enumerate(goals):
        guide(ground, solve_field(ground, goal), ASKED, np.flatnonzero(state["goal"] == number), whole)
    lost = whole["togo"] >= LOST
    np.testing.assert_array_equal(state["togo"] >= LOST, lost)
    assert (~lost).sum() > 80
    # Searches that take boxes in another order may bend elsewhere.
    apart = np.abs(state["togo"] - whole["togo"])[~lost]
    assert apart.max() <= 0.05 * whole["togo"][~lost].max()
    assert np.median(apart) < 0.01
    assert np.mean(state["turn"][~lost] == whole["turn"][~lost]) > 0.95


@pytest.mark.parametrize("seed", range(4))
def test_who_is_pushed_about_arrives_all_the_same(seed, monkeypatch):
    """Pushed off its way by up to 2 m now and then, each agent gets another one from there."""
    monkeypatch.setattr(own_ways, "ASIDE", 0.2)
    rng = np.random.default_rng(seed)
    areas = strewn(seed + 40)
    ground = build_ground([outline_segments(area) for area in areas], NO_MARGIN, bounds=HALL.bounds)
    goals = [np.array(place) for place in free_places(areas, 30, seed + 5, 0.35)]
    state, following, ways = guided(ground, goals, free_places(areas, 90, seed))
    rows = np.flatnonzero(state["togo"] < LOST)
    reached = np.zeros(len(state), bool)
    begun = following.copy()
    changes = 0
    free = areas[0].buffer(-0.16)
    for step in range(900):
        on_way = rows[~reached[rows]]
        if not len(on_way):
            break
        ways.write(goals, state, following, on_way)
        assert (state["togo"][on_way] < LOST).all()
        changes += int((following != begun).sum())
        begun = following.copy()
        pace = np.minimum(0.05, state["togo"][on_way])
        state["x"][on_way] += state["gx"][on_way] * pace
        state["y"][on_way] += state["gy"][on_way] * pace
        reached[on_way] = state["togo"][on_way] <= 0.06
        if step % 60 == 30 and step < 200:
            there = np.column_stack([state["x"], state["y"]])
            pushed = there + rng.uniform(-2.0, 2.0, there.shape)
            # Straight pushes that no wall stops.
            lines = shapely.linestrings(np.stack([there, pushed], axis=1))
            go = shapely.covers(free, lines)
            state["x"][go], state["y"][go] = pushed[go].T
    assert reached[rows].all()
    assert changes > 5


def test_ways_depend_on_goal_and_beginning_alone():
    """Neither on threads, nor on the order of the agents, nor on what was asked before."""
    areas = scene(2)
    ground = ground_of(areas)
    goals, places = goals_in(areas, 25, 3), free_places(areas, 75, 4, 0.16)
    first, following, ways = guided(ground, goals, places)
    again, same, _ = guided(ground, goals, places, threads=3)
    np.testing.assert_array_equal(following, same)
    assert first.tobytes() == again.tobytes()
    # In the other order, one by one, and with ways that others followed before.
    for row in np.arange(len(places))[::-1]:
        again["togo"][row] = -1.0
        same[row] = PLAIN
        ways.write(goals, again, same, np.array([row]))
    np.testing.assert_array_equal(following, same)
    assert first.tobytes() == again.tobytes()


def cell_in_a_room():
    """Ground of a room with a cell in it that has no door."""
    room = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(3.9, 3.9, 6.1, 6.1))
    segments = [outline_segments(part) for part in (room, shapely.box(4.2, 4.2, 5.8, 5.8))]
    return build_ground([np.concatenate(segments)] * 2, NO_MARGIN)


OUT_OF_REACH = {
    "beyond the place": np.array([30.0, 30.0]),
    "no points": np.empty((0, 2)),
    "nothing": shapely.Polygon(),
    "in the cell": shapely.box(4.3, 4.3, 5.7, 5.7),
}


@pytest.mark.parametrize("goal", OUT_OF_REACH.values(), ids=OUT_OF_REACH)
def test_goals_out_of_reach_are_told_without_a_search(goal, monkeypatch):
    def no_search(*_):
        raise AssertionError("a search was made")

    monkeypatch.setattr(own_ways, "solve", no_search)
    state, _, ways = guided(cell_in_a_room(), [goal], np.array([(1.0, 1.0), (9.0, 5.0), (0.4, 9.5)]))
    assert (state["togo"] == LOST).all()
    assert (state["gx"] == 0.0).all()
    assert (state["gy"] == 0.0).all()
    assert ways.memory < 10_000


@pytest.mark.parametrize("goal", [*OUT_OF_REACH.values(), shapely.Point(4.0, 5.0).buffer(0.05), np.array([8.0, 8.0])])
def test_who_is_in_a_wall_or_outside_has_the_way_of_a_field(goal):
    ground = cell_in_a_room()
    state, _, _ = guided(ground, [goal], np.array([(4.05, 5.0), (3.9, 5.0), (-40.0, 3.0), (0.0, 0.0), (9.99, 9.99)]))
    whole = state.copy()
    guide(ground, solve_field(ground, goal), ASKED, np.arange(len(state)), whole)
    assert state.tobytes() == whole.tobytes()


def test_who_is_in_the_goal_has_arrived():
    room = shapely.box(0.0, 0.0, 10.0, 10.0)
    state, _, _ = guided(ground_of([room] * 2), [shapely.box(2.0, 2.0, 6.0, 6.0)], np.array([(4.0, 4.0), (8.0, 4.0)]))
    assert state["togo"][0] == 0.0
    assert state["togo"][1] == pytest.approx(2.0, abs=0.2)
    assert (state["gx"][1], state["gy"][1]) == pytest.approx((-1.0, 0.0), abs=0.1)


def test_a_way_in_the_open_knows_few_boxes_of_a_large_place():
    room = shapely.box(0.0, 0.0, 200.0, 200.0)
    ground = ground_of([room] * 2)
    goal, place = np.array([160.0, 150.0]), np.array([(40.0, 30.0)])
    state, following, ways = guided(ground, [goal], place)
    assert state["togo"][0] == pytest.approx(np.hypot(120.0, 120.0), abs=1e-3)
    # An ellipse whose foci are the goal and the agent.
    field = ways.field([goal], 0, int(following[0]), place[0])
    apart = np.hypot(120.0, 120.0)
    long = apart + LEAST_DETOUR
    assert 2.0 * own_ways.ASIDE**2 / apart < LEAST_DETOUR
    area = np.pi / 4.0 * long * np.sqrt(long**2 - apart**2)
    assert len(field.known) * BOX**2 == pytest.approx(area, rel=0.02)
    assert ways.memory < 0.06 * solve_field(ground, goal).cost.base.nbytes


def test_ways_that_nobody_follows_are_dropped():
    room = shapely.box(0.0, 0.0, 20.0, 10.0)
    rng = np.random.default_rng(1)
    places, goals = rng.uniform(1.0, 9.0, (40, 2)), list(rng.uniform(1.0, 9.0, (40, 2)))
    state, following, ways = guided(ground_of([room] * 2), goals, places)
    most = ways.memory
    for _ in range(own_ways.IDLE + 2):
        ways.write(goals, state, following, np.arange(4))
    assert ways.memory < 0.25 * most
    # They come back if they are asked for.
    before = state.copy()
    ways.write(goals, state, following, np.arange(40))
    assert before.tobytes() == state.tobytes()


def test_another_goal_with_the_same_number_gets_other_ways():
    room = shapely.box(0.0, 0.0, 20.0, 10.0)
    guidance = Guidance(ground_of([room] * 2), [np.array([18.0, 5.0])], ASKED, own=np.array([True]))
    state, following = sent([(10.0, 5.0)], [0])
    assert guidance.write(state, following) == 0
    assert state["gx"][0] == pytest.approx(1.0)
    assert guidance.end(0, int(following[0]), (10.0, 5.0)) == pytest.approx((18.0, 5.0))
    guidance.put(0, np.array([2.0, 5.0]), own=True)
    assert guidance.write(state, following) == 0
    assert state["gx"][0] == pytest.approx(-1.0)
    # Many come: from now on a field leads them.
    guidance.put(0, np.array([2.0, 5.0]))
    following[:] = PLAIN
    assert guidance.write(state, following) == 0
    assert state["gx"][0] == pytest.approx(-1.0)
    assert guidance.lengths(0, [(10.0, 5.0)]) == pytest.approx(8.0)


def test_a_changed_place_has_other_ways():
    room = shapely.box(0.0, 0.0, 20.0, 10.0)
    wall = shapely.box(9.9, 0.0, 10.1, 8.0)
    guidance = Guidance(ground_of([room] * 2), [np.array([18.0, 1.0])], ASKED, own=np.array([True]))
    state, following = sent([(2.0, 1.0)], [0])
    for area, length in ((room, 16.0), (room.difference(wall), 21.9), (room, 16.0)):
        guidance.rebuild(ground_of([area] * 2))
        assert guidance.write(state, following) == 0
        assert state["togo"][0] == pytest.approx(length, abs=0.2)


def test_who_is_squeezed_in_without_a_way_gets_out():
    cell = shapely.box(4.0, 3.0, 6.0, 5.0).difference(shapely.box(4.2, 3.2, 5.8, 4.8))
    area = shapely.box(0.0, 0.0, 12.0, 8.0).difference(cell.difference(shapely.box(3.9, 3.84, 4.3, 4.16)))
    guidance = Guidance(ground_of([area] * 2), [np.array([11.0, 4.0])], ASKED, own=np.array([True]))
    state, following = sent([(5.0, 4.0)], [0])
    assert guidance.write(state, following, lead_out=False) == 1
    for _ in range(600):
        assert guidance.write(state, following) == 0
        state["x"] += 0.05 * state["gx"]
        state["y"] += 0.05 * state["gy"]
        if state["togo"][0] < 0.1:
            break
    assert state["togo"][0] < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_parts_of_a_ground_are_those_that_ways_connect(seed):
    ground = build_ground([outline_segments(area) for area in strewn(seed)], NO_MARGIN, bounds=HALL.bounds)
    labels = np.full(ground.columns * ground.rows, -1, np.int32)
    count = label_boxes(ground, labels, np.empty_like(labels))
    expected = guidance_reference.parts(ground, STEPS)
    fits = expected >= 0
    np.testing.assert_array_equal(labels >= 0, fits)
    pairs = np.unique(np.column_stack([labels[fits], expected[fits]]), axis=0)
    assert len(pairs) == len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == count


@pytest.mark.parametrize("seed", range(3))
def test_a_way_begins_where_the_agent_can_go(seed):
    """At the pin of the box around it, else at the nearest one beside it that no wall hides."""
    areas = strewn(seed)
    ground = build_ground([outline_segments(area) for area in areas], NO_MARGIN, bounds=HALL.bounds)
    places = np.random.default_rng(seed).uniform(-1.0, 13.0, (1500, 2))
    begins = np.empty(len(places), np.int32)
    begin_ways(ground, np.arange(len(places)), rows_at(places), begins)
    box = np.arange(len(ground.widest))
    pins = np.column_stack([box % ground.columns, box // ground.columns]) * BOX + 0.5 * BOX
    pins += (ground.left, ground.bottom) + PIN_UNIT * ground.pins
    expected = [guidance_reference.way_begin(areas, NO_MARGIN.radii, ground, pins, place) for place in places]
    # The slow twin measures distances to areas, whose outlines are those of the walls but for rounding.
    assert np.mean(begins == expected) > 0.998
    beside = ground.widest[np.minimum(begins, len(pins) - 1)] >= 0
    own = (places - (ground.left, ground.bottom)) // BOX
    assert (beside & (begins != own[:, 1] * ground.columns + own[:, 0])).sum() > 10


def test_all_are_led_at_once_as_each_by_its_own_field():
    areas = scene(1)
    ground = ground_of(areas)
    goals, places = goals_in(areas, 20, 3), free_places(areas, 60, 4, 0.16)
    fields = [solve_field(ground, goal) for goal in goals]
    numbers = np.arange(len(places)) % len(goals)
    at_once, each = rows_at(places), rows_at(places)
    table = np.array([own_ways.places_of(field) for field in fields])
    sample_each(ground, NOBODY, table, numbers, ASKED, np.arange(len(places)), at_once)
    for number, field in enumerate(fields):
        guide(ground, field, ASKED, np.flatnonzero(numbers == number), each)
    assert at_once.tobytes() == each.tobytes()


def before_a_door():
    """Guidance of a hall with a door of 1 m ahead and another one 4 m aside, and rows of a crowd before the first."""
    wall = shapely.box(9.9, 0.0, 10.1, 12.0)
    for y in (3.0, 7.0):
        wall = wall.difference(shapely.box(9.8, y - 0.5, 10.2, y + 0.5))
    ground = ground_of([shapely.box(0.0, 0.0, 20.0, 12.0).difference(wall)] * 2)
    goals = [np.array([14.0, 3.0])] + [np.array([14.0 + 0.02 * k, 3.0]) for k in range(60)]
    guidance = Guidance(ground, goals, ASKED, own=np.ones(61, bool))
    x, y = np.meshgrid(np.linspace(7.0, 9.6, 6), np.linspace(1.6, 4.4, 10))
    state, following = sent(np.column_stack([np.append(6.6, x.ravel()), np.append(3.0, y.ravel())]), goals)
    # Their turn comes in the first second of four.
    state["share"] = 0.3
    assert guidance.write(state, following) == 0
    return guidance, state, following


def test_some_go_around_the_crowd_in_turn_and_stay_on_that_way():
    guidance, state, following = before_a_door()
    straight = float(state["togo"][0])
    assert (state["gx"][0], state["gy"][0]) == pytest.approx((1.0, 0.0), abs=0.05)
    state["stuck"][0] = 2.5
    # It is not the turn of those with such a share, then it is not time, then it is.
    for step, changes in ((20, False), (11, False), (10, True)):
        guidance.refresh_in_turn(step, 10, state, following)
        assert guidance.write(state, following) == 0
        assert (state["togo"][0] > straight + 2.0) == changes
        assert (state["gy"][0] > 0.5) == changes
    around = int(following[0])
    # It stays on that way when it is on it again, and when others look for theirs.
    state["stuck"][0] = 0.0
    for step in range(20, 20 + 2 * own_ways.IDLE, 10):
        guidance.refresh_in_turn(step, 10, state, following)
        guidance.write(state, following)
    assert following[0] == around
    assert guidance.end(0, around, (6.6, 3.0)) == pytest.approx((14.0, 3.0))
    # In a changed place it begins anew; asked for its end, with the number of a way that is no more, it is told one.
    guidance.rebuild(guidance.ground)
    assert guidance.end(0, around, (6.6, 3.0)) == pytest.approx((14.0, 3.0))
    assert guidance.end(0, PLAIN, (6.6, 3.0)) == pytest.approx((14.0, 3.0))
    guidance.refresh_in_turn(30, 10, state, following)
    assert guidance.write(state, following) == 0
    assert state["togo"][0] == pytest.approx(straight)
    assert following[0] != around


def test_ways_around_a_crowd_are_the_same_in_any_order_of_the_agents():
    guidance, state, following = before_a_door()
    state["stuck"] = np.where(state["x"] < 7.2, np.linspace(2.0, 2.9, len(state)), 0.0)
    other, mixed = before_a_door()[0], np.random.default_rng(1).permutation(len(state))
    shuffled, followed = state[mixed], following[mixed]
    guidance.refresh_in_turn(10, 10, state, following)
    other.refresh_in_turn(10, 10, shuffled, followed)
    assert (following > len(guidance.ground.widest)).sum() > 3
    np.testing.assert_array_equal(following[mixed], followed)
    guidance.write(state, following)
    other.write(shuffled, followed)
    assert state[mixed].tobytes() == shuffled.tobytes()


def test_at_most_so_many_look_for_a_way_around_at_a_time(monkeypatch):
    monkeypatch.setattr(own_ways, "MOST_AROUND", 3)
    guidance, state, following = before_a_door()
    state["stuck"] = 2.0 + 0.01 * np.arange(len(state))
    guidance.refresh_in_turn(10, 10, state, following)
    changed = np.flatnonzero(following > len(guidance.ground.widest))
    assert 0 < len(changed) <= 3
    assert changed.min() >= len(state) - 3


def test_ways_around_a_crowd_that_nobody_follows_are_dropped():
    guidance, state, following = before_a_door()
    state["stuck"][0] = 2.5
    guidance.refresh_in_turn(10, 10, state, following)
    guidance.write(state, following)
    most = guidance.memory
    following[0] = PLAIN
    guidance.write(state, following)
    guidance.refresh_in_turn(20, 10, state, following)
    assert guidance.memory < most
