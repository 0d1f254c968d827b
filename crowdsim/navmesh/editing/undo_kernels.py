"""Undo the insertion of a point by copying back what it changed, which is cheaper than to remove the point.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`.
"""

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at


@helper
def _copy_corners(m, source, target, t):
    """Copy the records of the vertices that triangle t has in mesh ``m`` from mesh ``source`` to mesh ``target``."""
    for h in range(3 * t, 3 * t + 3):
        v = m.sides[h].org
        target.vertices[v] = source.vertices[v]


@helper
def _copy_twins(m, source, target, t):
    """Copy the records of the twins that triangle t has in mesh ``m`` from mesh ``source`` to mesh ``target``."""
    for h in range(3 * t, 3 * t + 3):
        g = m.sides[h].twin
        if g >= 0:
            target.sides[g] = source.sides[g]


@helper
def _number(w, k, first):
    """Return the k-th triangle to copy: k counts the triangles listed as changed, then those from ``first`` on."""
    listed = w.progress[0].changed
    return w.to_do[k].changed if k < listed else first + k - listed


@kernel
def copy_back(places, before):
    """Undo the INSERT of `edit_point` that was the last edit of the mesh at ``places``, and that returned a vertex.

    Return False if the list of changed triangles overflowed; then nothing is copied. Changed are the triangles listed,
    new or gone, all that they point to and all that points to them, before or after the edit.

    Parameters
    ----------
    places : (12, 2) int64
        Addresses of the mesh and its workshop, see address_kernels.
    before : (5, 2) int64
        Addresses of a copy of the mesh as it was, with as much room.
    """
    w = workshop_at(places)
    # s: the mesh as it was; t: the mesh to restore.
    s = mesh_at(before)
    t = mesh_at(places)
    if w.progress[0].changed > w.to_do.size:
        return False
    # Triangles from ``first`` on are new or gone.
    filled = s.frame[0].triangles
    other = t.frame[0].triangles
    first = min(filled, other)
    count = w.progress[0].changed + max(filled, other) - first
    # Each listed triangle has its hint cell beside it.
    for k in range(w.progress[0].changed):
        cell = w.to_do[k].cell
        t.hints[cell] = s.hints[cell]
    # What the changed triangles point to now: only their present sides tell, so it comes before these are overwritten,
    # and all corners come before any side.
    for k in range(count):
        i = _number(w, k, first)
        if i < other:
            _copy_corners(t, s, t, i)
    for k in range(count):
        i = _number(w, k, first)
        if i < other:
            _copy_twins(t, s, t, i)
    # Then the triangles themselves, and what they pointed to before.
    for k in range(count):
        i = _number(w, k, first)
        if i < filled:
            _copy_corners(s, s, t, i)
            _copy_twins(s, s, t, i)
            t.cover[i] = s.cover[i]
            for h in range(3 * i, 3 * i + 3):
                t.sides[h] = s.sides[h]
    # The vertex of the point. If it was a spare one, its record held the next of that list; if it was in use, the point
    # raised its number of obstacles (vref); a new one does not matter.
    v = w.progress[0].vertex
    t.vertices[v] = s.vertices[v]
    t.frame[0] = s.frame[0]
    return True
