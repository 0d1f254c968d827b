"""Solids: exact footprints and refusals that name the solid."""

import math

import numpy as np
import pytest
import shapely
from shapely import Point, Polygon

from crowdsim.environment.solids import Solid, box, centered_box, circle_around, cylinder, extrusion, require_polygon
from crowdsim.errors import GeometryError


def test_a_box_by_corners_and_by_center_is_the_same():
    by_corners = box("b", (1.0, 2.0), (3.0, 3.0), 0.0, 1.0)
    by_center = centered_box("b", (2.0, 2.5), (2.0, 1.0), 0.0, 1.0)
    assert by_corners.footprint.equals(by_center.footprint)
    assert by_corners.footprint.bounds == (1.0, 2.0, 3.0, 3.0)


def test_a_box_turns_counter_clockwise_about_its_center():
    turned = centered_box("b", (5.0, 5.0), (4.0, 0.2), 0.0, 1.0, rotation=30.0).footprint
    end = Point(5.0 + 1.9 * math.cos(math.pi / 6), 5.0 + 1.9 * math.sin(math.pi / 6))
    assert turned.covers(end)
    assert turned.area == pytest.approx(0.8)
    assert turned.centroid.distance(Point(5.0, 5.0)) < 1e-12


@pytest.mark.parametrize("radius", [1e-3, 0.05, 0.3, 2.0, 40.0])
def test_the_polygon_of_a_cylinder_holds_the_true_cylinder_tightly(radius):
    center = np.array([3.0, -2.0])
    footprint = cylinder("c", tuple(center), radius, 0.0, 1.0).footprint
    corners = shapely.get_coordinates(footprint)[:-1]
    # A convex polygon contains the disc exactly if every edge line keeps at least the radius from the center.
    ahead = np.roll(corners, -1, axis=0)
    edge = ahead - corners
    apart = np.abs(edge[:, 0] * (center - corners)[:, 1] - edge[:, 1] * (center - corners)[:, 0])
    assert (apart / np.hypot(*edge.T) >= radius * (1.0 - 1e-12)).all()
    assert np.hypot(*(corners - center).T).max() <= radius + 0.00201
    np.testing.assert_allclose(
        footprint.bounds, [3.0 - radius, -2.0 - radius, 3.0 + radius, -2.0 + radius], atol=1e-12 * max(1, radius)
    )


def test_circle_has_no_more_corners_than_it_needs():
    assert len(circle_around((0.0, 0.0), 0.3).exterior.coords) - 1 <= 32


@pytest.mark.parametrize(
    ("points", "word"),
    [
        ([(0, 0), (4, 4), (4, 0), (0, 4)], "crosses"),
        ([(0, 0), (5, 0), (10, 0)], "no area"),
        ([(0, 0), (1, 1)], "2 distinct points"),
        ([(0, 0), (0, 0), (1, 1), (1, 1)], "2 distinct points"),
        ([(0, 0), (math.inf, 0), (1, 1)], "finite"),
        ([(0, 0), (math.nan, 0), (1, 1)], "finite"),
        ([(0, 0), (10, 0), (10, 10), (20, 10), (10, 10), (0, 10)], "crosses or touches"),
        ([], "0 distinct points"),
    ],
)
def test_bad_outlines_name_the_solid(points, word):
    with pytest.raises(GeometryError, match=f"'shelf'.*{word}"):
        extrusion("shelf", points, 0.0, 1.0)


def test_an_outline_with_nan_says_so():
    # Bounds leave nan out.
    with np.errstate(invalid="ignore"):
        outline = Polygon([(0.0, 0.0), (1.0, 0.0), (1.0, math.nan), (0.0, 1.0)])
    with pytest.raises(GeometryError, match="crate: the outline has a coordinate that is not a finite number"):
        require_polygon(outline, "crate")


@pytest.mark.parametrize(("bottom", "top"), [(1.0, 1.0), (1.0, 0.5), (math.nan, 1.0), (0.0, math.inf)])
def test_bad_heights_name_the_solid(bottom, top):
    with pytest.raises(GeometryError, match=r"'shelf'.*top"):
        box("shelf", (0.0, 0.0), (1.0, 1.0), bottom, top)


def test_bad_sizes_name_the_solid():
    with pytest.raises(GeometryError, match=r"'shelf'.*min below max"):
        box("shelf", (1.0, 0.0), (0.0, 1.0), 0.0, 1.0)
    with pytest.raises(GeometryError, match=r"'pole'.*radius"):
        cylinder("pole", (0.0, 0.0), math.nan, 0.0, 1.0)
    with pytest.raises(GeometryError, match=r"'void'.*empty"):
        Solid("void", Polygon(), 0.0, 1.0)


def test_overlap_of_heights_is_open():
    solid = box("b", (0.0, 0.0), (1.0, 1.0), 0.5, 0.8)
    assert not solid.overlaps(0.8, 1.5)
    assert not solid.overlaps(0.1, 0.5)
    assert solid.overlaps(0.7, 0.71)
    assert solid.overlaps(0.1, 2.0)
