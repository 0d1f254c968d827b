"""Floor plans: what WKT and DXF draw, and what they are refused for."""

import json

import pytest
import shapely

from crowdsim.environment.floor_plans import read_floor_plan
from crowdsim.errors import CrowdSimError, GeometryError, PlaceError


def wkt(tmp_path, text):
    path = tmp_path / "plan.wkt"
    path.write_text(text)
    return path


def test_a_polygon_is_the_floor_with_holes_as_obstacles(tmp_path):
    plan = read_floor_plan(wkt(tmp_path, "POLYGON((0 0,10 0,10 8,0 8,0 0),(2 2,4 2,4 4,2 4,2 2))\n"))
    assert plan.floor.area == pytest.approx(76.0)
    assert plan.solids == ()
    assert "76.0 m2" in plan.report[0]


def test_collections_are_united_as_jupedsim_does(tmp_path):
    text = (
        "GEOMETRYCOLLECTION(POLYGON((0 0,4 0,4 4,0 4,0 0)),GEOMETRYCOLLECTION(MULTIPOLYGON(((4 1,8 1,8 3,4 3,4 1)))))"
    )
    plan = read_floor_plan(wkt(tmp_path, text))
    assert plan.floor.geom_type == "Polygon"
    assert plan.floor.area == pytest.approx(24.0)


def test_units_scale_a_plan_and_odd_sizes_are_doubted(tmp_path):
    path = wkt(tmp_path, "POLYGON((0 0,10000 0,10000 8000,0 8000,0 0))")
    assert any("meters?" in line for line in read_floor_plan(path).report)
    plan = read_floor_plan(path, units="mm")
    assert plan.floor.area == pytest.approx(80.0)
    assert not any("meters?" in line for line in plan.report)


def test_a_large_place_drawn_in_millimeters_is_read_in_meters(tmp_path):
    """Limits on sizes are in meters."""
    path = wkt(tmp_path, "POLYGON((0 0,30000000 0,30000000 20000000,0 20000000,0 0))")
    assert read_floor_plan(path, units="mm").floor.area == pytest.approx(30_000.0 * 20_000.0)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("POINT (1 2)", "holds a POINT"),
        ("LINESTRING (0 0, 1 1)", "holds a LINESTRING"),
        ("GEOMETRYCOLLECTION (POLYGON((0 0,4 0,4 4,0 4,0 0)), POINT (1 2))", "holds a POINT"),
        ("GEOMETRYCOLLECTION EMPTY", "empty collection"),
        ("POLYGON EMPTY", "empty"),
        ("POLYGON((0 0,5 0,10 0,0 0))", "no area"),
        ("POLYGON((0 0,inf 0,1 1,0 0))", "plan.wkt"),
        ("POLYGON((0 0,10 0,10 8,0 8,0 0),(12 2,14 2,14 4,12 4,12 2))", "outside of its polygon"),
        ("POLYGON((0 0,1 0", "well-known text"),
        ("hello", "well-known text"),
        ("CURVEPOLYGON (CIRCULARSTRING (0 0, 4 0, 4 4, 0 4, 0 0))", "well-known text"),
    ],
)
def test_wkt_of_another_kind_names_the_file(tmp_path, text, word):
    with pytest.raises(PlaceError, match=rf"plan\.wkt.*{word}|{word}"):
        read_floor_plan(wkt(tmp_path, text))


def test_broken_polygons_are_repaired_or_refused_and_never_leak(tmp_path, shared):
    for case in json.loads((shared / "faults" / "polygons.json").read_text()):
        text = str(case.get("wkt", ""))
        if "POLYGON" not in text:
            continue
        try:
            plan = read_floor_plan(wkt(tmp_path, text))
        except CrowdSimError:
            refused = True
        else:
            refused = False
            assert plan.floor.is_valid
        assert "reject" in case["expect"] if refused else case["expect"] != "reject", case


def test_a_repair_is_reported(tmp_path):
    crossed = read_floor_plan(wkt(tmp_path, "POLYGON((0 0,4 4,4 0,0 4,0 0))"))
    assert any("warning" in line and "[2 2]" in line for line in crossed.report)


def test_a_byte_order_mark_is_no_text(tmp_path):
    assert read_floor_plan(wkt(tmp_path, "\ufeffPOLYGON((0 0,4 0,4 4,0 4,0 0))")).floor.area == pytest.approx(16.0)


