"""Builds of bodies: how tall and how stout each agent is drawn. Nothing but drawing knows of them.

A stature stretches a posed body upward from the floor. Places on the floor stay, so that planted feet stay planted. A
girth moves skin and clothes outward by less than bodies keep from obstacles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.skeleton import Skeleton

STATURES = (0.985, 0.925, 1.03, 0.955, 1.0)
"""Heights, as multiples of the skeleton's."""
GIRTHS = (0.0, -0.007, 0.011)
"""How far skin lies outside that of an average body [m]: average, slim and stout."""
SHORTEST, TALLEST = 1.55, 1.9
"""Bounds of a drawn body's height [m], if its skeleton is within them."""

_ABOVE_HEAD = 0.23
"""Height of the top of the head above the joint of the head, of an adult [m]."""
_BELOW_BALL = 0.028
"""Thickness of a sole below the joint of the ball of the foot [m]."""


def builds_of(count: int, skeleton: Skeleton) -> NDArray[np.float32]:
    """Return (count, 2) the stature, a multiple of the skeleton's, and the girth [m] of each agent.

    Statures are limited to heights from SHORTEST to TALLEST, unless the skeleton itself is outside of these.
    """
    rest = skeleton.rest_positions()
    feet = min(float(rest[skeleton.joint(f"{side}_toe"), 2]) for side in ("left", "right"))
    height = float(rest[skeleton.joint("head"), 2]) + _ABOVE_HEAD - feet + _BELOW_BALL
    statures = np.array(STATURES)
    if SHORTEST <= height <= TALLEST:
        statures = np.clip(statures, SHORTEST / height, TALLEST / height)
    agent = np.arange(count)
    # The numbers of statures and girths have no common divisor, so that all combinations appear.
    builds = np.stack([statures[agent % len(STATURES)], np.array(GIRTHS)[agent % len(GIRTHS)]], axis=1)
    return builds.astype(np.float32)
