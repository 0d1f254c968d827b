"""Floors and obstacles from files, walls with openings, and clutter, as a scenario asks for them."""

import re

import numpy as np
import pytest
import shapely
import trimesh

from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.errors import ScenarioError
from crowdsim.scenario.loader import load_scenario
from tests.unit.scenario.sample import solids_of

HEAD = "crowdsim: 1\nname: place\nseed: 1\nduration: 10.0\n"
AGENTS = """\
agents:
  - {name: guests, count: 1, start: {point: [1.0, 1.0]}, goal: {point: [7.0, 1.0]}}
"""


def load(folder, place: str):
    file = folder / "place.yaml"
    file.write_text(HEAD + place + AGENTS)
    return load_scenario(file)


def refused(folder, place: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(folder, place)
    return str(caught.value)


@pytest.fixture
def room(tmp_path):
    """A room of 8 x 4 m with a table, Y up, its floor 1 m above the file's origin; returns its folder."""
    scene = trimesh.Scene()
    for name, (x, y, z), size in (
        ("slab", (4.0, 2.0, 0.95), (8.2, 4.2, 0.1)),
        ("table", (4.0, 2.0, 1.7), (1.0, 0.8, 0.1)),
        ("carpet", (2.0, 2.0, 1.01), (1.0, 1.0, 0.02)),
        ("north", (4.0, 4.05, 2.3), (8.2, 0.1, 2.6)),
        ("south", (4.0, -0.05, 2.3), (8.2, 0.1, 2.6)),
    ):
        box = trimesh.creation.box(size)
        box.apply_translation((x, y, z))
        box.apply_transform(np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float))
        scene.add_geometry(box, node_name=name, geom_name=name)
    scene.export(tmp_path / "room.glb")
    return tmp_path


MESH = "obstacles:\n  - {name: house, mesh: {file: room.glb}}\n"


def test_a_floor_is_found_in_a_file_and_its_parts_stand_on_it(room):
    scenario = load(room, "floor: {derive: true}\n" + MESH)
    assert scenario.environment.floor.area == pytest.approx(8.2 * 4.2, rel=0.01)
    solids = {solid.name: solid for solid in solids_of(scenario)}
    assert set(solids) == {"house: table", "house: north", "house: south"}
    assert all(isinstance(solid, MeshSolid) for solid in solids.values())
    assert (solids["house: table"].bottom, solids["house: table"].top) == pytest.approx((0.65, 0.75))
    legs, torso = scenario.environment.layers
    assert legs.free.area == pytest.approx(8.2 * 4.0 - 0.8, abs=0.02)
    # The top of the table is as high as hands hang.
    assert torso.free.area == pytest.approx(8.2 * 4.0 - 0.8, abs=0.02)
    assert any("carpet" in line for line in scenario.environment.report)


def test_a_given_floor_leaves_heights_as_the_file_has_them(room):
    drawn = load(room, "floor: {rectangle: [0, 0, 8, 4], height: 1.0}\n" + MESH)
    assert {solid.name for solid in solids_of(drawn)} == {"house: table", "house: north", "house: south"}
    moved = load(
        room,
        "floor: {rectangle: [0, 0, 8, 4]}\n"
        "obstacles:\n  - {name: house, mesh: {file: room.glb, position: [0, 0, -1]}}\n",
    )
    assert moved.environment.layers[0].free.equals_exact(drawn.environment.layers[0].free, 1e-9)


def test_a_floor_in_a_file(tmp_path):
    (tmp_path / "floor.wkt").write_text("POLYGON ((0 0, 8 0, 8 4, 0 4, 0 0), (3 1, 3 3, 5 3, 5 1, 3 1))")
    scenario = load(tmp_path, "floor: {file: floor.wkt}\n")
    assert scenario.environment.layers[0].free.area == pytest.approx(28.0)


def test_a_floor_in_a_file_of_another_unit(tmp_path):
    (tmp_path / "floor.wkt").write_text("POLYGON ((0 0, 800 0, 800 400, 0 400, 0 0))")
    scenario = load(tmp_path, "floor: {file: floor.wkt, units: cm}\n")
    assert scenario.environment.layers[0].free.area == pytest.approx(32.0)


