"""Choose the moment of a recording that a single picture shows."""

from __future__ import annotations

import numpy as np

from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording

_LOOKED_AT = 200
"""Number of steps, evenly over the recording, of which the best is chosen."""


def telling_time(recording: Recording) -> float:
    """Return the time at which moving agents show the most behaviors at once [s].

    Among times with equally many, it is one at which the most agents move; of these, the middle one, because agents are
    then away from their starts and goals. Raise RecordingError for a recording without steps.
    """
    if recording.steps == 0:
        raise RecordingError(f"{recording.path} holds no steps, so there is nothing to show; run the scenario again")
    steps = np.unique(np.linspace(0, recording.steps - 1, _LOOKED_AT).round().astype(int))
    kinds = len(recording.header.behaviors)
    score = np.zeros(len(steps), np.int64)
    for row, step in enumerate(steps.tolist()):
        moving = recording.state[step] == AgentState.MOVING
        seen = np.unique(recording.behavior[step][moving])
        # The factor makes one behavior count more than all agents.
        score[row] = np.sum((seen >= 0) & (seen < kinds)) * (recording.agent_count + 1) + moving.sum()
    best = steps[score == score.max()]
    return float(best[len(best) // 2]) / recording.steps_per_second
