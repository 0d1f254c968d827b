"""Who was pushed into a gap or a corner from which no way leads comes out of it, cell by cell."""

import numpy as np
import pytest
import shapely

from crowdsim.bench.mixed.strewn import strewn_hall
from crowdsim.jit import kernel
from crowdsim.steering.guidance import pocket_kernels, ways_out
from crowdsim.steering.guidance.field import asked_of, solve_field, ways
from crowdsim.steering.guidance.ground_kernels import BOX
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.guidance.pocket_kernels import CELLS, FINE, IN_SLOT, INSIDE, OUT
from crowdsim.steering.guidance.sample_kernels import THICKNESS, is_pinched
from crowdsim.steering.guidance.ways_out import WaysOutOfPockets
from tests.reference import guidance_reference, pocket_reference
from tests.support.guided import BEHAVIORS, free_places, ground_of, rows_at

ASKED = asked_of(BEHAVIORS)
ROOM = shapely.box(0.0, 0.0, 3.0, 3.0)
GOAL = np.array([2.7, 2.7])


@kernel
def find_pinched(ground, boxes, places, out):
    """Fill ``out`` (n,) with whether ``places`` (n, 2) in ``boxes`` (n,) are pinched."""
    for n in range(len(places)):
        out[n] = is_pinched(ground, boxes[n], places[n, 0], places[n, 1], THICKNESS)


def strewn_room(seed):
    """Free areas of a room of 3 m strewn with small things, with gaps of all widths between them."""
    rng = np.random.default_rng(seed)
    things = [shapely.Point(*rng.uniform(0.2, 2.3, 2)).buffer(rng.uniform(0.1, 0.3), 4) for _ in range(9)]
    things += [shapely.box(0.0, 0.0, 0.1, 2.5), shapely.box(0.0, 0.0, 2.5, 0.1)]
    free = ROOM.difference(shapely.union_all(things))
    return [free, free]


def lost_in(areas, ground, field, count=200, seed=1):
    """Return places where a body fits, but from which no way leads."""
    places = free_places(areas, count, seed, 0.126)
    return places[~np.isfinite(ways(ground, field, places).length)]


