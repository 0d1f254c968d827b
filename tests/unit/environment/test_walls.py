"""Walls with doors and windows."""

import math

import pytest
import shapely

from crowdsim.environment.layers import LEGS, TORSO, clearance_layers
from crowdsim.environment.walls import Opening, wall
from crowdsim.errors import GeometryError

FLOOR = shapely.box(-1, -1, 7, 6)


def test_a_plain_wall_is_one_mitered_prism():
    (prism,) = wall("w", [(0, 0), (5, 0), (5, 4)], 0.2, 0.0, 2.6)
    expected = shapely.union_all([shapely.box(0, -0.1, 5.1, 0.1), shapely.box(4.9, -0.1, 5.1, 4)])
    assert prism.footprint.symmetric_difference(expected).area < 1e-12
    assert (prism.name, prism.bottom, prism.top) == ("w", 0.0, 2.6)


def test_a_door_leaves_a_lintel_and_a_passage():
    solids = wall("w", [(0, 0), (5, 0)], 0.2, 0.0, 2.6, [Opening(at=2.0, width=0.9)])
    assert [(s.name, s.bottom, s.top) for s in solids] == [("w 1", 0, 2.6), ("w 2", 0, 2.6), ("w, lintel", 2.05, 2.6)]
    assert solids[2].footprint.bounds == pytest.approx((1.55, -0.1, 2.45, 0.1))
    legs, torso = clearance_layers(FLOOR, solids, [LEGS, TORSO])
    for layer in (legs, torso):
        assert layer.obstacles.area == pytest.approx(0.2 * 4.1)
        assert layer.free.covers(shapely.box(1.56, -0.5, 2.44, 0.5))


def test_a_window_stops_legs_and_lets_the_torso_lean_out():
    solids = wall("w", [(0, 0), (5, 0)], 0.2, 0.0, 2.6, [Opening(2.0, 1.2, bottom=0.6, top=2.1)])
    assert [s.name for s in solids] == ["w 1", "w 2", "w, sill", "w, lintel"]
    legs, torso = clearance_layers(FLOOR, solids, [LEGS, TORSO])
    assert legs.obstacles.area == pytest.approx(1.0)
    assert torso.obstacles.area == pytest.approx(0.2 * 3.8)


def test_all_pieces_of_a_wall_make_it_whole_again():
    openings = [Opening(4.6, 0.8), Opening(0.45, 0.9, 0.9, 2.1), Opening(6.0, 1.0, 1.0, 3.0)]
    solids = wall("w", [(0, 0), (5, 0), (5, 4)], 0.15, 0.0, 2.5, openings)
    (whole,) = wall("w", [(0, 0), (5, 0), (5, 4)], 0.15, 0.0, 2.5)
    volume = sum(s.footprint.area * (s.top - s.bottom) for s in solids)
    gaps = 0.15 * (0.8 * 2.05 + 0.9 * 1.2 + 1.0 * 1.5)
    assert volume == pytest.approx(whole.footprint.area * 2.5 - gaps, abs=1e-6)
    assert len({s.name for s in solids}) == len(solids)


def test_a_closed_line_goes_around_without_ends():
    (ring,) = wall("w", [(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)], 0.2, 0.0, 2.6)
    assert ring.footprint.area == pytest.approx(5.2 * 4.2 - 4.8 * 3.8)
    legs = clearance_layers(
        FLOOR, wall("w", [(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)], 0.2, 0, 2.6, [Opening(2, 1)]), [LEGS]
    )
    assert len(legs[0].free.geoms) == 1


def test_an_opening_around_a_corner_and_a_slanted_wall():
    solids = wall("w", [(0, 0), (3, 4), (6, 4)], 0.1, 0.0, 2.5, [Opening(5.0, 1.0)])
    (legs,) = clearance_layers(FLOOR, solids, [LEGS])
    assert legs.free.covers(shapely.Point(3, 4).buffer(0.3))
    assert math.isclose(solids[-1].bottom, 2.05)


def test_an_opening_at_the_begin_is_open_whatever_rounding_makes_of_its_place():
    """Here it is put a little before the begin of the wall, which is no place before its end."""
    opening = Opening(0.3 * 1.5, 0.9)
    assert opening.at - 0.5 * opening.width < 0.0
    (legs,) = clearance_layers(FLOOR, wall("w", [(0, 0), (5, 0)], 0.1, 0.0, 2.5, [opening]), [LEGS])
    assert legs.free.covers(shapely.Point(0.45, 0))
    assert not legs.free.intersects(shapely.LineString([(0.91, 0), (4.99, 0)]))


@pytest.mark.parametrize(
    ("points", "thickness", "top", "openings", "word"),
    [
        ([(0, 0)], 0.1, 2.5, [], "1 distinct"),
        ([(0, 0), (0, 0)], 0.1, 2.5, [], "1 distinct"),
        ([], 0.1, 2.5, [], "0 distinct"),
        ([(0, 0), (math.nan, 0)], 0.1, 2.5, [], "finite"),
        ([(0, 0), (1, 0)], 0.0, 2.5, [], "thickness"),
        ([(0, 0), (1, 0)], math.nan, 2.5, [], "thickness"),
        ([(0, 0), (1, 0)], 0.1, 0.0, [], "top"),
        ([(0, 0), (5, 0)], 0.1, 2.5, [Opening(0.2, 0.9)], "reaches past"),
        ([(0, 0), (5, 0)], 0.1, 2.5, [Opening(4.9, 0.9)], "5 m long"),
        ([(0, 0), (5, 0)], 0.1, 2.5, [Opening(2, 1), Opening(2.5, 1)], "inside of another"),
    ],
)
def test_bad_walls_are_named(points, thickness, top, openings, word):
    with pytest.raises(GeometryError, match=f"wall 'w'.*{word}"):
        wall("w", points, thickness, 0.0, top, openings)


@pytest.mark.parametrize("numbers", [(1.0, 0.0), (1.0, 1.0, 2.0, 1.0), (math.nan, 1.0), (1.0, 1.0, 0.0, math.inf)])
def test_bad_openings_are_refused(numbers):
    with pytest.raises(GeometryError, match="opening"):
        Opening(*numbers)
