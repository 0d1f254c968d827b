"""How well feet keep to the floor, over bodies that walk, slide and fly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.report.foot_kernels import place_points, standing_distances
from crowdsim.crowd.report.foot_statistics import FootStatistics
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.foot_contacts import Feet, feet_of, foot_points
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.recording.header import RecordedFrame
from tests.reference.planted_feet import planted_distances, planted_speed
from tests.unit.motion.walker import walk

RATE = int(CAPTURE_RATE)
ALONE = np.array([0])
SIDES = ("left", "right")


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_motion_graph([MotionSource(walk(steps=8), 0, ("crossing", "standing"))])


def played(graph: MotionGraph, node: int, sliding: float = 0.0) -> list[RecordedFrame]:
    """All frames of a node, whose body slides to its left by so many meters a second."""
    arrays = graph.arrays
    rows = slice(arrays.node_track[node], arrays.node_track[node] + arrays.node_frames[node] + 1)
    frames = []
    for k, at in enumerate(compose(np.array([2.0, -1.0, 0.4]), arrays.tracks[rows])):
        x, y, heading = at + [0.0, sliding * k / RATE, 0.0]
        columns = (x, y, heading, node, -1, k, 0, 0, np.nan)
        frames.append(RecordedFrame(*(np.array([value]) for value in columns)))
    return frames


def taken(graph: MotionGraph, frames: list[RecordedFrame]) -> FootStatistics:
    statistics = FootStatistics(graph, RATE)
    for frame in frames:
        statistics.add(frame, ALONE)
    return statistics


def longest(graph: MotionGraph) -> int:
    return int(np.argmax(graph.arrays.node_frames))


def feet(graph: MotionGraph, node: int, pose: np.ndarray, like: Feet | None = None) -> Feet:
    """Feet of all frames of a node at track poses (F, 3)."""
    joints, count = graph.skeleton.joint_count, len(pose)
    positions, rotations = np.empty((count, joints, 3), np.float32), np.empty((count, joints, 4), np.float32)
    nodes, at = np.full(count, node, np.int32), np.arange(count, dtype=np.int32)
    pose_joints(graph.poses, nodes, np.full(count, -1, np.int32), at, pose, positions, rotations)
    return feet_of(graph.skeleton, positions.astype(np.float64), rotations.astype(np.float64), like)


def test_feet_of_the_walker_rest_and_those_of_a_sliding_body_slide(graph: MotionGraph) -> None:
    node = longest(graph)
    still = taken(graph, played(graph, node))
    assert still.stance_speed is not None
    assert still.stance_speed < 0.05
    assert still.lowest == pytest.approx(0.0, abs=2e-3)
    for speed in (0.3, 1.5):  # the second is as fast as a foot that swings
        sliding = taken(graph, played(graph, node, sliding=speed))
        assert sliding.stance_speed == pytest.approx(speed, rel=0.1)


def test_equals_the_slow_twin(graph: MotionGraph) -> None:
    node = longest(graph)
    frames = played(graph, node, sliding=0.2)
    own = graph.arrays.tracks[graph.arrays.node_track[node] :][: len(frames)]
    like = FootStatistics(graph, RATE)._rows.feet
    shown = feet(graph, node, np.array([[f.x[0], f.y[0], f.heading[0]] for f in frames]), like)
    expected = np.nanmean(planted_speed(shown, feet(graph, node, own, like), RATE))
    assert taken(graph, frames).stance_speed == pytest.approx(float(expected), abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_feet_of_a_crowd_equal_the_slow_twin(graph: MotionGraph, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = FootStatistics(graph, RATE)._rows
    frames, joints = graph.poses.node_frames, foot_points(graph.skeleton, rows.feet.ankles)

    def moment(agents: np.ndarray, node: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, float, Feet]:
        """Points of the feet, how far the lowest is above its lowest height, and the same by the slow way."""
        count = len(agents)
        pose = np.column_stack([rng.uniform(-5, 5, (count, 2)), rng.uniform(-3, 3, count)])
        shape = count, graph.skeleton.joint_count
        positions, rotations = np.empty((*shape, 3), np.float32), np.empty((*shape, 4), np.float32)
        pose_joints(graph.poses, node, np.full(count, -1, np.int32), at, pose, positions, rotations)
        points = np.empty((count, *joints[0].shape, 3))
        lowest = place_points(*joints, rows.feet.lowest, positions, rotations, points)
        return points, lowest, feet_of(graph.skeleton, positions.astype(float), rotations.astype(float), rows.feet)

    # Some play on, some begin another node or the same one anew, some come, some leave; frames are whole or not.
    then, now = (np.sort(rng.choice(40, 30, replace=False)) for _ in range(2))
    node = rng.integers(0, len(frames), 40).astype(np.int32)
    old = np.where(rng.random(40) < 0.3, 0.0, rng.uniform(0.0, frames[node]))
    later = np.where(rng.random(40) < 0.3, rng.integers(0, len(frames), 40), node).astype(np.int32)
    at = np.where(
        later == node, np.minimum(old + rng.integers(-1, 4, 40), frames[node]).clip(0.0), rng.uniform(0, 3, 40)
    )
    before, _, _ = moment(then, node[then], old[then])
    points, lowest, slow = moment(now, later[now], at[now])
    assert np.allclose(points, slow.points, atol=1e-9)
    assert lowest == pytest.approx((slow.points[..., 2] - slow.lowest).min(), abs=1e-9)
    both, mine, theirs = np.intersect1d(now, then, return_indices=True)
    total, count = standing_distances(
        graph.poses, rows.lifted, theirs, mine, (node[then], old[then], before), (later[now], at[now], points)
    )
    known = [
        ({a: (int(n[a]), float(f[a])) for a in agents.tolist()}, dict(zip(agents.tolist(), feet, strict=True)))
        for agents, n, f, feet in ((then, node, old, before), (now, later, at, points))
    ]
    expected = planted_distances(rows, *known)
    assert 0 < count < 2 * len(both)
    assert count == len(expected)
    assert total == pytest.approx(sum(expected))


def test_a_step_of_several_frames_counts_if_the_foot_is_planted_in_all_of_them(graph: MotionGraph) -> None:
    node = longest(graph)
    frames = played(graph, node, sliding=0.2)
    each = taken(graph, frames)
    every_second = FootStatistics(graph, RATE // 2)
    for frame in frames[::2]:
        every_second.add(frame, ALONE)
    assert each.stance_speed == pytest.approx(every_second.stance_speed, rel=0.1)
    assert 2 * every_second._speed_count <= each._speed_count


def test_a_foot_stays_planted_across_the_seam_of_two_nodes(graph: MotionGraph) -> None:
    """A node and its successor in the clip, whose cut lies in the middle of a stance."""
    names = [name.split(":")[1].split("-") for name in graph.node_names]
    first = next(i for i, name in enumerate(names) if any(name[1] == other[0] for other in names))
    second = next(i for i, name in enumerate(names) if name[0] == names[first][1])
    before, after = played(graph, first)[-2], played(graph, second)[1]
    statistics = taken(graph, [before, after])
    assert statistics._speed_count >= 1


def test_toes_and_their_tips_count_if_both_feet_have_them(graph: MotionGraph) -> None:
    skeleton, ankles = graph.skeleton, np.array([0.08, 0.09])
    left, right = (skeleton.joint(f"{side}_toe") for side in ("left", "right"))
    joints, offsets = foot_points(skeleton, ankles)
    assert joints[:, :2].tolist() == [
        [skeleton.joint(f"{side}_ankle"), skeleton.joint(f"{side}_toe")] for side in SIDES
    ]
    assert offsets[:, 0, 2].tolist() == [-0.08, -0.09]
    assert not offsets[:, 1].any()
    with_tips = replace(skeleton, end_parents=np.array([left, right], np.int32), end_offsets=np.full((2, 3), 0.05))
    assert foot_points(with_tips, ankles)[1][:, 2].tolist() == [[0.05] * 3] * 2
    with_one = replace(skeleton, end_parents=np.array([left], np.int32), end_offsets=np.full((1, 3), 0.05))
    assert foot_points(with_one, ankles)[0].shape == (2, 2)
    without = replace(skeleton, roles={role: joint for role, joint in skeleton.roles.items() if "toe" not in role})
    ankle = skeleton.joint("left_ankle")
    assert foot_points(without, ankles)[0][0].tolist() == [ankle, ankle]


def test_an_empty_step_changes_nothing(graph: MotionGraph) -> None:
    statistics = FootStatistics(graph, RATE)
    for frame in played(graph, longest(graph))[:3]:
        statistics.add(frame, np.array([], np.int64))
    assert statistics.stance_speed is None
    assert statistics.lowest == np.inf


def test_who_was_not_there_before_has_no_speed(graph: MotionGraph) -> None:
    first, second = played(graph, longest(graph))[:2]
    statistics = FootStatistics(graph, RATE)
    statistics.add(first, np.array([], np.int64))
    statistics.add(second, ALONE)
    assert statistics.stance_speed is None
