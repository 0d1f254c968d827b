"""Elementary functions that give the same bits on every processor.

The C library, numpy and BLAS pick the code that runs fastest on a processor, with or without fused multiply-add, so
their results differ between processors. The functions here use only +, -, *, / and the square root, which IEEE 754
rounds in one way, in a fixed order.

Errors are at most, in units in the last place (the tests compare with mpmath): sin, cos, exp and log 1; power 1 if the
result lies in [1e-12, 1e12]; hypot 1.1; atan2 1.6; tan 2; acos and asin 2.5. Angles may be as large as
:data:`LARGEST_ANGLE`. Domain errors and overflow give nan and infinity.

The array functions for Python code are in :mod:`crowdsim.geometry.elementary`. The coefficients are those of Chebyshev
fits, printed by ``tools/fit_elementary.py``; those of exp are the reciprocal factorials.
"""

import math

from crowdsim.jit import helper, kernel

LARGEST_ANGLE = 1e6
"""Largest angle [rad] for which the error bounds hold."""

_TWO_OVER_PI = 0.6366197723675814
# pi / 2 in three parts: the first two have 32 bits, so that their products with up to 2**21 quarter turns are exact.
_QUARTER_1 = 1.5707963267341256
_QUARTER_2 = 6.077100506303966e-11
_QUARTER_3 = 2.0222662487959506e-21
# An eighth and a quarter of a turn [rad] as doubles, the rest that each double leaves out, and a tangent.
_EIGHTH = 0.7853981633974483
_EIGHTH_REST = 3.061616997868383e-17
_QUARTER = 1.5707963267948966
_QUARTER_REST = 6.123233995736766e-17
_TAN_SIXTEENTH = 0.41421356237309503
# ln 2 in two parts: the first has 32 bits, so that its product with an exponent is exact.
_LN2_1 = 0.6931471803691238
_LN2_2 = 1.9082149292705877e-10
_INVERSE_LN2 = 1.4426950408889634
_ROOT_HALF = 0.7071067811865476
_SPLITTER = 134217729.0  # 2**27 + 1: halves the bits of a double (Dekker 1971)

_SIN_1 = -0.16666666666666666
_SIN_2 = 0.008333333333330925
_SIN_3 = -0.00019841269836722418
_SIN_4 = 2.755731608381636e-06
_SIN_5 = -2.5051127944014188e-08
_SIN_6 = 1.5917848524808262e-10

_COS_1 = 0.041666666666666664
_COS_2 = -0.0013888888888887382
_COS_3 = 2.480158729874307e-05
_COS_4 = -2.7557317260008837e-07
_COS_5 = 2.0876143827993133e-09
_COS_6 = -1.1382456778061306e-11

_ATAN_1 = -0.3333333333333333
_ATAN_2 = 0.19999999999999804
_ATAN_3 = -0.14285714285659729
_ATAN_4 = 0.11111111105145725
_ATAN_5 = -0.09090908753017178
_ATAN_6 = 0.07692296361048218
_ATAN_7 = -0.06666424634599337
_ATAN_8 = 0.05878926110528101
_ATAN_9 = -0.052304330074828924
_ATAN_10 = 0.0455149623749493
_ATAN_11 = -0.034568068014968874
_ATAN_12 = 0.016282993238924487

_LOG_1 = 0.6666666666666666
_LOG_2 = 0.4000000000000088
_LOG_3 = 0.2857142857080285
_LOG_4 = 0.22222222391887064
_LOG_5 = 0.18181795621632782
_LOG_6 = 0.15386240708969665
_LOG_7 = 0.13268746195596595
_LOG_8 = 0.13086907887965027


@helper
def hypot(x, y):
    """Return the length of the vector (x, y).

    Lengths outside of 1e-150 to 1e150 are lost, as squares are not scaled.
    """
    return math.sqrt(x * x + y * y)


@helper
def _reduce(x):
    """Split an angle [rad] into quarter turns and a remainder in [-pi/4, pi/4] [rad].

    Return the quarter turns modulo 4, the remainder as a double, and the small part of it that this double leaves out.
    """
    turns = math.floor(x * _TWO_OVER_PI + 0.5)
    quarters = float(turns)
    # Exact: a multiple of the last bit of x, and small, as x is near quarters * pi / 2.
    remainder = x - quarters * _QUARTER_1
    # Cody and Waite's reduction: subtract the parts of pi / 2 one by one, and keep what each rounding leaves out.
    second = quarters * _QUARTER_2
    less = remainder - second
    left_out = (remainder - less) - second
    third = quarters * _QUARTER_3 - left_out
    high = less - third
    return turns & 3, high, (less - high) - third


@helper
def _sin_near(x, rest):
    """Return sin(x + rest) for -pi/4 <= x <= pi/4; x is the leading term, the polynomial adds the last bits.

    The angle is x + rest [rad]: ``rest`` is what the double x leaves out, less than a unit in its last place.
    """
    z = x * x
    tail = _SIN_2 + z * (_SIN_3 + z * (_SIN_4 + z * (_SIN_5 + z * _SIN_6)))
    cube = z * x
    return x - ((z * (0.5 * rest - cube * tail) - rest) - cube * _SIN_1)