@pytest.mark.parametrize("placed", ["units: mm", "scale: 1000", "position: [0, 0, 5]", "position: [50, 0, -1]"])
def test_a_mesh_of_which_nothing_is_in_any_layer_leaves_no_silent_empty_place(room, placed):
    said = refused(
        room,
        f"floor: {{rectangle: [0, 0, 8, 4]}}\nobstacles:\n  - {{name: house, mesh: {{file: room.glb, {placed}}}}}\n",
    )
    assert re.search(r"7:25: obstacles.0.mesh: room.glb: nothing of it is in a layer over the given floor", said)
    assert ("m high as a whole" in said) == ("position" not in placed)


def test_a_floor_covered_by_a_mesh_of_another_unit_hints_at_it(room):
    place = (
        "floor: {rectangle: [0, 0, 8, 4]}\n"
        "obstacles:\n  - {name: house, mesh: {file: room.glb, scale: 1000, position: [-4000, -2000, -1651]}}\n"
    )
    assert re.search("obstacles cover all of it; room.glb: warning: .* give units=m,", refused(room, place))


def test_a_derived_floor_is_the_one_that_a_plan_draws(tmp_path):
    document = pytest.importorskip("ezdxf").new()
    document.header["$INSUNITS"] = 6
    drawing = document.modelspace()
    drawing.add_lwpolyline([(0, 0), (10, 0), (10, 8), (0, 8)], close=True)
    for wall in (((5, 0), (5, 3)), ((5, 5), (5, 8))):
        drawing.add_line(*wall)
    document.saveas(tmp_path / "plan.dxf")
    place = "floor: {derive: true}\nobstacles: [{name: walls, plan: {file: plan.dxf}, top: 2.5}]\n"
    scenario = load(tmp_path, place)
    assert scenario.environment.floor.area == pytest.approx(80.0)
    assert len(solids_of(scenario)) == 2


def test_a_derived_floor_of_another_unit_is_refused_with_its_place(room):
    mesh = "{file: room.glb, scale: 248000, position: [-100000, 0, 0]}"
    said = refused(room, f"floor: {{derive: true}}\nobstacles: [{{name: house, mesh: {mesh}}}]\n")
    assert "5:8: floor: floor: the polygon spans" in said


def test_a_carpet_may_be_moved(room):
    box = trimesh.creation.box((1.0, 0.02, 1.0))
    box.export(room / "carpet.glb")
    scenario = load(
        room,
        "floor: {derive: true}\nobstacles:\n  - {name: house, mesh: {file: room.glb}}\n"
        "  - {name: carpet, mesh: {file: carpet.glb, position: [2, 2, 1.01]}}\n"
        "events: [{at: 1, move: {name: carpet, to: [4, 2]}}]\n",
    )
    assert scenario.environment.timetable.movables[0].solids == ()


def test_walls_with_doors_and_windows(tmp_path):
    scenario = load(
        tmp_path,
        "floor: {rectangle: [0, 0, 8, 4]}\n"
        "obstacles:\n  - name: wall\n    wall:\n      points: [[4, 0], [4, 4]]\n      thickness: 0.2\n"
        "      openings: [{at: 1.0, width: 0.9}, {at: 3.0, width: 1.0, bottom: 0.9, top: 2.1}]\n    top: 2.5\n",
    )
    legs, torso = scenario.environment.layers
    assert legs.obstacles.area == pytest.approx(0.2 * (4.0 - 0.9))
    # From a chest to a chin a window is open in part, which does not count as open.
    assert torso.obstacles.area == pytest.approx(0.2 * (4.0 - 0.9))
    assert legs.free.covers(shapely.Point(4.0, 1.0))


def test_clutter_is_dense_and_leaves_starts_and_goals(tmp_path):
    scenario = load(tmp_path, "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: dense}\n")
    solids = solids_of(scenario)
    assert sum(solid.footprint.area for solid in solids) == pytest.approx(0.24 * 28.0, rel=0.2)
    share = float(re.search(r"cover ([0-9.]+)% of the floor off starts and goals", scenario.environment.report[-1])[1])
    assert share == pytest.approx(24.0, abs=3.0)
    assert all(solid.footprint.distance(shapely.Point(1.0, 1.0)) >= 0.45 for solid in solids)
    again = load(tmp_path, "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: dense}\n")
    assert [solid.footprint for solid in solids_of(again)] == [solid.footprint for solid in solids]


