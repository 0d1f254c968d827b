"""NamedTuples in kernels: handed on by address if they are large, with the same results as in Python."""

import subprocess
import sys
from collections import namedtuple

import numba
import numpy as np
import pytest

from crowdsim.jit import helper, kernel
from crowdsim.numba_internals import _key_text
from crowdsim.numba_internals import _Tried as Large


@helper
def total(large):
    return large.numbers.sum() + 10.0 * large.counts.sum() + 100.0 * large.within[0].sum()


@kernel
def total_of_swapped(first, second, rounds):
    for _ in range(rounds):
        first, second = second, first
    return total(first) - total(second)


@kernel
def total_of_built(large, rounds):
    whole = 0.0
    other = large
    for k in range(rounds):
        if k % 2 == 0:
            other = Large(large.numbers[k:], large.counts, (large.counts[k:], large.counts))
        numbers = other.numbers
        if k == 2:
            numbers = large.numbers * 2.0
        whole += total(Large(numbers, other.counts, other.within)) + total(other)
    return whole


@kernel
def given_back(large):
    return large, large.within, large.numbers[1:]


@kernel
def place_of(large, value):
    return large.index(value)


@kernel
def first_letter(large):
    return large.numbers[0]


def large_of(start):
    return Large(start + np.arange(5.0), np.arange(7), (np.arange(4) + 1, np.arange(3)))


@pytest.mark.parametrize("rounds", [0, 1, 2, 5])
def test_arguments_may_be_swapped_and_built_anew(rounds):
    first, second = large_of(1.0), large_of(20.0)
    for compiled, arguments in ((total_of_swapped, (first, second, rounds)), (total_of_built, (first, rounds))):
        python = {"total": total.py_func, "Large": Large, "range": range}
        plain = type(compiled.py_func)(compiled.py_func.__code__, python)
        assert compiled(*arguments) == plain(*arguments)


def test_what_is_given_back_outlives_the_call():
    before = large_of(3.0)
    expected = [each.copy() for each in (before.numbers, before.counts, *before.within, before.numbers[1:])]
    large, within, rest = given_back(before)
    del before
    for found, wanted in zip((large.numbers, large.counts, *within, rest), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_calls_keep_no_references():
    large, letters = large_of(0.0), bytes([65, 66])
    with_letters = Large(letters, large.counts, large.within)
    objects = (letters, large.numbers, large.counts, large.within[0])
    assert total_of_built(large, 3) > 0.0
    assert first_letter(with_letters) == 65
    counts = [sys.getrefcount(each) for each in objects]
    for _ in range(20):
        total_of_built(large, 3)
        first_letter(with_letters)
    assert [sys.getrefcount(each) for each in objects] == counts


def test_tuples_keep_their_methods():
    assert place_of(Large(4, 5, 6), 5) == 1


def test_classes_of_one_name_have_code_of_their_own():
    one, other = namedtuple("Pair", ["x", "y"]), namedtuple("Pair", ["y", "x"])
    assert _key_text(numba.typeof(one(1, 2))) != _key_text(numba.typeof(other(1, 2)))
    assert _key_text((numba.typeof((one(1, 2),)),)) != _key_text((numba.typeof((other(1, 2),)),))


def test_tuples_that_numba_knows_already_stay_usable():
    code = """
from collections import namedtuple
import numba, numpy as np
Pair = namedtuple("Pair", ["x", "y"])
add = lambda pair: pair.x[0] + pair.y[0]
pair = Pair(np.ones(1), np.ones(1, np.int64))
assert numba.njit(add)(pair) == 2.0
import crowdsim.jit
assert numba.njit(lambda pair: 2.0 * (pair.x[0] + pair.y[0]))(pair) == 4.0
"""
    subprocess.run([sys.executable, "-c", code], check=True)
