"""Gaps between two bodies on their timelines, while they move from one sample to the next.

``a`` and ``b`` are two timelines (K, 13), with the columns of :data:`crowdsim.crowd.state.components.SAMPLE`; one body
moves from sample ``i`` to ``j``, the other from ``k`` to ``m``. A body is a disc, or a capsule if it has a core.
"""

import math

from crowdsim.crowd.state.components import CORE, QUARTERS, RADIUS, REST
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper

_DISCS = 4
"""Discs to either side of the middle of a capsule, where the motion of two bodies is followed exactly."""


@helper
def moving_gap(a, i, j, b, k, m):
    """Return the least gap of two bodies [m] while they move from sample ``i`` to ``j`` and from ``k`` to ``m``.

    A capsule is replaced by three discs. A segment is as broad as the broader of its ends.
    """
    radii = max(a[i, RADIUS], a[j, RADIUS]) + max(b[k, RADIUS], b[m, RADIUS])
    my_discs = a[i, CORE] != 0.0 or a[i, CORE + 1] != 0.0 or a[j, CORE] != 0.0 or a[j, CORE + 1] != 0.0
    its_discs = b[k, CORE] != 0.0 or b[k, CORE + 1] != 0.0 or b[m, CORE] != 0.0 or b[m, CORE + 1] != 0.0
    mine = 1 if my_discs else 0
    its = 1 if its_discs else 0
    least = math.inf
    for p in range(-mine, mine + 1):
        for q in range(-its, its + 1):
            # Relative motion of two discs: a point from d to d + e. Its nearest distance to the origin is at t.
            dx = a[i, 0] + p * a[i, CORE] - b[k, 0] - q * b[k, CORE]
            dy = a[i, 1] + p * a[i, CORE + 1] - b[k, 1] - q * b[k, CORE + 1]
            ex = a[j, 0] + p * a[j, CORE] - b[m, 0] - q * b[m, CORE] - dx
            ey = a[j, 1] + p * a[j, CORE + 1] - b[m, 1] - q * b[m, CORE + 1] - dy
            square = ex * ex + ey * ey
            t = 0.0
            if square > 0.0:
                t = min(max(-(dx * ex + dy * ey) / square, 0.0), 1.0)
            cx = dx + t * ex
            cy = dy + t * ey
            least = min(least, cx * cx + cy * cy)
    return math.sqrt(least) - radii


@helper
def _at_quarter(a, i, j, quarter, p, axis):
    """Return a coordinate of a point of a core after some quarters of its way from sample ``i`` to ``j`` [m].

    ``p`` is -1 and 1 at the ends of the core.
    """
    share = 0.25 * quarter
    core = a[i, CORE + axis] + share * (a[j, CORE + axis] - a[i, CORE + axis])
    place = a[i, axis] + share * (a[j, axis] - a[i, axis]) + p * core
    if j > i and 0 < quarter < 4:
        place += a[i, QUARTERS + 2 * (quarter - 1) + axis]
    return place


@helper
def beside_discs(a, i, j, pieces):
    """Return how far a capsule reaches beyond discs along its core, ``pieces`` to either side of the middle [m]."""
    core = max(hypot(a[i, CORE], a[i, CORE + 1]), hypot(a[j, CORE], a[j, CORE + 1]))
    radius = max(a[i, RADIUS], a[j, RADIUS])
    away = 0.5 * core / pieces
    return radius - math.sqrt(max(radius * radius - away * away, 0.0))


@helper
def sure_gap(a, i, j, b, k, m):
    """Return a lower bound of the gap of two bodies [m] from sample ``i`` to ``j`` and from ``k`` to ``m``.

    Tracks are followed from quarter to quarter, and capsules are nine discs; the bound allows for the rest of both.
    """
    mine = _DISCS if a[i, CORE] != 0.0 or a[i, CORE + 1] != 0.0 or a[j, CORE] != 0.0 or a[j, CORE + 1] != 0.0 else 0
    its = _DISCS if b[k, CORE] != 0.0 or b[k, CORE + 1] != 0.0 or b[m, CORE] != 0.0 or b[m, CORE + 1] != 0.0 else 0
    least = math.inf
    for p in range(-mine, mine + 1):
        for q in range(-its, its + 1):
            u, v = p / _DISCS, q / _DISCS
            dx = _at_quarter(a, i, j, 0, u, 0) - _at_quarter(b, k, m, 0, v, 0)
            dy = _at_quarter(a, i, j, 0, u, 1) - _at_quarter(b, k, m, 0, v, 1)
            for quarter in range(1, 5):
                ex = _at_quarter(a, i, j, quarter, u, 0) - _at_quarter(b, k, m, quarter, v, 0)
                ey = _at_quarter(a, i, j, quarter, u, 1) - _at_quarter(b, k, m, quarter, v, 1)
                least = min(least, point_segment_distance2(0.0, 0.0, dx, dy, ex, ey))
                dx, dy = ex, ey
    gap = math.sqrt(least) - max(a[i, RADIUS], a[j, RADIUS]) - max(b[k, RADIUS], b[m, RADIUS])
    return gap - a[i, REST] - b[k, REST] - beside_discs(a, i, j, _DISCS) - beside_discs(b, k, m, _DISCS)
