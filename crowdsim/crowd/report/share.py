"""The agents that a process measures: all of them, or some of a run on several processes."""

from __future__ import annotations

from typing import NamedTuple

from crowdsim.crowd.ranks.protocol import ONE_RANK, Ranks


class Share(NamedTuple):
    """Consecutive agents that a process measures, while others measure the rest.

    Attributes
    ----------
    agents : slice
        Their numbers.
    ranks : Ranks
        The processes, in the order of their agents.
    """

    agents: slice
    ranks: Ranks


EVERYBODY = Share(slice(0, None), ONE_RANK)
"""All agents, in one process."""
