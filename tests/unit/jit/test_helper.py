"""Helpers of kernels: kernels call them, Python may not."""

import pytest

from crowdsim.jit import helper, kernel


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
