"""Benchmark of films on a short one."""

import pytest

from crowdsim.bench import film
from crowdsim.bench.film import measure
from crowdsim.errors import DrawingUnavailable


def test_a_row_with_the_limit_of_its_length():
    try:
        measured = measure(seconds=3.0)
    except DrawingUnavailable as reason:
        pytest.skip(str(reason))
    (row,) = measured.rows
    assert row["most_cpu_s"] == 6.0
    # CPU time of the processes that draw counts, and there are at most as many at work as processors.
    assert row["cpu_s"] > 1.0
    assert row["pictures_per_s"] > 0.0
    assert row["cpu_ms_a_picture"] == pytest.approx(1000.0 * row["cpu_s"] / 90, abs=1.0)
    assert set(measured.headline) <= set(measured.figures)


def test_a_film_that_is_longer_than_the_run_counts_as_long_as_that(monkeypatch):
    monkeypatch.setattr(film, "_SCENARIO", film._SCENARIO.replace("duration: 60", "duration: 1"))
    try:
        (row,) = measure(seconds=9.0).rows
    except DrawingUnavailable as reason:
        pytest.skip(str(reason))
    assert row["film_s"] == pytest.approx(1.0, abs=0.11)
    assert row["most_cpu_s"] == pytest.approx(2.0 * row["film_s"], abs=0.06)
    assert row["pictures_per_s"] == pytest.approx(30.0 * row["film_s"] / row["wall_s"], rel=0.2)
