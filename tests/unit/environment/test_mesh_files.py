"""Mesh files: placed right whatever the format, and refused with a word where they are none."""

import json
import os
import struct

import numpy as np
import pytest
import shapely
import trimesh

from crowdsim.environment.layers import LEGS, clearance_layers
from crowdsim.environment.mesh_files import read_mesh_file
from crowdsim.errors import CrowdSimError, GeometryError, PlaceError

# A desk 2 m along x, 1 m along y and 0.8 m high, as z up; and turned to be y up.
CORNER = np.array([1.0, 2.0, 0.0])
EXTENT = np.array([2.0, 1.0, 0.8])
TO_Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)


def desk(y_up=False):
    mesh = trimesh.creation.box(
        extents=EXTENT, transform=trimesh.transformations.translation_matrix(CORNER + EXTENT / 2)
    )
    return mesh.apply_transform(TO_Y_UP) if y_up else mesh


def written(tmp_path, geometry, name):
    path = tmp_path / name
    if name.endswith(".dae"):
        pytest.importorskip("collada")
    path.write_bytes(
        content if isinstance(content := geometry.export(file_type=name.split(".")[-1]), bytes) else content.encode()
    )
    return path


def assert_is_desk(solid, corner=CORNER, extent=EXTENT):
    bounds = shapely.box(*corner[:2], *(corner + extent)[:2])
    assert solid.footprint.symmetric_difference(bounds).area < 1e-4
    assert (solid.bottom, solid.top) == pytest.approx((corner[2], corner[2] + extent[2]), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "y_up"), [("a.glb", True), ("a.obj", True), ("a.stl", False), ("a.ply", False), ("a.dae", True)]
)
def test_each_format_stands_upright_by_its_custom(tmp_path, name, y_up):
    scene = read_mesh_file(written(tmp_path, desk(y_up), name))
    (solid,) = scene.solids
    assert_is_desk(solid)
    assert any(f"{'y' if y_up else 'z'} is up" in line for line in scene.report)


def test_a_file_can_be_said_to_be_otherwise(tmp_path):
    assert_is_desk(read_mesh_file(written(tmp_path, desk(), "a.obj"), up="z").solids[0])
    assert_is_desk(read_mesh_file(written(tmp_path, desk(True), "a.stl"), up="y").solids[0])


def test_scale_then_rotation_then_position(tmp_path):
    (solid,) = read_mesh_file(
        written(tmp_path, desk(), "a.stl"), scale=2.0, rotation=90.0, position=(10.0, 20.0, 1.0)
    ).solids
    # (1, 2)..(3, 3) -> (2, 4)..(6, 6) -> (-6, 2)..(-4, 6) -> (4, 22)..(6, 26)
    assert_is_desk(solid, np.array([4.0, 22.0, 1.0]), np.array([2.0, 4.0, 1.6]))
    (turned,) = read_mesh_file(written(tmp_path, desk(), "a.stl"), rotation=30.0).solids
    assert turned.footprint.area == pytest.approx(2.0, abs=1e-4)
    assert turned.footprint.centroid.coords[0] == pytest.approx(
        (2.0 * np.cos(np.pi / 6) - 2.5 * np.sin(np.pi / 6), 2.0 * np.sin(np.pi / 6) + 2.5 * np.cos(np.pi / 6)), abs=1e-4
    )


def test_a_scene_graph_places_its_parts_by_name_each_once(tmp_path):
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene.add_geometry(desk(True), geom_name="desk", node_name="one")
    scene.add_geometry(desk(True), geom_name="desk", node_name="two", transform=mirror)
    path = written(tmp_path, scene, "scene.glb")
    solids = {solid.name: solid for solid in read_mesh_file(path).solids}
    assert set(solids) == {"one", "two"}
    assert_is_desk(solids["one"])
    assert_is_desk(solids["two"], np.array([-3.0, 2.0, 0.0]))
    # A mirrored part has its inside inside: higher than the band, it is solid.
    tall = read_mesh_file(path, scale=5.0).solids[1]
    assert tall.footprint_in(0.1, 2.0).area == pytest.approx(50.0, abs=1e-3)


def test_objects_of_an_obj_are_parts(tmp_path):
    path = tmp_path / "two.obj"
    lines = []
    for number, name in enumerate(("sofa", "lamp")):
        x = 4 * number
        lines += [f"o {name}", f"v {x} 0 0", f"v {x + 1} 0 0", f"v {x} 2 -1"]
        lines.append(f"f {3 * number + 1} {3 * number + 2} {3 * number + 3}")
    path.write_text("mtllib ../../../etc/passwd\n" + "\n".join(lines))
    solids = read_mesh_file(path).solids
    assert [solid.name for solid in solids] == ["lamp", "sofa"]
    assert solids[1].footprint.bounds == pytest.approx((0, 0, 1, 1), abs=3e-3)


