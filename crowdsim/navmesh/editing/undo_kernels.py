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

    Return False if the list of changed triangles overflowed; then nothing is copied. Otherwise copied are the triangles
    that are listed, new or gone, all that they point to and all that points to them, before or after the edit.

    Parameters
    ----------
    places : (12, 2) int64
        Addresses of the mesh and its workshop, see address_kernels.
    before : (5, 2) int64
        Addresses of a copy of the mesh as it was before the edit, with as much room.
    """
    w = workshop_at(places)
    # The mesh as it was, and the mesh to restore.
    source = mesh_at(before)
    target = mesh_at(places)
    if w.progress[0].changed > w.to_do.size:
        return False
    # Triangles from ``first`` on are new or gone.
    before_count = source.frame[0].triangles
    now_count = target.frame[0].triangles
    first = min(before_count, now_count)
    count = w.progress[0].changed + max(before_count, now_count) - first
    # Each listed triangle has its hint cell beside it.
    for k in range(w.progress[0].changed):
        cell = w.to_do[k].cell
        target.hints[cell] = source.hints[cell]
    # First copy what changed triangles point to in the present mesh, while their sides still tell. All corners come
    # before any twin, as to copy a twin may overwrite the origin of a side of another changed triangle.
    for k in range(count):
        t = _number(w, k, first)
        if t < now_count:
            _copy_corners(target, source, target, t)
    for k in range(count):
        t = _number(w, k, first)
        if t < now_count:
            _copy_twins(target, source, target, t)
    # Then copy the triangles themselves, and what they pointed to before.
    for k in range(count):
        t = _number(w, k, first)
        if t < before_count:
            _copy_corners(source, source, target, t)
            _copy_twins(source, source, target, t)
            target.cover[t] = source.cover[t]
            for h in range(3 * t, 3 * t + 3):
                target.sides[h] = source.sides[h]
    # The vertex of the point. If it was a spare one, its record held the next of that list. If it was in use, the point
    # raised its number of obstacles (vref). A new one does not matter: it is beyond the vertices in use before.
    v = w.progress[0].vertex
    target.vertices[v] = source.vertices[v]
    target.frame[0] = source.frame[0]
    return True
