"""Pages of places with doors and of mesh files, and of more people than have bodies of their own, in a real browser."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from crowdsim.crowd.simulation import Simulation
from crowdsim.export.page.page import write_page
from crowdsim.export.page.tracks import track_chunks
from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import parse_scenario
from tests.support.shown_bodies import compare
from tests.support.steered_scenes import steered_scene

CLOSED, OPEN, AGAIN = 1.0, 3.0, 6.5
"""Seconds at which the doors below are closed, open, and closed again."""

DOORS = """\
crowdsim: 1
name: two doors
seed: 3
duration: 8
floor: {rectangle: [0, 0, 9, 4]}
obstacles:
  - name: wall
    wall: {points: [[4.5, 0], [4.5, 4]], thickness: 0.2, openings: [{at: 1, width: 1}, {at: 3, width: 1}]}
    top: 2.4
doors:
  - {name: south, box: {min: [4.45, 0.5], max: [4.55, 1.5]}, top: 2.0, initially: closed}
  - {name: north, box: {min: [4.45, 2.5], max: [4.55, 3.5]}, top: 2.0, initially: closed}
agents:
  - {name: captured, count: 1, start: {rectangle: [2.4, 0.6, 3.4, 1.4]}, goal: {rectangle: [7, 0.5, 8.5, 1.5]}}
  - {name: steered, locomotion: steered, count: 2, start: {rectangle: [1, 2.4, 3.4, 3.6]},
     goal: {rectangle: [7, 2.4, 8.5, 3.6]}}
events:
  - {at: 2.0, open: south}
  - {at: 2.0, open: north}
  - {at: 6.0, close: south}
  - {at: 6.0, close: north}
"""
SOUTH, NORTH = (4.5, 1.0), (4.5, 3.0)
"""Middles of the doors."""

MESHES = """\
crowdsim: 1
name: furnished
seed: 1
duration: 4
floor: {rectangle: [0, 0, 8, 5]}
obstacles:
  - {name: room, mesh: {file: room.glb}}
agents:
  - {locomotion: steered, name: people, count: 4, start: {rectangle: [0.5, 0.5, 2, 4.5]},
     goal: {rectangle: [6, 0.5, 7.5, 4.5]}}
