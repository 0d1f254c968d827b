"""Whatever track a body is given, it is posed or the track is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.errors import MotionError
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at
from tests.support.deformed_figures import figures_of
from tests.unit.motion.deformed.tracks import walk_clip, with_phase

CLIP = deform_clip(walk_clip())
SPEEDS = st.tuples(st.floats(-0.5, 1.6), st.floats(-0.6, 0.6), st.floats(-2.5, 2.5))


def track_of(changes: list[tuple[float, float, float]]) -> np.ndarray:
    """A track that goes over from one triple of speeds (ahead, sideways, turning) to the next within a second each."""
    knots = np.array([(0.0, 0.0, 0.0), *changes, (0.0, 0.0, 0.0)])
    at = np.arange(0.0, len(knots) - 1, 0.1)
    ahead, side, turn = (np.interp(at, np.arange(len(knots)), column) for column in knots.T)
    heading = np.cumsum(turn * 0.1)
    x = np.cumsum((ahead * np.cos(heading) - side * np.sin(heading)) * 0.1)
    y = np.cumsum((ahead * np.sin(heading) + side * np.cos(heading)) * 0.1)
    return with_phase(np.column_stack([x, y, heading]))


@settings(max_examples=40, deadline=None)
@given(st.lists(SPEEDS, min_size=1, max_size=6))
def test_feet_stay_and_legs_reach_on_any_track(changes: list[tuple[float, float, float]]) -> None:
    found = figures_of(CLIP, track_of(changes))
    assert found.drift <= 0.001
    assert found.knee[0] >= 5.0
    assert found.reach <= 0.997
    assert found.floor >= -0.01


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 3), st.floats(-1e4, 1e4), st.floats(-10.0, 10.0), st.floats(-3.0, 1e5), st.floats(-5.0, 5.0))
def test_tracks_of_a_few_samples_are_posed(count: int, place: float, heading: float, phase: float, time: float) -> None:
    track = np.tile([place, -place, heading, phase], (count, 1))
    roots, rotations = pose_at(CLIP, plan_steps(CLIP, [track]), np.zeros(1, np.int64), np.array([time]))
    assert np.isfinite(roots).all()
    assert np.allclose(np.linalg.norm(rotations, axis=-1), 1.0)
    assert np.abs(roots[0, :2] - [place, -place]).max() < 0.2


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 20), st.integers(0, 3), st.sampled_from([np.nan, np.inf, -np.inf, 1e6, -1e6]))
def test_what_is_not_finite_or_jumps_is_refused(row: int, column: int, value: float) -> None:
    track = track_of([(1.0, 0.0, 0.0), (1.0, 0.0, 0.0)])[:21]
    track[row, column] = value
    if column == 2 and np.isfinite(value):
        return
    with pytest.raises(MotionError):
        plan_steps(CLIP, [track])