@helper
def _cos_near(x, rest):
    """Return cos(x + rest) for -pi/4 <= x <= pi/4; the rounding error of 1 - x**2 / 2 is added back.

    The angle is x + rest [rad], as in :func:`_sin_near`. As ``rest`` is tiny, -x * rest is all that it changes.
    """
    z = x * x
    tail = z * (_COS_1 + z * (_COS_2 + z * (_COS_3 + z * (_COS_4 + z * (_COS_5 + z * _COS_6)))))
    half = 0.5 * z
    lead = 1.0 - half
    return lead + (((1.0 - lead) - half) + (z * tail - x * rest))


@helper
def cos_sin(x):
    """Return cosine and sine of an angle [rad], in little more than the time of one of them."""
    # Beyond the bound a remainder by full turns keeps the result in [-1, 1], but not accurate; NaN and infinity give
    # NaN.
    if not abs(x) <= LARGEST_ANGLE:
        if not abs(x) < math.inf:
            return math.nan, math.nan
        x = x % (4.0 * _QUARTER)
    quarter, high, low = _reduce(x)
    c = _cos_near(high, low)
    s = _sin_near(high, low)
    # Turn back by the quarter turns.
    if quarter == 0:
        return c, s
    if quarter == 1:
        return -s, c
    if quarter == 2:
        return -c, -s
    return s, -c


@helper
def cos(x):
    """Return the cosine of an angle [rad]."""
    return cos_sin(x)[0]


@helper
def sin(x):
    """Return the sine of an angle [rad]."""
    return cos_sin(x)[1]


@helper
def tan(x):
    """Return the tangent of an angle [rad]."""
    c, s = cos_sin(x)
    return s / c


@helper
def atan2(y, x):
    """Return the angle of the vector (x, y) in [-pi, pi] [rad].

    Coordinates may be as large as 1e300, or infinite; nan gives nan. Signs of zeros count as in C.
    """
    ax = abs(x)
    ay = abs(y)
    near = min(ax, ay)
    far = max(ax, ay)
    if x != x or y != y:
        return math.nan
    # An infinite coordinate points along its axis, two of them along the diagonal, as in C; inf / inf would be nan.
    if far == math.inf:
        near, far = (1.0, 1.0) if ax == ay else (0.0, 1.0)
    # Angle to the nearer axis, in [0, pi/4]. Above pi/8, whose tangent is _TAN_SIXTEENTH, the vector is turned back by
    # pi/4, to where the series converges fast. Every base comes with the rest that its double leaves out.
    base = 0.0
    base_rest = 0.0
    if near > _TAN_SIXTEENTH * far:
        t = (near - far) / (near + far)
        base = _EIGHTH
        base_rest = _EIGHTH_REST
    elif far > 0.0:
        t = near / far
    else:  # x and y are 0
        t = 0.0
    # Arctangent of t as an odd series: t + t**3 times a polynomial in z = t**2. The smallest terms are added first.
    z = t * t
    # fmt: off
    tail = _ATAN_1 + z * (_ATAN_2 + z * (_ATAN_3 + z * (_ATAN_4 + z * (_ATAN_5 + z * (_ATAN_6 + z * (_ATAN_7 + z * (
        _ATAN_8 + z * (_ATAN_9 + z * (_ATAN_10 + z * (_ATAN_11 + z * _ATAN_12))))))))))
    # fmt: on
    angle = base + (t + (t * (z * tail) + base_rest))
    # If the y axis is nearer, measure from there; then take the side of x into account.
    behind = math.copysign(1.0, x) < 0.0
    if ay > ax:
        angle = _QUARTER + (angle + _QUARTER_REST) if behind else _QUARTER - (angle - _QUARTER_REST)
    elif behind:
        angle = 2.0 * _QUARTER - (angle - 2.0 * _QUARTER_REST)
    return math.copysign(angle, y)


@helper
def acos(x):
    """Return the angle in [0, pi] of a cosine [rad]; nan outside of [-1, 1]."""
    return atan2(math.sqrt((1.0 - x) * (1.0 + x)), x)


@helper
def asin(x):
    """Return the angle in [-pi/2, pi/2] of a sine [rad]; nan outside of [-1, 1]."""
    return atan2(x, math.sqrt((1.0 - x) * (1.0 + x)))


@helper
def _exp_of_sum(x, rest):
    """Return exp(x + rest); ``rest`` is what the double x leaves out of the exponent."""
    # Overflow, NaN, underflow: doubles reach from exp(-745.1) to exp(709.78).
    if not x < 709.8:
        return math.inf if x > 0.0 else math.nan
    if x < -745.5:
        return 0.0
    # x + rest = power ln 2 + r with |r| <= ln 2 / 2. The first part of ln 2 has few bits, so that ``high`` is exact;
    # ``left_out`` is what the double r leaves out.
    power = math.floor(x * _INVERSE_LN2 + 0.5)
    high = x - power * _LN2_1
    low = power * _LN2_2 - rest
    r = high - low
    left_out = (high - r) - low
    # fmt: off
    tail = 1 / 2 + r * (1 / 6 + r * (1 / 24 + r * (1 / 120 + r * (1 / 720 + r * (1 / 5040 + r * (1 / 40320 + r * (
        1 / 362880 + r * (1 / 3628800 + r * (1 / 39916800 + r * (1 / 479001600 + r * (1 / 6227020800)))))))))))
    # fmt: on
    return math.ldexp(1.0 + (r + (left_out + r * r * tail)), power)


