"""A path as samples at equal steps of arc length: its points and directions, and the nearest point of a stretch.

``guide.pose`` (m, 3) are the samples, ``guide.step`` meters apart, ``guide.per_meter`` of them per meter. Arc length
runs from 0 to the path's length. The path continues straight beyond both ends, so that a motion that starts before it
or overshoots it still has a target.

``arc`` is an arc length, ``low`` and ``high`` bound the arc length that is searched [m].
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel


@helper
def sample_index(guide, arc):
    """Return the index of the path sample nearest to ``arc``."""
    # Truncation rounds negative numbers up, but there the first sample is right anyway.
    return min(max(np.int64(arc * guide.per_meter + 0.5), 0), guide.pose.shape[0] - 1)


@helper
def sample_before(guide, arc):
    """Return the index of the last path sample at or before ``arc``."""
    return min(max(np.int64(arc * guide.per_meter), 0), guide.pose.shape[0] - 1)


@helper
def path_point(guide, arc):
    """Return the point (x, y) of the path at ``arc``."""
    samples = arc * guide.per_meter
    i = min(max(np.int64(samples), 0), guide.pose.shape[0] - 2)
    u = samples - i
    x, y = guide.pose[i, 0], guide.pose[i, 1]
    return x + u * (guide.pose[i + 1, 0] - x), y + u * (guide.pose[i + 1, 1] - y)


@helper
def project(guide, x, y, low, high):
    """Return the arc length of the path's point nearest to (x, y), from ``low`` to ``high``, and its distance [m].

    Whole pieces between samples are searched, so the arc length may be up to a step outside of ``low`` and ``high``. It
    may be below 0 or above the path's length, as the first and the last piece continue straight. The first of several
    nearest points wins. Pieces that cannot be nearer than the best are skipped, as consecutive samples are at most a
    step apart.
    """
    pose = guide.pose
    per_meter = guide.per_meter
    last = pose.shape[0] - 1
    begin = min(max(np.int64(low * per_meter), 0), last - 1)
    end = min(max(np.int64(high * per_meter), begin), last - 1)
    # near: an upper bound of the least squared distance, from the sample at high.
    ux, uy = x - pose[end, 0], y - pose[end, 1]
    near = ux * ux + uy * uy
    worth = 8.0 * guide.step * guide.step
    best_at = 0.0
    best = math.inf
    i = begin
    while i <= end:
        ax, ay = pose[i, 0], pose[i, 1]
        dx, dy = pose[i + 1, 0] - ax, pose[i + 1, 1] - ay
        ux, uy = x - ax, y - ay
        along, whole = ux * dx + uy * dy, dx * dx + dy * dy
        # Clamp the foot to the piece, except on the first and last, which continue the path straight.
        if along <= 0.0 and i > 0:
            u = 0.0
            gap = ux * ux + uy * uy
        elif along >= whole and i < last - 1:
            u = 1.0
            gap = (ux - dx) ** 2 + (uy - dy) ** 2
        else:
            u = along / whole
            gap = (ux - u * dx) ** 2 + (uy - u * dy) ** 2
        if gap < best:
            best = gap
            best_at = i + u
            near = min(near, gap)
        # A piece two steps farther than the nearest lets the search skip ahead; test that without a square root, by
        # (a + b)^2 <= 2 a^2 + 2 b^2 for a distance and two steps.
        leap = np.int64(1)
        if gap > 2.0 * near + worth:
            leap = max(np.int64((math.sqrt(gap) - math.sqrt(near)) * per_meter) - 1, leap)
        # The last piece extends beyond the path's end, so it may be nearer than its samples: never skip it.
        i = max(min(i + leap, last - 1), i + 1)
    return best_at * guide.step, math.sqrt(best)


@helper
def path_gap(guide, x, y, low, high):
    """Return what :func:`project` does, but for a path that stops at its ends: arc length and distance [m]."""
    arc, gap = project(guide, x, y, low, high)
    if arc < 0.0 or arc > guide.length:
        arc = min(max(arc, 0.0), guide.length)
        px, py = path_point(guide, arc)
        gap = math.sqrt((x - px) * (x - px) + (y - py) * (y - py))
    return arc, gap


@kernel
def near_planned(arc, behavior, widest, reach, allowed):
    """Fill ``allowed`` (m,): True within ``reach`` [m] of a sample planned for behavior ``widest`` or a narrower one.

    ``arc`` (m,) are the arc lengths of the samples [m], ``behavior`` (m,) int32 the behaviors planned there.
    """
    # Forwards from the planned samples, then backwards.
    last = -math.inf
    for i in range(len(arc)):
        if behavior[i] <= widest:
            last = arc[i]
        allowed[i] = arc[i] - last <= reach
    following = math.inf
    for i in range(len(arc) - 1, -1, -1):
        if behavior[i] <= widest:
            following = arc[i]
        allowed[i] = allowed[i] or following - arc[i] <= reach
