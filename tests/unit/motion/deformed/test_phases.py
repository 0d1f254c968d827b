"""The phase of a step: cadence by speed, and stands with both feet on the floor."""

import numpy as np
import pytest

from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases
from tests.unit.motion.deformed.tracks import STEP, TRACKS, moving, stop_and_go, with_phase


def rate_at(ahead: float, side: float = 0.0, turn: float = 0.0) -> float:
    """Cycles a second in the middle of a swing."""
    phases, anchors = np.array([0.3]), np.zeros((1, 3))
    advance_phases(np.zeros((1, 3)), np.array([[ahead, side]]), np.array([turn]), STEP, phases, anchors)
    return float(phases[0] - 0.3) / STEP


def test_cadence_lies_in_the_measured_bands() -> None:
    # 1.2 to 1.3 m/s: 106 to 109 steps a minute, strides of 1.31 to 1.46 m; about 1 m/s: 95 to 107.
    for speed, low, high in ((1.25, 106.0, 109.0), (1.0, 94.0, 107.0), (1.6, 118.0, 138.0)):
        assert low <= 120.0 * rate_at(speed) <= high
    assert 1.31 <= 1.25 / rate_at(1.25) <= 1.46


def test_cadence_grows_with_every_speed_without_jumps() -> None:
    for speeds in (
        [(v, 0.0, 0.0) for v in np.linspace(0.55, 2.2, 100)],
        [(0.0, v, 0.0) for v in np.linspace(0.1, 1.0, 100)],
        [(0.0, 0.0, w) for w in np.linspace(0.3, 3.0, 100)],
    ):
        rates = np.diff([rate_at(*each) for each in speeds])
        assert rates.min() >= -1e-12
        assert rates.max() < 0.03


def test_turning_left_and_right_are_alike_and_fast_turns_take_more_steps() -> None:
    assert rate_at(0.0, turn=2.5) == rate_at(0.0, turn=-2.5)
    assert 2.5 / rate_at(0.0, turn=2.5) < np.radians(110.0)


def test_going_at_an_angle_to_the_chest_is_walking_ahead() -> None:
    assert rate_at(0.9, side=0.5) == pytest.approx(rate_at(np.hypot(0.9, 0.5)), rel=0.01)


def test_whoever_stands_keeps_its_phase() -> None:
    track = moving(seconds=5.0)
    assert (track[:, 3] == STAND).all()


def test_whoever_stops_stands_with_both_feet_under_it() -> None:
    for name in ("walk", "brisk", "side", "back", "turn"):
        end = TRACKS[name][-1, 3]
        assert (2.0 * end) % 1.0 == pytest.approx(2.0 * STAND, abs=1e-9), name
        assert TRACKS[name][-4, 3] == end, name


def test_a_creep_of_centimeters_is_stood_and_one_of_more_is_stepped() -> None:
    still = with_phase(np.column_stack([np.linspace(0.0, 0.02, 40), np.zeros((40, 2))]))
    assert still[-1, 3] == STAND
    creeping = with_phase(np.column_stack([np.linspace(0.0, 0.3, 60), np.zeros((60, 2))]))
    assert creeping[-1, 3] > 1.0


def test_phases_never_go_back() -> None:
    for track in [*TRACKS.values(), stop_and_go(30.0)]:
        assert np.diff(track[:, 3]).min() >= 0.0


def test_a_phase_does_not_depend_on_who_else_is_advanced() -> None:
    rng = np.random.default_rng(2)
    places, velocities, turns = rng.normal(size=(30, 3)), rng.normal(size=(30, 2)), rng.normal(size=30)
    phases, anchors = rng.uniform(0.0, 2.0, 30), rng.normal(size=(30, 3))
    alone = phases[7:8].copy(), anchors[7:8].copy()
    advance_phases(places, velocities, turns, STEP, phases, anchors)
    advance_phases(places[7:8], velocities[7:8], turns[7:8], STEP, *alone)
    assert alone[0][0] == phases[7]
    assert np.array_equal(alone[1][0], anchors[7])


def test_nobody_to_advance_is_fine() -> None:
    advance_phases(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0), STEP, np.zeros(0), np.zeros((0, 3)))


def test_who_is_nudged_while_it_waits_takes_no_step() -> None:
    times = np.arange(0.0, 6.0, STEP)
    nudged = with_phase(
        np.column_stack([0.03 * np.sin(5.0 * times), 0.02 * np.cos(4.0 * times), 0.1 * np.sin(3 * times)])
    )
    assert np.ptp(nudged[:, 3]) == 0.0


def test_who_sets_off_hard_takes_a_quick_first_step() -> None:
    times = np.arange(0.0, 4.0, STEP)
    speed = np.clip(2.5 * (times - 1.0), 0.0, 1.4)
    hard = with_phase(np.column_stack([np.cumsum(speed * STEP), 0.0 * times, 0.0 * times]))
    gone = hard[np.searchsorted(hard[:, 3], 0.6), 0]
    # The foot that stayed behind lifts after half a meter; at the cadence of its speed that would be 0.7 m.
    assert 0.3 < gone < 0.62
    # Steady walking is as it was.
    assert np.diff(hard[-10:, 3]) == pytest.approx(0.1 * rate_at(1.4))
