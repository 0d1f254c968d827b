"""Search for a short way over intervals of sides, after Polyanya (Cui, Harabor and Grastien, IJCAI 2017).

Each side is cut by the radius at both ends, at most to its middle. A way crosses the rest in straight lines from root
to root; roots are ends of cut sides, where the way bends. The cost of a way is its length with chords in place of arcs.
The widths of sides and corners decide what can be crossed, as in :mod:`crowdsim.navmesh.paths.search_kernels`.

Arguments of all helpers are those of :func:`find_way`; ``label`` is a record LABEL of the workspace (not the behavior
of a section): an interval of a side that is seen from a root r, between the ends l (left) and p (right). ``spent`` is
the length up to the root [m]. ``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``work`` is
the :class:`crowdsim.navmesh.paths.workspace.Workspace`, of which ``labels`` (the first ``used`` in use), ``waypoints``
and ``reached`` are arrays and ``stamp`` is the number of the query; ``regions`` (nt,) are records
:data:`crowdsim.navmesh.paths.region_kernels.REGION`; s = (sx, sy) is the start and g = (gx, gy) the goal [m]. h,
``before`` and ``corner`` are fields of a label; np.int64 gives these int32 the type of other numbers, as numba would
compile a helper again for each type.
"""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh.heap_kernels import place, pop
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.guide_kernels import GREED, guided_estimate
from crowdsim.navmesh.paths.region_kernels import lay_waypoints
from crowdsim.navmesh.paths.search_kernels import can_leave
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node

_SAME = 1e-9
"""Difference [m] below which two ways count as equally long."""


@helper
def _set_label(label, rx, ry, spent, lx, ly, px, py, h, before, corner, ends):
    """Fill a record :data:`crowdsim.navmesh.paths.workspace.LABEL`."""
    label.rx = rx
    label.ry = ry
    label.spent = spent
    label.lx = lx
    label.ly = ly
    label.px = px
    label.py = py
    label.h = h
    label.before = before
    label.corner = corner
    label.ends = ends


@helper
def _estimate(label, x, y):
    """Estimate the length [m] of a way from the start over the label's interval to (x, y).

    Meters beyond the interval, which are still to be searched, count GREED times, as in weighted A*: so labels near the
    goal come first, and fewer are searched.
    """
    rx = label.rx
    ry = label.ry
    lx = label.lx - rx
    ly = label.ly - ry
    px = label.px - rx
    py = label.py - ry
    # Coordinates relative to the root.
    x -= rx
    y -= ry
    ux = lx - px
    uy = ly - py
    # How far the target and the root are off the line of the interval, times its length.
    behind = ux * (y - py) - uy * (x - px)
    root = uy * px - ux * py
    # The target is on the root's side of the interval: mirror it, which keeps the length.
    if behind * root > 0.0:
        k = 2.0 * behind / (ux * ux + uy * uy)
        x += k * uy
        y -= k * ux
        behind = -behind
    # The straight line passes the interval on the left: bend around its left end. Then the same on the right.
    if x * ly - y * lx < 0.0:
        ux = lx - x
        uy = ly - y
        return label.spent + math.sqrt(lx * lx + ly * ly) + GREED * math.sqrt(ux * ux + uy * uy)
    if x * py - y * px > 0.0:
        ux = px - x
        uy = py - y
        return label.spent + math.sqrt(px * px + py * py) + GREED * math.sqrt(ux * ux + uy * uy)
    # It crosses the interval: weight the part behind it. If root and target both are on the line of the interval (total
    # is 0), all of it counts as behind.
    total = root - behind
    part = root / total if total != 0.0 else 0.0
    return label.spent + math.sqrt(x * x + y * y) * (part + GREED * (1.0 - part))


