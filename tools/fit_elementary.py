"""Print the coefficients of ``crowdsim/geometry/elementary_kernels.py``: ``python tools/fit_elementary.py``.

Each series is a Chebyshev fit, with fifty digits, of the rest of a function after its leading terms; the largest error
of the fit is printed beside it.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath
from mpmath import mpf

NEARLY_ZERO = mpf("1e-12")
"""Replaces 0 in quotients that would be 0 / 0; smooth functions have nearly the same value there."""


def of_square(function: Callable[[mpf], mpf]) -> Callable[[mpf], mpf]:
    """Return ``function``, which is even, as a function of z = x**2."""
    return lambda z: function(mpmath.sqrt(max(abs(z), NEARLY_ZERO)))


def main() -> None:
    """Print all series."""
    mpmath.mp.dps = 50
    quarter, turn, root = mpmath.pi / 4, mpmath.tan(mpmath.pi / 8), mpmath.sqrt(2)
    series = (
        ("sin", of_square(lambda x: (mpmath.sin(x) / x - 1) / x**2), (quarter * mpf("1.001")) ** 2, 6),
        ("cos", of_square(lambda x: (mpmath.cos(x) - 1 + x**2 / 2) / x**4), (quarter * mpf("1.001")) ** 2, 6),
        ("atan", of_square(lambda x: (mpmath.atan(x) / x - 1) / x**2), (turn * mpf("1.0001")) ** 2, 12),
        (
            "log",
            of_square(lambda s: (mpmath.log((1 + s) / (1 - s)) / s - 2) / s**2),
            ((root - 1) / (root + 1) * mpf("1.0001")) ** 2,
            8,
        ),
    )
    for name, function, limit, terms in series:
        coefficients, error = mpmath.chebyfit(function, [0, limit], terms, error=True)
        print(f"{name}: error {mpmath.nstr(error, 3)}")
        for coefficient in reversed(coefficients):
            print(f"    {float(coefficient)!r}")


if __name__ == "__main__":
    main()