def test_content_in_memory_is_read_whatever_has_its_name_on_disk(tmp_path):
    folder = tmp_path / "floor.wkt"
    folder.mkdir()
    plan = read_floor_plan(folder, content=b"POLYGON((0 0,10 0,10 8,0 8,0 0))")
    assert plan.floor.area == pytest.approx(80.0)


@pytest.mark.parametrize("name", ["a.pdf", "a"])
def test_other_files_are_refused(tmp_path, name):
    with pytest.raises(PlaceError, match=r"known are \.wkt, \.dxf"):
        read_floor_plan(tmp_path / name)


@pytest.mark.parametrize("name", ["absent.wkt", "absent.dxf"])
def test_missing_files_are_named(tmp_path, name):
    with pytest.raises(PlaceError, match=rf"{name}: (cannot be read|DXF files need)"):
        read_floor_plan(tmp_path / name)


def test_bad_walls_are_refused(tmp_path):
    with pytest.raises(GeometryError, match="thickness"):
        read_floor_plan(tmp_path / "a.dxf", thickness=0.0)
    with pytest.raises(GeometryError, match="top"):
        read_floor_plan(tmp_path / "a.dxf", top=-1.0)


def test_binary_content_is_no_wkt(tmp_path):
    (tmp_path / "plan.wkt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlaceError, match="is not a text file"):
        read_floor_plan(tmp_path / "plan.wkt")


def test_dxf_without_its_reader_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    (tmp_path / "a.dxf").write_text("0")
    with pytest.raises(PlaceError, match=r"pip install 'crowdsim\[dxf\]'"):
        read_floor_plan(tmp_path / "a.dxf")


@pytest.fixture
def drawing():
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4  # millimeters
    return document


def saved(document, tmp_path):
    path = tmp_path / "plan.dxf"
    document.saveas(path)
    return path


def rectangle(space, x0, y0, x1, y1, layer="0"):
    return space.add_lwpolyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], close=True, dxfattribs={"layer": layer})


def test_lines_are_walls_and_closed_curves_are_filled(drawing, tmp_path):
    space = drawing.modelspace()
    rectangle(space, 0, 0, 10000, 8000, "outline")
    space.add_line((2000, 0), (2000, 5000), dxfattribs={"layer": "walls"})
    space.add_line((5000, 5000), (2000, 5000), dxfattribs={"layer": "walls"})
    space.add_arc((7000, 6000), 1000, 0, 90, dxfattribs={"layer": "walls"})
    space.add_circle((8000, 2000), 500, dxfattribs={"layer": "columns"})
    hatch = space.add_hatch(dxfattribs={"layer": "hatched"})
    hatch.paths.add_polyline_path([(5000, 1000), (6000, 1000), (6000, 2000), (5000, 2000)], is_closed=True)
    hatch.paths.add_polyline_path([(5400, 1400), (5600, 1400), (5600, 1600), (5400, 1600)], is_closed=True)
    space.add_text("kitchen")
    plan = read_floor_plan(saved(drawing, tmp_path), thickness=0.2, top=3.0)
    assert plan.floor.equals(shapely.box(0, 0, 10, 8))
    solids = {solid.name: solid for solid in plan.solids}
    assert set(solids) == {"walls 1", "walls 2", "columns 1", "hatched 1"}
    corner = shapely.union_all([shapely.box(1.9, 0, 2.1, 5.1), shapely.box(1.9, 4.9, 5, 5.1)])
    areas = {
        round(solid.footprint.symmetric_difference(corner).area, 6): name
        for name, solid in solids.items()
        if name.startswith("walls")
    }
    assert min(areas) == 0.0  # mitered where the lines meet
    assert solids["columns 1"].footprint.area == pytest.approx(3.14159 * 0.25, rel=0.01)
    assert solids["hatched 1"].footprint.area == pytest.approx(0.96)
    assert all((solid.bottom, solid.top) == (0.0, 3.0) for solid in plan.solids)
    report = "\n".join(plan.report)
    assert "mm" in report
    assert "TEXT" in report
    assert "(layer 'outline') is the floor" in report


def test_a_closed_curve_around_something_is_a_wall_around_it(drawing, tmp_path):
    space = drawing.modelspace()
    rectangle(space, 0, 0, 4000, 4000, "rooms")
    rectangle(space, 1000, 1000, 2000, 2000, "rooms")
    rectangle(space, 6000, 0, 9000, 3000, "rooms")
    plan = read_floor_plan(saved(drawing, tmp_path), thickness=0.1)
    assert plan.floor is None
    assert sorted(round(solid.footprint.area, 3) for solid in plan.solids) == [1.0, round(16 * 0.1, 3), 9.0]


