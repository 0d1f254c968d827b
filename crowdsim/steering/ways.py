"""Others who do not steer: how they are seen, and what they have reserved to walk on."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.way_kernels import clear_of_ways, list_ways

Frame = tuple[float, float, int, int]


class Others(NamedTuple):
    """Characters who walk ways that they have reserved, which steered agents keep clear of.

    Nobody who steers may touch a reserved way before a step; then nobody does after it.
    """

    rows: NDArray[Any]
    """ROW[m]: as they are seen."""
    segments: NDArray[np.float64]
    """float64[s, 5]: both ends of each piece of their ways from now on, and the radius of the disc that goes there."""
    owners: NDArray[np.int64]
    """int64[s]: whose each is, a number of ``rows``."""


NOBODY_ELSE = Others(np.zeros(0, ROW), np.zeros((0, 5)), np.zeros(0, np.int64))


class ListedWays(NamedTuple):
    """Reserved ways by the cells that they are near to."""

    segments: NDArray[np.float64]
    owners: NDArray[np.int64]
    starts: NDArray[np.int64]
    """Where the list of a cell begins, cells row by row."""
    lists: NDArray[np.int64]


def listed(others: Others, frame: Frame, reach: float) -> ListedWays:
    """Reserved ways by the cells of ``frame`` that lie within ``reach`` [m] of their discs."""
    starts = np.zeros(frame[2] * frame[3] + 1, np.int64)
    lists = np.zeros(0, np.int64)
    if len(others.segments):
        lists = np.zeros(list_ways(others.segments, frame, reach, starts, lists), np.int64)
        # An empty list would only be counted again.
        if len(lists):
            list_ways(others.segments, frame, reach, starts, lists)
    return ListedWays(others.segments, others.owners, starts, lists)


def clear_of(
    ways: ListedWays,
    frame: Frame,
    bodies: NDArray[Any],
    room: float,
    own: NDArray[np.int64] | None = None,
    ignored: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Which of ``bodies``, ROW[k], stand at least ``room`` [m] off all reserved ways listed in the cells of ``frame``.

    ``own``, (k,): the owner whose ways a body may touch, NONE for nobody. ``ignored``, (owners,): whose do not count.
    """
    clear = np.ones(len(bodies), np.bool_)
    if len(ways.lists) and len(bodies):
        own = np.full(len(bodies), NONE, np.int64) if own is None else own
        ignored = np.zeros(int(ways.owners.max()) + 1, np.bool_) if ignored is None else ignored
        clear_of_ways(bodies, ways, frame, room, own, ignored, clear)
    return clear
