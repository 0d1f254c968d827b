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
    kinds = len(recording.header.behaviors)
    score = np.zeros(len(steps), np.int64)
    for row, step in enumerate(steps.tolist()):
        moving = recording.state[step] == AgentState.MOVING
        seen = np.unique(recording.behavior[step][moving])
        score[row] = np.sum((seen >= 0) & (seen < kinds)) * (recording.agent_count + 1) + moving.sum()
    best = steps[score == score.max()]
    return float(best[len(best) // 2]) / recording.steps_per_second