@helper
def _key(m, regions, waypoints, guide, label, gx, gy, radius):
    """Return the key of a label in the heap: about how long a way over it is [m], with meters to go times GREED.

    One of ``guide`` and ``regions`` is None, the other is not. A guide without sides leaves the plain estimate to the
    goal.
    """
    key = 0.0
    if guide is not None:
        key = guided_estimate(m.sides, m.vertices, guide, label, radius, _estimate(label, gx, gy))
    # With regions: aim at the next bridge; the rest is estimated by straight lines from bridge to bridge.
    if regions is not None:
        aim = waypoints[regions[m.sides[label.h].twin // 3].top]
        key = GREED * aim.rest + _estimate(label, aim.x, aim.y)
    return key


@helper
def _leave_start(m, regions, work, start, sx, sy, gx, gy, radius, width, guide):
    """Put a label for each side that leads out of triangle ``start`` into the labels and the heap; return their number.

    ``width`` is the least width to pass [m].
    """
    labels = work.labels
    heap = work.heap
    waypoints = work.waypoints
    stamp = work.stamp[0]
    sides = m.sides
    vertices = m.vertices
    count = np.int64(0)
    for h in range(3 * start, 3 * start + 3):
        if not can_leave(sides, vertices, h, sx, sy, width):
            continue
        # This side leads to a region off the way.
        if regions is not None and waypoints[regions[sides[h].twin // 3].top].stamp != stamp:
            continue
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        ux = b.x - a.x
        uy = b.y - a.y
        # Cut the side by the radius; all of it is seen, and the way may bend at both ends (3).
        k = min(radius / math.sqrt(ux * ux + uy * uy), 0.5)
        ux *= k
        uy *= k
        _set_label(labels[count], sx, sy, 0.0, b.x - ux, b.y - uy, a.x + ux, a.y + uy, h, NONE, NONE, np.int64(3))
        count = place(heap, count, _key(m, regions, waypoints, guide, labels[count], gx, gy, radius), count)
    return count


@helper
def _spent_at(label, x, y, before, stamp):
    """Return the length [m] of the way up to the end (x, y) of a label's interval, if the end becomes a root.

    It is infinite if the end was a root already, in this search (``stamp``), on a shorter way. ``before`` is here the
    record REACHED of the end.
    """
    dx = x - label.rx
    dy = y - label.ry
    spent = label.spent + math.sqrt(dx * dx + dy * dy)
    if before.stamp == stamp and before.spent < spent - _SAME:
        return math.inf
    return spent


@helper
def _add_labels(labels, used, i, reached, stamp, spent_left, spent_right, e, turn, v, o, radius):
    """Add labels for the ways from label i across side e, whose ends are v and o; return the new number of labels.

    There are up to three: straight from the root across the part it sees, and around the left and the right end of the
    label's interval across the rest. ``spent_left`` and ``spent_right`` are the lengths [m] of the way up to these
    ends, infinite if it cannot bend there; ends that become roots are entered into ``reached``. The side is cut by the
    radius at both ends; v and o are records VERTEX, v the left end if ``turn`` is 0, the right one if it is 1.
    """
    ux = v.x - o.x
    uy = v.y - o.y
    k = min(radius / math.sqrt(ux * ux + uy * uy), 0.5)
    ux *= k
    uy *= k
    # The ends of the cut side e, left and right.
    elx = v.x - ux if turn == 0 else o.x + ux
    ely = v.y - uy if turn == 0 else o.y + uy
    erx = o.x + ux if turn == 0 else v.x - ux
    ery = o.y + uy if turn == 0 else v.y - uy
    label = labels[i]
    h = np.int64(label.h)
    rx = label.rx
    ry = label.ry
    # The ends of the label's interval, relative to the root.
    dlx = label.lx - rx
    dly = label.ly - ry
    dpx = label.px - rx
    dpy = label.py - ry
    # A root at the end of the interval sees all on that side.
    sees_left = dlx == 0.0 and dly == 0.0
    sees_right = dpx == 0.0 and dpy == 0.0
    # Cross products, positive if a cut end of e is left of a ray from the root over an end of the interval: the first
    # letter is the end of the interval (left or right), the second the end of e.
    ll = -1.0 if sees_left else dlx * (ely - ry) - dly * (elx - rx)
    lr = -1.0 if sees_left else dlx * (ery - ry) - dly * (erx - rx)
    rl = 1.0 if sees_right else dpx * (ely - ry) - dpy * (elx - rx)
    rr = 1.0 if sees_right else dpx * (ery - ry) - dpy * (erx - rx)
    # The part of e between these two rays.
    slx = elx
    sly = ely
    if ll > 0.0:
        at = ll / (ll - lr) if lr < 0.0 else 1.0
        slx += at * (erx - elx)
        sly += at * (ery - ely)
    srx = erx
    sry = ery
    if rr < 0.0:
        at = rr / (rr - rl) if rl > 0.0 else 1.0
        srx += at * (elx - erx)
        sry += at * (ely - ery)
    # Straight on, unless all of e is left of the left ray or right of the right one.
    if not (ll > 0.0 and lr >= 0.0) and not (rr < 0.0 and rl <= 0.0):
        ends = np.int64(ll <= 0.0) + 2 * np.int64(rr >= 0.0)
        before = np.int64(label.before)
        corner = np.int64(label.corner)
        _set_label(labels[used], rx, ry, label.spent, slx, sly, srx, sry, e, before, corner, ends)
        used += 1
    # Around the left end, to the part of e left of the part that the root sees; then the same on the right.
    if ll > 0.0 and spent_left < math.inf:
        ends = 1 + 2 * np.int64(lr >= 0.0)
        _set_label(labels[used], label.lx, label.ly, spent_left, elx, ely, slx, sly, e, i, 2 * h, ends)
        used += 1
        reached[2 * h].spent = spent_left
        reached[2 * h].stamp = stamp
    if rr < 0.0 and spent_right < math.inf:
        ends = 2 + np.int64(rl <= 0.0)
        _set_label(labels[used], label.px, label.py, spent_right, srx, sry, erx, ery, e, i, 2 * h + 1, ends)
        used += 1
        reached[2 * h + 1].spent = spent_right
        reached[2 * h + 1].stamp = stamp
    return used


@helper
def find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, width, guide, farther=None, longest=None):
    """Search for a short way from triangle ``start`` to ``goal``; return (last label or -1, number of labels, limit).

    The way passes widths of at least ``width`` [m], twice the clearance it needs. Not found are ways that cross a
    bridge of regions and come back over it, and ways for which the workspace has no room. ``guide`` is None, or a guide
    to this goal, (k,) GUIDE, with ``regions`` None. ``longest`` is None, or a length [m] beyond which no way is
    followed. ``farther`` is None, or (factor, meters): then the search goes on until all keys exceed the limit, and
    returns no last label. The limit is the estimate [m] of the shortest way found, times the factor, plus the meters;
    it is infinite if no way was found, or without ``farther``.
    """
    labels = work.labels
    heap = work.heap
    reached = work.reached
    waypoints = work.waypoints
    sides = m.sides
    vertices = m.vertices
    work.stamp[0] += 1
    stamp = work.stamp[0]
    if regions is not None and not lay_waypoints(m, regions, waypoints, heap, stamp, start, goal, gx, gy, radius):
        return NONE, np.int64(0), math.inf  # free space does not join start and goal
    # Corners of closed sides have a clearance of 0: never pass them.
    width = max(width, 1e-30)
    most = 6 * m.frame[0].triangles - 6  # a step adds up to six labels, three for each of two sides
    limit = math.inf
    # In one triangle the straight line is a way, from which the limit is known at once.
    if farther is not None and start == goal:
        limit = farther[0] * math.sqrt((gx - sx) ** 2 + (gy - sy) ** 2) + farther[1]
    count = _leave_start(m, regions, work, start, sx, sy, gx, gy, radius, width, guide)
    used = count
    following = NONE  # the best of the labels just made, if better than all in the heap, need not pass through it
    while used < most:
        i = following
        if i < 0:
            if count == 0:
                break
            pop(heap, count)
            count -= 1
            if farther is not None and heap[count].key > limit:
                break
            i = heap[count].item
        following = NONE
        label = labels[i]
        spent = label.spent
        # Too long even if straight from here, without GREED. The key is no bound, as it estimates ways behind bridges.
        if longest is not None and spent + (_estimate(label, gx, gy) - spent) / GREED > longest:
            continue
        # Its root was reached on a shorter way since.
        corner = np.int64(label.corner)
        if corner >= 0 and reached[corner].spent < spent - _SAME:
            continue
        # In the triangle of the goal the search ends, or knows its limit if it is to follow longer ways as well.
        h = np.int64(label.h)
        g = sides[h].twin
        if g // 3 == goal and can_leave(sides, vertices, g, gx, gy, width):
            if farther is None:
                return i, used, limit
            limit = min(limit, farther[0] * _estimate(label, gx, gy) + farther[1])
        # The way may bend at an end of the interval that is an end of the cut side, unless the root is there.
        spent_left = math.inf
        if label.ends & 1 and not (label.lx == label.rx and label.ly == label.ry):
            spent_left = _spent_at(label, label.lx, label.ly, reached[2 * h], stamp)
        spent_right = math.inf
        if label.ends & 2 and not (label.px == label.rx and label.py == label.ry):
            spent_right = _spent_at(label, label.px, label.py, reached[2 * h + 1], stamp)
        # The two other sides of the triangle beyond, if the corner between is wide enough to turn.
        first = used
        v = vertices[sides[prv(g)].org]
        for turn in range(2):
            e = nxt(g) if turn == 0 else prv(g)
            # ``around``: half-edge at whose origin is the corner that h and e share.
            around = e if turn == 0 else g
            if sides[around].corner_clearance < width:
                continue
            f = sides[e].twin
            t = f // 3
            # Side e leads to a region off the way, or into a triangle with no way out.
            if regions is not None and waypoints[regions[t].top].stamp != stamp:
                continue
            if sides[f].corner_clearance < width and sides[nxt(f)].corner_clearance < width and t != goal:
                continue
            o = vertices[sides[around].org]
            used = _add_labels(labels, used, i, reached, stamp, spent_left, spent_right, e, turn, v, o, radius)
        if used == first + 1:  # only one way on: followed at once, whatever its key
            following = first
            continue
        # The best of the new labels follows at once, unless the heap holds a better one; the others go into the heap.
        best = math.inf
        for k in range(first, used):
            key = _key(m, regions, waypoints, guide, labels[k], gx, gy, radius)
            if key < best:
                if following >= 0:
                    count = place(heap, count, best, following)
                best = key
                following = k
            else:
                count = place(heap, count, key, k)
        if following >= 0 and count > 0 and heap[0].key < best:
            count = place(heap, count, best, following)
            following = NONE
    return NONE, used, limit


@helper
def string_along(m, labels, last, sx, sy, gx, gy, radius):
    """Return the nodes (STRING_NODE) that the way over label ``last`` to the goal bends around, and their number.

    They begin with the start and end with the goal. STRING_NODE is of tangent_kernels. The array has 64 rows to spare
    or more, for repairs of the string.
    """
    label = labels[last]
    h = np.int64(label.h)
    x = gx - label.rx
    y = gy - label.ry
    corner = np.int64(label.corner)
    # Does the way to the goal bend at the last interval?
    bend = NONE
    if label.ends & 1 and x * (label.ly - label.ry) - y * (label.lx - label.rx) < 0.0:
        bend = 2 * h
    if label.ends & 2 and x * (label.py - label.ry) - y * (label.px - label.rx) > 0.0:
        bend = 2 * h + 1
    # Count the roots, then fill the nodes from the goal backwards.
    count = 3 if bend >= 0 else 2
    i = last
    while corner >= 0:
        count += 1
        i = np.int64(labels[i].before)
        corner = np.int64(labels[i].corner)
    nodes = np.empty(count + 64, STRING_NODE)
    k = count - 1
    set_node(nodes[k], gx, gy, 0.0, NONE)
    i = last
    corner = bend if bend >= 0 else np.int64(labels[i].corner)
    while corner >= 0:
        h = corner // 2
        right = corner % 2 == 1
        v = m.sides[h if right else nxt(h)].org
        q = -radius if right else radius
        # A way around one corner has roots at several sides, for which one node is enough.
        if nodes[k].vertex != v or nodes[k].q != q:
            k -= 1
            set_node(nodes[k], m.vertices[v].x, m.vertices[v].y, q, v)
        # The bend at the last interval has no label of its own.
        if bend >= 0:
            bend = NONE
        else:
            i = np.int64(labels[i].before)
        corner = np.int64(labels[i].corner)
    k -= 1
    set_node(nodes[k], sx, sy, 0.0, NONE)
    for i in range(count - k):
        nodes[i] = nodes[k + i]
    return nodes, count - k
