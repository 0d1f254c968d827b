"""Choose the steps and agents of a recording that a page shows."""

from __future__ import annotations

from typing import NamedTuple

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice
from crowdsim.export.page.packing import Ints
from crowdsim.recording.reader import Recording


class Chosen(NamedTuple):
    """The part of a recording on a page: ``steps`` steps from step ``first`` on, and ``agents`` (N,), ascending."""

    first: int
    steps: int
    agents: Ints


def shown_of(recording: Recording, choice: Choice) -> Chosen:
    """Return the part of a recording that a page shows: all steps of a range, because the page interpolates bodies.

    Raise CrowdSimError if the range is empty, or if the choice leaves steps out.
    """
    if not recording.steps or choice.end <= choice.first:
        raise CrowdSimError(f"{recording.path} holds no steps there, so there is nothing to show; choose other times")
    if choice.every != 1:
        raise CrowdSimError("a page shows every step of a recording; leave the rate out")
    return Chosen(choice.first, choice.end - choice.first, choice.agents)
