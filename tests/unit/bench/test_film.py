"""Benchmark of films on a short one."""

import pytest

from crowdsim.bench.film import measure
from crowdsim.errors import DrawingUnavailable


def test_a_row_with_the_limit_of_its_length():
    try:
        measured = measure(seconds=9.0)
    except DrawingUnavailable as reason:
        pytest.skip(str(reason))
    (row,) = measured.rows
    assert row["most_cpu_s"] == 18.0
    # CPU time of the processes that draw counts, and there are at most as many at work as processors.
    assert row["cpu_s"] > 1.0
    assert row["pictures_per_s"] > 0.0
    assert row["cpu_ms_a_picture"] == pytest.approx(1000.0 * row["cpu_s"] / 270, abs=1.0)
    assert set(measured.headline) <= set(measured.figures)
