"""Goals that commands give, and goals of so few agents that each gets a way of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.scenario.people.crowd_placement import CrowdPlacement

FEW = 4
"""Largest number of agents that get ways of their own to one goal. In places of 100 m and more, a field for all takes
as long to solve as about twenty ways, but follows the crowd."""

MANY = 16
"""Largest number of goals of a scenario of which all have a field, however few go there."""


class NewGoal(NamedTuple):
    """A goal given by a command."""

    number: int
    """Number of the goal among those of guidance."""
    places: NDArray[np.float64]
    """(k, 2) spot of each agent [m]."""
    stays: bool
    """True if the agents stay there."""


def goals_of_few(cast: CrowdPlacement) -> NDArray[np.bool_]:
    """Return which goals (m,) of a scenario give their agents ways of their own.

    Those do to which FEW agents or less go, if the scenario has more than MANY goals.
    """
    bound = np.zeros(len(cast.goals), np.int64)
    for number, itinerary in enumerate(cast.itineraries):
        bound[np.unique(itinerary.goals)] += int((cast.group == number).sum())
    # All agents may choose an exit.
    bound[list(cast.exits.values())] = cast.head_count
    return (bound <= FEW) & (len(cast.goals) > MANY)
