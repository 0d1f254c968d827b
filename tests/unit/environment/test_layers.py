"""Clearance layers: which solid counts where, and what floor is left."""

import math

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Polygon

from crowdsim.environment import footprints
from crowdsim.environment.layers import LEGS, TORSO, Band, Plane, clearance_layers, dropped_solids
from crowdsim.environment.solids import Solid, box, centered_box, cylinder
from crowdsim.errors import GeometryError
from tests.support.meshes import box as meshes_box
from tests.support.meshes import joined, solid

FLOOR = shapely.box(0.0, 0.0, 10.0, 10.0)


def test_each_solid_counts_in_the_bands_it_meets():
    bench = box("bench", (1.0, 1.0), (2.0, 2.0), 0.0, 0.45)
    sign = box("sign", (3.0, 1.0), (4.0, 2.0), 1.0, 1.4)
    wall = box("wall", (5.0, 1.0), (6.0, 2.0), 0.0, 2.6)
    lamp = box("lamp", (7.0, 1.0), (8.0, 2.0), 2.0, 2.3)
    carpet = box("carpet", (1.0, 5.0), (9.0, 9.0), 0.0, 0.10)
    solids = [bench, sign, wall, lamp, carpet]
    legs, torso = clearance_layers(FLOOR, solids, [LEGS, TORSO])
    assert (legs.name, torso.name) == ("legs", "torso")
    assert legs.obstacles.equals(shapely.union_all([bench.footprint, sign.footprint, wall.footprint]))
    assert torso.obstacles.equals(shapely.union_all([sign.footprint, wall.footprint]))
    assert legs.free.area == pytest.approx(97.0)
    assert torso.free.area == pytest.approx(98.0)
    assert [solid.name for solid in dropped_solids(solids, [LEGS, TORSO])] == ["lamp", "carpet"]


def test_the_lowest_band_is_the_ground_whatever_the_order_and_holds_what_only_others_meet():
    shelf = box("shelf", (1.0, 1.0), (2.0, 2.0), 1.2, 1.4)
    low, high = Band("shins", 0.1, 0.5), Band("chest", 1.0, 1.5)
    for bands in ([low, high], [high, low]):
        layers = clearance_layers(FLOOR, [shelf], bands)
        assert [layer.name for layer in layers] == ["shins", "chest"]
        assert layers[0].obstacles.area == pytest.approx(1.0)


def test_no_solids_leave_the_whole_floor():
    (legs,) = clearance_layers(FLOOR, [], [LEGS])
    assert legs.obstacles.is_empty
    assert legs.free.equals(FLOOR)


def test_solids_that_touch_the_floor_from_outside_leave_no_lines_behind():
    beside = box("beside", (10.0, 0.0), (11.0, 10.0), 0.0, 2.0)
    (legs,) = clearance_layers(FLOOR, [beside], [LEGS])
    assert legs.free.geom_type == "MultiPolygon"
    assert legs.free.equals(FLOOR)


@pytest.mark.parametrize(
    ("holes", "area"),
    [
        ([[(1, 1), (6, 1), (6, 6), (1, 6)], [(4, 4), (9, 4), (9, 9), (4, 9)]], 100 - 25 - 25 + 4),
        ([[(1, 1), (9, 1), (9, 9), (1, 9)], [(3, 3), (6, 3), (6, 6), (3, 6)]], 100 - 64),
        ([[(0, 4), (2, 4), (2, 6), (0, 6)]], 96),
        ([[(-1, 4), (2, 4), (2, 6), (-1, 6)]], 96),
        ([[(1, 1), (4, 1), (4, 4), (1, 4)], [(4, 1), (7, 1), (7, 4), (4, 4)]], 100 - 18),
        ([[(1, 1), (1, 1), (1, 1)]], 100),
    ],
    ids=["overlap", "nested", "on the edge", "across the edge", "side by side", "a point"],
)
def test_holes_of_a_bad_floor_never_become_walkable(holes, area):
    floor = Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], holes)
    (legs,) = clearance_layers(floor, [], [LEGS])
    assert legs.free.is_valid
    assert legs.free.area == pytest.approx(area)


@pytest.mark.parametrize("floor", [Polygon(), Polygon([(0, 0), (5, 0), (10, 0)])])
def test_a_floor_without_area_is_refused(floor):
    with pytest.raises(GeometryError, match="floor"):
        clearance_layers(floor, [], [LEGS])


