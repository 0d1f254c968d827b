"""Plan of a synthesized motion: where and when the feet are put down.

A footprint is placed by the *body pose* it belongs to, a planar pose (x, y, heading) between the feet; the print is
half a step width to the side of it, the ankle a little behind, the toes a little out. Times are frames at
:data:`~crowdsim.constants.CAPTURE_RATE`, not always whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, sin
from crowdsim.geometry.planar import compose
from crowdsim.motion.synthesis.body import HIP_AHEAD
from crowdsim.motion.synthesis.styles import PLAIN, WALKING, Manner, Style

Floats = NDArray[np.float64]

LEFT, RIGHT = 0, 1
STANDING_HALF_WIDTH = 0.066
"""Distance from the middle to each ankle of a standing body [m]."""
TOE_OUT = np.radians(5.0)
"""Angle by which the toes point outward [rad]."""


@dataclass(frozen=True)
class Step:
    """The movement of one foot from a print to the next.

    side: LEFT or RIGHT. lift, land: frames. body: (3,) body pose that the new print belongs to; half_width: distance
    from it to the ankle, sideways [m].
    """

    side: int
    lift: float
    land: float
    body: Floats
    half_width: float

    @property
    def footprint(self) -> Floats:
        """Return the planar pose (3,) of the planted foot, at its ankle."""
        return footprint(self.side, self.body, self.half_width)


@dataclass(frozen=True)
class Hub:
    """A frame at which the body takes a pose shared by many motions: ``kind`` is "stand" or a gait's name.

    frame: whole number. body: (3,) body pose there; for a gait's hub, the one that the left print belongs to.
    """

    frame: int
    kind: str
    body: Floats


@dataclass
class Plan:
    """Steps in the order in which they land, from standing at ``start`` to standing.

    style, manner: how feet and body move. start: (3,) body pose, x, y [m], heading [rad]. hubs: in the order of their
    frames. frame_count: 0 until the plan is finished.
    """

    name: str
    style: Style = WALKING
    manner: Manner = PLAIN
    start: Floats = field(default_factory=lambda: np.zeros(3))
    steps: list[Step] = field(default_factory=list)
    hubs: list[Hub] = field(default_factory=list)
    frame_count: int = 0


def footprint(side: int, body: Floats, half_width: float) -> Floats:
    """Return the planar pose (3,) at the ankle of a foot planted for the body pose ``body`` (3,).

    side: LEFT or RIGHT. half_width: distance from the body pose to the ankle, sideways [m].
    """
    sign = 1.0 if side == LEFT else -1.0
    return compose(body, np.array([-HIP_AHEAD, sign * half_width, sign * TOE_OUT]))


def along_arc(body: Floats, length: float, turn: float) -> Floats:
    """Return the body pose (3,) that is ``length`` meters ahead of ``body`` on an arc that turns by ``turn`` [rad]."""
    half = 0.5 * turn
    chord = length * sin(half) / half if half != 0.0 else length
    return compose(body, np.array([chord * cos(half), chord * sin(half), turn]))


def mirrored(plan: Plan, name: str) -> Plan:
    """Return the motion with left and right exchanged; only for plans whose hubs all stand.

    The hubs of a gait are in a swing of the right foot, so they cannot be exchanged.
    """
    flip = np.array([1.0, -1.0, -1.0])
    return Plan(
        name=name,
        start=plan.start * flip,
        steps=[Step(1 - s.side, s.lift, s.land, s.body * flip, s.half_width) for s in plan.steps],
        hubs=[Hub(h.frame, h.kind, h.body * flip) for h in plan.hubs],
        frame_count=plan.frame_count,
        style=plan.style,
        manner=plan.manner,
    )
