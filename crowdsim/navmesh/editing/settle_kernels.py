"""Repairs after an edit: Delaunay sides, vertices that nothing needs, refinement and corner clearances.

Only what is around the touched vertices (see work_kernels) is looked at.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; t is a triangle, h a half-edge, v a vertex.
"""

from crowdsim.errors import BoundExceeded
from crowdsim.jit import helper
from crowdsim.navmesh.editing.removable_kernels import removable
from crowdsim.navmesh.editing.removal_kernels import POINT, SIDES, hint_cell, remove_vertex
from crowdsim.navmesh.mesh.half_edge_kernels import is_dirty, nxt, prv
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS
from crowdsim.navmesh.triangulation.refine_kernels import (
    add_foot,
    find_bottleneck,
    measure_triangle,
    refine,
)
from crowdsim.navmesh.triangulation.triangulation_kernels import inside_circle, restore_delaunay
from crowdsim.navmesh.triangulation.work_kernels import (
    CHANGED,
    KEPT,
    LOOKING,
    STUCK,
    TOUCHED,
    enqueue,
    is_spent,
    note_changed,
    touch,
)

_SEEN = -(1 << 40)
"""Cover of a free triangle that :func:`_look_out` has visited: a number that no count of obstacles has."""


@helper
def _seen_from_gone(m, t, w):
    """Return True if the circumcircle of triangle t meets one of the removed sides in ``gone``."""
    for i in range(w.progress[0].gone):
        side = w.gone[i]
        least, most = inside_circle(m, t, side.ax, side.ay, side.bx, side.by, 0.0, 1.0)
        if least < most:
            return True
    return False


@helper
def _look_out(m, w, h):
    """Let vertices beyond the open side h of a changed triangle look for bottlenecks that removed sides prevented.

    A disc between such a vertex and its foot is free now, crosses a removed side and holds neither end of that side.
    The circumcircles of all triangles from side h to the vertex then meet the removed side, see `_find_foot`. Each
    triangle is visited once in an edit: it is listed in the first column of ``pairs`` and has the cover _SEEN until
    `_forget_seen`.
    """
    sides = m.sides
    stack = w.stack
    progress = w.progress[0]
    stack[0] = h
    top = 1
    # Flood across open sides.
    while top > 0:
        top -= 1
        g = sides[stack[top]].twin
        t = g // 3
        # A changed triangle is looked at by itself.
        if is_dirty(sides, t) or m.cover[t] == _SEEN or not _seen_from_gone(m, t, w):
            continue
        m.cover[t] = _SEEN
        w.pairs[progress.pairs, 0] = t
        progress.pairs += 1
        # Its far corner looks for bottlenecks.
        z = sides[prv(g)].org
        touch(w, z)
        w.to_do[z].mark |= LOOKING
        for e in (nxt(g), prv(g)):
            if sides[e].constraints == 0:
                stack[top] = e
                top += 1


@helper
def _forget_seen(m, w):
    """Make the triangles in ``pairs`` free again after :func:`_look_out`."""
    progress = w.progress[0]
    for i in range(progress.pairs):
        m.cover[w.pairs[i, 0]] = 0
    progress.pairs = 0


