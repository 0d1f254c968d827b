"""Guidance of steered agents at their places: straight to the spot, slower near it, and turning or standing there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.geometry.planar import wrap_angle

TURNED_OFF = 0.1
"""Angle to the prescribed heading above which a standing agent turns [rad]."""

_SLOWING = 2.0
"""Largest speed of an agent near its spot, per meter of the distance to it [1/s]."""

_SLOWEST = 0.2
"""Speed of an agent in the last steps to its spot [m/s]."""

Floats = NDArray[np.float64]
"""Array of float64."""


def stop(state: NDArray[Any], rows: NDArray[np.int64]) -> None:
    """Remove the guidance of rows (k,): set gx, gy and togo to 0, turn and held to -1 (nothing is prescribed)."""
    state["gx"][rows] = state["gy"][rows] = state["togo"][rows] = 0.0
    state["turn"][rows] = state["held"][rows] = -1.0


def turn(state: NDArray[Any], rows: NDArray[np.int64], headings: Floats) -> NDArray[np.bool_]:
    """Let rows (k,) turn on the spot to headings (k,) [rad], nan for any; return which rows still turn, (k,).

    The heading becomes their guidance, and their free speed 0: so the body turns to it, and does not move.
    """
    off = np.abs(wrap_angle(headings - state["heading"][rows])) > TURNED_OFF
    turns = rows[off]
    state["gx"][turns], state["gy"][turns] = cos(headings[off]), sin(headings[off])
    state["speed"][turns] = 0.0
    return np.asarray(off)


def lead(view: View, rows: NDArray[np.int64]) -> Floats:
    """Lead rows (k,) straight to their spots, slower near them; return their distances (k,) [m]."""
    state: NDArray[Any] = view.row
    dx, dy = view.stand[rows, 0] - state["x"][rows], view.stand[rows, 1] - state["y"][rows]
    distance: Floats = hypot(dx, dy)
    far = np.maximum(distance, 1e-9)  # at the spot itself there is no direction
    state["gx"][rows], state["gy"][rows], state["togo"][rows] = dx / far, dy / far, distance
    # No section prescribes an angle between heading and way [rad], or arms held in [m]: -1.
    state["turn"][rows] = state["held"][rows] = -1.0
    state["speed"][rows] = speed_near(distance, view.pace[rows])
    return distance


def speed_near(distance: Floats, speed: Floats) -> Floats:
    """Return speeds (k,) [m/s] that fall as the distances (k,) [m] to spots do; at most ``speed`` (k,) [m/s]."""
    return np.minimum(speed, np.maximum(_SLOWING * distance, _SLOWEST))
