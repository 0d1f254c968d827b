"""Paths between two places while obstacles come and go, guided by how far it is without them."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.point_kernels import INSERT, edit_point, has_room
from crowdsim.navmesh.editing.undo_kernels import copy_edited
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.checked_kernels import add_dot, drop_dot
from crowdsim.navmesh.paths.component_kernels import are_joined
from crowdsim.navmesh.paths.guide_kernels import GUIDE, add_sides, clear_guide, fill_guide
from crowdsim.navmesh.paths.interval_kernels import find_way
from crowdsim.navmesh.paths.path_kernels import OK, TANGLED, append_path, plan_path

_INSERT = np.int64(INSERT)
"""As it comes from Python: for a bare number the whole edit would compile once more."""

_ROOM = np.int64(16)
"""Corners that an edit must have room for beforehand, so that it need not be settled in larger arrays."""

DONE = 0
NO_ROOM = 1
"""Make the arrays of the mesh larger."""
LOST = 2
"""The mesh is useless, as more changed around one point than anybody has seen; make it anew."""
NOT_TRACED = 3
"""There is a way, but repair found no path along it; a search without a guide may."""


@kernel
def begin_guide(m, guide):
    """Make a ``guide`` of zeros one for the mesh, of whatever radius and goal."""
    add_sides(m, guide)


@kernel
def aim_guide(m, labels, work, sx, sy, gx, gy, radius, least, farther, guide):
    """Fill ``guide`` for ways of a disc of ``radius`` from (sx, sy) to (gx, gy), both free.

    It knows ways that are longer than a short one by ``farther``, a factor and meters. What it knew of others before is
    forgotten; the mesh is as it was when the guide was begun. ``labels`` are those of `label_sides` for the disc: where
    they part the two, the guide knows nothing, rather than all that can be reached from the goal.
    """
    clear_guide(guide)
    goal = triangle_of(m, gx, gy, NONE)
    start = triangle_of(m, sx, sy, goal)
    if start < 0 or goal < 0:
        return
    if start != goal and not are_joined(m, labels, start, sx, sy, goal, gx, gy, 2.0 * least):
        return
    nothing = np.zeros(3, GUIDE)
    _, used, limit = find_way(m, None, work, goal, gx, gy, start, sx, sy, radius, 2.0 * least, nothing, farther)
    fill_guide(m, work.labels, used, radius, limit, guide)


@helper
def find_detour(places, before, m, w, work, checked, sx, sy, gx, gy, radius, least, guide, x, y, points, filled):
    """The path of `crowdsim.navmesh.paths.path_kernels.plan_path`, found with ``guide``, around (x, y) as well.

    A point obstacle is put there into the mesh at ``places`` (see address_kernels) and taken back: at ``before`` is a
    copy of the mesh, with as much room. The path is written behind the first ``filled`` of ``points``, which grow as
    they are needed.

    Returns (DONE, or why not, points, up to where they are filled, length: infinite where there is no path).
    """
    if not has_room(m, w, _ROOM) or not add_dot(checked, x, y):
        return NO_ROOM, points, filled, math.inf
    v = edit_point(places, _INSERT, x, y, NONE)
    if v < NONE:
        return LOST, points, filled, math.inf
    found, path = plan_path(m, None, work, sx, sy, gx, gy, radius, least, guide, checked)
    drop_dot(checked)
    if v >= 0 and not copy_edited(places, before, places):
        return LOST, points, filled, math.inf
    if found == TANGLED:
        return NOT_TRACED, points, filled, math.inf
    if found != OK:
        return DONE, points, filled, math.inf
    points, length = append_path(points, filled, path)
    return DONE, points, filled + path.shape[0], length


@kernel
def keeps_off(points, x, y, distance):
    """Whether the polyline ``points`` (n, 2) comes nowhere closer than ``distance`` to (x, y)."""
    nearest = math.inf
    for k in range(points.shape[0] - 1):
        d2 = point_segment_distance2(x, y, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1])
        nearest = min(nearest, d2)
    return nearest >= distance * distance