"""

PRESENT, WHOLE = 240, 60
"""Number of people in a crowd, and how many of them a page draws with whole bodies."""

DRAWN = """hidden => {
    const { player } = crowdsim, gl = player.renderer.getContext();
    const size = 4 * gl.drawingBufferWidth * gl.drawingBufferHeight;
    const read = () => {
        player.draw();
        const pixels = new Uint8Array(size);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        return pixels;
    };
    const object = hidden.split(".").reduce((found, name) => found[name], player), keep = object.layers.mask;
    const shown = read();
    object.traverse(each => each.layers.disableAll());
    const without = read();
    object.traverse(each => { each.layers.mask = keep; });
    let count = 0;
    for (let k = 0; k < size; k += 4) {
        count += Math.abs(shown[k] - without[k]) + Math.abs(shown[k + 1] - without[k + 1])
            + Math.abs(shown[k + 2] - without[k + 2]) > 24;
    }
    return count;
}"""
"""Number of pixels that an object of the player makes differ."""

COLORS = """([time, places]) => {
    const { player } = crowdsim, gl = player.renderer.getContext();
    player.set("view", "top"); player.set("paths", "none"); player.seek(time); player.draw();
    const w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, pixel = new Uint8Array(4);
    return places.map(([x, y]) => {
        const v = player.cameras.camera.position.clone().set(x, y, 0).project(player.cameras.camera);
        const at = [Math.round(0.5 * (v.x + 1) * w), Math.round(0.5 * (v.y + 1) * h)];
        gl.readPixels(...at, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return Array.from(pixel);
    });
}"""
"""Colors of places on the floor, seen from above."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """``made(text)`` gives the recording of a scenario and its page; files of the scenario are beside both."""
    folder = tmp_path_factory.mktemp("places")
    write_room(folder / "room.glb")
    pages: dict[str, tuple[Path, Path]] = {}

    def of(text: str) -> tuple[Path, Path]:
        if text not in pages:
            source, page = (folder / f"{len(pages)}.{ending}" for ending in ("h5", "html"))
            with Simulation(parse_scenario(text, folder / "scenario.yaml"), workers=2) as simulation:
                simulation.run(source).close()
            with Recording.open(source) as recording:
                write_page(recording, page)
            pages[text] = source, page
        return pages[text]

    return of


def write_room(file: Path) -> None:
    """Write a table, a pillar and a tent, with y up."""
    scene = trimesh.Scene()
    upright = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    for name, mesh, place in (
        ("table", trimesh.creation.box((1.2, 0.8, 0.75)), (4.0, 1.2, 0.375)),
        ("pillar", trimesh.creation.cylinder(0.25, 2.4), (4.0, 3.0, 1.2)),
        ("tent", trimesh.creation.cone(0.4, 1.0), (5.2, 4.2, 0.0)),
    ):
        mesh.apply_translation(place)
        scene.add_geometry(mesh.apply_transform(upright), node_name=name, geom_name=name)
    file.write_bytes(scene.export(file_type="glb"))


def crowd() -> str:
    """Return the scenario of a crowd."""
    return steered_scene(
        f"name: people, count: {PRESENT}, start: {{rectangle: [1, 1, 20, 19]}}, goal: {{rectangle: [26, 1, 29, 19]}}",
        floor="{rectangle: [0, 0, 30, 20]}",
        duration=2.0,
    )


def is_brown(color) -> bool:
    """Return whether a pixel shows a door."""
    return color[0] - color[2] > 40


def assert_near(places, joints) -> None:
    """Hold places and joints of a page to what it promises [m]."""
    assert places <= 0.001
    assert np.percentile(joints, 99) <= 0.001
    assert max(joints) <= 0.002


def test_doors_open_and_close_as_in_the_run(visit, made):
    source, page = made(DOORS)
    shown = visit(page)
    closed, open_, again = (shown.ask(COLORS, [time, [SOUTH, NORTH]]) for time in (CLOSED, OPEN, AGAIN))
    assert all(map(is_brown, closed))
    assert not any(map(is_brown, open_))
    assert all(map(is_brown, again))
    with Recording.open(source) as recording:
        assert [(change.movable, change.footprint is None) for change in recording.changes[2:4]] == [
            (0, True),
            (1, True),
        ]
        # Everybody goes through a door, and nobody before it opens.
        opened = recording.changes[2].step
        crossed = recording.x[:] > 4.5
        assert crossed.any(axis=0).all()
        assert not crossed[:opened].any()
        for agent in range(3):
            first = int(np.argmax(crossed[:, agent]))
            y = recording.y[first, agent]
            assert min(abs(y - SOUTH[1]), abs(y - NORTH[1])) < 0.5
        times = np.linspace(0.1, recording.duration - 0.1, 15).tolist()
        places, joints, _, _ = compare(recording, shown, times)
    assert_near(places, joints)
    assert shown.requests == [page.as_uri()]
    assert shown.complained == []


def test_paths_lead_through_open_doors(visit, made):
    source, page = made(DOORS)
    shown = visit(page)
    for time, drawn in ((CLOSED, False), (OPEN, True)):
        shown.ask("time => { crowdsim.player.set('paths', 'all'); crowdsim.player.seek(time); }", time)
        assert (shown.ask(DRAWN, "pathLines.mesh") > 200) == drawn
    (path,) = shown.ask("crowdsim.player.pathLines.paths.map(({ agent, points }) => ({ agent, points }))")
    with Recording.open(source) as recording:
        (planned,) = recording.paths
    assert path["agent"] == planned.agent
    through = [points for points in path["points"] if points[0] <= 4.5 < points[2]]
    assert len(through) == 1
    assert abs(0.5 * (through[0][1] + through[0][3]) - SOUTH[1]) < 0.4


def test_a_page_of_a_mesh_file_shows_its_parts_and_people(visit, made):
    source, page = made(MESHES)
    shown = visit(page)
    shown.ask("crowdsim.player.seek(2)")
    # People, the table and the tent, and glass: the pillar alone.
    assert shown.ask(DRAWN, "crowd.group") > 2000
    assert shown.ask(DRAWN, "place.walls") > 500
    assert shown.ask(DRAWN, "place.group") > 30_000
    table, tent, floor = shown.ask(COLORS, [0.0, [(4.0, 1.2), (5.2, 4.2), (7.0, 2.5)]])
    assert table[0] - table[2] > 30
    assert tent[0] - tent[2] > 30
    assert floor[0] - floor[2] < 30
    with Recording.open(source) as recording:
        assert sorted(mesh.name for mesh in recording.header.meshes) == ["room: pillar", "room: table", "room: tent"]
        places, joints, _, _ = compare(recording, shown, np.linspace(0.1, recording.duration - 0.1, 12).tolist())
    assert_near(places, joints)
    assert shown.requests == [page.as_uri()]
    assert shown.complained == []


LEVELS = """() => {
    const { player } = crowdsim, { crowd, frame } = player, eye = player.cameras.camera.position;
    player.draw();
    const away = ({ agent, mesh }) => Array.from(agent.array.subarray(0, mesh.geometry.instanceCount),
        k => [k, Math.hypot(frame.x[k] - eye.x, frame.y[k] - eye.y)]);
    return { near: away(crowd.near), far: away(crowd.far), vertices: crowd.vertices,
        whole: crowd.near.vertices, few: crowd.far.vertices, ...crowdsim.costs() };
}"""
"""Agents with their distances from the eye [m], and costs, by level of detail."""


def test_bodies_walk_on_at_the_end_of_a_coarse_page_as_in_the_recording(visit, made, tmp_path, monkeypatch):
    """Footsteps after the end are extrapolated from the last steps, which whole millimeters would put 8 mm off."""
    source, _ = made(crowd())
    monkeypatch.setattr(track_chunks, "_FEW", 0)
    page = tmp_path / "coarse.html"
    with Recording.open(source) as recording:
        write_page(recording, page)
        times = (recording.duration - np.array([0.4, 0.25, 0.1, 0.0])).tolist()
        places, joints, _, _ = compare(recording, visit(page), times)
    assert len(joints) > 4 * PRESENT
    assert places <= 0.001
    assert np.percentile(joints, 99) <= 0.0015
    assert max(joints) <= 0.003


@pytest.mark.parametrize("view", ["overview", "follow"])
def test_of_many_those_near_are_whole_and_the_others_simple(visit, made, view):
    source, page = made(crowd())
    shown = visit(page, f"#t=1&agent=7&view={view}")
    seen = shown.ask(LEVELS)
    near, far = seen["near"], seen["far"]
    with Recording.open(source) as recording:
        here = np.flatnonzero(recording.shown_levels(recording.shown_step(1.0)) != Level.NOBODY)
    assert len(here) == PRESENT
    assert sorted(agent for agent, _ in near + far) == here.tolist()
    assert len(near) == WHOLE
    assert max(away for _, away in near) <= min(away for _, away in far)
    if view == "follow":
        assert 7 in [agent for agent, _ in near]
    assert seen["whole"] > 8 * seen["few"]
    assert seen["few"] <= 120
    assert seen["vertices"] == WHOLE * seen["whole"] + (PRESENT - WHOLE) * seen["few"]
    assert seen["calls"] <= 20
    # Both levels are seen.
    assert shown.ask(DRAWN, "crowd.near.mesh") > 2000
    assert shown.ask(DRAWN, "crowd.far.mesh") > 2000
    assert shown.complained == []
