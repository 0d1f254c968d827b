"""Squared distances between points and segments, and lengths of polylines."""

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel


@kernel
def point_segment_distance2(px, py, ax, ay, bx, by):
    """Return the squared distance from p to the segment from a to b, which may be a point [m2]."""
    ux = bx - ax
    uy = by - ay
    wx = px - ax
    wy = py - ay
    length2 = ux * ux + uy * uy
    along = ux * wx + uy * wy
    # Before a, beyond b, or beside the segment, where the cross product is distance times length.
    if along <= 0.0:
        return wx * wx + wy * wy
    if along >= length2:
        wx = px - bx
        wy = py - by
        return wx * wx + wy * wy
    cross = ux * wy - uy * wx
    return cross * cross / length2


@kernel
def segment_segment_distance2(px, py, qx, qy, ax, ay, bx, by):
    """Return the squared distance between two segments, which may be points [m2]; 0 if they cross.

    One leads from p to q, the other from a to b.
    """
    # They cross if each has its ends strictly on both sides of the other one's line.
    ux = qx - px
    uy = qy - py
    side_a = ux * (ay - py) - uy * (ax - px)
    side_b = ux * (by - py) - uy * (bx - px)
    vx = bx - ax
    vy = by - ay
    side_p = vx * (py - ay) - vy * (px - ax)
    side_q = vx * (qy - ay) - vy * (qx - ax)
    if ((side_a > 0.0 and side_b < 0.0) or (side_a < 0.0 and side_b > 0.0)) and (
        (side_p > 0.0 and side_q < 0.0) or (side_p < 0.0 and side_q > 0.0)
    ):
        return 0.0
    # Otherwise the nearest pair of points includes an end.
    best = point_segment_distance2(px, py, ax, ay, bx, by)
    best = min(best, point_segment_distance2(qx, qy, ax, ay, bx, by))
    best = min(best, point_segment_distance2(ax, ay, px, py, qx, qy))
    return min(best, point_segment_distance2(bx, by, px, py, qx, qy))


@kernel
def add_lengths(points, arc):
    """Fill ``arc`` (n,) with the length of a polyline (n, 2) up to each of its points [m]."""
    length = 0.0
    for i in range(points.shape[0]):
        if i > 0:
            length += hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        arc[i] = length


@helper
def polyline_length(points):
    """Return the length of a polyline (n, 2) [m]."""
    length = 0.0
    for i in range(points.shape[0] - 1):
        length += hypot(points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1])
    return length
