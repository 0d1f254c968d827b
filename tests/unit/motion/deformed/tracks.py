"""Tracks to deform clips to: made of speeds, with the phase that a simulation would give them."""

from __future__ import annotations

import numpy as np

from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import PLAIN
from crowdsim.motion.synthesis.synthesize import synthesize

STEP = 0.1


def walk_clip() -> Clip:
    """The default walk, a few cycles of it."""
    builder = PlanBuilder("walk", manner=PLAIN).start(PLAIN.normal)
    for _ in range(3):
        builder.cycle(PLAIN.normal)
    return synthesize(builder.stop().finish())


def with_phase(poses: np.ndarray) -> np.ndarray:
    """Poses (N, 3) with their phases, (N, 4)."""
    poses = np.asarray(poses, np.float64)
    phases, anchors = np.array([STAND]), poses[:1].copy()
    track = np.column_stack([poses, np.full(len(poses), STAND)])
    for row in range(1, len(poses)):
        moved = (poses[row] - poses[row - 1]) / STEP
        advance_phases(poses[row : row + 1], moved[None, :2], moved[2:], STEP, phases, anchors)
        track[row, 3] = phases[0]
    return track


def moving(ahead: float = 0.0, side: float = 0.0, turn: float = 0.0, seconds: float = 8.0) -> np.ndarray:
    """A track (N, 4) that stands, sets off within a second or so, goes on and stops again."""
    times = np.arange(0.0, seconds, STEP)
    rise = max(abs(ahead), abs(side), 0.5 * abs(turn), 0.3)
    share = np.clip(np.minimum(times - 1.0, seconds - 1.5 - times) / rise, 0.0, 1.0)
    heading = np.cumsum(turn * share * STEP)
    middle = heading - 0.5 * turn * share * STEP
    x = np.cumsum((ahead * np.cos(middle) - side * np.sin(middle)) * share * STEP)
    y = np.cumsum((ahead * np.sin(middle) + side * np.cos(middle)) * share * STEP)
    return with_phase(np.column_stack([x, y, heading]))


def stop_and_go(seconds: float = 12.0) -> np.ndarray:
    """A track (N, 4) that walks off and stops every five seconds."""
    times = np.arange(0.0, seconds, STEP)
    speed = np.clip(0.6 - 0.7 * np.cos(times * 2.0 * np.pi / 5.0), 0.0, 1.3)
    return with_phase(np.column_stack([np.cumsum(speed * STEP), 0.0 * times, 0.0 * times]))


TRACKS = {
    "slow": moving(0.2),
    "walk": moving(0.8),
    "brisk": moving(1.6),
    "curve": moving(1.2, turn=0.8),
    "tight": moving(0.6, turn=1.5),
    "side": moving(side=0.5),
    "right": moving(side=-0.5),
    "back": moving(-0.5),
    "turn": moving(turn=2.5),
    "diagonal": moving(0.6, side=0.4),
    "stop_and_go": stop_and_go(),
}
