"""Helpers of kernels: kernels call them, Python may not."""

import numpy as np
import pytest

from crowdsim.jit import cache_folder, helper, kernel


@helper
def _twice(x):
    return 2 * x


@kernel
def _four_times(x):
    return _twice(_twice(x))


def test_python_is_refused_before_and_after_a_kernel_compiled_the_helper() -> None:
    with pytest.raises(TypeError, match="_twice is a helper of kernels"):
        _twice(1)
    assert _four_times(3) == 12
    with pytest.raises(TypeError, match="_twice is a helper of kernels"):
        _twice(1)


@helper
def _filled(n):
    values = np.empty(n)
    for i in range(n):
        values[i] = i
    return values


@kernel
def _sum_of_filled(n):
    total = 0.0
    for value in _filled(n):
        total += value
    return total


def test_a_helper_is_linked_into_its_kernels_and_has_no_cache_of_its_own() -> None:
    assert _sum_of_filled(5) == 10.0
    kept = {file.name for file in cache_folder().rglob("*.nbc")}
    assert any("_sum_of_filled" in name for name in kept)
    assert not any("._filled" in name for name in kept)
