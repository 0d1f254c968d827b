"""Cleaning of walkable polygons: obstacles never open, nonsense is refused."""

import json

import numpy as np
import pytest
import shapely
import shapely.affinity

from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import buffered, clean_polygon, turned

ROOM = [(0, 0), (10, 0), (10, 10), (0, 10)]


@pytest.mark.parametrize(
    ("holes", "area"),
    [
        ([[(1, 1), (6, 1), (6, 6), (1, 6)], [(4, 4), (9, 4), (9, 9), (4, 9)]], 100 - 46),  # overlapping
        ([[(1, 1), (6, 1), (6, 6), (1, 6)], [(2, 2), (4, 2), (4, 4), (2, 4)]], 100 - 25),  # one in another
        ([[(0, 4), (2, 4), (2, 6), (0, 6)]], 100 - 4),  # shares an edge with the shell
        ([[(-1, 4), (2, 4), (2, 6), (-1, 6)]], 100 - 4),  # sticks out of the shell
        ([[(1, 1), (3, 1), (3, 3), (1, 3)], [(3, 1), (5, 1), (5, 3), (3, 3)]], 100 - 8),  # share an edge
    ],
)
def test_holes_only_take_away(holes, area):
    cleaned = clean_polygon(shapely.Polygon(ROOM, holes))
    assert cleaned.is_valid
    assert cleaned.area == pytest.approx(area)


def test_a_valid_polygon_stays_as_it_is():
    polygon = shapely.Polygon(ROOM, [[(1, 1), (2, 1), (2, 2)]])
    assert clean_polygon(polygon) is polygon


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        (shapely.Polygon(), "empty"),
        (shapely.Polygon([(0, 0), (5, 0), (10, 0)]), "no area"),
        (shapely.LineString([(0, 0), (1, 1)]), "LineString"),
        (None, "NoneType"),
        (shapely.Polygon([(0, 0), (float("inf"), 0), (1, 1)]), "finite"),
    ],
)
def test_nonsense_is_refused(geometry, message):
    with pytest.raises(GeometryError, match=message):
        clean_polygon(geometry)


def test_fault_collection(shared):
    for fault in json.loads((shared / "faults" / "polygons.json").read_text()):
        if fault["wkt"] == "INF":
            geometry = shapely.Polygon([(0, 0), (float("inf"), 0), (1, 1)])
        else:
            geometry = shapely.from_wkt(fault["wkt"])
        if fault["expect"] == "reject":
            with pytest.raises(GeometryError):
                clean_polygon(geometry)
        else:
            cleaned = clean_polygon(geometry)
            assert cleaned.is_valid
            assert cleaned.area > 0.0, fault["id"]


def test_buffers_lie_on_the_grid_in_one_order():
    star = shapely.Polygon([(0, 0), (0.1, 3), (0.2, 0), (3, 0.1)])
    for style in ({}, {"join_style": "mitre"}, {"quad_segs": 4}):
        grown = buffered(star, 0.3, **style)
        corners = shapely.get_coordinates(grown)
        np.testing.assert_allclose(corners, np.round(corners, 6), rtol=0.0, atol=1e-12)
        assert shapely.hausdorff_distance(grown, star.buffer(0.3, **style)) < 1e-6
        assert shapely.equals_exact(grown, shapely.normalize(grown), 0.0)
    assert buffered(star, -5.0).is_empty
    third = buffered(shapely.box(0, 0, 3, 3), 0.5, join_style="mitre") - shapely.box(1 / 3, 1 / 3, 1, 1)
    assert 1 / 3 in shapely.get_coordinates(third), "what is made of a buffer is on no grid"


def test_outlines_turn_about_the_middle_of_their_bounds():
    box = shapely.box(1, 2, 5, 4)
    assert shapely.equals(turned(box, 90.0), shapely.box(2, 1, 4, 5))
    assert shapely.hausdorff_distance(turned(box, 20.0), shapely.affinity.rotate(box, 20.0)) < 1e-12