def test_a_plane_sees_what_it_cuts_and_the_ground_holds_that_too():
    table = solid(joined(meshes_box((4, 4, 0.7), (6, 5, 0.75)), meshes_box((4.9, 4.4, 0.0), (5.1, 4.6, 0.7))), "table")
    sign, lamp = box("sign", (1.0, 1.0), (2.0, 2.0), 1.1, 1.3), box("lamp", (8.0, 8.0), (9.0, 9.0), 1.2, 1.3)
    shins, eyes = clearance_layers(FLOOR, [table, sign, lamp], [Plane("eyes", 1.15), Plane("shins", 0.3)])
    assert (shins.low, shins.high, eyes.low, eyes.high) == (0.3, 0.3, 1.15, 1.15)
    assert eyes.obstacles.equals(sign.footprint)
    assert shins.obstacles.area == pytest.approx(0.04 + 1.0)  # the table's leg, and the sign above
    assert dropped_solids([table, sign, lamp], [Plane("eyes", 1.15), Plane("shins", 0.3)]) == (lamp,)
    assert dropped_solids([table, lamp], [Plane("low", 0.3), Band("high", 1.25, 1.5)]) == ()


def test_planes_and_bands_make_layers_together():
    shelf = box("shelf", (1.0, 1.0), (2.0, 2.0), 1.2, 1.4)
    layers = clearance_layers(FLOOR, [shelf], [Plane("plane", 1.3), TORSO, LEGS])
    assert [layer.name for layer in layers] == ["legs", "torso", "plane"]
    assert all(layer.obstacles.equals(shelf.footprint) for layer in layers)


def test_a_floor_in_pieces_is_one_place():
    floor = MultiPolygon([FLOOR, shapely.box(20.0, 0.0, 30.0, 10.0)])
    (legs,) = clearance_layers(floor, [], [LEGS])
    assert legs.free.area == pytest.approx(200.0)


def test_planes_are_checked():
    with pytest.raises(GeometryError, match="'x'"):
        Plane("x", math.inf)


def test_bands_are_checked():
    with pytest.raises(GeometryError, match="'x'"):
        Band("x", 1.0, 1.0)
    with pytest.raises(GeometryError, match="'x'"):
        Band("x", 0.0, math.nan)
    with pytest.raises(GeometryError, match="distinct names"):
        clearance_layers(FLOOR, [], [LEGS, Band("legs", 0.5, 0.6)])
    with pytest.raises(GeometryError, match="distinct names"):
        clearance_layers(FLOOR, [], [])


_coordinate = st.floats(-1.0, 11.0)
_height = st.floats(0.0, 2.5)


@st.composite
def _solids(draw) -> list[Solid]:
    solids = []
    for number in range(draw(st.integers(0, 8))):
        center = (draw(_coordinate), draw(_coordinate))
        bottom = draw(_height)
        top = bottom + draw(st.floats(0.01, 2.0))
        if draw(st.booleans()):
            solids.append(cylinder(f"c{number}", center, draw(st.floats(0.01, 2.0)), bottom, top))
        else:
            size = (draw(st.floats(0.01, 5.0)), draw(st.floats(0.01, 5.0)))
            solids.append(centered_box(f"b{number}", center, size, bottom, top, draw(st.floats(0.0, 90.0))))
    return solids


@settings(max_examples=40, deadline=None, derandomize=True)
@given(_solids())
def test_what_is_free_on_the_ground_is_free_above(solids):
    legs, torso = clearance_layers(FLOOR, solids, [TORSO, LEGS])
    assert torso.obstacles.difference(legs.obstacles).area < 1e-9
    assert legs.free.difference(torso.free).area < 1e-9
    for layer in (legs, torso):
        assert layer.free.is_valid
        assert layer.free.intersection(layer.obstacles).area < 1e-9
        assert layer.free.union(layer.obstacles).intersection(FLOOR).area == pytest.approx(100.0)


def test_progress_counts_solids_once_for_each_layer(monkeypatch):
    monkeypatch.setattr(footprints, "_TRIANGLES_AT_ONCE", 24)
    boxes = [
        solid(meshes_box((0.4 * k, 1.0, 0.2), (0.4 * k + 0.3, 1.3 + 0.01 * k, 1.0))) for k in range(9)
    ]  # no copies
    told = []
    clearance_layers(FLOOR, boxes, [TORSO, LEGS], lambda done, total: told.append((done, total)))
    assert told == [(done, 18) for done in (2, 4, 6, 8, 9, 11, 13, 15, 17, 18)]
