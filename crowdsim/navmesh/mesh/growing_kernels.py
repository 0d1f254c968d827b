"""Copies of arrays with more room, for arrays that grow."""

import numpy as np

from crowdsim.jit import helper


@helper
def longer(items):
    """Return a copy of ``items`` (n,) with room for 2 n + 1 items; those after the first n are not set."""
    # At least one more, so that an empty array grows as well.
    copy = np.empty(2 * items.size + 1, items.dtype)
    for i in range(items.size):
        copy[i] = items[i]
    return copy


@helper
def longer_rows(rows):
    """Return a copy of ``rows`` (n, 2) float64 with room for 2 n + 1 rows; those after the first n are not set."""
    copy = np.empty((2 * rows.shape[0] + 1, 2))
    for i in range(rows.shape[0]):
        copy[i, 0] = rows[i, 0]
        copy[i, 1] = rows[i, 1]
    return copy
