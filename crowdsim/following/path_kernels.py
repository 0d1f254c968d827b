"""A path as samples at equal steps of arc length: where it is, where it goes, the nearest point of a stretch.

``arc`` runs from 0 to the length L; a path goes on straight beyond both ends, so that a motion that starts before
it or overshoots it still has somewhere to aim.
"""

import math

from crowdsim.jit import helper


@helper
def sample_index(guide, arc):
    """Index of the path sample nearest to ``arc``."""
    last = guide.arc.shape[0] - 1
    i = math.floor(arc / guide.arc[last] * last + 0.5)
    return min(max(i, 0), last)


@helper
def sample_before(guide, arc):
    """Index of the last path sample at or before ``arc``."""
    last = guide.arc.shape[0] - 1
    i = math.floor(arc / guide.arc[last] * last)
    return min(max(i, 0), last)


@helper
def path_point(guide, arc):
    """Point (x, y) at ``arc``."""
    last = guide.arc.shape[0] - 1
    i = min(max(math.floor(arc / guide.arc[last] * last), 0), last - 1)
    u = (arc - guide.arc[i]) / (guide.arc[i + 1] - guide.arc[i])
    return (
        guide.pose[i, 0] + u * (guide.pose[i + 1, 0] - guide.pose[i, 0]),
        guide.pose[i, 1] + u * (guide.pose[i + 1, 1] - guide.pose[i, 1]),
    )


@helper
def project(guide, x, y, low, high):
    """Arc length of the point nearest to (x, y) between the arcs ``low`` and ``high``, and its distance.

    Of points equally near the first. Pieces that cannot be nearer than the best are leapt over: no sample is
    farther from the next than a step.
    """
    last = guide.arc.shape[0] - 1
    step = guide.arc[last] / last
    begin = min(max(math.floor(low / step), 0), last - 1)
    end = min(max(math.floor(high / step), begin), last - 1)
    best_arc = 0.0
    best = math.inf
    near = math.inf
    i = begin
    while i <= end:
        ax, ay = guide.pose[i, 0], guide.pose[i, 1]
        dx, dy = guide.pose[i + 1, 0] - ax, guide.pose[i + 1, 1] - ay
        ux, uy = x - ax, y - ay
        along, whole = ux * dx + uy * dy, dx * dx + dy * dy
        if along <= 0.0 and i > 0:
            u = 0.0
            gap = ux * ux + uy * uy
        elif along >= whole and i < last - 1:
            u = 1.0
            gap = (ux - dx) ** 2 + (uy - dy) ** 2
        else:
            u = along / whole
            gap = (ux - u * dx) ** 2 + (uy - u * dy) ** 2
        distance = math.sqrt(gap)
        if gap < best:
            best = gap
            near = distance
            best_arc = guide.arc[i] + u * (guide.arc[i + 1] - guide.arc[i])
        # The last piece goes on beyond the end of the path and may be nearer than its samples.
        leap = math.floor((distance - near) / step) - 1
        i = max(min(i + leap, last - 1), i + 1)
    return best_arc, near
