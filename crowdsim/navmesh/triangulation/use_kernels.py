"""Lists of the inserted obstacles that run along a half-edge.

Lists are sorted by owner, kept in a pool and never changed, so that half-edges can share them or their ends.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``uses`` is the pool of records USE, ``use``, ``one`` and ``other`` are lists
in it: the number of their first record, -1 if they are empty; ``owner`` is twice the slot of an inserted obstacle plus
its winding. If the pool is full, ``full`` of the workshop's progress is set and the returned list is incomplete.

np.int64 gives the int32 fields the type of other numbers: numba would compile a helper again for each type.
"""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.mesh_arrays import NONE


@helper
def new_use(w, owner, following):
    """Put ``owner`` in front of the list ``following``; return the new list.

    If the pool is full, note that and return an empty list.
    """
    progress = w.progress[0]
    if progress.uses == w.uses.size:
        progress.full = 1
        return NONE
    k = progress.uses
    w.uses[k].owner = owner
    w.uses[k].next = following
    progress.uses += 1
    return k


@helper
def _turned(w, use):
    """Return the items of list ``use`` in the opposite order."""
    turned = NONE
    k = np.int64(use)
    while k >= 0:
        turned = new_use(w, np.int64(w.uses[k].owner), turned)
        k = np.int64(w.uses[k].next)
    return turned


@helper
def joined(w, one, other):
    """Return a list of the items of both lists, sorted by owner."""
    a = np.int64(one)
    b = np.int64(other)
    if a < 0:
        return b
    if b < 0:
        return a
    # Merge the two. Lists grow at their heads, so the result is in the opposite order and is turned in the end.
    turned = NONE
    while a >= 0 or b >= 0:
        if b < 0 or (a >= 0 and w.uses[a].owner <= w.uses[b].owner):
            turned = new_use(w, np.int64(w.uses[a].owner), turned)
            a = np.int64(w.uses[a].next)
        else:
            turned = new_use(w, np.int64(w.uses[b].owner), turned)
            b = np.int64(w.uses[b].next)
    return _turned(w, turned)


@helper
def without(w, use, owner):
    """Return the items of list ``use`` without those of ``owner``."""
    k = np.int64(use)
    # Skip the items of ``owner`` in front.
    while k >= 0 and w.uses[k].owner == owner:
        k = np.int64(w.uses[k].next)
    # If there are no more of them, the rest is shared; otherwise the list is copied without them.
    i = k
    while i >= 0 and w.uses[i].owner != owner:
        i = np.int64(w.uses[i].next)
    if i < 0:
        return k
    turned = NONE
    while k >= 0:
        if w.uses[k].owner != owner:
            turned = new_use(w, np.int64(w.uses[k].owner), turned)
        k = np.int64(w.uses[k].next)
    return _turned(w, turned)


@helper
def count_use(uses, use, owner):
    """Return how often ``owner`` is in list ``use``."""
    count = 0
    k = np.int64(use)
    while k >= 0:
        if uses[k].owner == owner:
            count += 1
        k = np.int64(uses[k].next)
    return count


@helper
def same_uses(uses, one, other):
    """Return True if two lists have the same items."""
    a = np.int64(one)
    b = np.int64(other)
    # Two lists that come to the same item share the rest.
    while a != b:
        if a < 0 or b < 0 or uses[a].owner != uses[b].owner:
            return False
        a = np.int64(uses[a].next)
        b = np.int64(uses[b].next)
    return True


@kernel
def keep_used(m, uses, kept):
    """Copy the lists that half-edges refer to from ``uses`` to the start of ``kept``; return the number of items.

    Both are (k,) records USE. The half-edges then refer to ``kept``. Items that no half-edge refers to are left out.
    """
    sides = m.sides
    # ``place``: where an item was copied to.
    place = np.full(uses.size, -1, np.int32)
    count = 0
    for h in range(3 * m.frame[0].triangles):
        head = np.int64(sides[h].use)
        before = NONE
        k = head
        # Copy items until the end, or until one that another list has copied already.
        while k >= 0 and place[k] < 0:
            place[k] = count
            kept[count].owner = uses[k].owner
            kept[count].next = -1
            if before >= 0:
                kept[before].next = count
            before = np.int64(count)
            count += 1
            k = np.int64(uses[k].next)
        # Share the rest of that list.
        if k >= 0 and before >= 0:
            kept[before].next = place[k]
        if head >= 0:
            sides[h].use = place[head]
    return count