def test_units_are_applied(tmp_path):
    centimeters = desk().apply_scale(100.0)
    assert_is_desk(read_mesh_file(written(tmp_path, centimeters, "a.stl"), units="cm").solids[0])
    with pytest.raises(GeometryError, match="'parsecs' is unknown"):
        read_mesh_file(written(tmp_path, desk(), "a.stl"), units="parsecs")


def test_the_unit_and_axis_a_dae_states_are_applied(tmp_path):
    path = written(tmp_path, desk().apply_scale(100.0), "a.dae")
    text = path.read_text()
    assert "<up_axis>Y_UP</up_axis>" in text
    stated = '<unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis>'
    path.write_text(text.replace("<up_axis>Y_UP</up_axis>", stated))
    scene = read_mesh_file(path)
    assert_is_desk(scene.solids[0])
    assert any("0.01 m" in line for line in scene.report)


@pytest.mark.parametrize("meter", ["abc", "", "-1", "0", "inf"])
def test_a_unit_of_a_dae_that_is_no_number_of_meters_is_refused(tmp_path, meter):
    path = written(tmp_path, desk(), "a.dae")
    stated = f'<unit name="odd" meter="{meter}"/><up_axis>Y_UP</up_axis>'
    path.write_text(path.read_text().replace("<up_axis>Y_UP</up_axis>", stated))
    with pytest.raises(PlaceError, match="its unit is not a number of meters; give 'units'"):
        read_mesh_file(path)


def test_units_that_parts_of_a_glb_note_are_reported_and_not_applied(tmp_path):
    mesh = desk(True)
    mesh.metadata["units"] = "0.01 * meters"
    scene = read_mesh_file(written(tmp_path, mesh, "a.glb"))
    assert_is_desk(scene.solids[0])
    assert any("0.01 * meters" in line and "not applied" in line for line in scene.report)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "mm"), (100.0, "cm"), (3.28, "ft")])
def test_a_wrong_unit_is_suspected_by_the_height(tmp_path, factor, unit):
    room = trimesh.creation.box(extents=[5.0, 4.0, 3.2]).apply_scale(factor)
    report = read_mesh_file(written(tmp_path, room, "room.stl")).report
    assert any("warning" in line and unit in line for line in report)
    assert not any("warning" in line for line in read_mesh_file(tmp_path / "room.stl", units=unit).report)


def test_a_part_far_away_is_dropped_with_a_word(tmp_path):
    for far_first in (False, True):
        scene = trimesh.Scene()
        far = desk(True).apply_translation([-1e6, 0.0, 0.0])
        for name, mesh in (("a", far), ("b", desk(True))) if far_first else (("a", desk(True)), ("b", far)):
            scene.add_geometry(mesh, node_name=name, geom_name=name)
        found = read_mesh_file(written(tmp_path, scene, "far.glb"))
        (solid,) = found.solids
        assert_is_desk(solid)
        assert any("dropped" in line and "1000 m off" in line and "-999998" in line for line in found.report)


@pytest.mark.parametrize(
    ("shifts", "stay"), [((0, 1, 2, 1e5), 3), ((0, 1, 2, 1e5, -1e5, 2e5, 3e5), 3), ((0, 0, 0, 1e5, 1e5, 1e5), 6)]
)
def test_of_very_many_parts_those_near_the_middle_stay(tmp_path, monkeypatch, shifts, stay):
    """Also if more of them are far off; all stay if none is near it, as between two halves."""
    monkeypatch.setattr("crowdsim.environment.mesh_files._MANY", 2)
    scene = trimesh.Scene()
    for number, shift in enumerate(shifts):
        mesh = desk(True).apply_translation([shift, 0.0, -0.001 * number])
        scene.add_geometry(mesh, node_name=str(number), geom_name=str(number))
    found = read_mesh_file(written(tmp_path, scene, "many.glb"))
    assert len(found.solids) == stay
    assert sum("dropped" in line for line in found.report) == len(shifts) - stay


def _glb(tree, blob=b""):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if blob:
        chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_parts_with_numbers_that_are_none_are_dropped_or_refused(tmp_path):
    scene = trimesh.Scene()
    bad = desk(True)
    bad.vertices[3, 1] = np.nan
    scene.add_geometry(bad, node_name="bad", geom_name="bad")
    path = written(tmp_path, scene, "nan.glb")
    with pytest.raises(PlaceError, match=r"(?s)nan\.glb.*'bad'.*finite"):
        read_mesh_file(path)
    scene.add_geometry(desk(True), node_name="good", geom_name="good")
    found = read_mesh_file(written(tmp_path, scene, "nan.glb"))
    assert [solid.name for solid in found.solids] == ["good"]
    assert any("'bad'" in line and "finite" in line for line in found.report)


