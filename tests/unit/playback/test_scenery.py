"""Floor, solids, paths and camera, without drawing."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.errors import CrowdSimError, RecordingError
from crowdsim.playback.camera import FIELD_OF_VIEW, place_camera
from crowdsim.playback.moments import telling_time
from crowdsim.playback.scenery import (
    contact_shadows,
    floor_mesh,
    grid_lines,
    meshes_mesh,
    path_ribbons,
    paths_ahead,
    solids_mesh,
)
from crowdsim.recording.header import AgentState, MeshRecord, PlannedPath, SolidRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_header

RING = "POLYGON ((0 0, 4 0, 4 3, 0 3, 0 0), (1 1, 1 2, 3 2, 3 1, 1 1))"


def _areas(mesh):
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def test_floor_with_a_hole_has_its_area_and_faces_up():
    mesh = floor_mesh(replace(small_header(), floor=RING))
    areas = _areas(mesh)
    assert np.all(areas[:, 2] > 0.0)
    assert areas[:, 2].sum() == pytest.approx(10.0)


def test_solids_face_outward_with_all_their_sides():
    mesh = solids_mesh([SolidRecord("ring", RING, 0.5, 2.0)])
    areas = _areas(mesh)
    upright = np.abs(areas[:, 2]) < 1e-12
    assert np.linalg.norm(areas[upright], axis=1).sum() == pytest.approx((14.0 + 6.0) * 1.5)
    outside = mesh.points[mesh.triangles[upright]].mean(axis=1)
    at_east = outside[:, 0] > 3.9
    assert np.all(areas[upright][at_east, 0] > 0.0)
    in_hole = (np.abs(outside[:, 0] - 3.0) < 0.01) & (np.abs(outside[:, 1] - 1.5) < 0.4)
    assert in_hole.any()
    assert np.all(areas[upright][in_hole, 0] < 0.0)


def test_no_solids_are_an_empty_mesh():
    mesh = solids_mesh([])
    assert mesh.points.shape == (0, 3)
    assert mesh.triangles.shape == (0, 3)
    assert mesh.outline.shape == (0, 3)


def test_meshes_are_outlined_where_they_bend_and_not_across_flat_faces():
    # An open box without a lid, each face of two triangles with points of its own, as files have them.
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
    faces = [(0, 2, 6, 4), (0, 4, 5, 1), (4, 6, 7, 5), (6, 2, 3, 7), (2, 0, 1, 3)]
    points = np.concatenate([corners[list(face)] for face in faces]).astype(np.float32)
    triangles = np.concatenate([[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]] for k in range(5)])
    mesh = meshes_mesh([MeshRecord("box", points, triangles.astype(np.int32))] * 2)
    lengths = np.linalg.norm(np.diff(mesh.outline.reshape(-1, 2, 3), axis=1)[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(2 * 4 * (1 + 2 + 3))
    assert np.linalg.norm(_areas(mesh), axis=1).sum() == pytest.approx(2 * (2 + 2 * 3 + 2 * 6))
    assert meshes_mesh([]).points.shape == (0, 3)


def test_a_shape_that_is_none_is_refused():
    with pytest.raises(RecordingError, match="solid 'box'"):
        solids_mesh([SolidRecord("box", "POLYGON ((0 0", 0.0, 1.0)])


def test_path_pieces_carry_the_behavior_from_each_point_on():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    path = PlannedPath(0, 0, points, np.array([2, 1, 1, 0], np.int8))
    corners, triangles, behaviors = path_ribbons([path])
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)[:, 2]
    assert np.all(area > 0.0)
    assert area[behaviors == 2].sum() == pytest.approx(0.045, rel=0.05)
    assert area[behaviors == 1].sum() == pytest.approx(0.09, rel=0.05)
    assert set(behaviors.tolist()) == {1, 2}
    assert path_ribbons([])[1].shape == (0, 3)


def test_grid_stays_on_the_floor():
    ends = grid_lines(replace(small_header(), floor=RING), spacing=0.75)
    assert len(ends)
    middle = ends.reshape(-1, 2, 3).mean(axis=1)
    assert not np.any((middle[:, 0] > 1.01) & (middle[:, 0] < 2.99) & (middle[:, 1] > 1.01) & (middle[:, 1] < 1.99))


@pytest.mark.parametrize("aspect", [0.5, 16 / 9])
@pytest.mark.parametrize("turned", [False, True])
def test_overview_sees_all_of_the_floor_and_little_else(recording, aspect, turned):
    floor = "POLYGON ((0 0, 2 0, 2 20, 0 20, 0 0))" if turned else "POLYGON ((0 0, 20 0, 20 2, 0 2, 0 0))"
    header = recording.header
    recording.header = replace(header, floor=floor)
    try:
        camera = place_camera(recording, "overview", aspect, 0.0, None)
    finally:
        recording.header = header
    corners = np.array(
        [[x, y, z] for x in (0, 2 if turned else 20) for y in (0, 20 if turned else 2) for z in (0, 1.85)]
    )
    ahead = (camera.target - camera.eye) / np.linalg.norm(camera.target - camera.eye)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    depth = (corners - camera.eye) @ ahead
    half = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    across = np.abs((corners - camera.eye) @ right) / depth / half / aspect
    upward = np.abs((corners - camera.eye) @ above) / depth / half
    assert max(across.max(), upward.max()) <= 1.0
    assert max(across.max(), upward.max()) > 0.85


def test_following_keeps_the_agent_in_the_middle(recording):
    camera = place_camera(recording, "follow", 1.0, 2.0, 1)
    frame = recording.at_time(2.0)
    np.testing.assert_allclose(camera.target[:2], [frame.x[1], frame.y[1]], atol=0.1)


def test_bad_views_are_refused(recording):
    for view, agent, word in (("side", None, "no view 'side'"), ("follow", None, "needs"), ("follow", 3, "no agent 3")):
        with pytest.raises(CrowdSimError, match=word):
            place_camera(recording, view, 1.0, 0.0, agent)


def test_the_telling_time_shows_most_behaviors_moving(recording, tmp_path):
    step = round(telling_time(recording) * recording.steps_per_second)
    assert (recording.state[step] == AgentState.MOVING).all()
    with RecordingWriter(tmp_path / "empty.h5", small_header()) as writer:
        writer.finish({})
    with Recording.open(tmp_path / "empty.h5") as empty, pytest.raises(RecordingError, match="no steps"):
        telling_time(empty)


def test_only_what_lies_ahead_of_those_present_is_left_of_paths():
    corner = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    paths = [PlannedPath(agent, 0, corner, np.array([2, 1, 1], np.int8)) for agent in range(4)]
    x, y = np.array([1.0, 4.2, np.nan, 9.0]), np.array([0.3, 1.0, np.nan, 3.5])
    first, second, last = paths_ahead(paths, x, y)
    assert (first.agent, second.agent, last.agent) == (0, 1, 3)
    assert np.allclose(first.points, [[1.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    assert first.behaviors.tolist() == [2, 1, 1]
    assert np.allclose(second.points, [[4.0, 1.0], [4.0, 3.0]])
    assert second.behaviors.tolist() == [1, 1]
    assert np.allclose(last.points, [[4.0, 3.0], [4.0, 3.0]])  # at its goal
    assert len(path_ribbons([last])[1]) == 0


def test_shadows_of_solids_fade_on_the_floor_beside_what_stands_on_it():
    floor = "POLYGON ((0 0, 4 0, 4 3, 0 3, 0 0))"
    crate = SolidRecord("crate", "POLYGON ((1 1, 2 1, 2 2, 1 2, 1 1))", 0.0, 0.8)
    by_the_edge = SolidRecord("shelf", "POLYGON ((3 0, 4 0, 4 1, 3 1, 3 0))", 0.0, 2.0)
    lamp = SolidRecord("lamp", "POLYGON ((0 0, 1 0, 1 1, 0 1, 0 0))", 2.2, 2.5)
    mesh, dark = contact_shadows([crate, by_the_edge, lamp], floor)
    assert np.all(_areas(mesh)[:, 2] > 0.0)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    assert low[0] == pytest.approx(0.7)
    assert (high[0], low[1], high[1]) == pytest.approx((4.0, 0.0, 2.3))
    beside = np.abs(mesh.points[:, 0] - 1.0) + np.abs(mesh.points[:, 1] - 1.0) < 1e-6
    assert dark[beside].min() == 1.0
    assert dark[np.abs(mesh.points[:, 0] - 0.7) < 1e-6].max() < 1e-9
    assert len(contact_shadows([lamp], floor)[0].triangles) == 0
