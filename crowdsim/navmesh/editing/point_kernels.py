"""Point obstacles inserted into a finished mesh and removed again: without sides there is much less to do.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; v is a vertex, ``hint`` a triangle from which a search begins.
"""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.removable_kernels import is_free_point
from crowdsim.navmesh.editing.removal_kernels import SIDES, take_point
from crowdsim.navmesh.editing.settle_kernels import settle
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.mesh.half_edge_kernels import snapped
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import insert_point
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, LOOKING, STUCK, bound_turns, touch

INSERT, REMOVE, SETTLE = range(3)
"""What an edit does."""

NO_ROOM = -4
"""Status: make the arrays larger and try again."""
UNSETTLED = -5
"""Status: the edit is done; make the arrays larger and settle it there."""


@helper
def has_room(m, w, corners):
    """Return True if an edit of an obstacle with ``corners`` corners fits, unless it crosses very many others."""
    # More than the corners, as crossings and feet become vertices, too. A guess: an edit that needs more ends with FULL
    # or UNSETTLED.
    wanted = 8 * corners + 64
    frame = m.frame[0]
    # A mesh has two triangles for each vertex, less six; ``frame.vertices`` would count spare vertices, too.
    return frame.triangles // 2 + wanted < m.vertices.size and w.progress[0].uses + wanted < w.uses.size


@helper
def put_corner(m, w, x, y, hint):
    """Insert the grid point (x, y) [m] as a corner of an obstacle; return its vertex. `settle` must follow.

    If that fails, return FULL (no room in the arrays) or STUCK (too many loop turns, or an impossible mesh), both
    negative; the mesh is useless then.
    """
    v = insert_point(m, x, y, hint, w)
    if v >= 0:
        # The vertex must stay from now on. LOOKING: it looks for new bottlenecks. CHANGED: if it is new, triangles
        # around it changed; if it was there before, the mark does no harm.
        m.vertices[v].vref += 1
        touch(w, v)
        w.to_do[v].mark |= LOOKING | CHANGED
    return v


@helper
def _take_out(m, w, v):
    """Remove a point obstacle from vertex v; return 0, FULL or STUCK.

    FULL: ``pairs`` of the workshop has no room for another side. After FULL or STUCK the mesh is useless.
    """
    m.vertices[v].vref -= 1
    # Nothing needs the vertex any longer: take it out at once. Otherwise the repair has to decide, as after an obstacle
    # with sides.
    if is_free_point(m, v):
        return take_point(m, w, v)
    touch(w, v)
    progress = w.progress[0]
    progress.removal = SIDES
    # No side lost its constraint, and pairs left from another edit do not count.
    progress.pairs = 0
    progress.gone = 0
    return 0


@kernel
def edit_point(places, what, x, y, v):
    """Insert a point obstacle at (x, y), moved to the grid, remove the one at vertex v, or settle.

    Parameters
    ----------
    places : (12, 2) int64
        Addresses of the mesh and its workshop, see address_kernels.
    what : int
        INSERT, REMOVE or SETTLE.
    x, y : float
        For INSERT: place of the point [m].
    v : int
        For REMOVE: vertex of the point. If it is -1, as of a point that was not inserted, nothing is done.

    Returns
    -------
    int
        The vertex. -1: nothing was done, as ``v`` is -1, or as the point to insert is outside of the box or less than a
        cell within it. NO_ROOM: nothing was done. UNSETTLED: SETTLE in larger arrays ends the edit and returns the
        vertex. FULL or STUCK: the mesh is useless.
    """
    m = mesh_at(places)
    w = workshop_at(places)
    progress = w.progress[0]
    bound_turns(m, w, np.int64(1))
    if what == INSERT:
        frame = m.frame[0]
        cell = frame.cell
        # Written so that NaN counts as outside.
        inside = x >= frame.x0 + cell and x <= frame.x1 - cell and y >= frame.y0 + cell and y <= frame.y1 - cell
        if not inside:
            return NONE
        if not has_room(m, w, np.int64(1)):
            return np.int64(NO_ROOM)
        # ``copy_back`` undoes the edit by the list of changed triangles, which starts here.
        progress.changed = 0
        v = put_corner(m, w, snapped(cell, x), snapped(cell, y), np.int64(NONE))
        if v < 0:
            return v
        progress.vertex = v
    elif what == REMOVE:
        if v < 0:
            return NONE
        if not has_room(m, w, np.int64(1)):
            return np.int64(NO_ROOM)
        progress.vertex = v
        status = _take_out(m, w, v)
        if status < 0:
            return np.int64(status)
    # Repairs fail for lack of room, which larger arrays cure, or for good.
    status = settle(m, w)
    if status == 0:
        return progress.vertex
    return np.int64(STUCK if status == STUCK else UNSETTLED)