@helper
def exp(x):
    """Return e to the power of x."""
    return _exp_of_sum(x, 0.0)


@helper
def _split_exponent(x):
    """Return (f, k) with x = (1 + f) * 2**k and 1 + f in [sqrt(1/2), sqrt(2)), for a finite x > 0."""
    mantissa, k = math.frexp(x)
    # The mantissa lies in [1/2, 1). A small one is doubled; 2 * mantissa - 1 is formed without rounding.
    if mantissa < _ROOT_HALF:
        return (mantissa - 0.5) + (mantissa - 0.5), k - 1
    return mantissa - 1.0, k


@helper
def _log_tail(z):
    """Return (ln((1 + s) / (1 - s)) - 2 s) / (s z) for z = s**2 <= 0.0295."""
    return _LOG_1 + z * (_LOG_2 + z * (_LOG_3 + z * (_LOG_4 + z * (_LOG_5 + z * (_LOG_6 + z * (_LOG_7 + z * _LOG_8))))))


@helper
def log(x):
    """Return the natural logarithm; -inf for 0, nan for less than 0."""
    if not (0.0 < x < math.inf):
        if x == 0.0:
            return -math.inf
        return x if x > 0.0 else math.nan
    f, k = _split_exponent(x)
    # ln(1 + f) = ln((1 + s) / (1 - s)) with s = f / (2 + f); the largest terms are added last.
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    return k * _LN2_1 - ((half - (s * (half + z * _log_tail(z)) + k * _LN2_2)) - f)


@helper
def _product(a, b):
    """Return a * b as a double, and the rest of the exact product that it leaves out (Dekker 1971)."""
    product = a * b
    # Halve the bits of both factors: products of halves are exact.
    t = _SPLITTER * a
    a1 = t - (t - a)
    a2 = a - a1
    t = _SPLITTER * b
    b1 = t - (t - b)
    b2 = b - b1
    return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


@helper
def power(x, y):
    """Return x to the power of y, nan for x < 0 unless y is 0: exp(y ln x) with the logarithm in two doubles.

    Exponents of 1e15 or more count as infinite, and so do their negatives. This differs from C only if x is within
    1e-12 of 1.
    """
    # Special cases as in C, but for x < 0 and the sign of -0.0.
    if y == 0.0 or x == 1.0:
        return 1.0
    if y != y:
        return math.nan
    if not (0.0 < x < math.inf):
        # 0 to a positive power and infinity to a negative one are 0; the other two are infinite.
        if x == 0.0 or x == math.inf:
            return 0.0 if (x == 0.0) == (y > 0.0) else math.inf
        return math.nan
    if not abs(y) < 1e15:
        return math.inf if (y > 0.0) == (x > 1.0) else 0.0
    f, k = _split_exponent(x)
    # s = f / (2 + f) in two doubles: the quotient, and the remainder divided once more.
    d = 2.0 + f
    s = f / d
    p, p_rest = _product(s, d)
    s_rest = (((f - p) - p_rest) - s * (f - (d - 2.0))) / d
    z = s * s
    # ln x = k ln 2 + 2 s + s z tail, largest first, with the roundings of both sums kept. (For k = 0 the first sum
    # rounds nothing.)
    lead = k * _LN2_1
    high = lead + 2.0 * s
    low = ((lead - (high - 2.0 * s)) + (2.0 * s - (high - (high - 2.0 * s)))) if k != 0 else 0.0
    low += 2.0 * s_rest + k * _LN2_2
    small = s * (z * _log_tail(z))
    total = high + small
    low += (high - total) + small
    p, p_rest = _product(total, y)
    return _exp_of_sum(p, p_rest + low * y)


COS, SIN, TAN, ACOS, ASIN, ATAN2, EXP, LOG, POWER = range(9)


@kernel
def evaluate(function, x, y, out):
    """Set ``out`` to function(x, y) for arrays (n,); ``function`` is COS to POWER, those of one argument take x only.

    A single kernel, so that all functions are compiled together.
    """
    for i in range(len(out)):
        a = x[i]
        if function == COS:
            out[i] = cos(a)
        elif function == SIN:
            out[i] = sin(a)
        elif function == ATAN2:
            out[i] = atan2(a, y[i])
        elif function == ACOS:
            out[i] = acos(a)
        elif function == ASIN:
            out[i] = asin(a)
        elif function == TAN:
            out[i] = tan(a)
        elif function == EXP:
            out[i] = exp(a)
        elif function == LOG:
            out[i] = log(a)
        elif function == POWER:
            out[i] = power(a, y[i])
