"""Search for a short way over intervals of sides, after Polyanya (Cui, Harabor and Grastien, IJCAI 2017).

Sides are cut by the radius at both ends, and what is left of them is passed in straight lines from root to root, the
ends of the cut sides. So the cost of a way is its length but for its arcs, of which it has the chords. The widths of
sides and corners decide what may be crossed, just as in :mod:`crowdsim.navmesh.paths.search_kernels`.
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
"""Meters within which two ways are as long as each other."""


@helper
def _set_label(label, rx, ry, spent, lx, ly, px, py, h, before, corner, ends):
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
    """Meters from the start over the label's interval to (x, y), those behind the interval weighted."""
    rx = label.rx
    ry = label.ry
    lx = label.lx - rx
    ly = label.ly - ry
    px = label.px - rx
    py = label.py - ry
    x -= rx
    y -= ry
    ux = lx - px
    uy = ly - py
    behind = ux * (y - py) - uy * (x - px)
    root = uy * px - ux * py
    if behind * root > 0.0:  # the target is on the root's side: mirror it
        k = 2.0 * behind / (ux * ux + uy * uy)
        x += k * uy
        y -= k * ux
        behind = -behind
    if x * ly - y * lx < 0.0:
        ux = lx - x
        uy = ly - y
        return label.spent + math.sqrt(lx * lx + ly * ly) + GREED * math.sqrt(ux * ux + uy * uy)
    if x * py - y * px > 0.0:
        ux = px - x
        uy = py - y
        return label.spent + math.sqrt(px * px + py * py) + GREED * math.sqrt(ux * ux + uy * uy)
    total = root - behind
    part = root / total if total != 0.0 else 0.0
    return label.spent + math.sqrt(x * x + y * y) * (part + GREED * (1.0 - part))


