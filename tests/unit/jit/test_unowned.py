"""Arrays without owners in kernels: the same arrays, which their owner keeps."""

import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.jit import kernel, unowned


class Pair(NamedTuple):
    values: NDArray[np.float64]
    scale: float


@kernel
def _scale_all(pairs):
    total = 0.0
    for pair in unowned(pairs):
        values = pair.values
        for i in range(len(values)):
            values[i] *= pair.scale
            total += values[i]
    return total


def test_what_is_written_is_written_to_the_callers_array_and_nobody_counts() -> None:
    pairs = (Pair(np.arange(4.0), 2.0), Pair(np.ones(3), 5.0))
    before = [sys.getrefcount(pair.values) for pair in pairs]
    assert _scale_all(pairs) == 12.0 + 15.0
    assert pairs[0].values.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert pairs[1].values.tolist() == [5.0, 5.0, 5.0]
    assert [sys.getrefcount(pair.values) for pair in pairs] == before
