"""The point-cloud distance against search and against its closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.geometry.planar import transform_points
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.frame_distance import (
    RANGE_CAP,
    RANGE_STEP,
    WINDOW_REACH,
    align_all,
    cloud_joints,
    point_clouds,
)
from tests.reference.motion_distance import best_distance, distance_under
from tests.unit.motion.walker import make_skeleton, walk


def random_clouds(seed: int, count: int, points: int = 12) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, points, 3))


@pytest.mark.parametrize("seed", range(3))
def test_distances_equal_those_found_by_search(seed: int) -> None:
    a, b = random_clouds(seed, 3), random_clouds(seed + 100, 2)
    alignments = align_all(a, b)
    for i in range(3):
        for j in range(2):
            distance, _ = best_distance(a[i], b[j])
            assert alignments.distance[i, j] == pytest.approx(distance, abs=1e-6)


def test_a_moved_cloud_is_no_distance_away_and_its_turn_is_found() -> None:
    a = random_clouds(1, 1)
    pose = np.array([3.0, -2.0, 0.7])
    b = np.concatenate([transform_points(pose, a[0, :, :2]), a[0, :, 2:]], axis=1)[None]
    alignments = align_all(a, b)
    assert alignments.distance[0, 0] < 1e-6
    assert alignments.rotation[0, 0] == pytest.approx(-0.7)


def test_pinned_distance_is_the_plain_formula() -> None:
    a, b = random_clouds(2, 2), random_clouds(3, 2)
    alignments = align_all(a, b)
    rows, columns = np.array([0, 1, 1]), np.array([1, 0, 1])
    pivot_a, pivot_b = np.array([[0.1, 0.2], [1, -1], [0, 3]]), np.array([[0.5, 0], [0.2, 0.1], [-1, 2]])
    turn = np.array([0.3, -2.0, 1.0])
    found = alignments.pairs(rows, columns).pinned_distance(pivot_a, pivot_b, turn)
    for k in range(3):
        c, s = np.cos(turn[k]), np.sin(turn[k])
        shift = pivot_a[k] - np.array([[c, -s], [s, c]]) @ pivot_b[k]
        plain = distance_under(a[rows[k]], b[columns[k]], np.array([*shift, turn[k]]))
        assert found[k] == pytest.approx(plain, abs=1e-6)


@pytest.mark.parametrize("threshold", [0.02, 0.05, 0.1, 10.0])
def test_stepped_rotation_range_brackets_the_closed_form(threshold: float) -> None:
    a = random_clouds(4, 1)
    b = a + np.random.default_rng(5).normal(scale=0.005, size=a.shape)
    alignments = align_all(a, b)
    pivot_a = np.array([[0.4, -0.3]])
    # Pinned where the best alignment puts it, so that the closed form of a fixed translation holds.
    turn = alignments.rotation[0, 0]
    c, s = np.cos(turn), np.sin(turn)
    shift = a[0, :, :2].mean(axis=0) - np.array([[c, -s], [s, c]]) @ b[0, :, :2].mean(axis=0)
    pivot_b = (np.linalg.inv([[c, -s], [s, c]]) @ (pivot_a[0] - shift))[None]
    zero = np.array([0])
    low, high = alignments.pairs(zero, zero).rotation_range(pivot_a, pivot_b, threshold)
    centered_a, centered_b = (x[0, :, :2] - x[0, :, :2].mean(axis=0) for x in (a, b))
    inertia = np.hypot(
        np.sum(centered_a * centered_b),
        np.sum(centered_b[:, 0] * centered_a[:, 1] - centered_b[:, 1] * centered_a[:, 0]),
    )
    points = a.shape[1]
    arm = points * np.sum((a[0, :, :2].mean(axis=0) - pivot_a[0]) ** 2)
    spare = points * (threshold**2 - alignments.distance[0, 0] ** 2)
    limit = np.arccos(np.clip(1.0 - spare / (2.0 * (inertia + arm)), -1.0, 1.0))
    expected = min(np.floor(limit / RANGE_STEP + 1e-9), RANGE_CAP) * RANGE_STEP
    assert high[0] == pytest.approx(expected, abs=1e-9)
    assert low[0] == pytest.approx(-expected, abs=1e-9)


def test_a_pair_over_the_threshold_has_no_range() -> None:
    a, b = random_clouds(6, 1), random_clouds(7, 1)
    zero, pivot = np.array([0]), np.zeros((1, 2))
    low, high = align_all(a, b).pairs(zero, zero).rotation_range(pivot, pivot, 0.01)
    assert (low[0], high[0]) == (0.0, 0.0)


def test_dummy_joints_are_left_out() -> None:
    skeleton = make_skeleton()
    names = {skeleton.names[j] for j in cloud_joints(skeleton)}
    assert names == set(skeleton.names) - {"LeftHipJoint", "RightHipJoint"}


def test_windows_use_neighbors_hold_the_ends_and_hold_standing_poses() -> None:
    clip = walk(steps=4)
    track = track_of(clip)
    joints = len(cloud_joints(clip.skeleton))
    last = clip.frame_count - 1
    at, standing = np.array([80, 80, last]), np.array([False, True, False])
    moving, stood, held = point_clouds(clip, track, at, standing).reshape(3, -1, joints, 3)
    assert np.linalg.norm(moving[0] - moving[-1], axis=-1).max() > 0.1
    assert np.allclose(moving[WINDOW_REACH], stood)
    assert np.allclose(held[WINDOW_REACH:], held[-1])


planar = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.2, 3.2))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 1000), move_a=planar, move_b=planar, points=st.integers(1, 8))
def test_distance_does_not_depend_on_where_the_clouds_are(
    seed: int, move_a: tuple[float, ...], move_b: tuple[float, ...], points: int
) -> None:
    a, b = random_clouds(seed, 1, points), random_clouds(seed + 1, 1, points)
    moved = [
        np.concatenate([transform_points(np.array(pose), x[0, :, :2]), x[0, :, 2:]], axis=1)[None]
        for pose, x in ((move_a, a), (move_b, b))
    ]
    before, after = align_all(a, b), align_all(*moved)
    assert after.distance[0, 0] == pytest.approx(before.distance[0, 0], abs=1e-5)
    zero, pivots = np.array([0]), np.zeros((1, 2))
    for turn in (0.0, 1.0, float(after.rotation[0, 0])):
        pinned = after.pairs(zero, zero).pinned_distance(pivots, pivots, np.array([turn]))
        assert pinned[0] >= after.distance[0, 0] - 1e-6
