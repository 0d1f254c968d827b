"""Numbers and words as text, beside Python's own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowdsim.export.tables.text_rows import decimals, text_rows, whole_numbers, words


@given(st.lists(st.integers(-(10**15), 10**15), max_size=20))
def test_integers_are_written_as_python_writes_them(values):
    written = text_rows([whole_numbers(np.array(values, np.int64))], ",")
    assert written.decode() == "".join(f"{value}\n" for value in values)


@given(st.lists(st.floats(-1e6, 1e6, width=32), max_size=20), st.integers(1, 6))
def test_decimals_are_rounded_to_their_places(values, places):
    lines = text_rows([decimals(np.array(values, np.float32), places)], ",").decode().split("\n")
    assert len(lines) == len(values) + 1
    for line, value in zip(lines, values, strict=False):
        assert len(line.partition(".")[2]) == places
        assert abs(float(line) - value) <= 0.5 * 10.0**-places + 1e-9
        assert line not in {f"-{0:.{places}f}"}


def test_what_is_not_finite_is_never_written():
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match="not finite"):
            decimals(np.array([1.0, value]), 4)


def test_columns_stand_side_by_side():
    columns = [whole_numbers([7, -12]), decimals([0.5, -0.04], 1), words([1, 0], ["a", "größer"])]
    assert text_rows(columns, ", ").decode() == "7, 0.5, größer\n-12, 0.0, a\n"


def test_no_rows_are_no_text():
    assert text_rows([whole_numbers([]), words(np.zeros(0, int), [])], ",") == b""
