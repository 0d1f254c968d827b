"""Which vertices of a constrained Delaunay triangulation an edit can remove.

The half-edges that leave a vertex are its spokes; see removal_kernels.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; v, a, b and ``far`` are vertices.
"""

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.predicates_kernels import incircle
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, side
from crowdsim.navmesh.triangulation.use_kernels import same_uses


@helper
def _takes_over(m, v, far, a, b):
    """Return True if ``far`` is in one triangle with a and b once v, between them, is removed.

    Then the height of ``far`` in that triangle measures the passage, and v is not needed as its foot.
    """
    sides = m.sides
    vertices = m.vertices
    p = vertices[far]
    # Put ``far`` on the left of a -> b.
    where = side(vertices, a, b, p.x, p.y)
    if where < 0.0:
        a, b = b, a
    # On the line through a and b it makes no triangle with them.
    elif where == 0.0:
        return False
    ax = vertices[a].x
    ay = vertices[a].y
    bx = vertices[b].x
    by = vertices[b].y
    first = vertices[v].vhe
    h = first
    # They are one triangle if the circle of a, b and ``far`` holds no other neighbor of v on that side.
    for _ in range(sides.size):
        c = sides[nxt(h)].org
        q = vertices[c]
        other = c != a and c != b and c != far and side(vertices, a, b, q.x, q.y) > 0.0
        if other and incircle(ax, ay, bx, by, p.x, p.y, q.x, q.y, 1.0 / m.frame[0].cell) > 0:
            return False
        h = sides[prv(h)].twin
        if h == first:
            return True
    raise BoundExceeded


@helper
def removable(m, w, v):
    """Return True if vertex v, no corner of an obstacle, is neither a crossing nor the foot that a neighbor needs."""
    sides = m.sides
    vertices = m.vertices
    # Find the constrained spokes.
    first = vertices[v].vhe
    one = first
    other = first
    fixed = 0
    h = first
    for _ in range(sides.size):
        if sides[h].constraints != 0:
            other = one
            one = h
            fixed += 1
        h = sides[prv(h)].twin
        if h == first:
            break
    else:
        raise BoundExceeded
    # Free standing, or an end or crossing of constraints.
    if fixed == 0:
        return True
    if fixed != 2:
        return False
    # The two constraints must be the same in both directions to become one side a-b: to_one leads from v to a, from_one
    # back, to_other from v to b, from_other back.
    to_one = sides[one]
    to_other = sides[other]
    from_one = sides[to_one.twin]
    from_other = sides[to_other.twin]
    if from_one.constraints != to_other.constraints or from_one.winding != to_other.winding:
        return False
    if not same_uses(w.uses, from_one.use, to_other.use) or not same_uses(w.uses, to_one.use, from_other.use):
        return False
    # A neighbor ``far`` whose foot on the line a-b is at v, within rounding, needs v, unless its height will measure
    # the passage.
    a = vertices[from_one.org]
    b = vertices[from_other.org]
    x = vertices[v].x
    y = vertices[v].y
    ux = b.x - a.x
    uy = b.y - a.y
    # Offsets along a-b are measured times its length. A foot moves to the grid by up to half a cell in x and y; four
    # cells leave a margin, as at worst a vertex stays that is not needed.
    tolerance = 4.0 * m.frame[0].cell * (abs(ux) + abs(uy))
    h = first
    for _ in range(sides.size):
        if sides[h].constraints == 0 and m.cover[h // 3] == 0:
            far = vertices[sides[nxt(h)].org]
            is_foot = far.vref > 0 and abs((far.x - x) * ux + (far.y - y) * uy) <= tolerance
            if is_foot and not _takes_over(m, v, sides[nxt(h)].org, from_one.org, from_other.org):
                return False
        h = sides[prv(h)].twin
        if h == first:
            return True
    raise BoundExceeded


@helper
def is_free_point(m, v):
    """Return True if vertex v is no corner of an obstacle and no constrained side ends there."""
    sides = m.sides
    if m.vertices[v].vref > 0:
        return False
    first = m.vertices[v].vhe
    h = first
    fixed = False
    for _ in range(sides.size):
        fixed = fixed or sides[h].constraints != 0
        h = sides[prv(h)].twin
        if h == first:
            return not fixed
    raise BoundExceeded
