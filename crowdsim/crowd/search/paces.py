"""How fast each character plays its plan, so that it walks at a speed of its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST, Playback
from crowdsim.geometry.elementary import hypot

_STEADY = 0.7
"""Share of the natural speed from which a node shows somebody who walks, and neither sets off nor comes to rest."""

_WINDOW = 4
"""Nodes over which a character has its own speed: two strides or more."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Paces:
    """Rates at which n characters play their plans where nothing is in their way: as captured, unless told otherwise.

    speeds: (n,) float64, at which each walks straight on [m/s], nan for that of the motion.
    """

    def __init__(self, assets: Assets, count: int) -> None:
        graph = assets.graph
        tracks = graph.tracks[:, :2]
        steps = tracks[1:] - tracks[:-1]
        ways = np.concatenate([[0.0], np.cumsum(hypot(steps[:, 0], steps[:, 1]))])
        first = graph.node_track.astype(np.int64)
        self._lengths: Floats = ways[first + graph.node_frames] - ways[first]
        self._seconds: Floats = graph.node_frames / CAPTURE_RATE
        self._preferred = graph.node_behavior == len(assets.behaviors) - 1
        self._steady = np.zeros(len(first), np.bool_)
        self._natural_speed = np.inf
        self._natural_rate = Playback.natural(0, assets.frames_per_step).rate
        self.speeds = np.full(count, np.nan)

    def keep(self, speeds: Floats, natural_speed: float) -> None:
        """Let characters walk at their speeds, or at the nearest ones that the motion can be played at.

        Parameters
        ----------
        speeds : (n,) float64
            Of each character where nothing is in its way, nan for that of the motion [m/s].
        natural_speed : float
            That of the motion [m/s].
        """
        self._natural_speed = natural_speed
        self._steady = self._preferred & (self._lengths >= _STEADY * natural_speed * self._seconds)
        self.speeds = np.clip(speeds, SLOWEST * natural_speed, FASTEST * natural_speed)

    def rates_of(self, agent: int, plan: MotionPlan) -> Ints:
        """Ticks a step at which a character plays each node of a plan (P,).

        It has its own speed on average over that node and the next ones in which somebody walks on steadily, which may
        have been captured at different speeds.
        """
        speed = float(self.speeds[agent])
        if np.isnan(speed):
            return np.full(plan.count, self._natural_rate, np.int64)
        steady = self._steady[plan.nodes]
        lengths = _over_next(np.where(steady, self._lengths[plan.nodes], 0.0))
        seconds = _over_next(np.where(steady, self._seconds[plan.nodes], 0.0))
        natural = np.full(plan.count, self._natural_speed)
        np.divide(lengths, seconds, out=natural, where=seconds > 0.0)
        rates: Ints = np.rint(np.minimum(speed / natural, FASTEST) * self._natural_rate).astype(np.int64)
        return rates


def _over_next(values: Floats) -> Floats:
    """Sums of each of some values (P,) and the next ones, _WINDOW of them."""
    padded = np.concatenate([values, np.zeros(_WINDOW - 1)])
    sums: Floats = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW).sum(axis=1)
    return sums
