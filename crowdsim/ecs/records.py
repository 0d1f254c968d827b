"""Copies of record arrays: numpy copies records field by field, which takes ten times as long as copying them whole."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def opaque(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view of records as items without fields, which numpy copies whole; other arrays as they are.

    Parameters
    ----------
    array : (n, ...) array
        Records, or numbers.

    Returns
    -------
    (n, ...) array
        The same memory.
    """
    return array.view(np.dtype((np.void, array.dtype.itemsize))) if array.dtype.names else array


def joined(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Return the records (n + m,) of two arrays (n,) and (m,) of the same dtype, one after the other."""
    return np.concatenate((opaque(first), opaque(second))).view(first.dtype)
