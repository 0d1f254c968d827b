"""Whatever the place and the goal: fields are consistent, and who follows them arrives."""

import numpy as np
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crowdsim.steering.guidance import ask_kernels, pin_kernels, sample_kernels
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.guidance import crowding_of
from tests.support.guided import NEED, follow, free_places, ground_of

ROOM = shapely.box(0.0, 0.0, 6.0, 5.0)
THINGS = st.lists(
    st.tuples(
        st.floats(0.0, 6.0), st.floats(0.0, 5.0), st.floats(0.01, 1.5), st.floats(0.01, 1.5), st.floats(0.0, 90.0)
    ),
    max_size=6,
)
SPEED = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def areas_of(tall, low):
    """Free areas of both layers among turned boxes."""
    taken = []
    for things in (tall, low):
        boxes = [(shapely.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2), turn) for x, y, w, h, turn in things]
        taken.append(shapely.union_all([shapely.affinity.rotate(box, turn) for box, turn in boxes]))
    above = ROOM.difference(taken[0])
    return [above.difference(taken[1]), above]


@SPEED
@given(THINGS, THINGS, st.floats(-1.0, 7.0), st.floats(-1.0, 6.0), st.booleans(), st.integers(0, 60))
def test_fields_are_consistent(tall, low, x, y, is_region, agents):
    areas = areas_of(tall, low)
    ground = ground_of(areas, bounds=ROOM.bounds)
    goal = shapely.Point(x, y).buffer(0.7) if is_region else np.array([x, y])
    crowd = np.random.default_rng(agents).uniform(1.0, 4.0, (agents, 2))
    field = solve_field(ground, goal, crowding_of(ground, crowd))
    reached = np.flatnonzero(np.isfinite(field.cost))
    assert np.array_equal(reached, np.flatnonzero(np.isfinite(field.length)))
    assert np.array_equal(reached, np.flatnonzero(field.asks >= 0))
    assert (ground.widest[reached] >= 0).all()
    # Costs fall along the anchors, and a meter costs at least what it does for the widest behavior.
    anchors = field.anchor[reached]
    onwards = (anchors != reached) & (anchors < len(field.cost))
    assert (field.cost[anchors[onwards]] < field.cost[reached[onwards]]).all()
    assert (field.cost[reached] >= field.length[reached] * NEED.costs[-1] * (1.0 - 1e-5) - 1e-5).all()
    # Directions have unit length, or there are none.
    told = ways(ground, field, np.random.default_rng(0).uniform(-1.0, 7.0, (200, 2)))
    sizes = np.sqrt((told.direction**2).sum(axis=1))
    assert ((np.abs(sizes - 1.0) < 1e-9) | (sizes == 0.0)).all()
    assert np.array_equal(np.isfinite(told.cost), np.isfinite(told.length))
    assert (sizes[~np.isfinite(told.cost)] == 0.0).all()


@SPEED
@given(THINGS, THINGS, st.integers(0, 1000))
def test_who_follows_arrives(tall, low, seed):
    areas = areas_of(tall, low)
    goals = free_places(areas, 1, seed, 0.3)
    if not len(goals):
        return
    ground = ground_of(areas, bounds=ROOM.bounds)
    field = solve_field(ground, goals[0])
    places = free_places(areas, 40, seed + 1)
    told = ways(ground, field, places)
    _, _, arrived = follow(ground, field, places[np.isfinite(told.cost)])
    assert arrived.all()


def test_constants_fit_together():
    # Pins keep within their boxes; who has reached a pin is in its box or one around it.
    assert pin_kernels.GRID < pin_kernels.BOX / 2
    assert sample_kernels.REACHED < sample_kernels.BOX
    assert ask_kernels.BEFORE > sample_kernels.LOOK
