"""The error image against single distances, and its valleys against a plain search."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.motion.analysis.error_image import VALLEY_REACH, ErrorImage, error_image, valleys
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.frame_distance import WINDOW_REACH, align_all, align_pairs, point_clouds
from tests.reference.motion_distance import deepest_valleys
from tests.unit.motion.walker import walk


def clouds(clip: Clip) -> np.ndarray:
    frames = np.arange(clip.frame_count)
    return point_clouds(clip, track_of(clip), frames, np.zeros(len(frames), bool))


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    return [walk(steps=4, name="straight"), walk(steps=5, turn=0.6, name="left"), walk(steps=2, name="short")]


@pytest.fixture(scope="module")
def image(clips: list[Clip]) -> ErrorImage:
    return error_image(clips)


def test_every_entry_is_the_distance_of_its_two_moments(clips: list[Clip], image: ErrorImage) -> None:
    every = np.concatenate([clouds(clip) for clip in clips])[::7]
    single = align_all(every, every).distance
    assert image.distance[::7, ::7] == pytest.approx(single, abs=2e-6)
    assert image.clip_first.tolist() == np.cumsum([0, *(clip.frame_count for clip in clips)]).tolist()


def test_the_image_is_symmetric_with_nothing_on_its_diagonal(image: ErrorImage) -> None:
    assert (image.distance == image.distance.T).all()
    assert not image.distance.diagonal().any()
    assert np.isfinite(image.distance).all()


def test_the_image_does_not_depend_on_where_a_clip_was_captured(clips: list[Clip], image: ErrorImage) -> None:
    far = [Clip(c.name, c.skeleton, c.root_positions + np.array([40.0, -90.0, 0.0]), c.rotations) for c in clips]
    assert error_image(far).distance == pytest.approx(image.distance, abs=2e-6)


def test_a_clip_shorter_than_a_window_has_an_image() -> None:
    long = walk(steps=2)
    short = Clip("short", long.skeleton, long.root_positions[:3], long.rotations[:3])
    assert error_image([short, long]).distance.shape == (3 + long.frame_count,) * 2
    rows, _ = valleys(error_image([short]), 1.0)
    assert len(rows) == 0


@pytest.mark.parametrize("threshold", [0.02, 0.06, 0.2])
def test_valleys_are_those_of_a_plain_search(image: ErrorImage, threshold: float) -> None:
    rows, columns = valleys(image, threshold)
    assert len(rows)
    found = list(zip(rows.tolist(), columns.tolist(), strict=True))
    assert found == deepest_valleys(image.distance, image.clip_first, threshold, WINDOW_REACH, VALLEY_REACH)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10_000), lengths=st.lists(st.integers(1, 40), min_size=1, max_size=3), steps=st.integers(1, 30)
)
def test_valleys_of_any_symmetric_image_with_ties(seed: int, lengths: list[int], steps: int) -> None:
    first = np.concatenate([[0], np.cumsum(lengths)])
    noise = np.random.default_rng(seed).integers(0, steps, (first[-1], first[-1]))
    distance = np.minimum(noise, noise.T).astype(np.float32)
    np.fill_diagonal(distance, 0.0)
    rows, columns = valleys(ErrorImage(distance, first), steps / 2)
    found = list(zip(rows.tolist(), columns.tolist(), strict=True))
    assert found == deepest_valleys(distance, first, steps / 2, WINDOW_REACH, VALLEY_REACH)


def test_pairs_are_aligned_as_in_the_whole_table(clips: list[Clip]) -> None:
    a, b = clouds(clips[0])[::20], clouds(clips[1])[::30]
    rows, columns = np.array([0, 2, 1]), np.array([1, 0, 3])
    table, pairs = align_all(a, b).pairs(rows, columns), align_pairs(a[rows], b[columns])
    for name in ("distance", "rotation", "dot", "cross", "fixed", "mean_a", "mean_b"):
        assert getattr(pairs, name) == pytest.approx(getattr(table, name), abs=1e-9), name
