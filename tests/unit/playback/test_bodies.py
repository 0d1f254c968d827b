"""Bodies are closed, of human size, and follow their joints."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.motion.clips.kinematics import about_axis, forward_kinematics, rotate
from crowdsim.playback import crowd_mesh
from crowdsim.playback.bodies.bare_parts import sculpted_pose
from crowdsim.playback.bodies.builds import builds_of
from crowdsim.playback.bodies.sculptor import build_body
from crowdsim.playback.body_mesh import Tissue
from crowdsim.playback.crowd_mesh import (
    CrowdMesh,
    attribute_colors,
    crowd_meshes,
    distinct_colors,
    group_colors,
    hex_color,
    shaded,
    shades_of,
    shown_by,
)
from crowdsim.playback.surfaces import ellipsoid, limb, loft, vertex_normals
from tests.support.small_recording import small_skeleton

X, Y, Z = np.eye(3)


def _volume(points, triangles):
    """Signed volume: positive where every triangle faces outward."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.sum(np.cross(a, b) * c) / 6.0


def _is_closed(triangles):
    """Each edge is run through once in each direction."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there = {tuple(edge) for edge in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def test_surfaces_are_closed_and_face_outward():
    ball = ellipsoid([1.0, 2.0, 3.0], np.diag([0.3, 0.2, 0.5]), 24)
    assert _is_closed(ball.triangles)
    assert _volume(ball.points - [1.0, 2.0, 3.0], ball.triangles) == pytest.approx(4 / 3 * np.pi * 0.03, rel=0.06)
    rod = limb([0, 0, 0], [0, 0, 2.0], [0.1, 0.1], 32)
    assert _is_closed(rod.triangles)
    assert _volume(rod.points, rod.triangles) == pytest.approx(np.pi * 0.01 * (2.0 + 4 / 3 * 0.1), rel=0.03)
    box = loft([[0, 0, 0], [0, 0, 1.0]], [X, X], [Y, Y], 64, squareness=20.0)
    assert _volume(box.points, box.triangles) == pytest.approx(4.0, rel=0.03)
    normals = vertex_normals(ball.points, ball.triangles)
    assert np.all(np.sum(normals * (ball.points - [1.0, 2.0, 3.0]), axis=1) > 0.0)


@pytest.mark.parametrize("sides", [6, 16])
def test_body_has_human_measures(sides):
    skeleton = small_skeleton()
    body = build_body(skeleton, sides)
    assert _is_closed(body.triangles)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1))
    still[0, [skeleton.roles["left_shoulder"]]] = about_axis(X, np.radians(-85.0))
    still[0, [skeleton.roles["right_shoulder"]]] = about_axis(X, np.radians(85.0))
    positions, rotations = forward_kinematics(skeleton, np.array([[0.0, 0.0, 0.93]]), still)
    vertices, normals = body.place(positions, rotations)
    low, high = vertices[0].min(axis=0), vertices[0].max(axis=0)
    assert 1.6 < high[2] - low[2] < 1.9
    assert 0.42 < high[1] - low[1] < 0.66
    assert 0.2 < high[0] - low[0] < 0.4
    assert 0.05 < _volume(vertices[0].astype(float), body.triangles) < 0.12
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-4)
    assert {*body.tissue.tolist()} == {*map(int, Tissue)}


def test_a_child_of_half_the_size_has_half_the_flesh():
    whole = small_skeleton()
    half = replace(whole, offsets=0.5 * whole.offsets, end_offsets=0.5 * whole.end_offsets)
    large, small = build_body(whole, 8), build_body(half, 8)
    np.testing.assert_allclose(small.places, 0.5 * large.places, atol=1e-3)


def test_turning_a_body_turns_all_of_it():
    skeleton = small_skeleton()
    body = build_body(skeleton, 8)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1))
    turn = about_axis(Z, 0.7)
    turned = still.copy()
    turned[0, 0] = turn
    before, normals_before = body.place(*forward_kinematics(skeleton, np.zeros((1, 3)), still))
    after, normals_after = body.place(*forward_kinematics(skeleton, np.array([[1.0, 2.0, 0.0]]), turned))
    np.testing.assert_allclose(after[0], rotate(turn, before[0].astype(float)) + [1.0, 2.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(normals_after[0], rotate(turn, normals_before[0].astype(float)), atol=1e-5)


def test_a_bent_knee_moves_the_shank_and_nothing_else():
    skeleton = small_skeleton()
    body = build_body(skeleton, 8)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1, skeleton.joint_count, 1))
    bent = still.copy()
    bent[0, skeleton.roles["left_knee"]] = about_axis(Y, 1.0)
    before, _ = body.place(*forward_kinematics(skeleton, np.zeros((1, 3)), still))
    after, _ = body.place(*forward_kinematics(skeleton, np.zeros((1, 3)), bent))
    moved = np.linalg.norm(after - before, axis=-1)[0] > 1e-6
    lower = [skeleton.roles[f"left_{part}"] for part in ("knee", "ankle", "toe")]
    hanging = (np.isin(body.joints, lower) & (body.weights > 0.0)).any(axis=1)
    assert not moved[~hanging].any()
    # Only what lies on the axis of the knee itself stays.
    assert moved[hanging].mean() > 0.95


def test_crowd_mesh_follows_tracks_and_behaviors(recording):
    crowd = CrowdMesh(recording, "behavior")
    frame = recording.at_time(2.0)
    crowd.update(2.0)
    middle = 0.5 * (crowd.points.min(axis=1) + crowd.points.max(axis=1))
    np.testing.assert_allclose(middle[:, 0], frame.x, atol=0.35)
    np.testing.assert_allclose(middle[:, 1], frame.y, atol=0.35)
    for agent, shade in enumerate(shades_of(3)):
        shirt = hex_color(recording.header.behaviors[frame.behavior[agent]].color)
        assert (crowd.colors[agent] == shaded(shirt[None], np.array([shade]))).all(axis=1).any()
    assert crowd.triangles.max() == crowd.points.shape[0] * crowd.points.shape[1] - 1


def test_who_has_no_behavior_looks_as_one_of_the_first(recording):
    frame = recording.at_time(2.0)
    colors = []
    for behavior in (-1, 0):
        mesh = CrowdMesh(recording, "behavior")
        with pytest.MonkeyPatch.context() as patch:
            changed = frame._replace(behavior=np.full(3, behavior))
            patch.setattr(recording, "at_time", lambda _, changed=changed: changed)
            mesh.update(2.0, np.arange(3))
        colors.append(mesh.colors)
    assert np.array_equal(*colors)


def test_absent_characters_shrink_to_nothing(recording):
    crowd = CrowdMesh(recording, "agent")
    crowd.update(recording.duration)
    crowd.update(0.0)
    assert np.ptp(crowd.points[2], axis=0).max() == 0.0
    assert np.ptp(crowd.shadow_points[2], axis=0).max() == 0.0
    assert np.ptp(crowd.points[0], axis=0)[2] > 1.5


def test_agent_colors_differ():
    colors = distinct_colors(24)
    assert len(np.unique(colors, axis=0)) == 24


def test_words_have_colors_of_their_own_and_numbers_lie_on_a_scale():
    shirts, legend = attribute_colors(np.array(["nurse", "", "visitor", "nurse"]))
    assert [word for word, _ in legend] == ["nurse", "visitor"]
    assert (shirts[0] == shirts[3]).all()
    assert len({tuple(shirt) for shirt in shirts.tolist()}) == 3
    for agent, word in ((0, 0), (2, 1)):
        assert (shirts[agent] == hex_color(legend[word][1])).all()
    shirts, legend = attribute_colors(np.array([20.0, 70.0, np.nan, 45.0]))
    assert [word for word, _ in legend] == ["20", "70"]
    assert (shirts[0] == hex_color(legend[0][1])).all()
    assert (shirts[1] == hex_color(legend[1][1])).all()
    assert len({tuple(shirt) for shirt in shirts.tolist()}) == 4
    shirts, legend = attribute_colors(np.array([3.0, 3.0]))
    assert len(legend) == 1
    assert (shirts[0] == shirts[1]).all()


def test_builds_differ_and_stand_on_the_floor():
    skeleton = small_skeleton()
    body, builds = build_body(skeleton, 10), builds_of(15, skeleton)
    assert len(np.unique(builds, axis=0)) == 15
    positions, rotations = sculpted_pose(skeleton)
    plain, _ = body.place(positions[None], rotations[None])
    standing = positions - [0.0, 0.0, plain[0, :, 2].min()]
    posed, _ = body.place(np.tile(standing, (15, 1, 1)), np.tile(rotations, (15, 1, 1)), builds)
    assert np.abs(posed[..., 2].min(axis=1)).max() < 1e-3
    heights = posed[..., 2].max(axis=1)
    assert heights.min() >= 1.55
    assert heights.max() <= 1.9
    assert np.ptp(heights) > 0.12
    # Shoes stay where the recording has them, whatever the build.
    shoes = body.tissue == Tissue.SHOES
    np.testing.assert_allclose(posed[:, shoes, :2], np.tile(posed[:1, shoes, :2], (15, 1, 1)), atol=1e-6)


def test_parts_have_one_tissue_and_shoulders_follow_both_trunk_and_arm():
    skeleton = small_skeleton()
    body = build_body(skeleton, 10)
    assert (body.tissue[body.triangles] == body.tissue[body.triangles[:, :1]]).all()
    arm = skeleton.joint("left_shoulder")
    shirt = body.tissue == Tissue.SHIRT
    shared = shirt & (body.joints == arm).any(axis=1) & (body.weights.min(axis=1) > 0.05)
    assert shared.sum() > 20


def test_shades_keep_the_order_of_colors():
    blue = np.tile(hex_color("#1f77b4"), (14, 1))
    shirts = shaded(blue, shades_of(14))
    assert len(np.unique(shirts, axis=0)) == 7
    assert (np.argsort(shirts, axis=1) == np.argsort(blue, axis=1)).all()


def test_groups_have_the_colors_of_pages_and_a_legend(recording):
    crowd = CrowdMesh(recording, "group")
    names = sorted(set(recording.header.agents.groups))
    assert [name for name, _ in crowd.legend] == names
    assert [tuple(hex_color(color)) for _, color in crowd.legend] == group_colors(len(names))


def test_of_many_those_before_the_eye_have_finer_bodies(recording, monkeypatch):
    monkeypatch.setattr(crowd_mesh, "_MANY", 2)
    monkeypatch.setattr(crowd_mesh, "_NEAR", 1)
    monkeypatch.setattr(crowd_mesh, "_SIDES", ((1, 10), (10**9, 5)))
    near, far = meshes = crowd_meshes(recording, "behavior")
    assert near.points.shape[1] > 2 * far.points.shape[1]
    frame = recording.at_time(2.0)
    for agent in range(3):
        for behind in (False, True):
            x, y = frame.x[agent], frame.y[agent]
            eye, target = (x, y, 2.0), (2.0 * x, 2.0 * y, 1.0)
            if behind:
                # The camera stands beside this one, but looks away from it and at the others.
                away = np.array([np.delete(frame.x, agent).mean() - x, np.delete(frame.y, agent).mean() - y])
                eye = (*(np.array([x, y]) + 0.01 * away), 2.0)
                target = (*(np.array([x, y]) + away), 1.0)
            shown = shown_by(meshes, recording, 2.0, eye, target)
            assert [len(agents) for agents in shown] == [1, 2]
            assert sorted(np.concatenate(shown).tolist()) == [0, 1, 2]
            assert (shown[0][0] == agent) != behind
    for mesh, agents in zip(meshes, shown, strict=True):
        mesh.update(2.0, agents)
        middle = 0.5 * (mesh.points.min(axis=1) + mesh.points.max(axis=1))[: len(agents)]
        np.testing.assert_allclose(middle[:, 0], frame.x[agents], atol=0.35)
        assert np.ptp(mesh.points[len(agents) :], axis=1).max(initial=0.0) == 0.0


def test_hair_leaves_the_face_free_and_covers_the_rest_of_the_head():
    body = build_body(small_skeleton(), 16)
    head = small_skeleton().joint("head")
    follows = body.joints[:, 0] == head
    hair = body.places[follows & (body.tissue == Tissue.HAIR), 0]
    skin = body.places[follows & (body.tissue == Tissue.SKIN), 0]
    # Skull and hair have the same corners in the same order, before nose, eyes and ears.
    count = next(n for n in range(len(hair), 0, -1) if np.abs(hair[:n] - skin[:n]).max() < 0.02)
    middle = skin[:count].mean(axis=0)
    outward = np.sum((hair[:count] - skin[:count]) * (skin[:count] - middle), axis=1)
    ahead, up = (skin[:count] - middle)[:, 0], (skin[:count] - middle)[:, 2]
    face = (ahead > 0.06) & (up < 0.02)
    back = (ahead < -0.04) & (up > -0.04)
    assert face.sum() > 10
    assert back.sum() > 10
    assert (outward[face] < 0.0).all()
    assert (outward[back] > 0.0).all()
