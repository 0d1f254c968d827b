"""Paths between two places while obstacles come and go, guided by how far it is without them."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import kernel
from crowdsim.navmesh.editing.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.editing.point_kernels import INSERT, REMOVE, edit_point, has_room
from crowdsim.navmesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.guide_kernels import add_sides, clear_guide, fill_guide
from crowdsim.navmesh.paths.interval_kernels import find_way
from crowdsim.navmesh.paths.path_kernels import OK, append_path, plan_path

_INSERT = np.int64(INSERT)
_REMOVE = np.int64(REMOVE)
"""As they come from Python: for bare numbers the whole edit would compile once more."""

_ROOM = np.int64(16)
"""Corners that an edit must have room for beforehand, so that the one that undoes it has room as well."""

DONE = 0
NO_ROOM = 1
"""Make the arrays of the mesh larger and go on."""
LOST = 2
"""The mesh is useless, with more new vertices around one point than anybody has seen; make it anew and go on."""


@kernel
def begin_guide(m, guide):
    """Make a ``guide`` of zeros one for the mesh, of whatever radius and goal."""
    add_sides(m, guide)


@kernel
def aim_guide(m, work, sx, sy, gx, gy, radius, least, limit, guide):
    """Fill ``guide`` for ways of a disc of ``radius`` from (sx, sy) to (gx, gy), both free, up to ``limit`` meters.

    What it knew of others before is forgotten; the mesh is as it was when the guide was begun.
    """
    clear_guide(guide)
    goal = triangle_of(m, gx, gy, NONE)
    _, used = find_way(m, None, work, goal, gx, gy, NONE, sx, sy, radius, 2.0 * least, guide, limit)
    fill_guide(m, work.labels, used, radius, limit, guide)


@kernel
def plan_detours(places, work, sx, sy, gx, gy, radius, least, guide, blocked, first, points, ends, status, lengths):
    """Paths as of `crowdsim.navmesh.paths.path_kernels.plan_path`, found with ``guide``, around one place each.

    For each row of ``blocked`` (n, 2) from ``first`` on, a point obstacle is put there into the mesh at ``places`` (see
    address_kernels) and removed again. Fills ``status`` (n,), that of the path, ``lengths`` (n,), infinite for none,
    and ``ends`` (n,): path i has the points (m, 2) from ends[i - 1] up to ends[i]. ``points`` grow as they are needed.

    Returns (DONE, or why not, the row up to which all is done, points).
    """
    m = mesh_at(places)
    w = workshop_at(places)
    filled = ends[first - 1] if first > 0 else 0
    for i in range(first, blocked.shape[0]):
        if not has_room(m, w, _ROOM):
            return NO_ROOM, i, points
        v = edit_point(places, _INSERT, blocked[i, 0], blocked[i, 1], NONE)
        if v < NONE:
            return LOST, i, points
        found, path = plan_path(m, None, work, sx, sy, gx, gy, radius, least, guide)
        if edit_point(places, _REMOVE, 0.0, 0.0, v) < NONE:
            return LOST, i, points
        status[i] = found
        lengths[i] = math.inf
        if found == OK:
            points, lengths[i] = append_path(points, filled, path)
            filled += path.shape[0]
        ends[i] = filled
    return DONE, blocked.shape[0], points


@kernel
def keeps_off(points, x, y, distance):
    """Whether the polyline ``points`` (n, 2) comes nowhere closer than ``distance`` to (x, y)."""
    nearest = math.inf
    for k in range(points.shape[0] - 1):
        d2 = point_segment_distance2(x, y, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1])
        nearest = min(nearest, d2)
    return nearest >= distance * distance
