"""Point obstacles put into a finished mesh and taken out again: without sides there is much less to do."""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.removal_kernels import SIDES, is_free_point, take_point
from crowdsim.navmesh.editing.settle_kernels import settle
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.mesh.half_edge_kernels import snapped
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import insert_point
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, LOOKING, STUCK, bound_turns, touch

INSERT, REMOVE, SETTLE = range(3)
"""What to do in an edit."""

NO_ROOM = -4
"""Status: make the arrays larger and try again."""
UNSETTLED = -5
"""Status: the edit is done; make the arrays larger and settle it."""


@helper
def has_room(m, w, corners):
    """Whether an edit of an obstacle with so many corners fits, unless it crosses uncommonly many others."""
    wanted = 8 * corners + 64
    frame = m.frame[0]
    return frame.triangles // 2 + wanted < m.vertices.size and w.progress[0].uses + wanted < w.uses.size


@helper
def put_corner(m, w, x, y, hint):
    """Insert (x, y), on the grid, as a corner of an obstacle that is to be settled; its vertex, FULL or STUCK."""
    v = insert_point(m, x, y, hint, w)
    if v >= 0:
        m.vertices[v].vref += 1
        touch(w, v)
        w.to_do[v].mark |= LOOKING | CHANGED
    return v


@helper
def _take_out(m, w, v):
    """Vertex v is a point obstacle no longer; 0, FULL or STUCK."""
    m.vertices[v].vref -= 1
    if is_free_point(m, v):
        return take_point(m, w, v)
    touch(w, v)
    progress = w.progress[0]
    progress.removal = SIDES
    progress.pairs = 0
    progress.gone = 0
    return 0


@kernel
def edit_point(places, what, x, y, v):
    """Insert a point obstacle at (x, y), moved to the grid, or remove the one at vertex v; or settle.

    ``places`` are those of the mesh and its workshop (see address_kernels). Returns the vertex; -1 for a point that is
    not inside of the box, which has no effect; NO_ROOM: nothing was done; UNSETTLED: SETTLE in larger arrays ends the
    edit and returns what this would have; or FULL or STUCK: the mesh is useless.
    """
    m = mesh_at(places)
    w = workshop_at(places)
    progress = w.progress[0]
    bound_turns(m, w, np.int64(1))
    if what == INSERT:
        frame = m.frame[0]
        cell = frame.cell
        inside = x >= frame.x0 + cell and x <= frame.x1 - cell and y >= frame.y0 + cell and y <= frame.y1 - cell
        if not inside:
            return NONE
        if not has_room(m, w, np.int64(1)):
            return np.int64(NO_ROOM)
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
    status = settle(m, w)
    if status == 0:
        return progress.vertex
    return np.int64(STUCK if status == STUCK else UNSETTLED)
