"""The shortest path for a disc with the sections that it has for behaviors, in one call."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import polyline_length
from crowdsim.jit import kernel
from crowdsim.navmesh.paths.path_kernels import OK, plan_path
from crowdsim.planning.labels.fitting_kernels import annotate

_SPARE = 1.001
"""How much longer the way to a path may be than the path, which is pulled taut."""


@kernel
def labelled_path(m, regions, work, ends, radius, least, most, fitting):
    """(status, points (n, 2), length, sections (k, 3), cost) of the path from ends[0] to ends[1], as of `plan_path`.

    m, regions, work, radius, least: as there. No sections and infinite cost
    where it fits no behavior, or costs ``most`` or more by its length alone.
    """
    nothing = np.empty((0, 3))
    preferred = fitting.costs[fitting.costs.size - 1]
    sx, sy, gx, gy = ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1]
    longest = _SPARE * most / preferred
    status, points = plan_path(m, regions, work, sx, sy, gx, gy, radius, least, None, longest)
    if status != OK:
        return status, points, math.inf, nothing, math.inf
    length = polyline_length(points)
    if length * preferred >= most:
        return status, points, length, nothing, math.inf
    sections, cost, _ = annotate(fitting, points)
    return status, points, length, sections, cost
