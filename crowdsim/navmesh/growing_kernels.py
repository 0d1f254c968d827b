"""Arrays that double when they are full."""

import numpy as np

from crowdsim.jit import helper


@helper
def longer_rows(rows):
    """A float64 array of twice the rows of ``rows`` (n, k), which it starts with."""
    copy = np.empty((2 * rows.shape[0] + 1, rows.shape[1]))
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            copy[i, k] = rows[i, k]
    return copy


@helper
def longer_list(items):
    """An int64 array of twice the length of ``items``, which it starts with."""
    copy = np.empty(2 * items.size + 1, np.int64)
    for i in range(items.size):
        copy[i] = items[i]
    return copy
