"""Lists of things by the cells of a grid, as a counting sort makes them: which cells a thing is near, and the lists.

The lists of all cells lie one after the other in an array; ``starts`` (cells + 1,) has the index at which each begins.
Both are of integers. The caller goes through the things twice, in the same order: first with ``starts`` all 0 and empty
``lists``, to count; then, after :func:`counts_to_starts`, to fill the lists.
"""

import math

from crowdsim.jit import helper


@helper
def cells_between(low, high, edge, side, count):
    """Return the first and the last of ``count`` cells in a row that the interval [low, high] [m] meets.

    The first cell begins at ``edge`` [m], and cells are ``side`` [m] long. If none is met, the first exceeds the last.
    """
    return max(math.floor((low - edge) / side), 0), min(math.floor((high - edge) / side), count - 1)


@helper
def count_or_list(starts, lists, cell, number):
    """Add the number of a thing to the list of a cell; while ``lists`` is empty, only count it.

    ``starts[cell + 1]`` is the count of the cell in the first pass, and the index of its next entry in the second.
    """
    if len(lists) > 0:
        lists[starts[cell + 1]] = number
    starts[cell + 1] += 1


@helper
def counts_to_starts(starts):
    """Replace counts by prefix sums between the two passes, and return the length that ``lists`` needs.

    ``starts[c + 1]`` becomes the index at which cell c begins. Filling moves it to the end of cell c, which is where
    cell c + 1 begins.
    """
    total = 0
    for cell in range(1, len(starts)):
        count = starts[cell]
        starts[cell] = total
        total += count
    return total
