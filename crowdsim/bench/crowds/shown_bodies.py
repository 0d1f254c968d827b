"""Frames per second of a large crowd: all steps of all agents, and the poses of the bodies in view."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.bench.crowds.whole_runs import square_scenario
from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip
from crowdsim.motion.deformed.live_bodies import LiveBodies
from crowdsim.scenario.loader import parse_scenario

FRAMES_A_STEP = 3
"""Frames between two steps, at 30 frames per second."""

STEPS = 60
"""Number of timed steps, after twice as many that are not timed: half of these without bodies, half with them."""


def frames_a_second(simulated: int, posed: int) -> float:
    """Return frames per second of ``simulated`` agents at 0.25 /m2, with ``posed`` bodies posed in every frame.

    One thread steps the crowd while another poses bodies, FRAMES_A_STEP times in each step. From 30 frames per second
    on, both keep up with real time. Drawing is not included.
    """
    clips = gait_clips(load_behavior_set(("lateral", "arm_constrained", "frontal"), [(0.0, 2.0)]))
    clip = deform_clip(clips[-1])
    scenario = parse_scenario(square_scenario(simulated, 0.25))
    with Simulation(scenario, workers=1) as simulation, ThreadPoolExecutor(1) as viewer:
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        for _ in range(STEPS):
            simulation.step()
        bodies = LiveBodies(clip, _samples(crowd, posed))
        times = []
        for _ in range(2 * STEPS):
            begin = time.perf_counter()
            shown = viewer.submit(_show, bodies, clip, _samples(crowd, posed))
            simulation.step()
            shown.result()
            times.append(time.perf_counter() - begin)
    return FRAMES_A_STEP / float(np.mean(times[STEPS:]))


def _show(bodies: LiveBodies, clip: DeformedClip, samples: NDArray[np.float64]) -> None:
    """Take in the ``samples`` (n, 4) of a step, see :func:`_samples`, and pose all bodies for its frames."""
    bodies.add(samples)
    for frame in range(FRAMES_A_STEP):
        roots, rotations = bodies.pose(frame / FRAMES_A_STEP / STEERING_RATE)
        forward_kinematics(clip.skeleton, roots, rotations)


def _samples(crowd: SteeredCrowd, posed: int) -> NDArray[np.float64]:
    """Return (posed, 4) x, y [m], heading [rad] and phase [cycles] of the first agents."""
    view = crowd.world.view()
    rows = view.row[:posed]
    return np.column_stack((rows["x"], rows["y"], rows["heading"], view.phase[:posed]))