@helper
def _key(m, regions, waypoints, guide, label, gx, gy, radius):
    """What a label is in the heap by: about how long a way over it is."""
    key = 0.0
    if guide is not None:
        key = guided_estimate(m.sides, m.vertices, guide, label, radius, _estimate(label, gx, gy))
    if regions is not None:
        aim = waypoints[regions[m.sides[label.h].twin // 3].top]
        key = GREED * aim.rest + _estimate(label, aim.x, aim.y)
    return key


@helper
def _leave_start(m, regions, work, start, sx, sy, gx, gy, radius, width, guide):
    """Put labels of the sides that lead out of triangle ``start`` towards the goal into the heap; their number."""
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
        if regions is not None and waypoints[regions[sides[h].twin // 3].top].stamp != stamp:
            continue
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        ux = b.x - a.x
        uy = b.y - a.y
        k = min(radius / math.sqrt(ux * ux + uy * uy), 0.5)
        ux *= k
        uy *= k
        _set_label(labels[count], sx, sy, 0.0, b.x - ux, b.y - uy, a.x + ux, a.y + uy, h, NONE, NONE, np.int64(3))
        count = place(heap, count, _key(m, regions, waypoints, guide, labels[count], gx, gy, radius), count)
    return count


@helper
def _spent_at(label, x, y, before, stamp):
    """Meters up to the end (x, y) of a label's interval, as a root; infinite if it was one at less ``before``."""
    dx = x - label.rx
    dy = y - label.ry
    spent = label.spent + math.sqrt(dx * dx + dy * dy)
    if before.stamp == stamp and before.spent < spent - _SAME:
        return math.inf
    return spent


@helper
def _add_labels(labels, used, i, reached, stamp, spent_left, spent_right, e, turn, v, o, radius):
    """Add the labels of ways from label i on over side e, whose ends are v and o; how many labels there are then.

    Straight from the root over what it sees of the side, and around the left and the right end of the label's interval
    over the rest, where the way is ``spent_left`` and ``spent_right`` long up to these; infinite where it may not bend.
    The side is cut by the radius at both ends; v is its left end if ``turn`` is 0.
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
    dlx = label.lx - rx
    dly = label.ly - ry
    dpx = label.px - rx
    dpy = label.py - ry
    # From a root at the end of the side, everything on that end's side is seen.
    sees_left = dlx == 0.0 and dly == 0.0
    sees_right = dpx == 0.0 and dpy == 0.0
    # How far the ends are left of the rays from the root over the ends of the interval.
    ll = -1.0 if sees_left else dlx * (ely - ry) - dly * (elx - rx)
    lr = -1.0 if sees_left else dlx * (ery - ry) - dly * (erx - rx)
    rl = 1.0 if sees_right else dpx * (ely - ry) - dpy * (elx - rx)
    rr = 1.0 if sees_right else dpx * (ery - ry) - dpy * (erx - rx)
    # The ends of what the root sees of e.
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
    # Straight on.
    if not (ll > 0.0 and lr >= 0.0) and not (rr < 0.0 and rl <= 0.0):
        ends = np.int64(ll <= 0.0) + 2 * np.int64(rr >= 0.0)
        before = np.int64(label.before)
        corner = np.int64(label.corner)
        _set_label(labels[used], rx, ry, label.spent, slx, sly, srx, sry, e, before, corner, ends)
        used += 1
    # Around the left end, to what lies left of what is seen; then around the right end.
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
    """The last label of a short way from triangle ``start`` to ``goal``, -1 for none, the number of labels, the limit.

    ``width`` is the least width passed, that of the disc of ``radius`` less what rounding may take. Where regions hang
    together by narrow passages, a way that goes back through one to turn around behind it is not found; nor is one
    for which there is no room in the workspace.

    ``guide`` is None, or a :func:`crowdsim.navmesh.paths.guide_kernels.fill_guide` to this goal, which stands in for
    ``regions`` (None then). ``farther`` is None, or a factor and meters by which the way to the goal is lengthened to
    the limit, as far as which all ways are followed that may be shorter; there is no last label then.
    ``longest`` is None, or meters beyond which no way is followed.
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
        return NONE, np.int64(0), math.inf
    width = max(width, 1e-30)  # that of the corners of closed sides is 0
    most = 6 * m.frame[0].triangles - 6
    limit = math.inf
    if farther is not None and start == goal:
        limit = farther[0] * math.sqrt((gx - sx) ** 2 + (gy - sy) ** 2) + farther[1]
    count = _leave_start(m, regions, work, start, sx, sy, gx, gy, radius, width, guide)
    used = count
    following = NONE  # the best of the labels just made need not pass through the heap if nothing in there is better
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
        # Too long even straight from here; not by the key, which guesses what is behind bridges.
        if longest is not None and spent + (_estimate(label, gx, gy) - spent) / GREED > longest:
            continue
        corner = np.int64(label.corner)
        if corner >= 0 and reached[corner].spent < spent - _SAME:
            continue
        # In the triangle of the goal the search is over, or knows a limit if it is to follow longer ways as well.
        h = np.int64(label.h)
        g = sides[h].twin
        if g // 3 == goal and can_leave(sides, vertices, g, gx, gy, width):
            if farther is None:
                return i, used, limit
            limit = min(limit, farther[0] * _estimate(label, gx, gy) + farther[1])
        # Where the way may bend: at the ends of the interval that are those of the passable side, unless the root is.
        spent_left = math.inf
        if label.ends & 1 and not (label.lx == label.rx and label.ly == label.ry):
            spent_left = _spent_at(label, label.lx, label.ly, reached[2 * h], stamp)
        spent_right = math.inf
        if label.ends & 2 and not (label.px == label.rx and label.py == label.ry):
            spent_right = _spent_at(label, label.px, label.py, reached[2 * h + 1], stamp)
        # The two other sides of the triangle beyond, where the corner between is wide enough to turn.
        first = used
        v = vertices[sides[prv(g)].org]
        for turn in range(2):
            e = nxt(g) if turn == 0 else prv(g)
            around = e if turn == 0 else g  # the corner that h and e share is at the origin of this
            if sides[around].corner_clearance < width:
                continue
            f = sides[e].twin
            t = f // 3
            if regions is not None and waypoints[regions[t].top].stamp != stamp:
                continue
            if sides[f].corner_clearance < width and sides[nxt(f)].corner_clearance < width and t != goal:
                continue
            o = vertices[sides[around].org]
            used = _add_labels(labels, used, i, reached, stamp, spent_left, spent_right, e, turn, v, o, radius)
        if used == first + 1:  # nothing to choose from
            following = first
            continue
        # The best of the new labels follows at once, unless there is a better one in the heap; the others go there.
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
    """The nodes that the way to label ``last`` bends around, with room for more, and their number."""
    label = labels[last]
    h = np.int64(label.h)
    x = gx - label.rx
    y = gy - label.ry
    corner = np.int64(label.corner)
    bend = NONE  # at the last side
    if label.ends & 1 and x * (label.ly - label.ry) - y * (label.lx - label.rx) < 0.0:
        bend = 2 * h
    if label.ends & 2 and x * (label.py - label.ry) - y * (label.px - label.rx) > 0.0:
        bend = 2 * h + 1
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
        if nodes[k].vertex != v or nodes[k].q != q:  # a way around one corner has roots at several sides
            k -= 1
            set_node(nodes[k], m.vertices[v].x, m.vertices[v].y, q, v)
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
