"""Steered agents in the world in one step, as recordings hold them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.ecs.world import View
from crowdsim.recording.header import AgentState, RecordedFrame

PRESENT = np.dtype(
    [
        ("agent", np.int32),
        ("x", np.float32),
        ("y", np.float32),
        ("heading", np.float32),
        ("phase", np.float32),
        ("behavior", np.int8),
        ("state", np.int8),
    ]
)
"""An agent in one step."""


def present_rows(view: View) -> NDArray[Any]:
    """Return the agents of a view of a steered crowd (PRESENT)."""
    rows = np.empty(len(view.agent), PRESENT)
    for name in ("x", "y", "heading"):
        rows[name] = view.row[name]
    for name in ("agent", "phase", "behavior", "state"):
        rows[name] = getattr(view, name)
    return rows


def frame_of_rows(rows: NDArray[Any], count: int) -> RecordedFrame:
    """Return the step of ``count`` agents of which ``rows`` (PRESENT) are in the world."""
    whole = np.zeros(count, PRESENT)
    for name in ("x", "y", "heading", "phase"):
        whole[name] = np.nan
    whole["behavior"], whole["state"] = NONE, AgentState.ABSENT
    whole[rows["agent"]] = rows
    none = np.full(count, NONE, np.int32)
    return RecordedFrame(
        x=whole["x"],
        y=whole["y"],
        heading=whole["heading"],
        node=none,
        previous=none,
        frame=np.zeros(count, np.float32),
        behavior=whole["behavior"],
        state=whole["state"],
        phase=whole["phase"],
    )
