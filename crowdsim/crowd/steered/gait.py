"""Visible state of steered agents after a step: phase of the gait, behavior, and whether they walk or wait."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.steered.components import Errand
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.deformed.phase_kernels import advance_phases
from crowdsim.recording.header import AgentState

STANDS_BELOW = 0.1
"""Speed below which an agent counts as waiting [m/s]."""


def walk_on(view: View, headings_before: NDArray[np.float64], asked: NDArray[np.float64]) -> None:
    """Advance phases and anchors of the gait by the step taken, and set behavior and state of all rows.

    ``view`` holds the columns of :mod:`crowdsim.crowd.steered.components`. ``headings_before`` (n,) are the headings
    before the step [rad]. ``asked`` (behaviors, 2) are the turn [rad] and the half length with arms held in [m] that
    each behavior prescribes, -1 for none.
    """
    rows = view.row
    # Without steered agents, the kernel is not even compiled, which shortens the first run of a small place.
    if not len(rows):
        return
    places = np.column_stack((rows["x"], rows["y"], rows["heading"]))
    velocities = np.column_stack((rows["vx"], rows["vy"]))
    turns = wrap_angle(rows["heading"] - headings_before) * STEERING_RATE
    advance_phases(places, velocities, turns, 1.0 / STEERING_RATE, view.phase, view.anchor)
    # The behavior is the one whose turn guidance prescribes, and that holds the arms in if guidance prescribes this. Of
    # several such, it is the widest; if there is none, it is the last, preferred one.
    view.behavior[:] = len(asked) - 1
    for number, (turn, held) in enumerate(asked[:-1]):
        view.behavior[(rows["turn"] == turn) & ((rows["held"] >= 0.0) == (held >= 0.0))] = number
    speed = hypot(rows["vx"], rows["vy"])
    state = np.where(speed < STANDS_BELOW, AgentState.WAITING, AgentState.MOVING)
    view.state[:] = np.where(view.errand == Errand.STAYS, AgentState.ARRIVED, state)
