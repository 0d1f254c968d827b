"""Point obstacles put into a finished mesh and taken out again: without sides there is much less to do."""

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.editing.outline_kernels import OK, snap_inside
from crowdsim.navmesh.editing.removal_kernels import SIDES, is_free_point, take_point
from crowdsim.navmesh.editing.settle_kernels import settle
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import insert_point
from crowdsim.navmesh.triangulation.work_kernels import LOOKING, touch

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
def put_points(m, w, points, ids):
    """Insert ``points`` (n, 2) on the grid as vertices ``ids`` (n,) that are to be settled; 0 or FULL."""
    hint = NONE
    for i in range(points.shape[0]):
        v = insert_point(m, points[i, 0], points[i, 1], hint, w)
        if v < 0:
            return v
        ids[i] = v
        m.vertices[v].vref += 1
        touch(w, v)
        w.to_do[v].mark |= LOOKING
        hint = m.vertices[v].vhe // 3
    return 0


@helper
def _take_points(m, w, ids):
    """The points that are the vertices ``ids`` need these no longer; 0 or FULL."""
    for v in ids:
        m.vertices[v].vref -= 1
        touch(w, v)
    if is_free_point(m, ids):
        return take_point(m, w, ids[0])
    progress = w.progress[0]
    progress.removal = SIDES
    progress.pairs = 0
    progress.gone = 0
    return 0


@kernel
def edit_points(places, what, points, ids):
    """Insert, remove or settle (``what``) an obstacle of ``points`` (n, 2) alone, which are moved to the grid.

    ``places`` are those of the mesh and its workshop (see address_kernels). Returns what `edit` returns; or, where a
    point is not finite or outside of the box, what `snap_inside` does, and nothing was done.
    """
    m = mesh_at(places)
    w = workshop_at(places)
    status = 0
    if what != SETTLE and not has_room(m, w, points.shape[0]):
        return NO_ROOM
    if what == INSERT:
        outside = snap_inside(m, points, points)
        if outside != OK:
            return outside
        status = put_points(m, w, points, ids)
    elif what == REMOVE:
        status = _take_points(m, w, ids)
    if status < 0:
        return status
    return 0 if settle(m, w) == 0 else UNSETTLED
