import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.steering.guidance.crowding_kernels import CHAIN, GRAIN, add_agents, price_at, set_load
from crowdsim.steering.guidance.field import asked_of, solve_field, ways
from crowdsim.steering.guidance.ground_kernels import BOX, line_cost
from crowdsim.steering.guidance.guidance import PLAIN, Guidance, Weighing, crowding_of
from tests.reference import guidance_reference
from tests.support.guided import BEHAVIORS, follow, free_places, ground_of, rows_at

HALL = shapely.box(0.0, 0.0, 12.0, 10.0)
WALL = shapely.box(5.8, -1.0, 6.1, 11.0)
DOORS = shapely.box(5.0, 2.0, 7.0, 3.2).union(shapely.box(5.0, 6.8, 7.0, 8.0))
TWO_DOORS = HALL.difference(WALL.difference(DOORS))
GOAL = np.array([11.0, 5.0])
JAM = np.stack(np.meshgrid(np.arange(4.6, 6.0, 0.33), np.arange(1.6, 3.8, 0.33)), axis=-1).reshape(-1, 2)


@kernel
def costs_of(ground, crowding, lines, out):
    for n in range(len(lines)):
        out[n] = line_cost(ground, crowding, lines[n, 0], lines[n, 1], lines[n, 2], lines[n, 3], np.inf)


def spread(places, counts=None, cell=0.5, size=20):
    weights = np.zeros((size, size), np.int64)
    counts = np.ones(len(places)) if counts is None else counts
    add_agents(np.ascontiguousarray(places, np.float64), counts, 0.0, 0.0, cell, weights)
    return weights


def test_density_is_what_pairs_sum_up_to():
    places = np.random.default_rng(0).uniform(0.0, 10.0, (300, 2))
    found = spread(places) / GRAIN
    middles = (np.arange(20) + 0.5) * 0.5
    centers = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    assert found.ravel() == pytest.approx(guidance_reference.density(places, centers), abs=1e-4)
    assert spread([[5.1, 5.3]]).sum() / GRAIN * 0.25 == pytest.approx(1.0, abs=0.06)


def test_who_counts_for_several_adds_as_much_as_they():
    places = np.random.default_rng(0).uniform(0.0, 10.0, (40, 2))
    counts = np.arange(40) % 4 + 1.0
    # Each weight is rounded to a whole number of grains.
    assert np.abs(spread(places, counts) - spread(places.repeat(counts.astype(int), axis=0))).max() < 100


def test_density_does_not_depend_on_the_order():
    places = np.random.default_rng(1).uniform(-1.0, 11.0, (500, 2))
    assert np.array_equal(spread(places), spread(places[::-1]))


@pytest.mark.parametrize("places", [np.empty((0, 2)), [[np.nan, 1.0]], [[-50.0, 3.0]]])
def test_nobody_is_no_crowd(places):
    weights = spread(places)
    assert not weights.any()
    load = np.empty((20, 20), np.float32)
    quiet = np.empty((20, 20), np.uint8)
    assert set_load(weights, 0.6, 1.0, load, quiet) == 0
    assert (load == 1.0).all()


def test_loads_grow_with_the_density_above_one():
    weights = np.zeros((9, 9), np.int64)
    weights[4, 4], weights[4, 5], weights[0, 0] = 3 * GRAIN, GRAIN, GRAIN // 2
    load = np.empty((9, 9), np.float32)
    quiet = np.empty((9, 9), np.uint8)
    assert set_load(weights, 0.6, 1.0, load, quiet) == 1
    assert load[4, 4] == pytest.approx(1.0 + 0.6 * 2.0)
    assert (np.delete(load.ravel(), 40) == 1.0).all()
    rows, columns = np.indices((9, 9))
    assert np.array_equal(quiet, np.maximum(abs(rows - 4), abs(columns - 4)))


