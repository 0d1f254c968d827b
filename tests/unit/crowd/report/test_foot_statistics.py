"""How well feet keep to the floor, over bodies that walk, slide and fly."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.report.foot_statistics import FootStatistics
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.recording.header import RecordedFrame
from tests.reference.planted_feet import planted_speed
from tests.unit.motion.walker import walk

RATE = int(CAPTURE_RATE)
ALONE = np.array([0])


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
        columns = (x, y, heading, node, -1, k, 0, 0)
        frames.append(RecordedFrame(*(np.array([value]) for value in columns)))
    return frames


def taken(graph: MotionGraph, frames: list[RecordedFrame]) -> FootStatistics:
    statistics = FootStatistics(graph, RATE)
    for frame in frames:
        statistics.add(frame, ALONE)
    return statistics


def longest(graph: MotionGraph) -> int:
    return int(np.argmax(graph.arrays.node_frames))


def test_feet_of_the_walker_rest_and_those_of_a_sliding_body_slide(graph: MotionGraph) -> None:
    node = longest(graph)
    still, sliding = taken(graph, played(graph, node)), taken(graph, played(graph, node, sliding=0.3))
    assert still.stance_speed is not None
    assert still.stance_speed < 0.05  # the mean; feet that land or lift off are near the floor and slow, too
    assert still.lowest == pytest.approx(0.0, abs=2e-3)
    assert sliding.stance_speed == pytest.approx(0.3, rel=0.1)


def test_equals_the_slow_twin(graph: MotionGraph) -> None:
    node = longest(graph)
    frames = played(graph, node, sliding=0.2)
    joints = graph.skeleton.joint_count
    pose = np.array([[f.x[0], f.y[0], f.heading[0]] for f in frames])
    positions = np.empty((len(frames), joints, 3), np.float32)
    rotations = np.empty((len(frames), joints, 4), np.float32)
    count = np.full(len(frames), node, np.int32)
    at = np.arange(len(frames), dtype=np.int32)
    pose_joints(graph.poses, count, np.full_like(count, -1), at, pose, positions, rotations)
    expected = np.nanmean(planted_speed(graph.skeleton, positions, RATE))
    assert taken(graph, frames).stance_speed == pytest.approx(float(expected), rel=0.05)


def test_who_was_not_there_before_has_no_speed(graph: MotionGraph) -> None:
    first, second = played(graph, longest(graph))[:2]
    statistics = FootStatistics(graph, RATE)
    statistics.add(first, np.array([], np.int64))
    statistics.add(second, ALONE)
    assert statistics.stance_speed is None