def cells_of(ground, out, kind):
    """Return what is kept of the cells of a kind, by their columns and rows: cost or length to go, and address."""
    found = {}
    for address in np.flatnonzero(out.pockets.kinds == kind).tolist():
        box, number = int(out.pockets.owners[address // IN_SLOT]), address % IN_SLOT
        cell = (
            box % ground.columns * CELLS + number % CELLS,
            box // ground.columns * CELLS + number // CELLS,
        )
        found[cell] = (float(out.pockets.lengths[address]), address)
    return found


def way_length(ground, field):
    """Return a function that gives the length of the way from a place."""
    return lambda place: float(ways(ground, field, [place]).length[0])


@pytest.mark.parametrize("seed", range(6))
def test_pockets_and_their_ways_out_are_those_of_the_slow_twin(seed):
    areas = strewn_room(seed)
    ground = ground_of(areas)
    field = solve_field(ground, GOAL)
    for place in lost_in(areas, ground, field)[:4]:
        state = rows_at([place])
        out = WaysOutOfPockets(ground, field, ASKED)
        lost = out.write(np.zeros(1, np.int64), state)
        corner = ground.left, ground.bottom
        expected = pocket_reference.pocket(areas, ground.segments, way_length(ground, field), corner, place)
        inside, exits = cells_of(ground, out, INSIDE), cells_of(ground, out, OUT)
        if expected is None:
            assert lost == 1
            assert not inside
            continue
        costs, lengths = expected
        assert inside.keys() == costs.keys()
        assert exits.keys() == lengths.keys()
        for cell, (cost, address) in inside.items():
            assert cost == pytest.approx(costs[cell], rel=1e-9)
            # The next cell is beside it, and costs less.
            onward = int(out.pockets.onwards[address])
            assert (onward < 0) == (not lengths)
            if onward >= 0:
                assert out.pockets.lengths[onward] < cost
        assert lost == (0 if lengths else 1)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_found_does_not_depend_on_who_is_first(seed, monkeypatch):
    areas = strewn_room(seed)
    ground = ground_of(areas)
    field = solve_field(ground, GOAL)
    places = lost_in(areas, ground, field)
    state = rows_at(places)
    out = WaysOutOfPockets(ground, field, ASKED)
    lost = out.write(np.arange(len(places)), state)
    # With few slots, in another order, one by one.
    monkeypatch.setattr(ways_out, "SLOTS", 1)
    again = rows_at(places)
    other = WaysOutOfPockets(ground, field, ASKED)
    order = np.random.default_rng(seed).permutation(len(places))
    assert sum(other.write(order[n : n + 1], again) for n in range(len(places))) == lost
    assert np.array_equal(state, again)


def keep_off(area, state, clearance=0.125):
    """Push bodies (ROW[n]) that are nearer to a wall than ``clearance`` [m] straight off it."""
    for _ in range(3):
        places = shapely.points(state["x"], state["y"])
        to_walls = shapely.get_coordinates(shapely.shortest_line(places, area.boundary)).reshape(-1, 2, 2)
        off = to_walls[:, 0] - to_walls[:, 1]
        apart = np.hypot(*off.T)
        push = np.maximum(clearance - apart, 0.0) / apart
        state["x"] += push * off[:, 0]
        state["y"] += push * off[:, 1]


@pytest.mark.parametrize("seed", range(8))
def test_who_fits_between_things_walks_out(seed):
    """A body that follows its guidance comes to where a way leads, if a body of its size has room all the way."""
    areas = strewn_room(seed)
    ground = ground_of(areas)
    guidance = Guidance(ground, [GOAL], ASKED)
    roomy = areas[0].buffer(-0.135)
    open_part = next(part for part in getattr(roomy, "geoms", [roomy]) if part.distance(shapely.Point(GOAL)) < 0.2)
    places = free_places(areas, 400, seed, 0.136)
    places = places[shapely.contains_xy(open_part, places)][:40]
    assert len(places) > 10
    state, following = rows_at(places), np.full(len(places), PLAIN, np.int32)
    for _ in range(1500):
        assert guidance.write(state, following) == 0
        state["x"] += 0.01 * state["gx"]
        state["y"] += 0.01 * state["gy"]
        keep_off(areas[0], state)
        if (state["togo"] < 0.1).all():
            break
    assert (state["togo"] < 0.1).all()


@pytest.mark.parametrize(
    ("seed", "goal", "place"),
    [
        (3, 0, (8.91, 0.336)),
        (10, 1, (8.627, 1.708)),
        (10, 1, (8.958, 1.811)),
        (39, 1, (10.226, 5.609)),
    ],
)
def test_people_who_were_stuck_in_strewn_halls_are_led_out(seed, goal, place):
    scenario = strewn_hall("dense", seed, "steered")
    areas = [layer.free for layer in scenario.environment.layers]
    goals = [group.goal.shape() for group in scenario.agents]
    guidance = Guidance(ground_of(areas), goals, ASKED)
    state = rows_at([place], goal)
    assert guidance.write(state, np.full(1, PLAIN, np.int32)) == 0
    assert 0.99 < np.hypot(state["gx"][0], state["gy"][0]) < 1.01
    assert state["togo"][0] < 20.0
    # So are those with goals of their own.
    alone = Guidance(ground_of(areas), goals, ASKED, own=np.ones(2, bool))
    mine = rows_at([place], goal)
    assert alone.write(mine, np.full(1, PLAIN, np.int32)) == 0
    # They come out by the same cells at first; the way from there is not known yet.
    assert ways_out.BEYOND < mine["togo"][0] < ways_out.BEYOND + 2.0


def test_large_closed_places_are_no_pockets():
    """Where nobody can go on, all stay: a closed room costs no search for each."""
    room = shapely.box(0.0, 0.0, 12.0, 12.0).difference(shapely.box(9.0, 0.0, 9.2, 12.0))
    ground = ground_of([room, room])
    field = solve_field(ground, np.array([11.0, 6.0]))
    state = rows_at(free_places([room], 50, 1))
    left = np.flatnonzero(state["x"] < 8.9)
    out = WaysOutOfPockets(ground, field, ASKED)
    assert out.write(left, state) == len(left)
    assert (out.pockets.kinds != INSIDE).all()
    # Far from the wall there is nothing to look for.
    far = left[state["x"][left] < 9.0 - (pocket_kernels.AROUND + 2) * BOX]
    fresh = WaysOutOfPockets(ground, field, ASKED)
    assert fresh.write(far, state) == len(far)
    assert (fresh.pockets.slots < 0).all()


def test_single_agents_that_are_shut_in_cause_one_search_for_all():
    """A field of the whole place for each of their goals took seconds, and a step twenty times as long."""
    room = shapely.box(0.0, 0.0, 12.0, 12.0).difference(shapely.box(9.0, 0.0, 9.2, 12.0))
    goals = [np.array([11.0, y]) for y in np.linspace(1.0, 11.0, 30)]
    guidance = Guidance(ground_of([room, room]), goals, ASKED, own=np.ones(30, bool))
    state = rows_at(free_places([room], 60, 1)[:30], np.arange(30))
    shut_in = int((state["x"] < 9.0).sum())
    following = np.full(30, PLAIN, np.int32)
    assert guidance.write(state, following) == shut_in > 5
    assert len(guidance._ways_out._out_to_parts) == 1
    before = guidance.memory
    assert guidance.write(state, following) == shut_in
    assert guidance.memory == before


def test_nobody_leaves_the_boxes_or_a_wall():
    areas = strewn_room(0)
    ground = ground_of(areas)
    out = WaysOutOfPockets(ground, solve_field(ground, GOAL), ASKED)
    state = rows_at([(-50.0, 1.0), (0.05, 1.0), (1.0, 99.0)])
    assert out.write(np.arange(3), state) == 3
    assert not state["gx"].any()


def test_a_goal_that_cannot_be_reached_leads_nobody_out():
    areas = strewn_room(2)
    ground = ground_of(areas)
    out = WaysOutOfPockets(ground, solve_field(ground, np.array([50.0, 50.0])), ASKED)
    places = free_places(areas, 20, 1)
    assert out.write(np.arange(len(places)), rows_at(places)) == len(places)


@pytest.mark.parametrize("seed", range(4))
def test_pinched_places_are_those_of_the_slow_twin(seed):
    areas = strewn_room(seed)
    ground = ground_of(areas)
    places = free_places(areas, 400, seed, 0.01)
    # Near walls; most others have nothing on either side.
    places = places[shapely.distance(shapely.points(places), areas[0].boundary) < 0.12][:100]
    boxes = np.floor((places - (ground.left, ground.bottom)) / BOX).astype(int) @ (1, ground.columns)
    found = np.empty(len(places), np.bool_)
    find_pinched(ground, boxes, places, found)
    assert found.tolist() == [guidance_reference.is_pinched(ground.segments, place) for place in places]


def test_cells_are_no_larger_than_a_body_can_miss():
    """The body of an agent, anywhere in its cell, keeps the center of the cell as far off walls as is asked."""
    assert 0.125 - FINE * np.sqrt(0.5) >= pocket_kernels.KEPT
    assert abs(CELLS * FINE - BOX) < 1e-12
