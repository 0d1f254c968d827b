"""Paths between two places around one more obstacle, guided by the lengths of ways without it.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``work`` is the
:class:`crowdsim.navmesh.paths.workspace.Workspace`; ``least`` is the clearance that counts as enough, the radius less
the tolerance; all lengths and coordinates are in meters.
"""

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
"""An int64, as Python passes it: for a bare number numba would compile the whole edit once more."""

_ROOM = np.int64(16)
"""Room that an edit must find beforehand, in corners, so that it hardly ever has to be settled in larger arrays."""

DONE = 0
NO_ROOM = 1
"""Status: the arrays of the mesh are too small; make them larger."""
LOST = 2
"""Status: the edit failed, or changed more than can be undone; the mesh is useless, make it anew."""
NOT_TRACED = 3
"""Status: there is a way, but the repair found no path along it; a search without a guide may find one."""


class DetourSearch(NamedTuple):
    """A mesh that one thread may edit, and two places in it, to find detours between them."""

    places: NDArray[np.int64]
    """(12, 2) addresses of the mesh and its workshop, see address_kernels."""
    before: NDArray[np.int64]
    """(5, 2) addresses of a copy of the mesh, with as much room, to undo edits from."""
    work: Workspace
    ends: tuple[float, float, float, float, float, float]
    """x, y of the start and of the goal, radius and least clearance [m]."""
    guide: NDArray[Any]
    """(k,) records GUIDE of guide_kernels: distances to the goal, as :func:`aim_guide` fills them."""


@kernel
def begin_guide(m, guide):
    """Enter the sides of the mesh into a ``guide`` of zeros, (k,) GUIDE; `aim_guide` adds the distances to a goal."""
    add_sides(m, guide)


@kernel
def aim_guide(m, labels, work, sx, sy, gx, gy, radius, least, farther, guide):
    """Fill ``guide``, (k,) GUIDE, for ways of a disc of ``radius`` from (sx, sy) to (gx, gy), where it is free.

    The guide knows ways up to a limit: the length of a short way times the first of ``farther``, plus the second [m];
    see :func:`crowdsim.navmesh.paths.guide_kernels.fill_guide`. Distances from before are forgotten. The mesh must be
    as it was when the guide was begun. ``labels`` (3 nt,) int32 are those of `label_sides` for the disc. The guide
    stays without distances if a place is outside of the box, or if the two are in different components.
    """
    clear_guide(guide)
    goal = triangle_of(m, gx, gy, NONE)
    start = triangle_of(m, sx, sy, goal)
    if start < 0 or goal < 0:
        return
    # In different components there is no way, and the search would flood all that can be reached from the goal.
    # (Within one triangle there may be one although no side can be left through, and the labels do not tell.)
    if start != goal and not are_joined(m, labels, start, sx, sy, goal, gx, gy, 2.0 * least):
        return
    # From the goal to the start, so that the labels hold lengths to the goal. This search has no guide itself: it takes
    # an empty table of the least size.
    nothing = np.zeros(3, GUIDE)
    _, used, limit = find_way(m, None, work, goal, gx, gy, start, sx, sy, radius, 2.0 * least, nothing, farther)
    fill_guide(m, work.labels, used, radius, limit, guide)


@helper
def find_detour(search, x, y):
    """Find the path between the ends of ``search`` around one more point obstacle at (x, y): (status, points (n, 2)).

    ``search`` is a DetourSearch. The status is DONE, NO_ROOM, LOST or NOT_TRACED. The obstacle is inserted into the
    mesh, and taken back by copying. There are points only if a path was found; DONE without points says that there is
    none.
    """
    places = search.places
    m = mesh_at(places)
    sx, sy, gx, gy, radius, least = search.ends
    nothing = np.empty((0, 2))
    if not has_room(m, workshop_at(places), _ROOM):
        return NO_ROOM, nothing
    # v is NONE if the obstacle is outside of the box; then the mesh stays as it is. (The last argument is for
    # removals.)
    v = edit_point(places, _INSERT, x, y, NONE)
    # The edit failed, or is not settled for lack of room.
    if v < NONE:
        return LOST, nothing
    found, path = plan_path(m, None, search.work, sx, sy, gx, gy, radius, least, search.guide)
    # Undo the edit before looking at the result.
    if v >= 0 and not copy_back(places, search.before):
        return LOST, nothing
    if found == TANGLED:
        return NOT_TRACED, nothing
    return DONE, path if found == OK else nothing


@kernel
def keeps_off(points, x, y, distance):
    """Return True if the polyline ``points`` (n, 2) [m], n at least 2, stays at least ``distance`` [m] from (x, y)."""
    nearest = math.inf
    for k in range(points.shape[0] - 1):
        d2 = point_segment_distance2(x, y, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1])
        nearest = min(nearest, d2)
    return nearest >= distance * distance
