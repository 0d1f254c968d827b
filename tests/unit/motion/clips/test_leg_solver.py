"""Legs that reach for a place."""

import numpy as np
import pytest

from crowdsim.motion.clips.kinematics import about_axis, multiply, rotate, rotation_vectors, turns_of
from crowdsim.motion.clips.leg_solver import Leg, bend_legs, missing_height, raised_heels, stretch

THIGH, SHANK = 0.42, 0.41
DOWN = np.array([0.0, 0.0, -1.0])
Y = np.array([0.0, 1.0, 0.0])


def legs(hip_pitch, knee, yaw=0.0):
    """Legs whose thighs swing ahead by ``hip_pitch`` and knees bend by ``knee`` radians, all turned by ``yaw``."""
    hip_pitch, knee, yaw = np.broadcast_arrays(*np.atleast_1d(hip_pitch, knee, yaw))
    turned = about_axis(np.array([0.0, 0.0, 1.0]), yaw)
    thigh = multiply(turned, about_axis(Y, -hip_pitch))
    shank = multiply(thigh, about_axis(Y, knee))
    hips = np.tile([0.1, -0.2, 0.9], (len(thigh), 1))
    knees = hips + rotate(thigh, THIGH * DOWN)
    return Leg(hips, knees, knees + rotate(shank, SHANK * DOWN), thigh, shank, rotate(turned, Y))


def ankles_of(leg, thigh, shank):
    """Where the rotations of thigh and shank bring the ankles; bones lie down in their joints."""
    return leg.hips + rotate(thigh, THIGH * DOWN) + rotate(shank, SHANK * DOWN)


def knees_of(leg, thigh):
    return leg.hips + rotate(thigh, THIGH * DOWN)


def test_ankles_come_to_their_targets_and_knees_stay_ahead():
    rng = np.random.default_rng(1)
    leg = legs(rng.uniform(-0.4, 0.6, 400), rng.uniform(0.0, 1.5, 400), rng.uniform(-3.0, 3.0, 400))
    targets = leg.ankles + rng.uniform(-0.1, 0.1, (400, 3))
    far = np.linalg.norm(targets - leg.hips, axis=1)
    reached = far < 0.99 * (THIGH + SHANK)
    thigh, shank = bend_legs(leg, targets, np.full(400, 0.9965))
    assert np.abs(ankles_of(leg, thigh, shank) - targets)[reached].max() < 1e-9
    # In the frame of the leg the knee stays before the line from hip to ankle.
    line = ankles_of(leg, thigh, shank) - leg.hips
    ahead = np.sum(np.cross(knees_of(leg, thigh) - leg.hips, line) * leg.hinges, axis=1)
    assert ahead.min() > -1e-9


def test_a_leg_that_is_where_it_should_be_stays_as_it_is():
    leg = legs([0.1, 0.3, -0.3], [0.2, 1.0, 0.1], 0.7)
    thigh, shank = bend_legs(leg, leg.ankles, np.ones(3))
    assert np.abs(rotation_vectors(multiply(thigh, leg.thighs * [1, -1, -1, -1]))).max() < 1e-9
    assert np.abs(rotation_vectors(multiply(shank, leg.shanks * [1, -1, -1, -1]))).max() < 1e-7


def test_straight_and_overstretched_knees_bend_forward():
    for knee in (0.0, -0.05):
        leg = legs(0.0, knee)
        thigh, shank = bend_legs(leg, leg.ankles + [0.0, 0.0, 0.1], np.ones(1))
        assert ankles_of(leg, thigh, shank) == pytest.approx(leg.ankles + [0.0, 0.0, 0.1], abs=1e-9)
        assert knees_of(leg, thigh)[0, 0] > leg.hips[0, 0] + 0.05


def test_a_leg_that_does_not_reach_points_to_its_target():
    leg = legs(0.2, 0.4)
    target = leg.hips + [0.5, 0.0, -0.9]
    thigh, shank = bend_legs(leg, target, np.array([0.99]))
    way = ankles_of(leg, thigh, shank) - leg.hips
    assert np.linalg.norm(way) == pytest.approx(0.99 * (THIGH + SHANK))
    assert np.cross(way, target - leg.hips) == pytest.approx(0.0, abs=1e-9)


def test_the_height_that_is_missing_lets_a_leg_reach():
    leg = legs(0.0, 0.3)
    target = leg.ankles + [0.3, 0.0, 0.0]
    down = missing_height(leg, target, np.array([0.98]))
    assert down[0] > 0.0
    lower = leg._replace(hips=leg.hips - [0.0, 0.0, down[0]])
    assert np.linalg.norm(target - lower.hips) == pytest.approx(0.98 * (THIGH + SHANK))
    assert missing_height(leg, leg.ankles, np.ones(1))[0] < 0.0
    assert stretch(legs(0.0, 0.0)) == pytest.approx(1.0)


def feet(leg, back):
    """Balls of feet 0.14 m long, whose ankles are where legs have them ``back`` meters behind the hip, and the way."""
    targets = leg.hips + np.array([-back, 0.0, -np.sqrt(0.82**2 - back**2)])
    return targets + [0.12, 0.0, -0.07], targets


def test_heels_rise_until_legs_reach():
    leg = legs(-0.4, 0.1)
    # The hip has gone 0.3 m beyond the ankle; the leg is to reach 0.98 of its length, 7 mm less than the way.
    balls, targets = feet(leg, 0.3)
    turn = raised_heels(leg, balls, targets, np.array([0.98]))
    raised = balls + rotate(turn, targets - balls)
    assert np.linalg.norm(raised - leg.hips) == pytest.approx(0.98 * (THIGH + SHANK))
    assert raised[0, 2] > targets[0, 2] + 0.005
    # About the axis across the foot, toes down.
    assert rotation_vectors(turn)[0, [0, 2]] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < rotation_vectors(turn)[0, 1] < 0.3


def test_heels_stay_if_legs_reach_or_have_not_passed_or_there_is_no_foot():
    leg = legs(-0.4, 0.1)
    for back, most, foot in ((0.3, 0.99, 1.0), (-0.3, 0.98, 1.0), (0.3, 0.98, 0.0)):
        balls, targets = feet(leg, back)
        turn = raised_heels(leg, targets + foot * (balls - targets), targets, np.array([most]))
        assert turn == pytest.approx(np.array([[1.0, 0.0, 0.0, 0.0]]))
    # And never by more than half a radian.
    balls, targets = feet(leg, 0.3)
    turn = raised_heels(leg, balls, targets, np.array([0.8]))
    assert np.linalg.norm(rotation_vectors(turn)) == pytest.approx(0.5)


def test_rotation_vectors_are_those_of_their_rotations():
    rng = np.random.default_rng(2)
    vectors = rng.normal(size=(200, 3)) * rng.choice([0.0, 1e-12, 1e-5, 1.0], (200, 1))
    vectors *= np.minimum(1.0, 3.1 / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))
    turns = turns_of(vectors)
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(rotation_vectors(turns), vectors, atol=1e-9)
    np.testing.assert_allclose(rotation_vectors(-turns), vectors, atol=1e-9)
