"""Feet of captured bodies: where they stand, from touch-down to lift-off, and legs that are bent to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.deformed.body_kernels import REACH
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose_between
from crowdsim.motion.planted.follow_feet import FollowedFeet, Played
from crowdsim.motion.planted.follow_kernels import LONGEST_FADE
from crowdsim.motion.planted.pin_kernels import (
    COLUMNS,
    FADES,
    FARTHEST,
    MODE,
    NODE,
    SINCE,
    STANDS,
    UNTIL,
    YAW,
    X,
    pin_feet,
)
from crowdsim.motion.planted.planted_rows import NO_LANDING, FootTable, foot_table
from crowdsim.recording.between import frame_between
from crowdsim.recording.header import AgentState, RecordedFrame
from tests.reference.pinned_feet import carried, clip_place, pinned, place_of
from tests.unit.motion.walker import walk

DETECTORS = ("crossing", "standing")
CLIPS = [walk(steps=9, name="straight"), walk(steps=10, step_length=0.64, turn=1.2, name="left")]
NOWHERE = np.zeros(2)


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_motion_graph([MotionSource(clip, 0, DETECTORS) for clip in CLIPS])


@pytest.fixture(scope="module")
def feet(graph: MotionGraph) -> FootTable:
    return foot_table(graph.poses, graph.skeleton, graph.arrays.tracks)


def posed(graph: MotionGraph, node: int, previous: int, frame: float, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    joints = graph.skeleton.joint_count
    positions, rotations = np.zeros((1, joints, 3), np.float32), np.zeros((1, joints, 4), np.float32)
    columns = np.array([node], np.int32), np.array([previous], np.int32), np.array([frame])
    pose_joints(graph.poses, *columns, np.asarray(at, np.float64)[None], positions, rotations)
    return positions, rotations


def pin(
    graph: MotionGraph,
    feet: FootTable,
    states: np.ndarray,
    node: int,
    frame: float,
    body: tuple[np.ndarray, np.ndarray],
    spans: np.ndarray = NOWHERE,
) -> tuple[np.ndarray, np.ndarray]:
    positions, rotations = (values.copy() for values in body)
    pin_feet(
        graph.poses, feet, states[None], np.array([node], np.int32), np.array([frame]), spans, positions, rotations
    )
    return positions[0], rotations[0]


def stretches(feet: FootTable, positions: np.ndarray) -> np.ndarray:
    hip, knee, ankle = (positions[feet.legs[:, k]] for k in range(3))
    whole = np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)
    return np.linalg.norm(ankle - hip, axis=1) / whole


def test_feet_that_point_straight_down_at_rest_have_headings(graph: MotionGraph) -> None:
    offsets = graph.skeleton.offsets.copy()
    offsets[[graph.skeleton.joint("left_toe"), graph.skeleton.joint("right_toe")], :2] = 0.0
    found = foot_table(graph.poses, replace(graph.skeleton, offsets=offsets), graph.arrays.tracks)
    assert found.across.tolist() == [[0.0, 1.0, 0.0]] * 2
    assert np.isfinite(found.places).all()


def test_legs_are_bent_as_by_the_slow_twin(graph: MotionGraph, feet: FootTable) -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        node = int(rng.integers(graph.report.nodes))
        frame = float(rng.uniform(0.0, graph.arrays.node_frames[node]))
        body = posed(graph, node, -1, frame, rng.normal(size=3))
        moved = np.concatenate([rng.uniform(-0.06, 0.06, (2, 2)), rng.uniform(-0.3, 0.3, (2, 1))], axis=1)
        states = np.zeros((2, COLUMNS))
        # Half way of a fade: half of what fades is left.
        states[:, [MODE, NODE, SINCE, UNTIL]] = FADES, node, frame - 10.0, frame + 10.0
        states[:, X : YAW + 1] = 2.0 * moved
        positions, rotations = pin(graph, feet, states, node, frame, body)
        expected, turned = pinned(feet, moved, body[0][0], body[1][0])
        np.testing.assert_allclose(positions, expected, atol=5e-5)  # knees of nearly straight legs magnify rounding
        np.testing.assert_allclose(np.abs(np.sum(rotations * turned, axis=1)), 1.0, atol=1e-5)
        assert (stretches(feet, positions) <= np.maximum(stretches(feet, body[0][0]), REACH) + 1e-5).all()


def test_a_foot_stands_where_it_came_down_however_the_body_is_pushed(graph: MotionGraph, feet: FootTable) -> None:
    node = int(np.argmax(graph.arrays.node_frames))
    first = graph.poses.node_first[node]
    for foot in (0, 1):
        since = int(np.flatnonzero(feet.stands[first : first + graph.poses.node_frames[node], foot])[0])
        tracks = compose(np.full(3, 0.5), graph.arrays.tracks[graph.arrays.node_track[node] :])
        start = place_of(feet, foot, *(values[0] for values in posed(graph, node, -1, since, tracks[since])))
        states = np.zeros((2, COLUMNS))
        states[foot] = [STANDS, node, since, 0.0, *start]
        for k in range(0, 12, 3):
            frame = since + 0.5 * k
            body = posed(graph, node, -1, frame, tracks[int(frame)] + [0.003 * k, -0.004 * k, 0.01 * k])
            shown = place_of(feet, foot, *pin(graph, feet, states, node, frame, body))
            way = [clip_place(feet, first, foot, f) for f in (float(since), frame)]
            np.testing.assert_allclose(shown, carried(start, *way), atol=1e-5)


def test_a_foot_is_dragged_along_rather_than_left_far_behind(graph: MotionGraph, feet: FootTable) -> None:
    body = posed(graph, 0, -1, 3.0, np.zeros(3))
    place = place_of(feet, 0, body[0][0], body[1][0])
    states = np.zeros((2, COLUMNS))
    states[0] = [STANDS, 0, 3.0, 0.0, place[0] - 1.0, place[1], place[2]]
    positions, rotations = pin(graph, feet, states, 0, 3.0, body)
    assert np.linalg.norm(place_of(feet, 0, positions, rotations)[:2] - place[:2]) <= FARTHEST + 0.02


def test_across_the_ends_of_a_periodic_floor_a_foot_stays(graph: MotionGraph, feet: FootTable) -> None:
    body = posed(graph, 0, -1, 3.0, np.zeros(3))
    place = place_of(feet, 0, body[0][0], body[1][0])
    states = np.zeros((2, COLUMNS))
    states[0] = [STANDS, 0, 3.0, 0.0, place[0] + 8.0 + 0.01, place[1], place[2]]
    positions, rotations = pin(graph, feet, states, 0, 3.0, body, np.array([8.0, 0.0]))
    np.testing.assert_allclose(place_of(feet, 0, positions, rotations) - place, [0.01, 0.0, 0.0], atol=1e-5)


def test_rows_tell_when_feet_stand_and_land(graph: MotionGraph, feet: FootTable) -> None:
    for first, last in zip(graph.poses.node_first, graph.poses.node_first + graph.poses.node_frames, strict=True):
        assert not feet.stands[last].any()
        for foot in (0, 1):
            stands = feet.stands[first:last, foot]
            lands = np.flatnonzero(stands & ~np.append(True, stands[:-1]))
            for row in range(last - first):
                expected = lands[lands > row].min(initial=NO_LANDING)
                assert feet.landings[first + row, foot] == expected


def chain(graph: MotionGraph, length: int, twist: float) -> list[tuple[int, int, int, np.ndarray]]:
    """(node, node before, frame, track) of a body that plays some nodes, frame by frame; each seam is met once."""
    arrays, rng = graph.arrays, np.random.default_rng(5)
    node, previous, origin, blend_offset = 0, -1, np.zeros(3), np.zeros(3)
    played = []
    for _ in range(length):
        first = 0 if previous < 0 else 1
        played += [
            (node, previous, frame, np.array(track_pose_between(arrays, node, frame, 0.0, *origin, *blend_offset)))
            for frame in range(first, int(arrays.node_frames[node]) + 1)
        ]
        end = np.array(node_end(arrays, node, *origin))
        edge = int(rng.integers(arrays.edge_start[node], arrays.edge_start[node + 1]))
        turn = float(np.clip(twist, arrays.edge_low[edge], arrays.edge_high[edge]))
        origin = np.array(next_origin(arrays, edge, turn, *end))
        blend_offset = end - origin
        blend_offset[2] = wrap_angle(blend_offset[2])
        node, previous = int(arrays.edge_target[edge]), node
    return played


@pytest.mark.parametrize("twist", [0.0, 0.3])
def test_feet_are_followed_as_by_the_slow_twin(graph: MotionGraph, feet: FootTable, twist: float) -> None:
    """Frame by frame a standing foot moves as in its clip alone, whatever node it stands in."""
    followed = FollowedFeet(graph.poses, feet, 1, 60, NOWHERE)
    places: list[np.ndarray | None] = [None, None]
    before: tuple[int, int] | None = None
    compared = 0
    for node, previous, frame, track in chain(graph, 14, twist):
        followed.add(
            Played(np.array([node], np.int32), np.array([previous], np.int32), np.array([float(frame)]), track[None])
        )
        body = posed(graph, node, previous, frame, track)
        positions, rotations = pin(graph, feet, followed.states[0], node, frame, body)
        fading = followed.states[0, followed.states[0, :, MODE] == FADES]
        assert (fading[:, UNTIL] - fading[:, SINCE] <= LONGEST_FADE).all()
        first = graph.poses.node_first[node]
        for foot in (0, 1):
            shown = place_of(feet, foot, positions, rotations)
            # Stands until this frame, in this node or since the seam.
            begin = frame - 1
            stood = before is not None and feet.stands[first + begin, foot]
            place = places[foot]
            if place is not None and stood:
                way = [clip_place(feet, first, foot, float(f)) for f in (begin, frame)]
                places[foot] = place = carried(place, *way)
                assert np.linalg.norm(shown[:2] - place[:2]) < 2e-5
                assert abs(wrap_angle(shown[2] - place[2])) < 1e-4
                compared += 1
            stands = frame == graph.poses.node_frames[node] or feet.stands[first + frame, foot]
            if not (stood and stands):
                places[foot] = shown if stands else None
        before = node, frame
    assert compared > 300


@pytest.mark.parametrize("left", [2, 4, 5, 6, 9])
def test_feet_enter_a_node_when_it_is_shown_however_much_of_the_old_one_is_skipped(
    graph: MotionGraph, feet: FootTable, left: int
) -> None:
    """At 10 steps a second, 6 frames are played a step; an agent that leaves an idle node may be in its last ones."""
    frames, last = graph.poses.node_frames, int(graph.poses.node_frames[0])
    new = next(node for node in range(1, len(frames)) if frames[node] > 7 and frames[node] != last)
    since, frame = float(last - left), 6.0 if left < 6 else 4.0
    followed = FollowedFeet(graph.poses, feet, 1, 10, NOWHERE)
    before = Played(np.array([0], np.int32), np.array([-1], np.int32), np.array([since]), np.zeros((1, 3)))
    after = Played(np.array([new], np.int32), np.array([0], np.int32), np.array([frame]), np.array([[0.1, 0.0, 0.0]]))
    followed.add(before)
    _, shares, events = followed.add(after)
    enters = np.flatnonzero(events[:, NODE] == new)[:2]
    steps = [frame_of(node, previous, at) for node, previous, at in ((0, -1, since), (new, 0, frame))]
    for share in np.linspace(0.01, 0.99, 99):
        shown = frame_between(*steps, share, feet.tracks, 10, NOWHERE)
        assert (shown.node[0] == new) == (share > shares[enters[0]] + 1e-9) or abs(share - shares[enters[0]]) < 1e-9
        if shown.node[0] == new:
            assert shown.frame[0] >= events[enters, SINCE].max() - 1e-9


def frame_of(node: int, previous: int, at: float) -> RecordedFrame:
    """A recorded step of one agent that walks."""
    columns = {name: np.zeros(1) for name in ("x", "y", "heading", "phase")}
    whole = {"node": node, "previous": previous, "behavior": 0, "state": int(AgentState.MOVING)}
    return RecordedFrame(**columns, frame=np.array([at]), **{name: np.array([each]) for name, each in whole.items()})