def test_the_share_of_clutter_in_a_region_is_that_of_the_region(tmp_path):
    clutter = "clutter: {density: 0.2, region: {rectangle: [3, 0, 6, 4]}}\n"
    scenario = load(tmp_path, "floor: {rectangle: [0, 0, 8, 4]}\n" + clutter)
    found = re.search(r"cover ([0-9.]+)% of its region off starts and goals", scenario.environment.report[-1])
    covered = sum(solid.footprint.area for solid in solids_of(scenario))
    assert float(found[1]) == pytest.approx(100.0 * covered / 12.0, abs=0.06)


def test_people_walk_under_a_lintel_where_clutter_is_drawn(tmp_path):
    wall = "obstacles: [{name: wall, wall: {points: [[4, 0], [4, 4]], openings: [{at: 1.0, width: 1.0}]}, top: 2.5}]\n"
    scenario = load(tmp_path, "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.1}\n" + wall)
    assert scenario.environment.layers[0].free.covers(shapely.LineString([(3.8, 1.0), (4.2, 1.0)]))
    clutter = scenario.environment.solids[("clutter",)]
    assert clutter
    assert all(solid.footprint.disjoint(shapely.box(3.95, 0, 4.05, 4)) for solid in clutter), "nothing is in the wall"
    shut = wall.replace("width: 1.0", "width: 1.0, top: 0.05")
    assert "no way of 0.5 m leads to" in refused(
        tmp_path, "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.1}\n" + shut
    )


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (
            "floor: {derive: true}\nobstacles: [{name: a, mesh: {file: none.glb}}]\n",
            "6:29: obstacles.0.mesh: .*none.glb: cannot be read",
        ),
        ("floor: {file: none.wkt}\n", r"5:8: floor: .*none\.wkt: cannot be read \(No such file"),
        ("floor: {derive: true}\n", "5:8: floor: .*no parts to find a floor from; give a floor"),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nobstacles: [{name: a, mesh: {file: a.glb}, top: 2.0}]\n",
            "a mesh has its own heights",
        ),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nobstacles: [{name: a, box: {min: [3, 1], max: [4, 2]}}]\n",
            "a box needs a 'top'",
        ),
        ("floor: {rectangle: [0, 0, 8, 4], drawing_layer: a}\n", "'drawing_layer' is the layer of a drawing"),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\n"
            "obstacles: [{name: a, wall: {points: [[3, 1], [3, 2]], openings: [{at: 1, width: 0.9}]}, top: 2}]\n",
            "obstacles.0: wall 'a': the opening from 0.55 to 1.45 m reaches past the wall",
        ),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.4, sizes: [2.5, 3.0]}\n",
            "clutter: .*the floor is full",
        ),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.1, region: {rectangle: [9, 0, 10, 1]}}\n",
            "clutter: .*no floor to stand on",
        ),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.1, region: {point: [4, 2]}}\n",
            "clutter: .*no floor to stand on",
        ),
        (
            "floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: 0.1}\n"
            "obstacles: [{name: clutter, box: {min: [3, 1], max: [4, 2]}, top: 1}]\n",
            "7:20: obstacles.0.name: the name 'clutter' is reserved for the random obstacles; choose another one",
        ),
        ("floor: {rectangle: [0, 0, 8, 4]}\nclutter: {density: sparse}\n", "clutter.density: "),
        ("floor: {rectangle: [0, 0, 8, 4], units: cm}\n", "'units' are those of a file"),
        ("floor: {rectangle: [0, 0, 8, 4]}\nlayers: [{name: a, low: 0.1}]\n", "given by 'low' and 'high', or by one"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_place_and_a_remedy(tmp_path, place, message):
    assert re.search(message, refused(tmp_path, place)), refused(tmp_path, place)


def test_planes_are_layers_as_the_paper_has_them(tmp_path):
    scenario = load(
        tmp_path,
        "floor: {rectangle: [0, 0, 8, 4]}\n"
        "obstacles: [{name: shelf, box: {min: [3, 1], max: [4, 2]}, bottom: 1.0, top: 1.1}]\n"
        "layers: [{name: legs, height: 0.3}, {name: torso, height: 1.05}]\n",
    )
    legs, torso = scenario.environment.layers
    assert torso.obstacles.area == pytest.approx(1.0)
    assert legs.obstacles.area == pytest.approx(1.0)  # the ground holds what any layer holds
