"""Who follows a field gets on everywhere, also in strides far shorter than a box, and with no room to spare."""

import numpy as np
import pytest
import shapely

from crowdsim.planning.query.requirements import Requirements
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.ground import build_ground
from crowdsim.steering.guidance.ground_kernels import BOX
from crowdsim.steering.guidance.place_walls import outline_segments
from tests.support.guided import BEHAVIORS, follow, free_places

NO_MARGIN = Requirements.of(BEHAVIORS, 2, 0.0)
HALL = shapely.box(0.0, 0.0, 12.0, 10.0)


def strewn(seed):
    """Free areas of both layers of a hall in which turned boxes lie at random."""
    rng = np.random.default_rng(seed)

    def boxes(count):
        found = []
        for _ in range(count):
            x, y = rng.uniform(0.0, 12.0), rng.uniform(0.0, 10.0)
            w, h = rng.uniform(0.05, 2.5, 2)
            found.append(
                shapely.affinity.rotate(shapely.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2), rng.uniform(0.0, 90.0))
            )
        return shapely.union_all(found)

    tall, low = boxes(14), boxes(8)
    above = HALL.difference(tall)
    return [above.difference(low), above]


@pytest.mark.parametrize("seed", [7, 17, 20, 30])
def test_nobody_is_led_to_and_fro(seed):
    """Beside a pin, from which the way leads around a corner, followers of these halls once turned back for ever."""
    areas = strewn(seed)
    ground = build_ground([outline_segments(area) for area in areas], NO_MARGIN, bounds=HALL.bounds)
    goal = free_places(areas, 1, seed, 0.35)[0]
    field = solve_field(ground, goal if seed % 2 else shapely.Point(*goal).buffer(0.7).intersection(areas[0]))
    places = free_places(areas, 150, seed + 1)
    places = places[np.isfinite(ways(ground, field, places).cost)]
    _, _, arrived = follow(ground, field, places, step=0.02, most=6000)
    assert len(places) > 100
    assert arrived.all()


def test_beside_a_goal_along_a_wall_everybody_heads_for_its_nearest_part():
    """An agent between two boxes once headed for the far one of two places at the wall, in turns, for ever."""
    room = shapely.box(0.0, 0.0, 10.0, 10.0)
    ground = build_ground([outline_segments(room)] * 2, NO_MARGIN)
    field = solve_field(ground, shapely.box(0.0, 0.0, 0.3, 10.0))
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0.36, 0.6, 25), np.linspace(1.0, 9.0, 801)))
    told = ways(ground, field, np.column_stack([x, y]))
    aside = np.abs(told.direction[:, 1]) * told.length
    # Half a box, and the part of a box that is asked as one.
    assert aside.max() <= 0.75 * BOX
