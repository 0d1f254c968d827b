"""What the next stretch of a way asks of a body: narrow gaps ask, from a little before; open walls do not."""

import numpy as np
import pytest
import shapely

from crowdsim.steering.guidance.ask_kernels import BEFORE
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.ground_kernels import BOX
from tests.support.guided import NEED, ground_of

WIDEST = len(NEED.costs) - 1
FRONTAL, ARMS = (float(NEED.radii[number].max()) for number in (-1, -2))


def asked(area, goal, places):
    ground = ground_of([area, area])
    return ways(ground, solve_field(ground, goal), np.array(places)).behavior


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_nobody_at_an_open_wall_is_asked_for_anything(turn):
    """Beside a long wall, towards a corner and around it, however near the wall; not in the corner of a room."""
    room = shapely.union_all([shapely.box(0.0, 0.0, 8.0, 10.0), shapely.box(7.9, 4.0, 14.0, 6.0)])
    area = shapely.affinity.rotate(room, turn, origin=(0.0, 0.0))
    goal = shapely.affinity.rotate(shapely.box(12.0, 4.2, 13.5, 5.8), turn, origin=(0.0, 0.0))
    places = [(8.0 - off, y) for off in (0.13, 0.18, 0.22, 0.3, 0.36) for y in (1.0, 1.9, 2.9, 7.1, 8.1, 9.0)]
    turned = [shapely.affinity.rotate(shapely.Point(place), turn, origin=(0.0, 0.0)) for place in places]
    assert (asked(area, goal, shapely.get_coordinates(turned)) == WIDEST).all()


@pytest.mark.parametrize("length", [0.1, 0.6, 3.0])
@pytest.mark.parametrize("width", [2.0 * ARMS + 0.02, 2.0 * FRONTAL - 0.02])
def test_a_gap_asks_from_a_little_before_to_its_end(width, length):
    area = shapely.union_all(
        [
            shapely.box(0.0, 0.0, 5.0, 6.0),
            shapely.box(5.0, 3.0 - 0.5 * width, 5.0 + length, 3.0 + 0.5 * width),
            shapely.box(5.0 + length, 0.0, 11.0 + length, 6.0),
        ]
    )
    goal = shapely.box(8.0 + length, 2.0, 9.0 + length, 4.0)
    # Boxes are asked, each as a whole.
    along = np.arange(5.0 - BEFORE + BOX, max(5.0 + length - BOX, 5.0), 0.05)
    inside = np.column_stack((along, np.full(len(along), 3.0)))
    assert (asked(area, goal, inside) < WIDEST).all()
    assert (asked(area, goal, [(2.0, 3.0), (5.9 + length, 3.0)]) == WIDEST).all()
