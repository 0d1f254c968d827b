"""Samples of paths are those of the slow twin, to the last bit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowdsim.planning.labels.annotated_path import TANGENT_REACH, AnnotatedPath, Section, arc_lengths
from crowdsim.planning.labels.sample_kernels import sample_path
from tests.reference.path_samples import sampled


@st.composite
def paths(draw: st.DrawFn) -> AnnotatedPath:
    """Paths of a few pieces, some without length, in sections some of which are shorter than a step."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    steps = rng.uniform(-1.0, 1.0, (draw(st.integers(1, 8)), 2)) * rng.choice([0.0, 0.01, 0.3, 2.0], (1, 1))
    steps[rng.random(len(steps)) < 0.2] = 0.0
    points = np.concatenate([rng.uniform(-5.0, 5.0, (1, 2)), steps]).cumsum(axis=0)
    arc = arc_lengths(points)
    # Borders lie anywhere, or exactly at a sample.
    borders = np.sort(rng.choice([*rng.uniform(0.0, arc[-1], 4), *np.linspace(0.0, arc[-1], 5)[1:-1]], 3))
    bounds = [0.0, *borders.tolist(), float(arc[-1])]
    sections = tuple(Section(int(rng.integers(0, 3)), low, high) for low, high in pairwise(bounds))
    return AnnotatedPath(points, arc, sections, 1.0)


@given(paths(), st.sampled_from([0.1, 0.25, 0.7]))
def test_samples_are_those_of_the_slow_twin(path: AnnotatedPath, spacing: float) -> None:
    expected = sampled(path, spacing)
    for found, wanted in zip(path.sample(spacing), expected, strict=True):
        assert found.dtype == wanted.dtype
        assert np.array_equal(found, wanted)


@pytest.mark.parametrize("spacing", [0.1, 0.3])
def test_a_corner_is_smoothed_and_a_border_narrower(spacing: float) -> None:
    points = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]])
    path = AnnotatedPath(points, arc_lengths(points), (Section(2, 0.0, 3.0), Section(0, 3.0, 6.0)), 6.0)
    count = round(6.0 / spacing) + 1
    pose, arc, behavior = np.empty((count, 3)), np.empty(count), np.empty(count, np.int32)
    starts, labels = np.array([0.0, 3.0]), np.array([2, 0], np.int32)
    sample_path(points, path.arc, starts, labels, TANGENT_REACH, pose, arc, behavior)
    corner = round(3.0 / spacing)
    assert pose[corner] == pytest.approx([3.0, 0.0, np.pi / 4.0])
    assert pose[[0, -1], 2] == pytest.approx([0.0, np.pi / 2.0])
    assert behavior.tolist() == [2] * corner + [0] * (count - corner)
