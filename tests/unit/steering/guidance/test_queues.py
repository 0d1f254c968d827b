"""Who waits in a queue takes another door if that is sooner; the flank of the queue is no other door."""

import numpy as np
import pytest
import shapely

from crowdsim.crowd.simulation import Simulation
from crowdsim.jit import kernel
from crowdsim.scenario.scenario import Scenario
from crowdsim.steering.guidance.crowding_kernels import BENDS, are_apart
from crowdsim.steering.guidance.field import asked_of, solve_field
from crowdsim.steering.guidance.ground_kernels import BOX, PIN_UNIT
from crowdsim.steering.guidance.guidance import PLAIN, Guidance, Weighing, crowding_of, delays
from tests.reference import guidance_reference
from tests.support.guided import BEHAVIORS, free_places, ground_of, rows_at
from tests.support.small_scenes import scene

HALL = shapely.box(0.0, 0.0, 30.0, 12.0)
WALL = shapely.box(13.9, -1.0, 14.1, 13.0)
NEAR, FAR = shapely.box(13.0, 3.0, 15.0, 4.0), shapely.box(13.0, 7.7, 15.0, 9.3)
GOAL = shapely.box(27.0, 0.5, 29.5, 5.0)


def place(*doors):
    """Return the ground of a hall with a wall across it and some doors."""
    free = HALL.difference(WALL.difference(shapely.union_all(doors)))
    return ground_of([free, free])


def queue(speed=1.3, opposed=0.0):
    """Return rows of people who wait before the near door, in half a disc."""
    places = [
        (13.6 - r * np.cos(t), 3.5 + r * np.sin(t)) for r in (0.3, 0.8, 1.3, 1.8) for t in np.linspace(-1.4, 1.4, 7)
    ]
    state = rows_at(places)
    state["speed"], state["opposed"] = speed, opposed
    return state


def changes_of(ground, state, **weighing):
    """Return which agents follow another field after one look at the crowd."""
    guidance = Guidance(ground, [GOAL], asked_of(BEHAVIORS), weighing=Weighing(**weighing))
    following = np.full(len(state), PLAIN, np.int32)
    guidance.write(state, following)
    before = following.copy()
    guidance.refresh(0, state, following)
    return following != before


def test_some_of_a_queue_take_another_door_a_few_meters_away():
    changes = changes_of(place(NEAR, FAR), queue())
    assert changes.any()
    # Those in front go on waiting.
    assert not changes[:3].any()
    # They did not, as long as a queue counted by its density alone.
    assert not changes_of(place(NEAR, FAR), queue(), queue=0.0).any()


def test_nobody_leaves_a_queue_that_moves_or_for_its_flank():
    moving = queue()
    moving["vx"], moving["gx"] = 1.3, 1.0
    guidance = Guidance(place(NEAR, FAR), [GOAL], asked_of(BEHAVIORS))
    following = np.full(len(moving), PLAIN, np.int32)
    guidance.write(moving, following)
    moving["vx"], moving["vy"] = 1.3 * moving["gx"], 1.3 * moving["gy"]
    guidance.refresh(0, moving, following)
    assert (following == 0).all()
    # One door only: all ways around the queue lead back to it.
    assert not changes_of(place(NEAR), queue()).any()


def test_those_who_face_others_or_stand_do_not_queue():
    assert not changes_of(place(NEAR, FAR), queue(opposed=1.0)).any()
    assert not changes_of(place(NEAR, FAR), queue(speed=0.0)).any()


def test_delays_are_how_much_longer_agents_take():
    state = rows_at([(1.0, 1.0)] * 7)
    state["speed"] = [1.0, 1.0, 1.0, 2.0, 0.0, 1.0, 1.0]
    state["gx"] = 1.0
    state["vx"] = [1.0, 0.0, -0.5, 0.5, 0.0, 0.0, 1.3]
    state["opposed"] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0]
    assert delays(state) == pytest.approx([0.0, 9.0, 9.0, 3.0, 0.0, 6.75, 0.0])
    state["goal"] = -1
    assert not delays(state).any()


@kernel
def apart_from(ground, old, new, boxes, outline, out):
    """Fill ``out`` (k,) with whether a wall stands between the paths of ``boxes`` (k,) in two fields."""
    for n in range(len(boxes)):
        out[n] = are_apart(ground, old, new, boxes[n], outline)


def path_of(ground, field, box):
    """Return the pin of a box and the anchors of its path, (n, 2) [m]."""
    pins = np.column_stack(
        [np.arange(len(ground.widest)) % ground.columns, np.arange(len(ground.widest)) // ground.columns]
    )
    pins = (ground.left, ground.bottom) + (pins + 0.5) * BOX + PIN_UNIT * ground.pins
    path = []
    while True:
        path.append(pins[box] if box < len(pins) else field.points[box - len(pins)])
        ahead = box if box >= len(pins) else field.anchor[box]
        if ahead == box:
            return np.array(path)
        box = ahead


@pytest.mark.parametrize("seed", range(4))
def test_paths_that_are_apart_are_those_of_the_slow_twin(seed):
    areas = scene(seed)
    ground = ground_of(areas)
    places = free_places(areas, 80, seed, 0.3)
    old = solve_field(ground, places[0])
    new = solve_field(ground, places[0], crowding_of(ground, np.repeat(places[1:9], 6, axis=0)))
    boxes = np.flatnonzero((old.anchor >= 0) & (new.anchor >= 0))[::17]
    found = np.empty(len(boxes), np.bool_)
    apart_from(ground, old, new, boxes, np.empty((BENDS, 2)), found)
    expected = [
        guidance_reference.are_apart(ground.segments, path_of(ground, old, box), path_of(ground, new, box))
        for box in boxes.tolist()
    ]
    assert found.tolist() == expected
    assert 0 < sum(expected) < len(boxes)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_people_use_both_doors_of_a_wall(seed):
    """Forty people before a door of 0.9 m; one of 1.6 m is 5 m away. All went through the narrow one."""
    openings = [{"at": 3.5, "width": 0.9}, {"at": 8.5, "width": 1.6}]
    wall = {"name": "wall", "wall": {"points": [[14, 0], [14, 12]], "openings": openings}, "top": 2.6}
    start, goal = {"rectangle": [3, 0.5, 9, 5]}, {"rectangle": [27, 0.5, 29.5, 5]}
    group = {"name": "people", "count": 40, "locomotion": "steered", "start": start, "goal": goal}
    scenario = Scenario(floor={"rectangle": [0, 0, 30, 12]}, obstacles=[wall], agents=[group], seed=seed, duration=90.0)
    with Simulation(scenario) as simulation:
        far = set()
        while not simulation.finished:
            simulation.step()
            agents = simulation.agents
            beside = (np.abs(agents.x - 14.0) < 0.5) & (agents.y > 6.0)
            far |= set(np.flatnonzero(beside).tolist())
    assert 4 <= len(far) <= 30
