"""Which moment of a recording a single picture should show."""

from __future__ import annotations

import numpy as np

from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording

_LOOKED_AT = 200


def telling_time(recording: Recording) -> float:
    """Seconds at which most behaviors are to be seen at once, and among such times most characters moving.

    Among equal times the middle one, for characters are then away from where they start and end.
    """
    if recording.steps == 0:
        raise RecordingError(f"{recording.path} holds no steps, so there is nothing to show; run the scenario again")
    steps = np.unique(np.linspace(0, recording.steps - 1, _LOOKED_AT).round().astype(int))
    state, behavior = recording.state[:], recording.behavior[:]
    moving = state[steps] == AgentState.MOVING
    kinds = len(recording.header.behaviors)
    seen = np.stack([(moving & (behavior[steps] == kind)).any(axis=1) for kind in range(kinds)], axis=1).sum(axis=1)
    score = seen * (recording.agent_count + 1) + moving.sum(axis=1)
    best = steps[score == score.max()]
    return float(best[len(best) // 2]) / recording.steps_per_second