def test_layers_are_chosen_and_the_floor_has_one(drawing, tmp_path):
    space = drawing.modelspace()
    rectangle(space, 0, 0, 6000, 6000, "floor")
    rectangle(space, 6000, 1000, 9000, 3000, "floor")
    rectangle(space, 1000, 1000, 2000, 2000, "desks")
    rectangle(space, 3000, 1000, 4000, 2000, "notes")
    path = saved(drawing, tmp_path)
    plan = read_floor_plan(path, layers=["desks"], floor_layer="floor")
    assert plan.floor.area == pytest.approx(42.0)
    assert [solid.name for solid in plan.solids] == ["desks 1"]
    with pytest.raises(PlaceError, match=r"layer walls; there are: desks, floor, notes"):
        read_floor_plan(path, layers=["walls"])


def test_layers_that_are_switched_off_are_left_out(drawing, tmp_path):
    drawing.layers.add("old").off()
    rectangle(drawing.modelspace(), 0, 0, 1000, 1000, "old")
    rectangle(drawing.modelspace(), 3000, 0, 4000, 1000, "new")
    assert [s.name for s in read_floor_plan(saved(drawing, tmp_path)).solids] == ["new 1"]
    assert [s.name for s in read_floor_plan(tmp_path / "plan.dxf", layers=["old"]).solids] == ["old 1"]


def test_blocks_are_resolved_with_their_scale_turn_and_layer(drawing, tmp_path):
    chair, group = drawing.blocks.new("chair"), drawing.blocks.new("group")
    rectangle(chair, 0, 0, 500, 500)
    group.add_blockref("chair", (0, 0))
    group.add_blockref("chair", (1000, 0), dxfattribs={"rotation": 45})
    space = drawing.modelspace()
    space.add_blockref("group", (2000, 2000), dxfattribs={"layer": "seats", "xscale": 2.0, "yscale": 2.0})
    space.add_blockref("chair", (9000, 0), dxfattribs={"layer": "seats", "row_count": 2, "row_spacing": 1000})
    solids = read_floor_plan(saved(drawing, tmp_path)).solids
    assert sorted(round(solid.footprint.area, 2) for solid in solids) == [0.25, 0.25, 1.0, 1.0]
    assert all(solid.name.startswith("seats") for solid in solids)
    assert min(solid.footprint.bounds[0] for solid in solids) == pytest.approx(2.0)


@pytest.mark.parametrize(("code", "meters"), [(1, 0.0254), (2, 0.3048), (5, 0.01), (6, 1.0)])
def test_the_units_of_a_drawing_are_applied(drawing, tmp_path, code, meters):
    drawing.header["$INSUNITS"] = code
    rectangle(drawing.modelspace(), 0, 0, 2.0 / meters, 2.0 / meters)
    (solid,) = read_floor_plan(saved(drawing, tmp_path)).solids
    assert solid.footprint.area == pytest.approx(4.0, rel=0.01)


def test_a_drawing_without_units_is_in_meters_with_a_warning(drawing, tmp_path):
    drawing.header["$INSUNITS"] = 0
    rectangle(drawing.modelspace(), 0, 0, 2, 2)
    plan = read_floor_plan(saved(drawing, tmp_path))
    assert plan.solids[0].footprint.area == pytest.approx(4.0)
    assert any("warning" in line and "no unit" in line for line in plan.report)
    drawing.header["$INSUNITS"] = 18  # astronomical units
    with pytest.raises(PlaceError, match="code 18"):
        read_floor_plan(saved(drawing, tmp_path))


def test_drawings_of_nothing_and_damaged_ones_are_refused(drawing, tmp_path):
    drawing.modelspace().add_text("nothing")
    path = saved(drawing, tmp_path)
    with pytest.raises(PlaceError, match=r"(?s)plan\.dxf.*nothing to build.*TEXT"):
        read_floor_plan(path)
    whole = path.read_bytes()
    for content in (b"", b"hello", b"\x00\xff" * 100, whole[: len(whole) // 3]):
        path.write_bytes(content)
        with pytest.raises(PlaceError, match=r"plan\.dxf"):
            read_floor_plan(path)
    path.write_bytes(b"hello")
    with pytest.raises(PlaceError, match=r"plan\.dxf: cannot be read as DXF .*export it again"):
        read_floor_plan(path)
