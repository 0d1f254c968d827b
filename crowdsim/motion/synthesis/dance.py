"""Steps of a dance on the spot: to the sides and back, in a square, and around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, sin
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, Plan, mirrored
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import DANCING, Style

Floats = NDArray[np.float64]

_ON_THE_SPOT = Style(6.0, 2.0, 0.45, 0.03)
"""Feet are set down softly, and the weight shifts fully over each."""
_SWING = 19.0
_BEAT = 5.0
"""Frames of a swing (_SWING), and frames between a landing and the next lift-off."""


def _at(x: float, y: float, degrees: float = 0.0) -> Floats:
    """Return the body pose at (x, y) [m] with a heading [degrees]."""
    return np.array([x, y, np.radians(degrees)])


def _steps(name: str, places: list[tuple[int, Floats]]) -> Plan:
    """Return a plan of steps, each of a foot to a body pose."""
    return PlanBuilder(name, _ON_THE_SPOT, DANCING).steps(places, _SWING, _BEAT).finish()


def _side_to_side(name: str) -> Plan:
    """Plan a step to the left, to which the right foot closes, and the same back to the right."""
    aside, here = _at(0.0, 0.32), _at(0.0, 0.0)
    return _steps(name, [(LEFT, aside), (RIGHT, aside), (RIGHT, here), (LEFT, here)])


def _square(name: str) -> Plan:
    """Plan steps ahead, to the left, back, and to the right again."""
    corners = [_at(0.28, 0.0), _at(0.28, 0.26), _at(0.0, 0.26), _at(0.0, 0.0)]
    first = [(RIGHT, 0), (LEFT, 0), (LEFT, 1), (RIGHT, 1), (RIGHT, 2), (LEFT, 2), (RIGHT, 3), (LEFT, 3)]
    return _steps(name, [(side, corners[corner]) for side, corner in first])


def _around(name: str) -> Plan:
    """Plan one turn to the left, on a small circle."""
    places: list[tuple[int, Floats]] = []
    for part in range(1, 7):
        angle = np.radians(60.0 * part)
        body = np.array([0.2 * sin(angle), 0.2 * (1.0 - cos(angle)), angle])
        places += [(LEFT, body), (RIGHT, body)]
    return _steps(name, places)


def dance_plans() -> list[Plan]:
    """Return the plans of all dance steps, both ways."""
    plans = [_side_to_side("dance_sway_left"), _square("dance_square_left"), _around("dance_around_left")]
    return [*plans, *(mirrored(plan, plan.name.replace("left", "right")) for plan in plans)]
