"""Arrays that double when they are full."""

import numpy as np

from crowdsim.jit import helper


@helper
def longer(items):
    """An array of more than twice the length of the one-dimensional ``items``, which it starts with."""
    copy = np.empty(2 * items.size + 1, items.dtype)
    for i in range(items.size):
        copy[i] = items[i]
    return copy


@helper
def longer_rows(rows):
    """A float64 array of more than twice the rows of ``rows`` (n, 2), which it starts with."""
    copy = np.empty((2 * rows.shape[0] + 1, 2))
    for i in range(rows.shape[0]):
        copy[i, 0] = rows[i, 0]
        copy[i, 1] = rows[i, 1]
    return copy
