"""Exact orientation and in-circle tests for coordinates on a power-of-two grid.

The caller snaps every coordinate to a grid whose cell is a power of two and which spans at most 2**25 cells
(:mod:`crowdsim.geometry.snapping`). Differences are then integers of at most 25 bits times the cell: products of two of
them are exact in float64, and the in-circle determinant is exact in integers of three limbs.
"""

from crowdsim.jit import helper, kernel

_LIMB = 26
_MASK = (1 << _LIMB) - 1
"""Bit mask of a limb, a part of a long integer."""
_ROUNDING = 2.0**-50
"""Bound of the relative error of a sum of three rounded products, as a share of the sum of their sizes."""


@kernel
def orient2d(ax, ay, bx, by, cx, cy):
    """Return twice the signed area of abc [m2], exact for grid coordinates; positive if c is left of a -> b."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def incircle(ax, ay, bx, by, cx, cy, dx, dy, cells):
    """Return the sign of d against the circle through the counter-clockwise a, b, c: 1 inside, 0 on it, -1 outside.

    Coordinates are in meters, ``cells`` is 1 / cell of the grid [1/m]. The sign is exact for grid coordinates.
    """
    # The determinant of d's in-circle test, with d as the origin.
    ax -= dx
    ay -= dy
    bx -= dx
    by -= dy
    cx -= dx
    cy -= dy
    # Exact up to here, as are the two factors of each product, of at most 51 bits. Rounded are three products and two
    # sums.
    a = (ax * ax + ay * ay) * (bx * cy - by * cx)
    b = (bx * bx + by * by) * (cx * ay - cy * ax)
    c = (cx * cx + cy * cy) * (ax * by - ay * bx)
    total = a + b + c
    # The sign is certain beyond the error bound; otherwise compute in integers.
    error = _ROUNDING * (abs(a) + abs(b) + abs(c))
    if total > error:
        return 1
    if total < -error:
        return -1
    return _exact_incircle(ax * cells, ay * cells, bx * cells, by * cells, cx * cells, cy * cells)


@helper
def _exact_incircle(ax, ay, bx, by, cx, cy):
    """Return the sign of the origin against the circle through the counter-clockwise a, b, c, as `incircle` does.

    Coordinates are relative to the tested point, in cells: float64 with whole numbers.
    """
    # The determinant of `incircle` in integers: each lift is the squared distance of a corner.
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
    # The sum of lift * minor has up to 104 bits: add it up in limbs of 26 bits. Shift and mask round down, so that a
    # negative minor, too, is m1 * 2**26 + m0 with m0 >= 0.
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
    # Carry from limb to limb; the highest one has the sign.
    middle += low >> _LIMB
    low &= _MASK
    high += middle >> _LIMB
    middle &= _MASK
    if high > 0:
        return 1
    if high < 0:
        return -1
    return 1 if (middle > 0 or low > 0) else 0
