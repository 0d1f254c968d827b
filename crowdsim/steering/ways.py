"""Captured agents as steered agents meet them: how they are seen, and the segments that they have reserved."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.way_kernels import clear_of_ways, list_ways

Frame = tuple[float, float, int, int]
"""Grid of cells: left and bottom edge [m], columns, rows."""


class Others(NamedTuple):
    """Captured agents, which walk along segments that they have reserved and which steered agents keep clear of.

    Before a step no steered agent may touch a reserved segment; then none does after it.
    """

    rows: NDArray[Any]
    """ROW[m]: position, velocity and body of each, as steered agents see them."""
    segments: NDArray[np.float64]
    """float64[s, 5]: both ends of each segment of their ways from now on, and the radius of the disc on it [m]."""
    owners: NDArray[np.int64]
    """int64[s]: index in ``rows`` of the owner of each segment."""


NOBODY_ELSE = Others(np.zeros(0, ROW), np.zeros((0, 5)), np.zeros(0, np.int64))
"""No captured agents."""


class ListedWays(NamedTuple):
    """Reserved segments, listed by the cells that they are near to."""

    segments: NDArray[np.float64]
    """float64[s, 5], as in :class:`Others`."""
    owners: NDArray[np.int64]
    """int64[s], as in :class:`Others`."""
    starts: NDArray[np.int64]
    """int64[columns * rows + 1]: index in ``lists`` at which each cell begins, cells row by row."""
    lists: NDArray[np.int64]
    """int64[k]: segment numbers."""


def listed(others: Others, frame: Frame, reach: float) -> ListedWays:
    """List the reserved segments by the cells of ``frame`` that lie within ``reach`` [m] of their swept discs.

    A segment is listed in all cells that meet the bounding box of its swept disc, grown by ``reach``; so also in some
    that are farther off.
    """
    starts = np.zeros(frame[2] * frame[3] + 1, np.int64)
    lists = np.zeros(0, np.int64)
    if len(others.segments):
        lists = np.zeros(list_ways(others.segments, frame, reach, starts, lists), np.int64)
        # Fill the lists, unless no segment is near the grid: the kernel would take empty lists for another count.
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
    """Return which bodies are at least ``room`` [m] away from all reserved segments.

    Parameters
    ----------
    ways : ListedWays
        Reserved segments, listed with a reach of at least ``room`` plus the half breadth of the largest body.
    frame : Frame
        Grid with which they were listed.
    bodies : ROW[k]
        Bodies to test, none outside of the grid.
    room : float
        Least gap [m].
    own : (k,) int64, optional
        Owner whose segments each body may touch, NONE for no owner (default).
    ignored : (owners,) bool, optional
        Owners whose segments do not count; none by default.

    Returns
    -------
    (k,) bool
        True for bodies that are clear.
    """
    clear = np.ones(len(bodies), np.bool_)
    if len(ways.lists) and len(bodies):
        own = np.full(len(bodies), NONE, np.int64) if own is None else own
        ignored = np.zeros(int(ways.owners.max()) + 1, np.bool_) if ignored is None else ignored
        clear_of_ways(bodies, ways, frame, room, own, ignored, clear)
    return clear
