"""Steered agents in the world in one step, as recordings hold them."""

from __future__ import annotations

from collections.abc import Mapping
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
"""An agent in one step: x, y [m], heading [rad] and phase of its gait [cycles]; behavior and AgentState."""


def present_rows(view: View) -> NDArray[Any]:
    """Return the agents of a view of a steered crowd (COLUMNS of steered.components), as PRESENT[n]."""
    rows = np.empty(len(view.agent), PRESENT)
    for name in ("x", "y", "heading"):
        rows[name] = view.row[name]
    for name in ("agent", "phase", "behavior", "state"):
        rows[name] = getattr(view, name)
    return rows


def absent_columns(shape: tuple[int, ...], types: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return columns of a recording, of ``types`` by name, in which all agents are outside of the world.

    Each column has the ``shape``: states are ABSENT, behaviors NONE, all else nan.
    """
    absent = {"behavior": NONE, "state": AgentState.ABSENT}
    return {name: np.full(shape, absent.get(name, np.nan), dtype) for name, dtype in types.items()}


def frame_of_columns(columns: Mapping[str, NDArray[Any]]) -> RecordedFrame:
    """Return a step of N steered agents; ``columns`` (N,) are the fields of PRESENT without ``agent``."""
    count = len(columns["x"])
    none = np.full(count, NONE, np.int32)
    return RecordedFrame(node=none, previous=none, frame=np.zeros(count, np.float32), **columns)


def frame_of_rows(rows: NDArray[Any], count: int) -> RecordedFrame:
    """Return the step of ``count`` agents of which ``rows`` (PRESENT) are in the world."""
    fields = {name: PRESENT[name] for name in PRESENT.names or () if name != "agent"}
    columns = absent_columns((count,), fields)
    for name, values in columns.items():
        values[rows["agent"]] = rows[name]
    return frame_of_columns(columns)
