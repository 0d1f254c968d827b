"""Paths between two places while obstacles come and go, guided by how far it is without them."""

import math

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import kernel
from crowdsim.navmesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.guide_kernels import clear_guide, fill_guide
from crowdsim.navmesh.paths.interval_kernels import find_way
from crowdsim.navmesh.paths.path_kernels import plan_path


@kernel
def make_guide(m, work, sx, sy, gx, gy, radius, least, limit, guide):
    """Fill ``guide`` for ways of a disc of ``radius`` from (sx, sy) to (gx, gy), both free, up to ``limit`` meters."""
    clear_guide(m, limit, guide)
    goal = triangle_of(m, gx, gy, NONE)
    _, used = find_way(m, None, work, goal, gx, gy, NONE, sx, sy, radius, 2.0 * least, guide, limit)
    fill_guide(m, work.labels, used, radius, guide)


@kernel
def plan_guided(m, work, sx, sy, gx, gy, radius, least, guide):
    """(status, points (n, 2), meters) as of `crowdsim.navmesh.paths.path_kernels.plan_path`, found with ``guide``."""
    status, points = plan_path(m, None, work, sx, sy, gx, gy, radius, least, guide)
    length = 0.0
    for k in range(points.shape[0] - 1):
        length += math.hypot(points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1])
    return status, points, length


@kernel
def keeps_off(points, x, y, distance):
    """Whether the polyline ``points`` (n, 2) comes nowhere closer than ``distance`` to (x, y)."""
    nearest = math.inf
    for k in range(points.shape[0] - 1):
        d2 = point_segment_distance2(x, y, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1])
        nearest = min(nearest, d2)
    return nearest >= distance * distance
