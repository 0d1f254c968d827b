"""Slow twin of the kernel that lets characters go on along their plans: each is left to Python."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowdsim.crowd.systems.choose_kernels import ALL_DONE, OTHERWISE


def go_on_in_python(graph: Any, rows: Any, chosen: np.ndarray, begin: int, table: Any, *rest: Any) -> tuple[int, int]:
    """The next row that has a plan, or whose node ends; the arguments are those of `go_on`."""
    frames_per_step = rest[-2]
    for number in range(begin, len(chosen)):
        row = chosen[number]
        ends = rows.frame[row] + frames_per_step >= graph.node_frames[rows.node[row]]
        if ends or table.nodes[rows.agent[row]] >= 0:
            return number, OTHERWISE
    return len(chosen), ALL_DONE
