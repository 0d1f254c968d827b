"""Lists by cells, beside lists of Python that are filled in one pass."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from crowdsim.geometry import cell_kernels
from crowdsim.jit import kernel


@kernel
def cells_between(low, high, edge, side, count):
    return cell_kernels.cells_between(low, high, edge, side, count)


@kernel
def list_all(things, starts, lists):
    """List each column of ``things`` (bool[cells, things]) that is true in the row of the cell."""
    for number in range(things.shape[1]):
        for cell in range(things.shape[0]):
            if things[cell, number]:
                cell_kernels.count_or_list(starts, lists, cell, number)
    return cell_kernels.counts_to_starts(starts) if len(lists) == 0 else len(lists)


@given(st.floats(-8.0, 8.0), st.floats(0.0, 5.0), st.floats(-3.0, 3.0), st.sampled_from([0.1, 0.25, 1.0, 3.0]))
def test_cells_between_are_those_that_the_interval_meets(low, length, edge, side):
    count = 9
    first, last = cells_between(low, low + length, edge, side, count)
    met = [c for c in range(count) if (low - edge) / side < c + 1 and (low + length - edge) / side >= c]
    assert list(range(first, last + 1)) == met


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
@given(things=arrays(np.bool_, st.tuples(st.integers(1, 7), st.integers(0, 12))))
def test_two_passes_fill_the_lists_of_all_cells(dtype, things):
    cells = len(things)
    starts = np.zeros(cells + 1, dtype)
    total = list_all(things, starts, np.zeros(0, dtype))
    assert total == things.sum()
    lists = np.full(total, -1, dtype)
    if total:
        assert list_all(things, starts, lists) == total
    for cell in range(cells):
        assert lists[starts[cell] : starts[cell + 1]].tolist() == np.flatnonzero(things[cell]).tolist()
