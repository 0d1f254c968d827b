"""The steps in which agents go over from one level to the other, and those in which playback shows it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE

Ints = NDArray[np.int64]


class Switches(NamedTuple):
    """The S switches of a recording, sorted by agent, then by time.

    Attributes
    ----------
    agents : (S,) int64
        Agent that switches.
    steps : (S,) int64
        First step on the new level.
    shown : (S,) int64
        Step at which playback changes to the new level: some steps before ``steps`` if that is steered, some steps
        after, or in ``steps`` itself, if it is captured. In between a body walks as steered on its captured track.
    steered : (S,) bool
        Whether the new level is the steered one.
    """

    agents: Ints
    steps: Ints
    shown: Ints
    steered: NDArray[np.bool_]

    def last(self, agents: Ints, step: int | Ints) -> Ints:
        """Return (n,) the row of the latest switch of each of ``agents`` (n,) that is shown in ``step`` or before.

        NONE if there is none. ``step`` is one for all, or (n,).
        """
        # Agent and step in one sorted number: agent * most + step, with ``most`` above all steps shown. Later steps are
        # limited, so that their numbers are those of no other agent. NONE in front is found if nothing else is.
        most = int(self.shown.max(initial=0)) + 1
        numbers = np.append(NONE, self.agents * most + self.shown)
        found = np.searchsorted(numbers, agents * most + np.minimum(step, most - 1), side="right") - 1
        last: Ints = np.where(np.append(NONE, self.agents)[found] == agents, found - 1, NONE)
        return last

    def at(self, agents: Ints, steps: Ints) -> Ints:
        """Return (n,) the row of the switch that each of ``agents`` (n,) makes in ``steps`` (n,).

        NONE if it makes none then.
        """
        # Numbers as in last(). Beyond all numbers, the -1 at the end is found, which equals no number.
        most = int(max(self.steps.max(initial=0), np.max(steps, initial=0))) + 1
        numbers = np.append(self.agents * most + self.steps, -1)
        wanted = agents * most + steps
        found = np.searchsorted(numbers[:-1], wanted)
        at: Ints = np.where(numbers[found] == wanted, found, NONE)
        return at

    def steer_in_playback(self, step: int) -> Ints:
        """Return the agents (k,), captured at ``step``, that playback shows as steered.

        For these, ``step`` is between the step in which a switch happens and the one at which it is shown.
        """
        first, end = np.minimum(self.steps, self.shown), np.maximum(self.steps, self.shown)
        agents: Ints = self.agents[(first <= step) & (step < end)]
        return agents
