"""Lists of vertices that an edit still has to look at, each vertex at most once in each."""

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, TURNS

QUEUED = 1
"""Mark: the constrained sides from the vertex wait for refinement."""
TOUCHED = 2
"""Mark: triangles around the vertex may have changed."""
KEPT = 8
"""Mark: the vertex is touched and cannot be taken out."""
LOOKING = 16
"""Mark: the vertex is touched, and may be the near end of a bottleneck that is new."""
CHANGED = 32
"""Mark: the vertex is touched, and triangles around it did change."""
VISITED = 4
"""Mark of a walk, which clears it."""

STUCK = -3
"""Status: an edit went on beyond its bound, or met what no mesh may hold; the mesh is useless."""


@helper
def bound_turns(m, w, corners):
    """Begin an edit of so many corners: give its loops their turns."""
    w.progress[0].left = TURNS * (m.frame[0].triangles + corners + 1024)


@helper
def is_spent(w):
    """Take one of the turns that are left; whether there was none."""
    progress = w.progress[0]
    progress.left -= 1
    return progress.left < 0


@helper
def touch(w, v):
    """Note that triangles around vertex v may have changed."""
    item = w.to_do[v]
    if item.mark & TOUCHED == 0:
        item.mark |= TOUCHED
        progress = w.progress[0]
        w.to_do[progress.touched].touched = v
        progress.touched += 1


@helper
def touch_triangle(sides, w, t):
    """Note that triangle t changed, at a corner that is not one of the box."""
    for h in range(3 * t, 3 * t + 3):
        v = sides[h].org
        touch(w, v)
        if v >= BOX_CORNERS:
            w.to_do[v].mark |= CHANGED
            break


@helper
def note_changed(w, t, cell):
    """Note the number of a triangle that is another one than before the edit, or not as it was, and its hint cell.

    Those for which there is no room are counted.
    """
    progress = w.progress[0]
    if progress.changed < w.to_do.size:
        w.to_do[progress.changed].changed = t
        w.to_do[progress.changed].cell = cell
    progress.changed += 1


@helper
def enqueue(w, v):
    """Let the constrained sides from vertex v wait for refinement."""
    item = w.to_do[v]
    if item.mark & QUEUED == 0:
        item.mark |= QUEUED
        progress = w.progress[0]
        w.to_do[(progress.head + progress.waiting) % w.to_do.size].waiting = v
        progress.waiting += 1


@helper
def dequeue(w):
    """The vertex that waited longest."""
    progress = w.progress[0]
    v = w.to_do[progress.head].waiting
    progress.head = (progress.head + 1) % w.to_do.size
    progress.waiting -= 1
    w.to_do[v].mark &= ~QUEUED
    return v
