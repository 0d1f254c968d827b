"""Playback rates by which each captured agent walks at a speed of its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST, Playback
from crowdsim.geometry.elementary import hypot

_STEADY = 0.7
"""Least mean speed of a node of steady walking, as a share of the natural speed; slower nodes set off or stop."""

_WINDOW = 4
"""Number of consecutive nodes of a plan over which the mean speed is to be that of the agent: two strides or more."""

Floats = NDArray[np.float64]
"""Array of float64."""

Ints = NDArray[np.int64]
"""Array of int64."""


class Paces:
    """Rates at which n agents play their plans while nothing is in their way.

    All nodes are played at the natural rate, as captured, until :meth:`keep` gives speeds.
    """

    def __init__(self, assets: Assets, count: int) -> None:
        graph = assets.graph
        tracks = graph.tracks[:, :2]
        steps = tracks[1:] - tracks[:-1]
        # Length [m] and duration [s] of each node's track: ``ways`` is the length up to each sample of all tracks.
        ways = np.concatenate([[0.0], np.cumsum(hypot(steps[:, 0], steps[:, 1]))])
        first = graph.node_track.astype(np.int64)
        self._lengths: Floats = ways[first + graph.node_frames] - ways[first]
        self._seconds: Floats = graph.node_frames / CAPTURE_RATE
        # The last behavior is the preferred one; only its nodes can count as steady walking.
        self._preferred = graph.node_behavior == len(assets.behaviors) - 1
        self._steady = np.zeros(len(first), np.bool_)
        self._natural_speed = np.inf
        self._natural_rate = Playback.natural(0, assets.frames_per_step).rate
        self.speeds = np.full(count, np.nan)
        """(n,) float64: speed at which each agent walks straight on [m/s], nan for that of the motion."""

    def keep(self, speeds: Floats, natural_speed: float) -> None:
        """Let agents walk at ``speeds`` of their own, or at the nearest speeds at which the motion can be played.

        Parameters
        ----------
        speeds : (n,) float64
            Speed of each agent while nothing is in its way [m/s], nan for that of the motion.
        natural_speed : float
            Speed of steady walking in the preferred behavior, played as captured [m/s].
        """
        self._natural_speed = natural_speed
        self._steady = self._preferred & (self._lengths >= _STEADY * natural_speed * self._seconds)
        self.speeds = np.clip(speeds, SLOWEST * natural_speed, FASTEST * natural_speed)

    def rates_of(self, agent: int, plan: MotionPlan) -> Ints:
        """Return the rates (P,) at which an agent plays the P nodes of a plan [ticks/step].

        Without a speed of its own (nan), these are the natural rate. Otherwise the rate of each node scales the mean
        speed of the steady nodes among it and the next ones, :data:`_WINDOW` in all, to the speed of the agent: nodes
        of steady walking were captured at different speeds. If none of these nodes is steady, the natural speed takes
        the place of the mean. All rates are clipped to SLOWEST to FASTEST, as shares of the natural rate.
        """
        speed = float(self.speeds[agent])
        if np.isnan(speed):
            return np.full(plan.count, self._natural_rate, np.int64)
        steady = self._steady[plan.nodes]
        lengths = _over_next(np.where(steady, self._lengths[plan.nodes], 0.0))
        seconds = _over_next(np.where(steady, self._seconds[plan.nodes], 0.0))
        natural = np.full(plan.count, self._natural_speed)
        np.divide(lengths, seconds, out=natural, where=seconds > 0.0)
        rates: Ints = np.rint(np.clip(speed / natural, SLOWEST, FASTEST) * self._natural_rate).astype(np.int64)
        return rates


def _over_next(values: Floats) -> Floats:
    """Return for each of the values (P,) the sum of it and the next ones, _WINDOW in all, or fewer at the end."""
    padded = np.concatenate([values, np.zeros(_WINDOW - 1)])
    sums: Floats = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW).sum(axis=1)
    return sums