def test_lines_through_a_crowd_cost_its_load():
    area = shapely.box(0.0, 0.0, 20.0, 4.0)
    ground = ground_of([area, area])
    rows, columns = np.meshgrid(np.arange(0.0, 4.0, 0.4), np.arange(8.0, 12.0, 0.4))
    crowding = crowding_of(ground, np.column_stack([columns.ravel(), rows.ravel()]))
    lines = np.array([[1.0, 2.0, 19.0, 2.0], [15.0, 2.0, 19.0, 2.0]])
    found = np.empty(2)
    costs_of(ground, crowding, lines, found)
    at = ((np.arange(1.0, 19.0, 0.01) - crowding.left) / crowding.cell).astype(int)
    loads = crowding.load[int((2.0 - crowding.bottom) / crowding.cell), at]
    assert loads.max() > 3.0
    assert found == pytest.approx([loads.mean() * 18.0, 4.0], rel=0.03)
    # Along the walls, where fewer are, it is cheaper.
    way = ways(ground, solve_field(ground, [19.0, 2.0], crowding), lines[:, :2])
    assert way.cost[0] < found[0]
    assert way.cost[1] == pytest.approx(4.0, abs=1e-5)


def test_a_way_has_the_price_of_the_crowd_on_it():
    area = shapely.box(0.0, 0.0, 20.0, 4.0)
    ground = ground_of([area, area])
    rows, columns = np.meshgrid(np.arange(0.0, 4.0, 0.4), np.arange(8.0, 12.0, 0.4))
    crowding = crowding_of(ground, np.column_stack([columns.ravel(), rows.ravel()]))
    field = solve_field(ground, [19.0, 2.0])

    def priced(place):
        prices, chain = np.full(len(ground.widest), -1.0), np.empty(CHAIN, np.int64)
        return price_at(ground, crowding, field, *place, prices, chain)

    for x in (1.0, 6.0, 13.0):
        # At the pin of a box, in its middle: the way from there is the straight line.
        place = np.array([ground.left, ground.bottom]) + (np.array([x, 2.0]) // BOX + 1.5) * BOX
        line = place + np.linspace(0.0, 1.0, 4001)[:-1, None] * ([19.0, 2.0] - place)
        column, row = ((line - (crowding.left, crowding.bottom)) / crowding.cell).astype(int).T
        length = np.hypot(*([19.0, 2.0] - place))
        alone, now = priced(place)
        assert alone == pytest.approx(length, abs=1e-4)
        assert now == pytest.approx(crowding.load[row, column].mean() * length, rel=0.03)
        assert (now > 1.5 * alone) == (x < 8.0)
    assert priced((50.0, 50.0)) == (np.inf, np.inf)


def test_a_jam_at_one_door_sends_people_to_the_other():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    crowding = crowding_of(ground, JAM)
    places = np.array([[2.0, 4.4], [2.0, 4.0]])
    for field, door in ((solve_field(ground, GOAL), 3.2), (solve_field(ground, GOAL, crowding), 6.8)):
        trace, _, arrived = follow(ground, field, places)
        assert arrived.all()
        y = [np.interp(5.95, way[:, 0], way[:, 1]) for way in trace.transpose(1, 0, 2)]
        assert y == pytest.approx([door, door], abs=0.7)


def test_followers_arrive_in_a_crowd():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    rng = np.random.default_rng(3)
    crowd = np.concatenate([JAM, rng.uniform([7.0, 2.0], [10.0, 8.0], (60, 2))])
    field = solve_field(ground, GOAL, crowding_of(ground, crowd))
    _, _, arrived = follow(ground, field, free_places([TWO_DOORS], 80, 4))
    assert arrived.all()


def test_only_those_change_whom_it_saves_two_fifths():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    guidance = Guidance(ground, [GOAL, [1.0, 5.0]], asked_of(BEHAVIORS))
    near, past, back = [3.5, 4.4], [7.5, 2.6], [10.0, 5.0]
    state = rows_at(np.concatenate([[near, past, back], JAM]))
    state["goal"][2:] = 1
    following = np.full(len(state), PLAIN, np.int32)
    guidance.write(state, following)
    assert (following == 0).all()
    toward = state["gy"][0]
    guidance.refresh(0, state, following)
    assert following[:3].tolist() == [1, 0, 0]
    guidance.write(state, following)
    assert toward < 0.0 < state["gy"][0]
    # Nothing has changed since: nobody changes again.
    before = following.copy()
    guidance.refresh(0, state, following)
    assert np.array_equal(following, before)


@pytest.mark.parametrize(
    ("goal", "stuck", "opposed", "changes"), [(1, 4.0, 1.0, 0), (1, 20.0, 1.0, 1), (0, 20.0, 1.0, 0), (1, 20.0, 0.0, 0)]
)
def test_people_go_around_those_who_have_long_been_stuck_on_their_way_elsewhere(goal, stuck, opposed, changes):
    """Ten who stand at a door are not worth the way to the other one, unless they face people who will not let go."""
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    guidance = Guidance(ground, [GOAL, [1.0, 5.0]], asked_of(BEHAVIORS))
    state = rows_at(np.concatenate([[[3.5, 4.4]], JAM[::3]]))
    state["goal"][1:] = goal
    state["stuck"][1:] = stuck
    state["opposed"][1:] = opposed
    following = np.full(len(state), PLAIN, np.int32)
    guidance.write(state, following)
    guidance.refresh(0, state, following)
    assert (following[0] == 1) == changes


def test_people_go_around_others_at_an_open_corner_but_not_before_a_door():
    bend = shapely.box(0.0, 0.0, 20.0, 8.0).union(shapely.box(12.0, 0.0, 20.0, 16.0))
    door = shapely.box(0.0, 0.0, 20.0, 16.0).difference(shapely.box(10.0, -1.0, 10.3, 17.0))
    door = door.union(shapely.box(9.0, 7.4, 11.0, 8.6))
    waiting = np.stack(np.meshgrid(np.arange(0.0, 2.0, 0.4), np.arange(0.0, 2.0, 0.4)), axis=-1).reshape(-1, 2)
    more = np.stack(np.meshgrid(np.arange(0.0, 3.0, 0.35), np.arange(0.0, 3.0, 0.35)), axis=-1).reshape(-1, 2)
    for area, jam, goal, comes, changes in (
        (bend, more + [12.1, 7.0], shapely.box(12.0, 15.0, 20.0, 16.0), [4.0, 2.0], 1),
        (door, waiting + [8.2, 7.2], shapely.box(19.0, 0.0, 20.0, 16.0), [4.0, 9.0], 0),
    ):
        ground = ground_of([area, area])
        guidance = Guidance(ground, [goal, [1.0, 1.0]], asked_of(BEHAVIORS))
        state = rows_at(np.concatenate([[comes], jam]))
        state["goal"][1:] = 1
        following = np.full(len(state), PLAIN, np.int32)
        guidance.write(state, following)
        before = state["togo"][0]
        guidance.refresh(0, state, following)
        assert (following == 1).sum() == changes
        guidance.write(state, following)
        assert before <= state["togo"][0] < 1.2 * before
        assert (state["togo"][0] > before) == bool(changes)


def test_old_fields_are_given_up():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    guidance = Guidance(ground, [GOAL], asked_of(BEHAVIORS), weighing=Weighing(kept=2, around=0.0))
    state = rows_at([[2.0, 2.0]])
    following = np.full(1, PLAIN, np.int32)
    guidance.write(state, following)
    state = np.concatenate([state, rows_at(JAM)])
    state["goal"][1:] = -1
    following = np.array([0, *[PLAIN] * len(JAM)], np.int32)
    for number in range(1, 4):
        guidance.refresh(0, state, following)
        # That of the empty place is kept; who follows one that is given up follows the newest.
        assert following[0] == (0 if number == 1 else number)
        following[0] = number
    guidance.rebuild(ground)
    guidance.write(state, following)
    assert following[0] == 4


def test_threads_and_the_order_of_agents_do_not_show():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    goals = [GOAL, [1.0, 5.0], shapely.box(10.0, 1.0, 11.0, 2.0)]
    places = np.concatenate([free_places([TWO_DOORS], 60, 5), JAM])
    results = []
    for threads, order in ((1, np.arange(len(places))), (3, np.arange(len(places))[::-1])):
        guidance = Guidance(ground, goals, asked_of(BEHAVIORS), threads=threads)
        state = rows_at(places[order])
        following = np.full(len(state), PLAIN, np.int32)
        guidance.write(state, following)
        guidance.refresh(0, state, following)
        guidance.write(state, following)
        results.append((state[np.argsort(order)], following[np.argsort(order)]))
    assert np.array_equal(results[0][0], results[1][0])
    assert np.array_equal(results[0][1], results[1][1])


def test_nobody_is_refreshed():
    ground = ground_of([TWO_DOORS, TWO_DOORS])
    guidance = Guidance(ground, [GOAL], asked_of(BEHAVIORS))
    state = rows_at(np.empty((0, 2)))
    following = np.zeros(0, np.int32)
    assert guidance.write(state, following) == 0
    guidance.refresh(0, state, following)
