"""Lists of vertices that an edit still has to look at; each vertex is at most once in each list.

``to_do`` of the workshop holds them as columns: ``mark`` is indexed by vertex, the others by position in their list.

The marks are bits of the field ``mark`` of :data:`crowdsim.navmesh.mesh.mesh_arrays.TO_DO`.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` are its records SIDE; v is a vertex, t a triangle.
"""

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, TURNS

QUEUED = 1
"""Mark: the constrained sides from the vertex are queued for refinement."""
TOUCHED = 2
"""Mark: the vertex is in the list ``touched``: `settle` looks at it and at the triangles around it."""
KEPT = 8
"""Mark: the vertex is touched and cannot be removed."""
LOOKING = 16
"""Mark: the vertex is touched, and may be an end of a new bottleneck."""
CHANGED = 32
"""Mark: the vertex is touched, and triangles around it count as changed."""
VISITED = 4
"""Mark of a walk that visits each vertex once; the walk clears it."""

STUCK = -3
"""Status: an edit exceeded its bound of loop turns, or met an impossible mesh; the mesh is useless."""


@helper
def bound_turns(m, w, corners):
    """Begin an edit of ``corners`` corners: set the bound of its loop turns."""
    # 1024 more, so that an edit of a mesh of few triangles has turns enough as well.
    w.progress[0].left = TURNS * (m.frame[0].triangles + corners + 1024)


@helper
def is_spent(w):
    """Use one loop turn; return True if none was left."""
    progress = w.progress[0]
    progress.left -= 1
    return progress.left < 0


@helper
def touch(w, v):
    """List vertex v as touched, once: `settle` has to look at it."""
    item = w.to_do[v]
    if item.mark & TOUCHED == 0:
        item.mark |= TOUCHED
        progress = w.progress[0]
        w.to_do[progress.touched].touched = v
        progress.touched += 1


@helper
def touch_triangle(sides, w, t):
    """Note that triangle t changed: touch its corners up to the first that is no corner of the box; mark it CHANGED."""
    # One marked corner is enough: the walk around it finds the triangle. Corners of the box need no mark: once touched,
    # they always count as changed (`settle`).
    for h in range(3 * t, 3 * t + 3):
        v = sides[h].org
        touch(w, v)
        if v >= BOX_CORNERS:
            w.to_do[v].mark |= CHANGED
            break


@helper
def note_changed(w, t, cell):
    """List triangle t, which changed or got another number, so that the edit can be undone.

    cell: the cell of the hint grid that holds its center. Triangles for which there is no room are counted only.
    """
    progress = w.progress[0]
    # Count on beyond the room, so that the overflow shows.
    if progress.changed < w.to_do.size:
        w.to_do[progress.changed].changed = t
        w.to_do[progress.changed].cell = cell
    progress.changed += 1


@helper
def enqueue(w, v):
    """Queue vertex v: its constrained sides wait for refinement."""
    item = w.to_do[v]
    if item.mark & QUEUED == 0:
        item.mark |= QUEUED
        progress = w.progress[0]
        # A ring buffer. Each vertex is in it at most once, so it cannot overflow.
        w.to_do[(progress.head + progress.waiting) % w.to_do.size].waiting = v
        progress.waiting += 1


@helper
def dequeue(w):
    """Remove the vertex that waited longest from the queue and return it."""
    progress = w.progress[0]
    v = w.to_do[progress.head].waiting
    progress.head = (progress.head + 1) % w.to_do.size
    progress.waiting -= 1
    w.to_do[v].mark &= ~QUEUED
    return v
