"""Styles of motion: speeds, bounce, arms and head of plain walking, and of other moods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from crowdsim.errors import MotionError


class Style(NamedTuple):
    """Movement of feet and body in short steps.

    soft: frames over which a heel rises from standing before its foot lifts, or comes down after its foot has closed;
    slowing: frames in which that rise slows down again before the foot lifts, so that it stays low in its swing;
    sway: how far the body shifts over the foot that carries it, from 0 (not at all) to 1 (fully);
    raised: height to which even the shortest step lifts its foot [m].
    """

    soft: float
    slowing: float
    sway: float
    raised: float


WALKING = Style(11.0, 0.0, 0.52, 0.035)
SIDE_STEPPING = Style(4.5, 2.0, 0.2, 0.0)
"""Side steps follow one another briskly, carried by their momentum, on feet that skim the floor."""


@dataclass(frozen=True)
class Gait:
    """A steady walk.

    stride: length of a cycle [m]. cycle, swing: frames of a cycle, and of one foot's swing in it. half_width: distance
    from the path to an ankle [m].
    """

    name: str
    stride: float
    cycle: int
    swing: float
    half_width: float

    @property
    def double_support(self) -> float:
        """Return the frames with both feet on the floor, twice a cycle."""
        return self.cycle / 2.0 - self.swing


@dataclass(frozen=True)
class Manner:
    """Movement of a body beyond its footsteps; the defaults are plain walking.

    normal, slow, brisk: its gaits.
    lift: additional height of feet in their swing [m]. crouch: how much lower the pelvis is all the time [m].
    bounce: factor on how far the pelvis sinks between steps. sway: factor on how far it shifts over the carrying foot.
    pelvis_yaw, trunk_yaw, arm_swing, elbow_swing: angle per distance between the feet, ahead [rad/m].
    pelvis_roll, trunk_roll, head_roll: angle over the carrying foot [rad]. lean: angle ahead per speed [rad s/m].
    elbow, arm_out, arm_twist: angles at rest [rad]: the elbow's bend, how far the upper arm stands off the trunk, and
    its turn about itself (negative turns a bent forearm up).
    wave: angle by which the arm over the carrying foot goes up and the other one down [rad]. head_pitch: nod [rad].
    """

    name: str
    normal: Gait
    slow: Gait
    brisk: Gait
    lift: float = 0.0
    crouch: float = 0.0
    bounce: float = 1.0
    sway: float = 1.0
    pelvis_yaw: float = 0.125
    pelvis_roll: float = 0.075
    trunk_yaw: float = 0.14
    trunk_roll: float = 0.02
    lean: float = 0.022
    arm_swing: float = 0.50
    elbow: float = 0.22
    elbow_swing: float = 0.22
    arm_out: float = float(np.radians(8.5))
    arm_twist: float = 0.35
    wave: float = 0.0
    head_pitch: float = 0.03
    head_roll: float = 0.0

    def gait(self, name: str) -> Gait:
        """Return the gait called ``name``."""
        return next(gait for gait in (self.normal, self.slow, self.brisk) if gait.name == name)


NORMAL = Gait("normal", 1.40, 67, 25.5, 0.043)
SLOW = Gait("slow", 1.18, 78, 28.5, 0.047)
BRISK = Gait("brisk", 1.60, 62, 24.5, 0.040)

PLAIN = Manner("default", NORMAL, SLOW, BRISK)

HAPPY = Manner(
    "happy",
    Gait("normal", 1.38, 60, 23.0, 0.048),
    Gait("slow", 1.18, 68, 25.5, 0.050),
    Gait("brisk", 1.56, 56, 22.0, 0.045),
    lift=0.03,
    bounce=1.6,
    sway=1.25,
    pelvis_yaw=0.15,
    pelvis_roll=0.10,
    trunk_yaw=0.22,
    trunk_roll=0.045,
    lean=-0.01,
    arm_swing=0.85,
    elbow=0.45,
    elbow_swing=0.45,
    arm_out=float(np.radians(14.0)),
    head_pitch=-0.10,
    head_roll=0.04,
)
"""Quick and springy: more up and down, higher knees, wide arm swing, chest open and head up."""

DANCING = Manner(
    "dance",
    Gait("normal", 1.00, 68, 26.0, 0.065),
    Gait("slow", 0.84, 76, 28.0, 0.070),
    Gait("brisk", 1.14, 62, 24.0, 0.060),
    lift=0.03,
    bounce=1.6,
    sway=1.5,
    pelvis_yaw=0.20,
    pelvis_roll=0.13,
    trunk_yaw=0.30,
    trunk_roll=0.13,
    lean=0.0,
    arm_swing=0.25,
    elbow=1.35,
    elbow_swing=0.3,
    arm_out=float(np.radians(52.0)),
    arm_twist=-1.4,
    wave=0.38,
    head_pitch=-0.04,
    head_roll=-0.08,
)
"""Short swaying steps with raised arms that wave from side to side."""

MANNERS = {manner.name: manner for manner in (PLAIN, HAPPY, DANCING)}
"""All manners by the names of their motion sets."""

DEFAULT_SET = PLAIN.name
"""The motion set whose clips are in the behaviors' folders; others are synthesized on demand."""


def find_manner(motion_set: str) -> Manner:
    """Return the manner of the motion set called ``motion_set``; raise MotionError with the names if there is none."""
    try:
        return MANNERS[motion_set]
    except KeyError:
        raise MotionError(f"no motion set is called '{motion_set}'; there are {', '.join(MANNERS)}") from None
