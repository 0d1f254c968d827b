"""An edit undone by copying back what it changed, which is less than to take out what was put in."""

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at


@helper
def _copy_around(m, source, target, t):
    """Copy the corners of triangle t of mesh ``m``, and the sides of its neighbors, which point to it."""
    for h in range(3 * t, 3 * t + 3):
        v = m.sides[h].org
        target.vertices[v] = source.vertices[v]
        g = m.sides[h].twin
        if g >= 0:
            target.sides[g] = source.sides[g]


@helper
def _number(w, k, first):
    """The k-th triangle to copy, of which ``first`` is the first at the end of the mesh."""
    listed = w.progress[0].changed
    return w.to_do[k].changed if k < listed else first + k - listed


@kernel
def copy_back(places, before):
    """Undo INSERT of `edit_point`, which returned a vertex, in the mesh at ``places``, if nothing was edited since.

    At ``before`` is the mesh as it was, with as much room (all places are those of address_kernels). What changed is
    the triangles that are listed or new or no longer there, what they point to, and what points to them, before or
    after. False where there was no room for the list: then nothing is copied.
    """
    w = workshop_at(places)
    s = mesh_at(before)
    t = mesh_at(places)
    if w.progress[0].changed > w.to_do.size:
        return False
    filled = s.frame[0].triangles
    other = t.frame[0].triangles
    first = min(filled, other)
    count = w.progress[0].changed + max(filled, other) - first
    for k in range(w.progress[0].changed):
        cell = w.to_do[k].cell
        t.hints[cell] = s.hints[cell]
    for k in range(count):
        i = _number(w, k, first)
        if i < other:
            _copy_around(t, s, t, i)
    for k in range(count):
        i = _number(w, k, first)
        if i < filled:
            _copy_around(s, s, t, i)
            t.cover[i] = s.cover[i]
            for h in range(3 * i, 3 * i + 3):
                t.sides[h] = s.sides[h]
    v = w.progress[0].vertex
    t.vertices[v] = s.vertices[v]
    t.frame[0] = s.frame[0]
    return True
