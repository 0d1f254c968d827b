"""Quality figures of played bodies of steered agents: foot drift, knee bend, smoothness of the pelvis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowdsim.motion.clips.kinematics import conjugate, multiply, rotate
from crowdsim.motion.deformed.body_kernels import HEEL_BACK, PHASE
from crowdsim.motion.deformed.plan_kernels import PAD
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.track_blocks import block_of

SOLE_DOWN, STANCE = 0.125, 0.599


@dataclass
class Played:
    """Poses of some agents at T times, nan while they are absent.

    Attributes
    ----------
    times : (T,) float64
        Times [s].
    roots : (T, A, 3) float64
        Root positions [m].
    balls, heels : (T, A, 2, 3) float64
        Positions of the feet [m].
    knees : (T, A, 2) float64
        Bend of the knees [degrees].
    phases : (T, A) float64
        Gait phases [cycles].
    toes : (T, A, 2) float64
        Angle by which the feet point up [rad].
    """

    times: np.ndarray
    roots: np.ndarray
    balls: np.ndarray
    heels: np.ndarray
    knees: np.ndarray
    phases: np.ndarray
    toes: np.ndarray


def played(recording: Recording, times: np.ndarray) -> Played:
    """Return the poses of all steered agents at ``times``."""
    poses = recording._steered_poses
    count = recording.agent_count
    roots, phases = np.full((len(times), count, 3), np.nan), np.full((len(times), count), np.nan)
    balls, heels = (np.full((len(times), count, 2, 3), np.nan) for _ in range(2))
    knees, toes = (np.full((len(times), count, 2), np.nan) for _ in range(2))
    for row, time in enumerate(times):
        frame, step = recording.at_time(time), recording.shown_step(time)
        agents = np.flatnonzero(frame.steered)
        if not len(agents):
            continue
        places, world = poses.pose(time, step, agents)
        block = poses._blocks[block_of(step, recording.steps_per_second)]
        bodies = block.tracks.bodies_at(step, agents)
        phases[row, agents] = _phases(block.plan(recording.gait_clips.walk), bodies, time - block.tracks.zeros[bodies])
        # All behaviors use the same legs.
        model = recording.gait_clips.walk.model
        roots[row, agents] = places[:, 0]
        for foot in (0, 1):
            hip, knee, ankle, toe = model.legs[foot]
            thigh, shank = places[:, knee] - places[:, hip], places[:, ankle] - places[:, knee]
            cosine = np.sum(thigh * shank, axis=1) / (model.bones[foot, 0] * model.bones[foot, 1])
            knees[row, agents, foot] = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
            balls[row, agents, foot] = places[:, toe]
            level = multiply(world[:, ankle], conjugate(model.turns[foot, 3]))
            heels[row, agents, foot] = places[:, ankle] + rotate(
                level, np.array([-HEEL_BACK, 0.0, -model.bones[foot, 3]])
            )
            toes[row, agents, foot] = np.arcsin(rotate(level, np.array([1.0, 0.0, 0.0]))[:, 2])
    return Played(times, roots, balls, heels, knees, phases, toes)


def slides(shown: Played) -> tuple[np.ndarray, np.ndarray]:
    """Return the movement to the next time of the point that a foot stands on [m], (T - 1, A, 2), nan if it swings.

    The point is the ball if the sole is down, the heel before. Also return the movement summed over the stance so far.
    """
    own = shown.phases[:, :, None] - np.array([0.0, 0.5])
    cycle, share = np.floor(own), own - np.floor(own)
    same = (cycle[1:] == cycle[:-1]) & (share[1:] < STANCE)
    flat = same & (share[:-1] >= SOLE_DOWN)
    lands = same & (share[1:] < SOLE_DOWN) & (shown.toes[:-1] > 0.01) & (shown.toes[1:] > 0.01)
    moved = np.linalg.norm(np.diff(shown.balls, axis=0), axis=-1)
    heel = np.linalg.norm(np.diff(shown.heels, axis=0), axis=-1)
    step = np.where(flat, moved, np.where(lands, heel, np.nan))
    from_first = np.zeros_like(step)
    # Sum over each stance.
    for row in range(len(step)):
        before = from_first[row - 1] if row else 0.0
        from_first[row] = np.where(flat[row], before + moved[row], 0.0)
    return step, from_first


def _phases(plan: object, bodies: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Return the phases of bodies of a plan, by the weights of its splines."""
    place = seconds / plan.step + PAD
    row = place.astype(int)
    u = place - row
    weights = np.array([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]) / 6.0
    first = plan.firsts[bodies]
    return sum(weights[k] * plan.samples[first + row + k - 1, PHASE] for k in range(4))
