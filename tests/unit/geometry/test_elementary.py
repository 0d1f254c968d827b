"""Elementary functions against mpmath with fifty digits, and where they are not defined."""

import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from crowdsim.geometry import elementary
from crowdsim.geometry.elementary_kernels import LARGEST_ANGLE

RNG = np.random.default_rng(11)
COUNT = 3000

SMALL = 10.0 ** RNG.uniform(-12.0, 0.0, COUNT)
QUARTERS = np.arange(1, COUNT) * (math.pi / 2.0)
"""The doubles nearest to whole quarter turns, where all but the last bits of an angle cancel."""
ANGLES = np.concatenate([RNG.uniform(-7.0, 7.0, COUNT), RNG.uniform(-LARGEST_ANGLE, LARGEST_ANGLE, COUNT), SMALL])
ANGLES = np.concatenate([ANGLES, QUARTERS, -QUARTERS])
RATIOS = np.concatenate([RNG.uniform(-1.0, 1.0, COUNT), SMALL, 1.0 - SMALL, SMALL - 1.0])
EXPONENTS = np.concatenate([RNG.uniform(-40.0, 40.0, COUNT), RNG.uniform(-700.0, 700.0, COUNT), -SMALL])
POSITIVE = np.concatenate([10.0 ** RNG.uniform(-300.0, 300.0, COUNT), RNG.uniform(0.4, 2.0, COUNT), 1.0 + SMALL])

ONE_ARGUMENT: list[tuple[str, float, np.ndarray]] = [
    ("sin", 1.0, ANGLES),
    ("cos", 1.0, ANGLES),
    ("tan", 2.0, ANGLES),
    ("asin", 2.5, RATIOS),
    ("acos", 2.5, RATIOS),
    ("exp", 1.0, EXPONENTS),
    ("log", 1.0, POSITIVE),
]


def largest_error(found: np.ndarray, wanted: list[mpmath.mpf]) -> float:
    """Units in the last place."""
    errors = [
        abs(mpmath.mpf(float(value)) - exact) / float(np.spacing(abs(float(exact))))
        for value, exact in zip(found, wanted, strict=True)
    ]
    return float(max(errors))


@pytest.fixture(autouse=True)
def _fifty_digits():
    with mpmath.workdps(50):
        yield


@pytest.mark.parametrize(("name", "bound", "arguments"), ONE_ARGUMENT, ids=[name for name, _, _ in ONE_ARGUMENT])
def test_functions_err_by_no_more_than_they_say(name: str, bound: float, arguments: np.ndarray) -> None:
    exact = [getattr(mpmath, name)(mpmath.mpf(x)) for x in arguments.tolist()]
    assert largest_error(getattr(elementary, name)(arguments), exact) <= bound


def test_angles_of_vectors_err_by_no_more_than_they_say() -> None:
    y, x = RNG.normal(size=COUNT), RNG.normal(size=COUNT) * 10.0 ** RNG.uniform(-3.0, 3.0, COUNT)
    exact = [mpmath.atan2(mpmath.mpf(a), mpmath.mpf(b)) for a, b in zip(y.tolist(), x.tolist(), strict=True)]
    assert largest_error(elementary.atan2(y, x), exact) <= 1.6


def test_lengths_err_by_no_more_than_they_say() -> None:
    x, y = RNG.normal(size=(2, COUNT)) * 10.0 ** RNG.uniform(-3.0, 3.0, (2, COUNT))
    exact = [mpmath.sqrt(mpmath.mpf(a) ** 2 + mpmath.mpf(b) ** 2) for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    assert largest_error(elementary.hypot(x, y), exact) <= 1.1


def test_powers_err_by_no_more_than_they_say() -> None:
    base = np.concatenate([RNG.uniform(0.0, 1.0, COUNT), 10.0 ** RNG.uniform(-5.0, 5.0, COUNT)])
    exponent = np.concatenate([RNG.uniform(0.0, 6.0, COUNT), RNG.uniform(-2.3, 2.3, COUNT)])
    exact = [mpmath.power(mpmath.mpf(a), mpmath.mpf(b)) for a, b in zip(base.tolist(), exponent.tolist(), strict=True)]
    within = [i for i, value in enumerate(exact) if 1e-12 < value < 1e12]
    assert len(within) > COUNT
    assert largest_error(elementary.power(base, exponent)[within], [exact[i] for i in within]) <= 1.0


SPECIAL = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan)


def same(found: float, wanted: float) -> bool:
    """Whether both are nan, or nearly equal and of one sign, which zeros have as well."""
    if math.isnan(wanted):
        return math.isnan(found)
    return math.isclose(found, wanted, rel_tol=1e-15) and math.copysign(1.0, found) == math.copysign(1.0, wanted)


def by_numpy(function: Callable[..., float], *arguments: float) -> float:
    with np.errstate(all="ignore"):
        return float(function(*arguments))


@pytest.mark.parametrize("x", SPECIAL)
def test_functions_of_special_values_are_those_of_ieee(x: float) -> None:
    names = {"sin": "sin", "cos": "cos", "asin": "arcsin", "acos": "arccos", "exp": "exp", "log": "log"}
    for name, its_name in names.items():
        assert same(getattr(elementary, name)(x), by_numpy(getattr(np, its_name), x)), name
    for y in SPECIAL:
        assert same(elementary.atan2(y, x), math.atan2(y, x)), y


@pytest.mark.parametrize("base", [0.0, 0.5, 1.0, 2.0, math.inf, math.nan])
@pytest.mark.parametrize("exponent", [0.0, 1.0, -1.0, 2.5, 1e300, -1e300, math.inf, -math.inf, math.nan])
def test_powers_of_special_values_are_those_of_ieee(base: float, exponent: float) -> None:
    assert same(elementary.power(base, exponent), by_numpy(np.power, base, exponent))


def test_larger_angles_stay_finite_and_overflow_is_infinite() -> None:
    assert abs(elementary.sin(1e300)) <= 1.0
    assert elementary.exp(710.0) == math.inf
    assert elementary.exp(-746.0) == 0.0
    assert elementary.exp(-745.0) > 0.0
    assert elementary.log(5e-324) == pytest.approx(math.log(5e-324), rel=1e-15)


def test_shapes_broadcast_and_numbers_stay_numbers() -> None:
    assert isinstance(elementary.sin(0.5), float)
    assert elementary.atan2(np.ones((3, 1)), np.ones(4)).shape == (3, 4)
    assert elementary.cos(np.empty((0, 2))).shape == (0, 2)
    frozen = np.linspace(0.0, 1.0, 5)
    frozen.flags.writeable = False
    np.testing.assert_array_equal(elementary.cos(frozen), elementary.cos(frozen.copy()))
