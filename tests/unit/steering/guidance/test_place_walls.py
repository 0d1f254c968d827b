import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.ground import build_ground, update_ground
from crowdsim.steering.guidance.place_walls import PlaceWalls, outline_segments, update_walls
from crowdsim.steering.walls import build_walls
from tests.support.guided import NEED
from tests.support.small_scenes import scene

ROOM = shapely.box(0.0, 0.0, 12.0, 8.0)
BENCH = shapely.box(2.0, 2.0, 4.0, 2.6)
SHELF = shapely.box(6.0, 4.0, 7.0, 5.0)
LAMP = shapely.box(9.0, 1.0, 9.5, 1.5)


def rows_of(segments):
    """Segments as a set, whichever end comes first."""
    return {tuple(sorted([(a, b), (c, d)])) for a, b, c, d in np.asarray(segments).tolist()}


def assert_alike(one, other):
    """Walls whose distances differ by no more than a unit, as sums of steps may round otherwise."""
    assert rows_of(one.segments) == rows_of(other.segments)
    assert (one.left, one.bottom, one.columns, one.rows) == (other.left, other.bottom, other.columns, other.rows)
    assert np.array_equal(one.starts, other.starts)
    assert np.abs(one.distances.astype(int) - other.distances).max() <= 1


def test_outlines_have_all_their_sides():
    area = ROOM.difference(SHELF)
    assert rows_of(outline_segments(area)) == rows_of(outline_segments(ROOM)) | rows_of(outline_segments(SHELF))
    assert len(outline_segments(shapely.MultiPolygon([BENCH, SHELF]))) == 8
    assert outline_segments(None).shape == outline_segments(shapely.Polygon()).shape == (0, 4)


def test_legs_meet_the_lowest_layer_and_the_torso_all_others():
    legs = ROOM.difference(shapely.union_all([BENCH, SHELF, LAMP]))
    walls = PlaceWalls([legs, ROOM.difference(SHELF), ROOM.difference(LAMP)])
    assert rows_of(walls.legs.segments) == rows_of(outline_segments(legs))
    assert rows_of(walls.torso.segments) == rows_of(outline_segments(ROOM.difference(shapely.union_all([SHELF, LAMP]))))
    # The outline of the room stands in both upper layers, but once among the walls.
    assert len(walls.torso.segments) == 12


def test_a_single_layer_is_met_by_both():
    walls = PlaceWalls([ROOM])
    assert rows_of(walls.legs.segments) == rows_of(walls.torso.segments) == rows_of(outline_segments(ROOM))


@pytest.mark.parametrize("seed", [0, 1])
def test_an_edit_gives_what_new_walls_are(seed):
    areas = scene(seed)
    things = {0: [shapely.box(4.0, 4.2, 4.9, 4.5), None]}
    walls = PlaceWalls(areas, things)
    first = walls.legs
    distances = first.distances.copy()
    moves = [
        (0, [shapely.box(6.0, 1.0, 6.4, 1.9), shapely.box(6.0, 1.0, 6.4, 1.9)]),
        (1, [shapely.Point(2.0, 7.0).buffer(0.4), None]),
        (0, None),
        (1, None),
    ]
    for thing, outlines in moves:
        assert walls.put(thing, outlines) is not None
        things = {**things, thing: outlines}
        things = {number: each for number, each in things.items() if each is not None}
        anew = PlaceWalls(areas, things)
        assert_alike(walls.legs, anew.legs)
        assert_alike(walls.torso, anew.torso)
    assert_alike(walls.legs, PlaceWalls(areas).legs)
    assert np.array_equal(first.distances, distances)
    assert walls.put(0, None) is None


def test_walls_beyond_the_frame_are_built_from_the_start():
    old = build_walls(outline_segments(ROOM))
    farther = np.concatenate([outline_segments(ROOM), outline_segments(shapely.box(30.0, 0.0, 31.0, 1.0))])
    assert_alike(update_walls(old, farther, (30.0, 0.0, 31.0, 1.0)), build_walls(farther))
    assert len(update_walls(old, np.empty((0, 4)), ROOM.bounds).segments) == 0


@pytest.mark.parametrize("off", [0.5, 2.0, 3.5, 4.0, 5.0, 6.0, 9.0])
def test_a_window_off_the_grid_changes_nothing(off):
    walls = build_walls(outline_segments(ROOM))
    # To the left and right of the room, below and above it.
    for window in (
        (-off - 1.0, -1.0, -off, 9.0),
        (12.0 + off, -1.0, 13.0 + off, 9.0),
        (-1.0, -off - 1.0, 13.0, -off),
        (-1.0, 8.0 + off, 13.0, 9.0 + off),
    ):
        assert_alike(update_walls(walls, walls.segments, window), walls)


def test_a_door_that_closes_changes_fields_and_walls():
    area = ROOM.difference(shapely.box(5.9, -1.0, 6.1, 9.0).difference(shapely.box(5.0, 3.0, 7.0, 4.2)))
    door = shapely.box(5.95, 2.9, 6.05, 4.3)
    walls = PlaceWalls([area, area])
    open_ground = build_ground(walls.segments().layers, NEED)
    start, goal = [[2.0, 3.5]], [10.0, 3.5]
    assert ways(open_ground, solve_field(open_ground, goal), start).length[0] == pytest.approx(8.0, abs=0.01)
    window = walls.put(0, [door, door])
    shut = update_ground(open_ground, walls.segments().layers, NEED, window)
    assert np.isinf(ways(shut, solve_field(shut, goal), start).length[0])
    window = walls.put(0, None)
    again = update_ground(shut, walls.segments().layers, NEED, window)
    assert ways(again, solve_field(again, goal), start).length[0] == pytest.approx(8.0, abs=0.01)


def test_arguments():
    with pytest.raises(GeometryError, match="at least one layer"):
        PlaceWalls([])
    with pytest.raises(GeometryError, match="layers"):
        PlaceWalls([ROOM, ROOM], {0: [BENCH]})
