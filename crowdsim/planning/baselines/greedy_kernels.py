"""The published planner (2018 paper, algorithm 1) in one kernel: detours around conflict points, while they pay."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import polyline_length
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.detour_kernels import DONE, find_detour, keeps_off
from crowdsim.navmesh.mesh.growing_kernels import longer_rows
from crowdsim.planning.labels.fitting_kernels import annotate
from crowdsim.planning.labels.labelling_kernels import MIN_SECTION

MOST_ROUNDS = 64
"""Largest number of times that a detour replaces the path."""

SAME_PLACE = 1e-6
"""Conflict points closer to each other than this, in x and in y, count as one [m]."""


@helper
def _point_along(points, arc):
    """Return the point (x, y) at ``arc`` meters along a polyline ``points`` (n, 2); beyond the end, its last point."""
    last = points.shape[0] - 1
    for i in range(last):
        ux = points[i + 1, 0] - points[i, 0]
        uy = points[i + 1, 1] - points[i, 1]
        size = hypot(ux, uy)
        if arc <= size and size > 0.0:
            return points[i, 0] + arc / size * ux, points[i, 1] + arc / size * uy
        arc -= size
    return points[last, 0], points[last, 1]


@helper
def _add_conflicts(points, sections, away, places, count):
    """Append the new conflict points of a path to ``places`` (c, 2) [m], filled up to ``count``; return both anew.

    ``points`` (n, 2) is the path [m], ``sections`` (k, 3) its rows (behavior, start, end [m]), 0 the narrowest
    behavior. Conflict points lie every ``MIN_SECTION`` along the sections of the narrowest behavior, or along the whole
    path if no behavior fits it, and farther than ``away`` meters from both ends. ``places`` grows as needed.
    """
    last = points.shape[0] - 1
    for k in range(max(sections.shape[0], 1)):
        # A section of another behavior than the narrowest keeps length 0, and gets no points.
        start = 0.0
        end = 0.0
        if sections.shape[0] == 0:
            end = polyline_length(points)
        elif sections[k, 0] == 0.0:
            start = sections[k, 1]
            end = sections[k, 2]
        # The first point is half a step from the start, or in the middle of a section shorter than a step.
        start += 0.5 * min(MIN_SECTION, end - start)
        for i in range(math.ceil((end - start) / MIN_SECTION)):
            x, y = _point_along(points, start + i * MIN_SECTION)
            if hypot(x - points[0, 0], y - points[0, 1]) <= away:
                continue
            if hypot(x - points[last, 0], y - points[last, 1]) <= away:
                continue
            # Skip a point that an earlier round has blocked.
            known = 0
            while known < count and max(abs(places[known, 0] - x), abs(places[known, 1] - y)) > SAME_PLACE:
                known += 1
            if known < count:
                continue
            if count == places.shape[0]:
                places = longer_rows(places)
            places[count, 0] = x
            places[count, 1] = y
            count += 1
    return places, count


@kernel
def plan_around(search, fitting):
    """Run algorithm 1: replace the path by its cheapest detour around one conflict point, while that pays.

    Parameters
    ----------
    search: :class:`crowdsim.navmesh.editing.detour_kernels.DetourSearch`, on a copy of the legs' mesh.
    fitting: :class:`crowdsim.planning.labels.fitting_kernels.Fitting`.

    Returns
    -------
    (status, cost, points (n, 2) [m], sections (k, 3)). Sections are rows (behavior, start, end), from arc length to
    arc length [m], as of :func:`crowdsim.planning.labels.fitting_kernels.annotate`. The cost is the sum of length times
    cost per meter (``fitting.costs``), and of changes of behavior. A status other than DONE (see
    :mod:`crowdsim.navmesh.editing.detour_kernels`): the mesh is out of room or unusable, or a detour could not be
    traced; the path is then the best one up to there. No sections and infinite cost if no behavior fits; no points,
    either, if there is no path.
    """
    # search.ends: x, y of start and goal, the radius searched with, and the clearance that paths must keep.
    radius = search.ends[4]
    least = search.ends[5]
    preferred = fitting.costs[fitting.costs.size - 1]
    # The shortest path for the legs, and its sections (algorithm 2). An obstacle at infinity is outside of the mesh and
    # changes nothing.
    status, direct = find_detour(search, math.inf, math.inf)
    points = direct
    sections = np.empty((0, 3))
    cost = math.inf
    # The mesh is unusable, or there is no path.
    if status != DONE or direct.shape[0] == 0:
        return status, cost, points, sections
    sections, cost, _ = annotate(fitting, direct)
    places = np.empty((64, 2))
    count = np.int64(0)
    for _ in range(MOST_ROUNDS):
        # Block each conflict point on its own. A point blocked in an earlier round would give a known, dearer detour.
        # Within ``radius`` of an end a blocker would block the end itself; twice that leaves room around it.
        first = count
        places, count = _add_conflicts(points, sections, 2.0 * radius, places, count)
        lowest = cost
        best = points
        labels = sections
        for k in range(first, count):
            # A blocker clear of the unblocked shortest path leads back to that path.
            if keeps_off(direct, places[k, 0], places[k, 1], least):
                continue
            status, detour = find_detour(search, places[k, 0], places[k, 1])
            if status != DONE:
                return status, cost, points, sections
            # Lower bound of a detour's cost: its length at the preferred behavior.
            if detour.shape[0] == 0 or polyline_length(detour) * preferred >= lowest:
                continue
            found, value, _ = annotate(fitting, detour)
            if value < lowest:
                best, labels, lowest = detour, found, value
        # No detour costs less than the path.
        if lowest == cost:
            break
        # The cheapest detour becomes the path.
        points, sections, cost = best, labels, lowest
    return DONE, cost, points, sections
