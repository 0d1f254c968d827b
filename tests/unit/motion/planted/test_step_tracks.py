"""Tracks of captured bodies between two steps."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.planted.between_kernels import NodeTracks, tracks_between
from tests.reference.step_tracks import Step, track_between
from tests.unit.motion.planted.test_pinned_feet import CLIPS, DETECTORS, NOWHERE, chain


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_motion_graph([MotionSource(clip, 0, DETECTORS) for clip in CLIPS])


@pytest.fixture(scope="module")
def nodes(graph: MotionGraph) -> NodeTracks:
    return NodeTracks(graph.poses.node_first, graph.poses.node_frames, graph.arrays.tracks)


def between(nodes: NodeTracks, natural: float, olds: list[Step], news: list[Step], share: float, spans=NOWHERE):
    """The tracks (n, 3) of n bodies at a share of a step."""
    ends = []
    for steps in (olds, news):
        node, frame, pose = zip(*steps, strict=True)
        ends += [np.array(node, np.int32), np.array(frame), np.array(pose)]
    tracks = np.empty((len(olds), 3))
    tracks_between(nodes, natural, np.asarray(spans, float), *ends, share, tracks)
    return tracks


@pytest.mark.parametrize("twist", [0.0, 0.3])
def test_ten_steps_a_second_show_what_sixty_do(graph: MotionGraph, nodes: NodeTracks, twist: float) -> None:
    """Inside of a step a body is where its nodes have it, not on the straight line between both its ends."""
    played = chain(graph, 14, twist)
    steps = [(node, float(frame), track) for node, _, frame, track in played]
    off, straight = [], []
    for first in range(0, len(steps) - 6, 6):
        old, new = steps[first], steps[first + 6]
        for k in range(1, 6):
            shown, exact = between(nodes, 6.0, [old], [new], k / 6.0)[0], steps[first + k][2]
            off.append(np.append(shown[:2] - exact[:2], 0.1 * wrap_angle(shown[2] - exact[2])))
            line = old[2][:2] + k / 6.0 * (new[2][:2] - old[2][:2])
            straight.append(np.linalg.norm(line - exact[:2]))
    assert np.linalg.norm(off, axis=1).max() < 1e-3, "also as a node begins and its blend offset fades"
    assert max(straight) > (0.005 if twist else 0.001)


def test_bodies_meet_both_ends_of_a_step(graph: MotionGraph, nodes: NodeTracks) -> None:
    played = [(node, float(frame), track) for node, _, frame, track in chain(graph, 8, 0.3)]
    olds, news = played[:-6:6], played[6::6]
    for share, steps in ((0.0, olds), (1.0, news), (1.0 - 1e-9, news)):
        np.testing.assert_allclose(between(nodes, 6.0, olds, news, share), [step[2] for step in steps], atol=1e-6)


def test_tracks_are_those_of_the_slow_twin(graph: MotionGraph, nodes: NodeTracks) -> None:
    """For any node, frame and pose, also those that no run has."""
    rng, count = np.random.default_rng(3), len(nodes.first)
    for _ in range(400):
        ends = []
        for _ in range(2):
            node = int(rng.integers(-1, count))
            frame = float(rng.uniform(0, nodes.frames[node])) if node >= 0 else 0.0
            pose = np.append(rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0))
            ends.append((node, np.floor(frame) if rng.random() < 0.3 else frame, pose))
        if rng.random() < 0.4:
            ends[1] = (ends[0][0], min(ends[0][1] + 3.0, float(nodes.frames[max(ends[0][0], 0)])), ends[1][2])
        share = float(rng.choice([0.0, 0.25, rng.random()]))
        natural = float(rng.choice([2.0, 6.0, 30.0]))
        found, expected = (
            between(nodes, natural, [ends[0]], [ends[1]], share)[0],
            track_between(nodes, natural, *ends, share),
        )
        np.testing.assert_allclose(found[:2], expected[:2], atol=1e-9)
        assert abs(wrap_angle(found[2] - expected[2])) < 1e-9


def test_across_the_ends_of_a_periodic_floor_a_body_goes_on(graph: MotionGraph, nodes: NodeTracks) -> None:
    steps = [(node, float(frame), track) for node, _, frame, track in chain(graph, 4, 0.0)]
    for old, new in zip(steps[:-6:6], steps[6::6], strict=True):
        here = between(nodes, 6.0, [old], [new], 0.5)
        moved = (new[0], new[1], new[2] - [8.0, 0.0, 0.0])
        np.testing.assert_allclose(between(nodes, 6.0, [old], [moved], 0.5, (8.0, 0.0)), here, atol=1e-12)


def test_bodies_that_play_nothing_go_straight(nodes: NodeTracks) -> None:
    old, new = (-1, 0.0, np.array([0.0, 0.0, 3.0])), (-1, 0.0, np.array([1.0, 2.0, -3.0]))
    x, y, heading = between(nodes, 6.0, [old], [new], 0.5)[0]
    assert (x, y) == (0.5, 1.0)
    assert abs(wrap_angle(heading)) == pytest.approx(np.pi, abs=1e-9)
    # One that stands in a frame, and one that is captured at one end only.
    held = (0, 5.0, np.zeros(3)), (0, 5.0, np.array([0.2, 0.0, 0.0]))
    assert between(nodes, 6.0, [held[0]], [held[1]], 0.5)[0].tolist() == [0.1, 0.0, 0.0]
    assert between(nodes, 6.0, [held[0]], [(-1, 0.0, held[1][2])], 0.5)[0].tolist() == [0.1, 0.0, 0.0]
