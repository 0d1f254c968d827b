"""The kernels of deformed clips against their slow twins."""

import numpy as np
import pytest

from crowdsim.motion.clips.kinematics import forward_kinematics, rotate
from crowdsim.motion.deformed import body_kernels, plan_kernels
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip
from crowdsim.motion.deformed.phase_kernels import advance_phases, set_anchors
from crowdsim.motion.deformed.pose_kernels import pose_bodies
from crowdsim.motion.deformed.step_plan import StepPlan, plan_steps
from tests.reference.deformed_bodies import Body, advance, anchor_of, pose_one, upper_rotation
from tests.unit.motion.deformed.tracks import TRACKS, walk_clip

NAMES = ("brisk", "tight", "right", "diagonal", "stop_and_go")


@pytest.fixture(scope="module")
def clip() -> DeformedClip:
    return deform_clip(walk_clip())


@pytest.fixture(scope="module")
def twins(clip: DeformedClip) -> tuple[StepPlan, list[Body]]:
    tracks = [TRACKS[name][5:45] for name in NAMES]
    return plan_steps(clip, tracks), [Body(clip.model, track) for track in tracks]


def test_samples_and_drops_equal_the_twins(twins: tuple[StepPlan, list[Body]]) -> None:
    plan, bodies = twins
    for first, count, body in zip(plan.firsts, plan.counts, bodies, strict=True):
        assert np.allclose(plan.samples[first : first + count], body.samples, atol=2e-6)
    assert plan.samples[:, body_kernels.DROP].max() > 0.005


def test_prints_equal_the_twins(twins: tuple[StepPlan, list[Body]]) -> None:
    plan, bodies = twins
    for number, body in enumerate(bodies):
        rows = plan.steps[plan.rows[number] : plan.rows[number + 1]]
        assert plan.halves[number] == body.first_half
        assert len(rows) == body.last_half - body.first_half + 1
        expected = np.array([body.prints[half] for half in range(body.first_half, body.last_half + 1)])
        assert np.allclose(rows[:, :3], expected, atol=1e-5)


def test_swings_equal_the_twins(twins: tuple[StepPlan, list[Body]]) -> None:
    plan, bodies = twins
    body = bodies[0]
    for half in range(body.first_half + 5, body.last_half - 5):
        row = plan.steps[plan.rows[0] + half - body.first_half]
        for column, u, inside in ((plan_kernels.LIFT, 0.6, -0.01), (plan_kernels.LAND, 0.0, 0.01)):
            ankle, pitch, yaw, speed = body.end(half, u, inside)
            assert np.allclose(row[column : column + 5], [*ankle, pitch, yaw], atol=1e-5)
            assert np.allclose(row[column + 5 : column + 8], speed, atol=2e-3)


def test_poses_equal_the_twins(clip: DeformedClip, twins: tuple[StepPlan, list[Body]]) -> None:
    plan, bodies = twins
    model = clip.model
    numbers, times = np.repeat(np.arange(len(bodies)), 9), np.tile(np.linspace(0.3, 3.6, 9), len(bodies))
    roots, rotations = np.zeros((len(times), 3)), np.zeros((len(times), clip.skeleton.joint_count, 4))
    pose_bodies(model, plan, numbers, times, roots, rotations)
    places, world = forward_kinematics(clip.skeleton, roots, rotations)
    for k, (number, time) in enumerate(zip(numbers, times, strict=True)):
        expected = pose_one(bodies[number], float(time))
        assert np.allclose(roots[k], expected["root"], atol=2e-5)
        assert abs(np.sum(rotations[k, 0] * expected["turn"])) == pytest.approx(1.0, abs=1e-8)
        for foot in (0, 1):
            assert np.allclose(places[k, model.legs[foot, :3]], expected["legs"][foot], atol=1e-4)
            ahead = rotate(world[k, model.legs[foot, 2]], np.array([1.0, 0.0, 0.0]))
            yaw, pitch = expected["yaw"][foot], expected["pitch"][foot]
            level = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
            assert np.allclose(ahead, level, atol=1e-3)
            toes = rotate(world[k, model.legs[foot, 3]], np.array([1.0, 0.0, 0.0]))
            assert np.arcsin(toes[2]) == pytest.approx(pitch + expected["bend"][foot], abs=1e-3)
        track = bodies[number].at(float(time) + plan_kernels.PAD * 0.1)
        for upper, joint in enumerate(model.upper):
            turn = upper_rotation(model, upper, track[3], track[4], track[7])
            assert abs(np.sum(rotations[k, joint] * turn)) == pytest.approx(1.0, abs=1e-5)


def test_anchors_equal_the_twin() -> None:
    rng = np.random.default_rng(6)
    places, velocities = rng.normal(size=(300, 3)), rng.normal(size=(300, 2))
    velocities[:20] *= 1e-3
    velocities[:5], turns, phases = 0.0, rng.normal(size=300), rng.uniform(-1.0, 3.0, 300)
    turns[:30] *= 0.01
    anchors = np.full((300, 3), np.nan)
    set_anchors(places, velocities, turns, phases, anchors)
    expected = [anchor_of(*each) for each in zip(places, velocities, turns, phases, strict=True)]
    assert np.allclose(anchors, expected, atol=1e-12)
    assert np.array_equal(anchors[:5, :2], places[:5, :2])


def test_phases_equal_the_twin() -> None:
    rng = np.random.default_rng(4)
    phases, anchors = rng.uniform(0.0, 3.0, 400), rng.normal(size=(400, 3))
    places = anchors + rng.normal(size=(400, 3)) * rng.choice([0.0, 0.02, 0.3], (400, 1))
    velocities = rng.normal(size=(400, 2)) * rng.choice([0.0, 0.05, 0.2, 1.0], (400, 1))
    turns = rng.normal(size=400) * rng.choice([0.0, 0.05, 1.0], 400)
    expected = [
        advance(*each)
        for each in zip(places, velocities, turns, [0.1] * 400, phases.copy(), anchors.copy(), strict=True)
    ]
    advance_phases(places, velocities, turns, 0.1, phases, anchors)
    assert np.allclose(phases, [phase for phase, _ in expected], atol=1e-12)
    assert np.allclose(anchors, [anchor for _, anchor in expected])
