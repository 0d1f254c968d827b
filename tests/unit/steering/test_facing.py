"""Where agents face: those whose way leads behind them turn before they walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crowdsim.jit import kernel
from crowdsim.steering.decide_kernels import WANTED
from crowdsim.steering.direction_kernels import turn_first
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.rules import Rules
from tests.reference import steering_reference as reference


@kernel
def _turn_first(mine, rules, ux, uy, speed, want):
    return turn_first(mine, rules, ux, uy, speed, want)


def test_agents_that_face_away_turn_first():
    mine, want = np.zeros(1, ROW), np.zeros(1, WANTED)
    mine["speed"] = 1.3
    for off in np.radians(np.arange(0.0, 181.0, 5.0)):
        mine["hx"], mine["hy"], want["facing_x"], want["facing_y"] = math.cos(off), math.sin(off), 0.0, 0.0
        for wanted in (0.0, 0.2, 0.9, 1.3):
            found = _turn_first(mine[0], Rules(), 1.0, 0.0, wanted, want[0])
            assert found == pytest.approx(reference.speed_in_turn(wanted, 1.3, Rules().backward, math.cos(off)))
        # It turns to its way, wherever it moves.
        assert (want["facing_x"][0], want["facing_y"][0]) == ((1.0, 0.0) if math.cos(off) < -0.17 else (0.0, 0.0))
