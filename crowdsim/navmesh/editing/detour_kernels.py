"""Paths between two places while obstacles come and go, guided by how far it is without them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.point_kernels import INSERT, edit_point, has_room
from crowdsim.navmesh.editing.undo_kernels import copy_back
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.component_kernels import are_joined
from crowdsim.navmesh.paths.guide_kernels import GUIDE, add_sides, clear_guide, fill_guide
from crowdsim.navmesh.paths.interval_kernels import find_way
from crowdsim.navmesh.paths.path_kernels import OK, TANGLED, plan_path
from crowdsim.navmesh.paths.workspace import Workspace

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


class DetourSearch(NamedTuple):
    """A mesh that one thread may edit, and two places in it between which detours are looked for."""

    places: NDArray[np.int64]
    """Those of the mesh and its workshop (see address_kernels)."""
    before: NDArray[np.int64]
    """Places of a copy of the mesh, with as much room, from which edits are undone."""
    work: Workspace
    ends: tuple[float, float, float, float, float, float]
    """x, y of start and goal, radius and least clearance."""
    guide: NDArray[Any]


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
def find_detour(search, x, y):
    """(DONE, or why not, points (n, 2)) of the path between the ends of ``search`` around (x, y) as well.

    A point obstacle is put there into the mesh and taken back by copying. No points where there is no path.
    """
    places = search.places
    m = mesh_at(places)
    sx, sy, gx, gy, radius, least = search.ends
    nothing = np.empty((0, 2))
    if not has_room(m, workshop_at(places), _ROOM):
        return NO_ROOM, nothing
    v = edit_point(places, _INSERT, x, y, NONE)
    if v < NONE:
        return LOST, nothing
    found, path = plan_path(m, None, search.work, sx, sy, gx, gy, radius, least, search.guide)
    if v >= 0 and not copy_back(places, search.before):
        return LOST, nothing
    if found == TANGLED:
        return NOT_TRACED, nothing
    return DONE, path if found == OK else nothing


@kernel
def keeps_off(points, x, y, distance):
    """Whether the polyline ``points`` (n, 2) comes nowhere closer than ``distance`` to (x, y)."""
    nearest = math.inf
    for k in range(points.shape[0] - 1):
        d2 = point_segment_distance2(x, y, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1])
        nearest = min(nearest, d2)
    return nearest >= distance * distance
