"""Slow twin of the kernel that lets agents continue along their plans: each of them is left to Python."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowdsim.crowd.systems.choose_kernels import ALL_DONE, OTHERWISE, frame_of


def go_on_in_python(graph: Any, rows: Any, chosen: np.ndarray, begin: int, table: Any, *rest: Any) -> tuple[int, int]:
    """Return the next row that has a plan, or whose node ends; the arguments are those of `go_on`."""
    playback = rest[-1]
    for number in range(begin, len(chosen)):
        row = chosen[number]
        frame, leaves = frame_of(graph, rows, row, playback)
        if (leaves and frame == rows.frame[row]) or table.nodes[rows.agent[row]] >= 0:
            return number, OTHERWISE
    return len(chosen), ALL_DONE
