"""Checks of the outlines of obstacles before they enter a mesh.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`. ``points`` (n, 2) [m] are the corners as
given, ``snapped`` (n, 2) those on the grid.
"""

from crowdsim.geometry.predicates_kernels import orient2d
from crowdsim.jit import helper, kernel

OK, BACKWARD, UNSURE, OUTSIDE, NOT_FINITE = range(5)
"""Results of the checks: counter-clockwise, clockwise, not known, beyond the box, NaN or infinite."""

_MOST_CORNERS = 64
"""Outlines of more corners are left to shapely: the time of the test here grows with the square of their number."""


@helper
def _touch_each_other(snapped, i, j, k, end):
    """Return True if the segments from corners i to j and from k to ``end`` have a point in common."""
    ax = snapped[i, 0]
    ay = snapped[i, 1]
    bx = snapped[j, 0]
    by = snapped[j, 1]
    cx = snapped[k, 0]
    cy = snapped[k, 1]
    dx = snapped[end, 0]
    dy = snapped[end, 1]
    # Their bounding boxes are apart.
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx):
        return False
    if max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    # Each segment has its ends on both sides of the other one's line, or on it.
    c = orient2d(ax, ay, bx, by, cx, cy)
    d = orient2d(ax, ay, bx, by, dx, dy)
    a = orient2d(cx, cy, dx, dy, ax, ay)
    b = orient2d(cx, cy, dx, dy, bx, by)
    return c * d <= 0.0 and a * b <= 0.0


@kernel
def snap_inside(m, points, snapped):
    """Move ``points`` (n, 2) to the grid, into ``snapped`` (n, 2) [m]; return OK, NOT_FINITE or OUTSIDE.

    OUTSIDE: a corner is less than one grid cell within the box of the mesh, or beyond it; none may lie on the box.
    If a corner is not finite, NOT_FINITE is returned in any case. ``snapped`` counts only if the result is OK.
    """
    frame = m.frame[0]
    cell = frame.cell
    status = OK
    for i in range(points.shape[0]):
        for axis in range(2):
            value = points[i, axis]
            # Written so that NaN fails. Infinite values fail, too; no real coordinate comes near 1e300 [m].
            if not abs(value) < 1e300:
                return NOT_FINITE
            low = frame.x0 if axis == 0 else frame.y0
            high = frame.x1 if axis == 0 else frame.y1
            # Corners stay one cell off the box, whose sides are on the grid: so none is moved onto a side.
            if not (value >= low + cell and value <= high - cell):
                status = OUTSIDE
            snapped[i, axis] = round(value / cell) * cell
    return status


@kernel
def check_outline(m, points, snapped):
    """Snap the corners ``points`` to the grid, into ``snapped``, and test if they go around a simple polygon.

    Return OK if counter-clockwise, BACKWARD if clockwise, or NOT_FINITE or OUTSIDE as :func:`snap_inside` does. UNSURE:
    sides meet except in common corners, corners coincide, the area is 0, or there are fewer than 3 corners or too many
    for this test.
    """
    status = snap_inside(m, points, snapped)
    if status != OK:
        return status
    count = snapped.shape[0]
    if count < 3 or count > _MOST_CORNERS:
        return UNSURE
    area = 0.0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        after = j + 1 if j + 1 < count else 0
        # At each corner: the side may not turn back on the one before, nor have no length.
        turn = orient2d(
            snapped[i, 0], snapped[i, 1], snapped[j, 0], snapped[j, 1], snapped[after, 0], snapped[after, 1]
        )
        ux = snapped[j, 0] - snapped[i, 0]
        uy = snapped[j, 1] - snapped[i, 1]
        if turn == 0.0 and ux * (snapped[after, 0] - snapped[j, 0]) + uy * (snapped[after, 1] - snapped[j, 1]) <= 0.0:
            return UNSURE
        # Twice the signed area, from triangles with the first corner.
        area += orient2d(snapped[0, 0], snapped[0, 1], snapped[i, 0], snapped[i, 1], snapped[j, 0], snapped[j, 1])
        # Compare with each later side that shares no corner with this one.
        for k in range(i + 2, count):
            if (i > 0 or k + 1 < count) and _touch_each_other(snapped, i, j, k, k + 1 if k + 1 < count else 0):
                return UNSURE
    if area == 0.0:
        return UNSURE
    return OK if area > 0.0 else BACKWARD
