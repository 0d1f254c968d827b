"""Posing agents: against the slow twin, against the clips, and across seams."""

import numpy as np
import pytest

from crowdsim.geometry.planar import compose
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.foot_contacts import Feet, feet_of
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, blend_weight, next_origin, track_pose
from tests.reference.motion_pose import pose_one
from tests.reference.planted_feet import planted_speed
from tests.unit.motion.walker import walk

DETECTORS = ("crossing", "standing")
CLIPS = [walk(steps=9, name="straight"), walk(steps=10, step_length=0.64, turn=1.2, name="left")]


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_motion_graph([MotionSource(clip, 0, DETECTORS) for clip in CLIPS])


def pose(graph: MotionGraph, node: object, previous: object, frame: object, at: np.ndarray) -> tuple:
    count, joints = len(at), graph.skeleton.joint_count
    positions, rotations = np.zeros((count, joints, 3), np.float32), np.zeros((count, joints, 4), np.float32)
    columns = [np.broadcast_to(np.asarray(c, np.int32), (count,)).copy() for c in (node, previous)]
    shown = np.broadcast_to(np.asarray(frame, np.float64), (count,)).copy()
    pose_joints(graph.poses, *columns, shown, np.ascontiguousarray(at, np.float64), positions, rotations)
    return positions, rotations


def test_kernel_equals_the_slow_twin(graph: MotionGraph) -> None:
    rng = np.random.default_rng(0)
    n = graph.report.nodes
    for _ in range(40):
        node, previous = int(rng.integers(n)), int(rng.integers(-1, n))
        last = min(30, int(graph.arrays.node_frames[node]))
        frame = float(rng.choice([rng.integers(0, last + 1), rng.uniform(0.0, last)]))
        at = rng.normal(size=3)
        positions, rotations = pose(graph, node, previous, frame, at[None])
        expected, turned = pose_one(graph.poses, node, previous, frame, at, blend_weight(frame))
        assert np.allclose(positions[0], expected, atol=2e-6)
        assert np.allclose(np.abs(np.sum(rotations[0] * turned, axis=1)), 1.0, atol=1e-6)


def test_an_unblended_node_plays_its_clip(graph: MotionGraph) -> None:
    for node, name in enumerate(graph.node_names):
        clip = next(c for c in CLIPS if name.startswith(c.name + ":"))
        first, last = map(int, name.split(":")[1].split("-"))
        track = track_of(clip)
        arrays = graph.arrays
        rows = slice(arrays.node_track[node], arrays.node_track[node] + arrays.node_frames[node] + 1)
        at = compose(track[first], arrays.tracks[rows])
        positions, _ = pose(graph, node, -1, np.arange(last - first + 1), at)
        assert np.allclose(positions, clip.joint_positions[first : last + 1], atol=1e-5)


def seam(graph: MotionGraph, source: int, edge: int, twist: float) -> tuple[np.ndarray, np.ndarray, Feet]:
    """Joint positions of the source's last frame and of the target's first BLEND_FRAMES + 1 frames, and their feet."""
    arrays = graph.arrays
    target = int(arrays.edge_target[edge])
    end = arrays.node_motion[source]
    origin = next_origin(arrays, edge, twist, *end)
    gap = end[0] - origin[0], end[1] - origin[1], (end[2] - origin[2] + np.pi) % (2 * np.pi) - np.pi
    frames = np.arange(min(BLEND_FRAMES, arrays.node_frames[target]) + 1)
    at = np.array([track_pose(arrays, target, f, *origin, *gap) for f in frames])
    before, _ = pose(graph, source, -1, arrays.node_frames[source], end[None])
    positions, rotations = pose(graph, target, source, frames, at)
    return before[0], positions, feet_of(graph.skeleton, positions, rotations)


def test_seams_are_continuous_and_feet_stay_planted(graph: MotionGraph) -> None:
    sources = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    for edge, source in enumerate(sources):
        for twist in (0.0, graph.arrays.edge_low[edge], graph.arrays.edge_high[edge]):
            before, after, feet = seam(graph, int(source), edge, float(twist))
            assert np.allclose(before, after[0], atol=1e-5)
            target = graph.arrays.edge_target[edge]
            own = graph.arrays.tracks[graph.arrays.node_track[target] :][: len(after)]
            plain = feet_of(graph.skeleton, *pose(graph, target, -1, np.arange(len(after)), own), feet)
            assert np.nanmedian(planted_speed(feet, plain)) < (0.1 if twist == 0.0 else 0.3)
            assert np.abs(np.diff(after, axis=0)).max() < 0.12


def test_captured_planted_feet_move_less_than_a_centimeter_across_seams(shared: object) -> None:
    from pathlib import Path

    from crowdsim.motion.captures.reader import read_clip

    files = sorted((Path(str(shared)) / "mocap").glob("16_1[1-6]*.bvh"))
    graph = build_motion_graph([MotionSource(read_clip(path), 0, ("crossing",)) for path in files])
    left = [graph.skeleton.joint("left_ankle"), graph.skeleton.joint("left_toe")]
    sources = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    drifts = []
    for edge in range(0, graph.report.edges, 7):
        _, after, _ = seam(graph, int(sources[edge]), edge, 0.0)
        foot = after[:, left, :2].mean(axis=1)
        target = int(graph.arrays.edge_target[edge])
        own, _ = pose(
            graph,
            target,
            -1,
            np.arange(len(after)),
            graph.arrays.tracks[graph.arrays.node_track[target] :][: len(after)],
        )
        own_foot = own[:, left, :2].mean(axis=1)
        moved = np.linalg.norm(foot[-1] - foot[0]) - np.linalg.norm(own_foot[-1] - own_foot[0])
        drifts.append(abs(moved))
    assert np.median(drifts) < 0.005
    assert np.percentile(drifts, 95) < 0.01


def test_opposite_quaternion_signs_blend_the_short_way(graph: MotionGraph) -> None:
    flipped = graph.poses._replace(pool_rotations=graph.poses.pool_rotations.copy())
    last = flipped.node_first[0] + flipped.node_frames[0]
    flipped.pool_rotations[last] *= -1.0
    other = MotionGraph(graph.arrays, graph.node_names, flipped, graph.skeleton, graph.report)
    at = np.zeros((1, 3))
    assert np.allclose(pose(graph, 1, 0, 3, at)[0], pose(other, 1, 0, 3, at)[0], atol=1e-6)


def test_no_characters_is_fine(graph: MotionGraph) -> None:
    positions, _ = pose(graph, 0, -1, 0, np.zeros((0, 3)))
    assert positions.shape == (0, graph.skeleton.joint_count, 3)


def test_pool_is_compact(graph: MotionGraph) -> None:
    table = graph.poses
    assert len(table.pool_root) == int((table.node_frames + 1).sum())
    assert table.pool_rotations.dtype == table.pool_root.dtype == np.float32
    assert isinstance(CLIPS[0], Clip)
