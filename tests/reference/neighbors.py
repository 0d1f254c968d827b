"""Slow, obvious twins of neighbor searches: every row is tested."""

from __future__ import annotations

import numpy as np

from crowdsim.crowd.state.reservation_kernels import pair_meets
from crowdsim.crowd.state.timelines import Timelines
from tests.reference.crowd import FOREVER, off_way


def rows_met(me: int, timeline: np.ndarray, slot: int, everyone: Timelines, radius: float) -> list[int]:
    """Return the rows whose timelines are met by one that begins in ``slot`` and ends in a stand."""
    return [
        other
        for other in range(len(everyone.timeline))
        if other != me
        and pair_meets(
            *(timeline, slot, FOREVER),
            *(everyone.timeline[other], everyone.timeline_start[other], everyone.gone_slot[other]),
            *(slot, radius + everyone.body_radius[other], me >= 0),
        )
    ]


def rank_behind_all(row: int, ways: np.ndarray, ranks: np.ndarray, width: float, reach: float) -> int:
    """Return one more than the least rank of the agents ahead on the way of ``row`` that go in the same direction."""
    best = FOREVER
    for other in range(len(ways)):
        ahead = ways[other, 0] - ways[row, 0]
        if other == row or not np.hypot(*ahead) < reach:
            continue
        off, along = off_way(ways[row], ways[other, 0])
        goes = ways[other, 1] - ways[other, 0]
        if off < width and ahead @ along > 0.0 and goes @ along > 0.7 * np.hypot(*goes) * np.hypot(*along):
            best = min(best, int(ranks[other]) + 1)
    return best


def rows_before(row: int, ways: np.ndarray, ranks: np.ndarray, reach: float) -> list[int]:
    """Return the rows of lower rank whose ways begin within ``reach`` of that of ``row``."""
    away = np.hypot(*(ways[:, 0] - ways[row, 0]).T)
    return np.flatnonzero((ranks < ranks[row]) & (away < reach)).tolist()


def rows_in_way(me: int, ways: np.ndarray, ranks: np.ndarray, may_move: np.ndarray, places: np.ndarray, width: float):
    """Return the rows behind ``me`` that stand in its way."""
    return [
        row
        for row in range(len(ranks))
        if may_move[row] and ranks[row] > ranks[me] and off_way(ways[me], places[row])[0] < width
    ]