@helper
def _touch_around(m, w, v):
    """Touch the corners of changed triangles around vertex v, and mark them CHANGED; touch its feet and crossings.

    Feet and crossings are neighbors of v that are no corner of an obstacle (vref 0); they may have lost their use.
    """
    sides = m.sides
    vertices = m.vertices
    first = vertices[v].vhe
    h = first
    for _ in range(sides.size):
        p = prv(h)
        u = sides[nxt(h)].org
        # Corners of a changed triangle; else the neighbor alone, if it may have lost its use.
        if is_dirty(sides, h // 3):
            touch(w, u)
            w.to_do[u].mark |= CHANGED
            u = sides[p].org
            touch(w, u)
            w.to_do[u].mark |= CHANGED
        elif vertices[u].vref == 0:
            touch(w, u)
        h = sides[p].twin
        if h == first:
            break
    else:
        raise BoundExceeded


@helper
def _has_changed(m, w, v):
    """Return True if the touched vertex v is marked CHANGED, or a triangle around it changed."""
    sides = m.sides
    first = m.vertices[v].vhe
    h = first
    # Marked already. Otherwise a triangle around v shows it.
    if w.to_do[v].mark & CHANGED != 0:
        return True
    for _ in range(sides.size):
        if is_dirty(sides, h // 3):
            return True
        h = sides[prv(h)].twin
        if h == first:
            return False
    raise BoundExceeded


@helper
def _touch_corners(m, w):
    """Touch all corners of changed triangles around touched vertices, and remove touched vertices that nothing needs.

    Make the sides in ``pairs`` Delaunay. Return 0 or STUCK.
    """
    vertices = m.vertices
    i = 0
    while True:
        # The list grows while it is read.
        while i < w.progress[0].touched:
            if is_spent(w):
                return STUCK
            v = w.to_do[i].touched
            i += 1
            # Removed meanwhile, or a corner of the box: that stays, and the triangles around it do not close a circle.
            if vertices[v].vhe < 0 or v < BOX_CORNERS:
                continue
            if _has_changed(m, w, v):
                w.to_do[v].mark |= CHANGED
                _touch_around(m, w, v)
            # A vertex that cannot be removed is not tried again.
            unneeded = vertices[v].vref == 0 and w.to_do[v].mark & KEPT == 0 and removable(m, w, v)
            if unneeded and not remove_vertex(m, w, v):
                w.to_do[v].mark |= KEPT
        # Removals, also of an obstacle, leave sides that are not Delaunay. Flips also change triangles around vertices
        # that were passed already, so start again.
        top = w.progress[0].pairs
        if top == 0:
            return 0
        w.progress[0].pairs = 0
        # Without room for the stack, the sides in it are lost: the mesh has to be made anew.
        if restore_delaunay(m, w, top) < 0:
            return STUCK
        i = 0


@helper
def settle(m, w):
    """Bring refinement and corner clearances up to date around touched vertices; return 0, STUCK or FULL.

    A bottleneck is new only if the triangle at its wall is new, if its vertex is new, or if something between the two
    was removed. So it is seen from a wall of a changed triangle, from a new vertex, or from a vertex that lies next to
    what was removed or beyond it. After FULL, which asks for larger arrays, what is left to do is in the workshop.
    """
    sides = m.sides
    vertices = m.vertices
    status = _touch_corners(m, w)
    if status < 0:
        return status
    # Queue the walls of changed triangles, and let vertices look across removed sides.
    removal = w.progress[0].removal == SIDES
    for i in range(w.progress[0].touched):
        v = w.to_do[i].touched
        if vertices[v].vhe < 0 or v < BOX_CORNERS:
            continue
        # A removed side may have stood between v and a wall.
        if removal:
            w.to_do[v].mark |= LOOKING
        if w.to_do[v].mark & CHANGED == 0:
            continue
        first = vertices[v].vhe
        h = first
        for _ in range(sides.size):
            # Each side once: from its origin. Behind an open one, changed triangles are looked at by themselves.
            if is_dirty(sides, h // 3) and m.cover[h // 3] == 0:
                if sides[h].constraints != 0:
                    enqueue(w, v)
                elif removal and not is_dirty(sides, sides[h].twin // 3):
                    _look_out(m, w, h)
            h = sides[prv(h)].twin
            if h == first:
                break
        else:
            raise BoundExceeded
    _forget_seen(m, w)
    # From each looking vertex, add feet until it finds no more bottleneck.
    i = 0
    while i < w.progress[0].touched:
        v = w.to_do[i].touched
        if is_spent(w):
            return STUCK
        # Feet and crossings (vref 0) do not look: two walls are closest at a corner of one of them.
        looking = w.to_do[v].mark & LOOKING != 0 and vertices[v].vhe >= 0 and vertices[v].vref > 0
        if looking and v >= BOX_CORNERS:
            x = m.vertices[v].x
            y = m.vertices[v].y
            # After the removal of a point only discs that hold its place are new.
            if w.progress[0].removal == POINT:
                x = w.gone[0].ax
                y = w.gone[0].ay
            h, x, y = find_bottleneck(m, v, x, y, w)
            if h >= 0:
                status = add_foot(m, h, x, y, w)
                if status < 0:
                    return status
                continue
        w.to_do[v].mark &= ~LOOKING
        i += 1
    # Now from the queued walls.
    status = refine(m, w)
    if status < 0:
        return status
    # Measure the changed triangles, renew hints and clear the marks.
    progress = w.progress[0]
    for i in range(progress.touched):
        v = w.to_do[i].touched
        # A corner of the box may lack CHANGED, as `_touch_corners` skips it: once touched, it counts as changed.
        changed = w.to_do[v].mark & CHANGED != 0 or v < BOX_CORNERS
        w.to_do[v].mark &= ~(TOUCHED | KEPT | CHANGED)
        if vertices[v].vhe < 0 or not changed:
            continue
        first = vertices[v].vhe
        h = first
        for _ in range(sides.size):
            t = h // 3
            if is_dirty(sides, t):
                measure_triangle(m, t)
                cell = hint_cell(m, t)
                m.hints[cell] = t
                note_changed(w, t, cell)
            # The triangles around a corner of the box do not close a circle: the walk ends at the hull.
            h = sides[prv(h)].twin
            if h == first or h < 0:
                break
        else:
            raise BoundExceeded
    progress.touched = 0
    progress.removal = 0
    progress.gone = 0
    return 0
