"""Exact orientation and in-circle tests for coordinates on a power-of-two grid.

The caller snaps every coordinate to a grid whose cell is a power of two and which spans at most 2**25 cells
(:mod:`crowdsim.geometry.snapping`). Then differences are integers of at most 25 bits times the cell: products of two
fit float64 exactly, and the in-circle determinant fits two-limb integers.
"""

from crowdsim.jit import helper, kernel

_LIMB = 26
_MASK = (1 << _LIMB) - 1
_ROUNDING = 2.0**-50
"""More than the relative error of a sum of three products, times the sum of their sizes, which is rounded as well."""


@kernel
def orient2d(ax, ay, bx, by, cx, cy):
    """Twice the signed area of abc, exact for grid coordinates; positive when c is left of a -> b."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def incircle(ax, ay, bx, by, cx, cy, dx, dy, cells):
    """Sign of d against the circle through the counter-clockwise abc, +1 inside; ``cells`` is 1 / cell."""
    ax -= dx
    ay -= dy
    bx -= dx
    by -= dy
    cx -= dx
    cy -= dy
    # Exact up to here, and so are the two factors of each product, of at most 51 bits: three products are rounded, and
    # two sums.
    a = (ax * ax + ay * ay) * (bx * cy - by * cx)
    b = (bx * bx + by * by) * (cx * ay - cy * ax)
    c = (cx * cx + cy * cy) * (ax * by - ay * bx)
    total = a + b + c
    error = _ROUNDING * (abs(a) + abs(b) + abs(c))
    if total > error:
        return 1
    if total < -error:
        return -1
    return _exact_incircle(ax * cells, ay * cells, bx * cells, by * cells, cx * cells, cy * cells)


@helper
def _exact_incircle(ax, ay, bx, by, cx, cy):
    """Sign of the origin against the circle through the counter-clockwise abc, whose coordinates are integers."""
    aix = int(ax)
    aiy = int(ay)
    bix = int(bx)
    biy = int(by)
    cix = int(cx)
    ciy = int(cy)
    lift_a = aix * aix + aiy * aiy
    lift_b = bix * bix + biy * biy
    lift_c = cix * cix + ciy * ciy
    minor_a = bix * ciy - biy * cix
    minor_b = cix * aiy - ciy * aix
    minor_c = aix * biy - aiy * bix
    # The sum of lift * minor has up to 104 bits: add it up in limbs of 26 bits.
    high = 0
    middle = 0
    low = 0
    for lift, minor in ((lift_a, minor_a), (lift_b, minor_b), (lift_c, minor_c)):
        l1 = lift >> _LIMB
        l0 = lift & _MASK
        m1 = minor >> _LIMB
        m0 = minor & _MASK
        high += l1 * m1
        middle += l1 * m0 + l0 * m1
        low += l0 * m0
    middle += low >> _LIMB
    low &= _MASK
    high += middle >> _LIMB
    middle &= _MASK
    if high > 0:
        return 1
    if high < 0:
        return -1
    return 1 if (middle > 0 or low > 0) else 0
