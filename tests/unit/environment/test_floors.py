"""Floors found or given, what is dropped over and under them, and storeys refused."""

import numpy as np
import pytest
import shapely

from crowdsim.environment.floors import derive_floor, place_on_floor
from crowdsim.environment.layers import LEGS, clearance_layers
from crowdsim.environment.mesh_files import read_mesh_file
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import box as prism_box
from crowdsim.errors import GeometryError, PlaceError
from tests.support.meshes import box, inverted, joined, solid


def part(name, low, high):
    return solid(box(low, high), name)


def walls(height=2.6, base=0.0, size=(10.0, 8.0)):
    x, y = size
    outer, inner = ((0, 0, base), (x, y, base + height)), ((0.2, 0.2, base), (x - 0.2, y - 0.2, base + height))
    vertices, triangles = joined(box(*outer), inverted(box(*inner)))
    upright = np.ptp(vertices[triangles][:, :, 2], axis=1) > 0.0  # neither a floor nor a ceiling
    return solid((vertices, triangles[upright]), "walls")


FLOOR = part("floor", (0, 0, -0.3), (10, 8, 0.0))
TABLE = part("table", (4, 4, 0.7), (6, 5, 0.75))


def test_the_floor_is_the_lowest_large_level():
    found = derive_floor([TABLE, FLOOR, walls()])
    assert found.polygon.equals(shapely.box(0, 0, 10, 8))
    assert found.height == 0.0
    assert found.report[-1].endswith("80.0 m2 at 0 m of 'floor'")


def test_a_place_is_moved_onto_its_floor():
    high = [s.lifted(3.25) for s in (FLOOR, TABLE, walls())] + [prism_box("post", (1, 1), (2, 2), 3.25, 4.25)]
    place = place_on_floor(high)
    table, around, post = place.solids
    assert (table.name, table.bottom, around.bottom) == ("table", pytest.approx(0.7), pytest.approx(0.0))
    assert (post.bottom, post.top) == (0.0, 1.0)
    assert place.floor.area == pytest.approx(80.0)


def test_floors_carpets_and_ceilings_go_with_a_word():
    carpet = part("carpet", (1, 1, 0.0), (4, 4, 0.02))
    doorstep = part("doorstep", (1, 1, 0.0), (2, 2, 0.12))
    cellar = part("cellar", (0, 0, -2.0), (3, 3, -1.9))
    ceiling = part("ceiling", (0, 0, 2.6), (10, 8, 2.7))
    lamp = part("lamp", (5, 5, 2.2), (5.3, 5.3, 2.5))
    place = place_on_floor([FLOOR, carpet, doorstep, cellar, ceiling, lamp, walls()])
    assert [s.name for s in place.solids] == ["doorstep", "lamp", "walls"]
    report = "\n".join(place.report)
    for name in ("floor", "carpet", "cellar", "ceiling"):
        assert f"'{name}'" in report
    assert "the level at 2.7 m is a ceiling" in report


def test_rooms_with_floors_of_their_own_are_joined_at_their_doors():
    left, right = part("left", (0, 0, -0.1), (4, 4, 0.0)), part("right", (4.2, 0, -0.1), (8, 4, 0.02))
    found = derive_floor([left, right])
    assert found.polygon.geom_type == "Polygon"
    assert found.polygon.symmetric_difference(shapely.box(0, 0, 8, 4)).area < 1e-6


@pytest.mark.parametrize("slab", [((0, 0, 2.8), (10, 8, 3.0)), ((2, 2, 2.4), (5, 5, 2.5))], ids=["storey", "platform"])
def test_two_heights_over_one_point_are_refused_where_they_are(slab):
    upper = part("upper", *slab)
    with pytest.raises(PlaceError, match=r"around \(.*\).*walk at 0 m and, above that, at (3|2\.5) m") as refused:
        place_on_floor([FLOOR, upper])
    x, y = (float(word) for word in str(refused.value).split("(")[1].split(")")[0].split(","))
    assert upper.footprint.contains(shapely.Point(x, y))


def test_a_furnished_upper_storey_is_refused_and_a_roof_is_not():
    roof = part("roof", (0, 0, 2.6), (10, 8, 2.8))
    assert place_on_floor([FLOOR, walls(), roof]).floor.area == pytest.approx(80.0)
    with pytest.raises(PlaceError, match=r"at 0 m and, above that, at 2\.8 m"):
        place_on_floor([FLOOR, walls(), roof, walls(base=2.8)])