def test_point_clouds_and_lines_are_refused(tmp_path):
    cloud = trimesh.PointCloud(np.random.default_rng(0).random((20, 3)))
    for name in ("cloud.ply", "cloud.glb"):
        with pytest.raises(PlaceError, match=f"{name}.*(point cloud|no surfaces)"):
            read_mesh_file(written(tmp_path, cloud if name.endswith("ply") else trimesh.Scene(cloud), name))


@pytest.mark.parametrize("ending", ["glb", "obj", "stl", "ply", "dae"])
@pytest.mark.parametrize("content", [b"", b"  \n", b"hello", b"\x00\xff" * 300, b"PK\x03\x04" + b"\x01" * 200])
def test_files_that_are_no_meshes_name_the_file_and_a_remedy(tmp_path, ending, content):
    path = tmp_path / f"bad.{ending}"
    path.write_bytes(content)
    with pytest.raises(PlaceError, match=rf"bad\.{ending}.*(export|install)"):
        read_mesh_file(path)


@pytest.mark.parametrize("name", ["a.glb", "a.obj", "a.stl", "a.ply", "a.dae"])
def test_cut_and_damaged_files_are_read_or_refused_never_crash(tmp_path, name):
    whole = written(tmp_path, desk(), name).read_bytes()
    random = np.random.default_rng(0)
    outcomes = set()
    for number in range(30):
        content = bytearray(whole[: int(len(whole) * number / 30)] if number % 2 else whole)
        for place in random.integers(0, max(len(content), 1), 8 if number % 2 == 0 else 0):
            content[place] = int(random.integers(256))
        path = tmp_path / f"cut_{name}"
        path.write_bytes(bytes(content))
        try:
            outcomes.add(len(read_mesh_file(path).solids))
        except CrowdSimError:
            outcomes.add("refused")
    assert "refused" in outcomes
    assert 0 not in outcomes


def test_a_glb_cannot_make_other_files_be_read(tmp_path):
    (tmp_path / "secret.bin").write_bytes(np.zeros((3, 3), np.float32).tobytes() + np.arange(3, dtype="<u4").tobytes())
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0] * 3, "max": [0] * 3},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 48, "uri": "secret.bin"}],
    }
    (tmp_path / "trick.glb").write_bytes(_glb(tree))
    with pytest.raises(PlaceError, match=r"trick\.glb"):
        read_mesh_file(tmp_path / "trick.glb")


def test_other_endings_and_missing_files_are_refused(tmp_path):
    with pytest.raises(PlaceError, match=r"'\.gltf'.*save it as \.glb"):
        read_mesh_file(tmp_path / "a.gltf")
    with pytest.raises(PlaceError, match=r"'\.zip' cannot"):
        read_mesh_file(tmp_path / "a.zip")
    with pytest.raises(PlaceError, match="check the path"):
        read_mesh_file(tmp_path / "absent.glb")
    (tmp_path / "folder.glb").mkdir()
    os.mkfifo(tmp_path / "pipe.glb")
    (tmp_path / "endless.glb").symlink_to("/dev/zero")
    for name, what in (("folder", "a folder"), ("pipe", "no regular file"), ("endless", "no regular file")):
        with pytest.raises(PlaceError, match=what):
            read_mesh_file(tmp_path / f"{name}.glb")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"up": "x"}, "up"),
        ({"scale": 0.0}, "scale"),
        ({"scale": float("nan")}, "scale"),
        ({"rotation": float("inf")}, "rotation"),
        ({"position": (0.0, float("nan"), 0.0)}, "position"),
        ({"position": (0.0, 0.0)}, "position"),
    ],
)
def test_bad_arguments_are_named(tmp_path, arguments, word):
    with pytest.raises(GeometryError, match=f"^{word}"):
        read_mesh_file(tmp_path / "a.glb", **arguments)


def test_dae_without_its_reader_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "collada", None)
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    with pytest.raises(PlaceError, match=r"a\.dae.*pip install 'crowdsim\[dae\]'"):
        read_mesh_file(tmp_path / "a.dae")


def test_layers_of_a_file_are_those_of_its_solids(tmp_path):
    (solid,) = read_mesh_file(written(tmp_path, desk(), "a.ply")).solids
    (legs,) = clearance_layers(shapely.box(0, 0, 5, 5), [solid], [LEGS])
    assert legs.free.area == pytest.approx(23.0, abs=1e-4)
