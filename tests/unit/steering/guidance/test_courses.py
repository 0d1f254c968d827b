"""The course of a way: its first bend that is not quite near, and the direction behind it."""

import numpy as np
import pytest
import shapely

from crowdsim.steering.guidance.field import asked_of, guide, solve_field
from crowdsim.steering.guidance.ground import NOBODY, build_ground
from crowdsim.steering.guidance.ground_kernels import BOX, PIN_UNIT
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.guidance.sample_kernels import LOST
from crowdsim.steering.guidance.way_kernels import BENDS, NEAR_BEND, ON_LENGTH, end_of_way
from tests.reference import guidance_reference
from tests.support.guided import BEHAVIORS, free_places, ground_of, rows_at
from tests.unit.steering.guidance.test_ways_on import HALL, NO_MARGIN, strewn

ASKED = asked_of(BEHAVIORS)


def place_of(ground, field, number):
    """Return the place (2,) of an anchor."""
    boxes = len(ground.widest)
    if number >= boxes:
        return field.points[number - boxes]
    column, row = number % ground.columns, number // ground.columns
    corner = np.array([ground.left, ground.bottom])
    return corner + (np.array([column, row]) + 0.5) * BOX + PIN_UNIT * ground.pins[number]


def bends_from(ground, field, row):
    """Return the bends of the way of an agent, from the one that it heads for on."""
    place = np.array([row["x"], row["y"]])
    ahead = np.array([row["gx"], row["gy"]])
    boxes = len(ground.widest)
    known = np.flatnonzero(field.anchor >= 0)
    places = np.array(
        [place_of(ground, field, number) for number in [*known, *range(boxes, boxes + len(field.points))]]
    )
    numbers = np.array([*known, *range(boxes, boxes + len(field.points))])
    left = np.array([field.length[number] if number < boxes else 0.0 for number in numbers])
    # The target is on the line, and the way over it has the length to go.
    off = places - place
    length = np.hypot(*off.T)
    on_line = np.abs(off @ np.array([-ahead[1], ahead[0]])) < 1e-9 * np.maximum(length, 1.0)
    fits = on_line & (off @ ahead > 0.0) & (np.abs(length + left - row["togo"]) < 1e-4)
    found = [int(numbers[np.argmax(fits)])]
    while found[-1] < boxes and field.anchor[found[-1]] != found[-1]:
        found.append(int(field.anchor[found[-1]]))
    return [place_of(ground, field, number) for number in found] if fits.any() else None


@pytest.mark.parametrize("seed", range(4))
def test_it_is_that_of_the_slow_twin(seed):
    areas = strewn(seed)
    ground = build_ground([outline_segments(area) for area in areas], NO_MARGIN, bounds=HALL.bounds)
    goal = free_places(areas, 1, seed, 0.35)[0]
    field = solve_field(ground, goal)
    state = rows_at(free_places(areas, 120, seed + 1))
    guide(ground, field, ASKED, np.arange(len(state)), state)
    seen = 0
    for row in state[state["togo"] < LOST]:
        bends = bends_from(ground, field, row)
        if bends is None:
            continue
        course, ahead, on = guidance_reference.course(
            np.array([row["x"], row["y"]]), bends, NEAR_BEND, ON_LENGTH, BENDS
        )
        assert (row["cx"], row["cy"]) == pytest.approx(course, abs=1e-9)
        assert row["ahead"] == pytest.approx(ahead, abs=1e-9)
        assert (row["onx"], row["ony"]) == pytest.approx(on, abs=1e-9)
        assert end_of_way(ground, NOBODY, field, row["x"], row["y"]) == pytest.approx(bends[-1])
        seen += len(bends) > 1
    assert seen > 40


def test_who_is_pressed_against_the_wall_beside_a_door_is_on_its_way_through_the_door():
    wall = shapely.box(4.9, 0.0, 5.1, 8.0).difference(shapely.box(4.8, 3.0, 5.2, 5.0))
    ground = ground_of([shapely.box(0.0, 0.0, 10.0, 8.0).difference(wall)] * 2)
    field = solve_field(ground, np.array([9.0, 4.0]))
    state = rows_at([(4.7, 1.0), (4.7, 7.0), (1.0, 4.0), (9.0, 4.0)])
    guide(ground, field, ASKED, np.arange(4), state)
    # Up and down along the wall, to the posts, and on through the door.
    assert state["cy"][0] == pytest.approx(-state["cy"][1], abs=0.1)
    assert state["cy"][0] > 0.9
    assert state["ahead"][:2] == pytest.approx([2.3, 2.3], abs=0.4)
    assert (state["onx"][:2] > 0.9).all()
    # Straight through it, without a bend.
    assert (state["cx"][2], state["cy"][2], state["ahead"][2]) == pytest.approx((1.0, 0.0, 8.0), abs=0.05)
    assert (state["onx"][2], state["ony"][2]) == (0.0, 0.0)
    # At the goal.
    assert (state["cx"][3], state["cy"][3], state["ahead"][3]) == (0.0, 0.0, 0.0)