def test_the_caller_may_choose_the_storey():
    building = [FLOOR, walls(), part("slab", (0, 0, 2.6), (10, 8, 2.8)), walls(base=2.8)]
    outline = shapely.box(0, 0, 10, 8)
    ground = place_on_floor(building, outline, 0.0)
    upper = place_on_floor(building, outline, 2.8)
    derived = place_on_floor(building, height=2.8)
    assert [s.name for s in ground.solids] == ["walls"] == [s.name for s in upper.solids]
    assert upper.solids[0].top == pytest.approx(2.6)
    assert derived.floor.area == pytest.approx(80.0)
    for place in (ground, upper, derived):
        (legs,) = clearance_layers(place.floor, place.solids, [LEGS])
        assert legs.free.area == pytest.approx(9.6 * 7.6, abs=1e-3)


@pytest.mark.parametrize(
    ("low", "high"),
    [((2, 2, 2.3), (3.9, 3.9, 2.4)), ((2, 2, 1.7), (5, 5, 1.8)), ((2, 2, 0.0), (5, 5, 2.5))],
    ids=["too small", "too low to stand below", "a block"],
)
def test_what_nobody_stands_on_and_below_is_no_storey(low, high):
    assert place_on_floor([FLOOR, part("thing", low, high)]).floor.area == pytest.approx(80.0)


def test_a_floor_that_is_only_a_sheet_facing_down_is_found_with_a_word():
    sheet = MeshSolid(
        "sheet", np.array([(0, 0, 0), (8, 0, 0), (8, 8, 0), (0, 8, 0.0)]), np.array([(0, 2, 1), (0, 3, 2)])
    )
    found = derive_floor([sheet])
    assert found.polygon.area == pytest.approx(64.0)
    assert "faces up" in found.report[0]


def test_a_room_as_one_part_seen_from_inside():
    room = solid(inverted(box((0, 0, 0), (6, 5, 2.6))), "room")
    place = place_on_floor([room, TABLE])
    (legs,) = clearance_layers(place.floor, place.solids, [LEGS])
    assert place.floor.area == pytest.approx(30.0)
    assert 27.0 < legs.free.area < 28.1


def test_without_a_floor_the_ground_inside_the_walls_is_taken_with_a_warning():
    place = place_on_floor([walls(), TABLE])
    assert place.floor.area == pytest.approx(80.0)
    assert any("warning: there is no floor" in line for line in place.report)
    posts = [part(f"post {k}", (5 * k, 3 * (k % 2), 1), (5 * k + 0.1, 3 * (k % 2) + 0.1, 3)) for k in range(3)]
    hull = derive_floor(posts)
    assert hull.height == 1.0
    assert hull.polygon.covers(shapely.Point(5, 1.5))


def test_a_given_outline_hides_what_is_elsewhere():
    pit = part("pit", (20, 0, -3.0), (40, 8, -2.9))
    place = place_on_floor([FLOOR, walls(), pit], shapely.box(1, 1, 9, 7))
    assert place.floor.equals(shapely.box(1, 1, 9, 7))
    assert [s.name for s in place.solids] == ["walls"]


def test_an_empty_place_needs_a_floor():
    assert place_on_floor([], shapely.box(0, 0, 1, 1)).solids == ()
    with pytest.raises(PlaceError, match="give a floor"):
        place_on_floor([])


def test_unusable_floors_are_refused():
    with pytest.raises(GeometryError, match="floor"):
        place_on_floor([TABLE], shapely.Point(0, 0))
    with pytest.raises(GeometryError, match="height"):
        place_on_floor([TABLE], shapely.box(0, 0, 1, 1), float("nan"))
    with pytest.raises(PlaceError, match=r"no level surface at 7 m; there are some at 0"):
        place_on_floor([FLOOR], height=7.0)
    with pytest.raises(PlaceError, match=r"enclose no more than .* m2"):
        place_on_floor([part("cup", (0, 0, 0), (0.1, 0.1, 0.1))])


def test_the_floor_of_a_real_house_is_found(shared):
    worlds = shared / "worlds"
    given = shapely.from_wkt((worlds / "small_house_floor.wkt").read_text())
    found = derive_floor(read_mesh_file(worlds / "small_house.glb").solids)
    assert found.polygon.symmetric_difference(given).area < 0.01
    assert found.height == 0.0
    assert "'FloorB_01_001/link/0'" in found.report[0]
