"""The shortest path of a disc and its cheapest sections, in one call."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import polyline_length
from crowdsim.jit import kernel
from crowdsim.navmesh.paths.path_kernels import OK, plan_path
from crowdsim.planning.labels.fitting_kernels import annotate

_SPARE = 1.001
"""Length up to which a path is searched for, as a multiple of the longest one that may cost less than ``most``. Lower:
faster, but may miss the path."""


@kernel
def labelled_path(m, regions, work, ends, radius, least, most, fitting):
    """Find a short path of a disc from ends[0] to ends[1] and its cheapest sections.

    Parameters
    ----------
    m, regions, work, radius, least: as of :func:`crowdsim.navmesh.paths.path_kernels.plan_path`.
    ends: (2, 2) float64, start and goal [m].
    most: limit of the cost; infinite for none. The search gives up ways whose length alone costs a little more than
    this (see `_SPARE`), and only paths whose length alone costs less are labelled.
    fitting: :class:`crowdsim.planning.labels.fitting_kernels.Fitting`.

    Returns
    -------
    (status, points (n, 2), length [m], sections (k, 3), cost). The status is that of ``plan_path``; unless it is OK
    there are no points, and the length is infinite. No sections and infinite cost if there is no path, if no behavior
    fits somewhere, or if the length alone costs ``most`` or more.
    """
    nothing = np.empty((0, 3))
    preferred = fitting.costs[fitting.costs.size - 1]
    sx, sy, gx, gy = ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1]
    # Each meter costs at least as much as one of the preferred behavior, so ``most`` bounds the length.
    longest = _SPARE * most / preferred
    status, points = plan_path(m, regions, work, sx, sy, gx, gy, radius, least, None, longest)
    if status != OK:
        return status, points, math.inf, nothing, math.inf
    length = polyline_length(points)
    # Too dear by its length alone: save the labelling.
    if length * preferred >= most:
        return status, points, length, nothing, math.inf
    sections, cost, _ = annotate(fitting, points)
    return status, points, length, sections, cost
