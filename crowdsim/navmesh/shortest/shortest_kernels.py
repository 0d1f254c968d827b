"""The shortest path of a disc: A* over the tangent graph, from the corners that the start sees to those the goal sees.

What a node costs is the length up to its arc less radius * the angle turned there on arrival, so that arrivals at
different places of one arc compare. Of two arrivals only the cheaper is kept, though the other one may leave the arc at
places that the cheaper one has passed already: who would turn back there can cut the corner, so that another string
is shorter. Where arrivals tie within the tolerance, as between gaps as wide as the disc, there may be no room to cut,
and the one that has turned less is kept.
"""

import math

import numpy as np

from crowdsim.geometry.predicates_kernels import orient2d
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import is_free_way
from crowdsim.navmesh.half_edge_kernels import nxt, prv, side, triangle_of
from crowdsim.navmesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.path_kernels import (
    GOAL_BLOCKED,
    NO_PASSAGE,
    OK,
    START_BLOCKED,
    TANGLED,
    append_path,
    straight_path,
)
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node
from crowdsim.navmesh.shortest.tangent_graph_kernels import nearest_end, touches, turned_to
from crowdsim.navmesh.shortest.visibility_kernels import SLACK, see_corners, set_ellipse

_DETOUR = 1.06
"""The first search is for paths at most so much longer than the straight line: most are, and it looks at little."""

_SAME = 1e-9
"""Meters and radians within which lengths and angles are equal."""


@helper
def _distance(dx, dy):
    return math.sqrt(dx * dx + dy * dy)


@helper
def _free_triangle(m, x, y, least):
    """A free triangle whose closure holds (x, y), and whether there are others; (-1, False) where the disc is not free.

    There are others where (x, y) is on a side or a corner, or beyond a side within rounding to the grid.
    """
    sides = m.sides
    vertices = m.vertices
    t = triangle_of(m, x, y, NONE)
    if t < 0:
        return NONE, False
    if least > 0.0:
        distance, _ = disc_clearance(m, x, y, 1.01 * least, t)
        if distance < least:
            return NONE, False
        for h in range(3 * t, 3 * t + 3):
            if side(vertices, sides[h].org, sides[nxt(h)].org, x, y) <= 0.0:
                return t, True
        return t, False
    on = 0
    for h in range(3 * t, 3 * t + 3):
        if side(vertices, sides[h].org, sides[nxt(h)].org, x, y) == 0.0:
            on += 1
    if on > 0:
        for h in range(3 * t, 3 * t + 3):
            v = vertices[sides[h].org]
            if on == 2 and v.x == x and v.y == y:
                first = h
                while m.wind[h // 3] != 0:
                    h = sides[prv(h)].twin
                    if h == first:
                        break
                t = h // 3
                break
            if on == 1 and m.wind[t] != 0 and side(vertices, sides[h].org, sides[nxt(h)].org, x, y) == 0.0:
                t = sides[h].twin // 3
                break
    return (t, on > 0) if m.wind[t] == 0 else (NONE, False)


@helper
def _sees(m, t, x0, y0, x1, y1):
    """Whether the straight line from (x0, y0) in the closure of the free triangle t stays free, for a point.

    False where the line meets a corner: the tangent graph knows of those.
    """
    sides = m.sides
    vertices = m.vertices
    came = NONE
    for _ in range(m.wind.size):
        out = NONE
        inside = True
        for h in range(3 * t, 3 * t + 3):
            a = vertices[sides[h].org]
            b = vertices[sides[nxt(h)].org]
            if orient2d(a.x, a.y, b.x, b.y, x1, y1) < 0.0:
                inside = False
                left = orient2d(x0, y0, x1, y1, b.x, b.y)
                right = orient2d(x0, y0, x1, y1, a.x, a.y)
                if h != came and left > 0.0 and right < 0.0:
                    out = h
        if inside:
            return True
        if out < 0 or sides[out].cst != 0:
            return False
        came = sides[out].twin
        t = came // 3
    return False


@helper
def _see_each_other(m, t, x0, y0, x1, y1):
    """Whether a straight way is free for a point that stands on a side or a corner of the free triangle t."""
    sides = m.sides
    vertices = m.vertices
    for h in range(3 * t, 3 * t + 3):
        v = vertices[sides[h].org]
        if v.x == x0 and v.y == y0:
            g = h
            while True:
                if m.wind[g // 3] == 0 and _sees(m, g // 3, x0, y0, x1, y1):
                    return True
                g = sides[prv(g)].twin
                if g == h:
                    return False
    for h in range(3 * t, 3 * t + 3):
        g = sides[h].twin
        on = side(vertices, sides[h].org, sides[nxt(h)].org, x0, y0) == 0.0
        if on and m.wind[g // 3] == 0 and _sees(m, g // 3, x0, y0, x1, y1):
            return True
    return _sees(m, t, x0, y0, x1, y1)


@helper
def _look(m, graph, scratch, x, y, t, radius, slack, margin, found):
    """Add what (x, y) in the closure of triangle t sees across its other sides to the outlook; the new count."""
    for h in range(3 * t, 3 * t + 3):
        if side(m.vertices, m.sides[h].org, m.sides[nxt(h)].org, x, y) > 0.0:
            found = see_corners(
                m, graph.arc_begin, x, y, 0.0, radius, h, slack, margin, 0.0, 0.0, 0.0, 0.0,
                scratch.outlook, found,
            )  # fmt: skip
    return found


@helper
def _find_ends(m, graph, scratch, x, y, triangle, others, radius, slack, margin, to_goal):
    """Tangents from the point (x, y) to arcs it sees, or from those to it; not checked for what cuts them; the count.

    A disc that touches an obstacle may stand closer to it than ``radius`` by the tolerance. Its tangents may then miss
    the begin or the end of an arc by an angle of ``margin``, and lead to that place instead.

    ``others``: the point is on a side or a corner of the triangle, and sees through what else touches it as well.
    """
    sides = m.sides
    vertices = m.vertices
    seen = scratch.outlook.seen
    ends = scratch.ends
    found = _look(m, graph, scratch, x, y, triangle, radius, slack, margin, np.int64(0))
    if others:
        for h in range(3 * triangle, 3 * triangle + 3):
            v = vertices[sides[h].org]
            if v.x == x and v.y == y:
                g = sides[prv(h)].twin
                while g != h:
                    if m.wind[g // 3] == 0:
                        found = _look(m, graph, scratch, x, y, g // 3, radius, slack, margin, found)
                    g = sides[prv(g)].twin
                break
            w = sides[nxt(h)].org
            beyond = sides[h].twin // 3
            corner = vertices[w].x == x and vertices[w].y == y
            if not corner and side(vertices, sides[h].org, w, x, y) <= 0.0 and m.wind[beyond] == 0:
                found = _look(m, graph, scratch, x, y, beyond, radius, slack, margin, found)
    count = 0
    for i in range(found):
        tangent = seen[i]
        q = int(math.copysign(1.0, tangent.q))
        for k in range(graph.arc_begin[tangent.vertex], graph.arc_begin[tangent.vertex + 1]):
            arc = graph.arcs[k]
            nx = q * tangent.ty
            ny = -q * tangent.tx
            length = tangent.length
            angle = turned_to(arc, nx, ny) if touches(arc, nx, ny) else -1.0
            if angle < 0.0:
                angle = nearest_end(arc, nx, ny, margin)
                if angle < 0.0:
                    continue
                c = math.cos(angle)
                s = math.sin(angle)
                nx = arc.nx * c - arc.ny * s
                ny = arc.ny * c + arc.nx * s
                length = _distance(arc.x + radius * nx - x, arc.y + radius * ny - y)
            clockwise = (q < 0) != to_goal
            end = ends[count]
            count += 1
            end.node = 2 * k + 1 if clockwise else 2 * k
            end.length = length
            end.turned = arc.extent - angle if clockwise else angle
            end.x = arc.x + radius * nx
            end.y = arc.y + radius * ny
    return count


@helper
def _is_better(cost, turned, label, tie):
    """Whether an arrival is cheaper than the label of its node or, where they tie, leaves the arc from earlier on."""
    if cost < label.cost - tie:
        return True
    if turned < label.turned - _SAME:
        return cost < label.cost + tie
    return cost < label.cost - _SAME and turned <= label.turned + _SAME


@helper
def _search(m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack, longest):
    """(last node, length) of the shortest path of at most ``longest`` meters, or -1; the labels lead back from it."""
    links = graph.links
    nodes = graph.nodes
    labels = scratch.labels
    goals = scratch.goals
    ends = scratch.ends
    scratch.stamp[0] += 1
    stamp = scratch.stamp[0]
    set_ellipse(scratch.outlook.ellipse[0], sx, sy, gx, gy, longest + 2.0 * radius)
    margin = SLACK
    if least > 0.0:
        # A tangent dips into a circle by the tolerance where it is off by this angle.
        margin += math.sqrt(2.0 * max(radius - least, 0.0) / radius)
    count = _find_ends(m, graph, scratch, gx, gy, goal, goal_others, radius, slack, margin, np.bool_(True))
    for i in range(count):
        goals[ends[i].node] = ends[i]
        goals[ends[i].node].stamp = stamp
    tie = max(2.0 * (radius - least), _SAME)
    heap = scratch.heap
    size = np.int64(0)
    total = nodes.size
    count = _find_ends(m, graph, scratch, sx, sy, start, start_others, radius, slack, margin, np.bool_(False))
    for k in range(count):
        node = nodes[ends[k].node]
        cost = ends[k].length - radius * ends[k].turned
        heap, size = push(heap, size, cost + _distance(gx - node.x, gy - node.y), 2 * total + k)
    while size > 0:
        pop(heap, size)
        size -= 1
        item = heap[size].item
        key = heap[size].key
        if key > longest:
            break
        if item >= 2 * total:  # a tangent from the start
            end = ends[item - 2 * total]
            n = end.node
            label = labels[n]
            cost = end.length - radius * end.turned
            if label.stamp == stamp and not _is_better(cost, end.turned, label, tie):
                continue
            if least > 0.0 and not is_free_way(m, scratch.stack, start, sx, sy, end.x, end.y, least):
                continue
            label.stamp = stamp
            label.cost = cost
            label.turned = end.turned
            label.before = -1
        elif item >= total:  # a tangent to the goal
            n = item - total
            end = goals[n]
            if least <= 0.0 or is_free_way(m, scratch.stack, goal, gx, gy, end.x, end.y, least):
                return n, key
            end.stamp = -1
            continue
        else:
            n = item
            label = labels[n]
            if key > label.cost + _distance(gx - nodes[n].x, gy - nodes[n].y) + _SAME:
                continue
        cost = label.cost
        turned = label.turned - _SAME
        if goals[n].stamp == stamp and goals[n].turned >= turned:
            heap, size = push(heap, size, cost + radius * goals[n].turned + goals[n].length, total + n)
        for k in range(nodes[n].begin, nodes[n + 1].begin):
            link = links[k]
            if link.leave < turned:
                continue
            through = cost + link.cost
            to = labels[link.to]
            if to.stamp == stamp and not _is_better(through, link.arrive, to, tie):
                continue
            to.stamp = stamp
            to.cost = through
            to.turned = link.arrive
            to.before = n
            node = nodes[link.to]
            heap, size = push(heap, size, through + _distance(gx - node.x, gy - node.y), link.to)
    return NONE, np.inf


@helper
def _string(graph, labels, last, sx, sy, gx, gy, radius):
    """Nodes of the string from the start to the goal whose last arc is that of node ``last``."""
    count = 2
    n = last
    while n >= 0:
        count += 1
        n = labels[n].before
    string = np.empty(count, STRING_NODE)
    set_node(string[0], sx, sy, 0.0, NONE)
    set_node(string[count - 1], gx, gy, 0.0, NONE)
    n = last
    for i in range(count - 2, 0, -1):
        arc = graph.arcs[n >> 1]
        set_node(string[i], arc.x, arc.y, -radius if n & 1 else radius, arc.vertex)
        n = labels[n].before
    return string


@helper
def shortest_path(m, graph, scratch, sx, sy, gx, gy, radius, least, slack):
    """(status, points (n, 2), length) of the shortest path of a disc that comes nowhere closer than ``least``.

    ``graph`` is that of ``radius``, ``least`` and ``slack``; ``scratch`` a
    :class:`crowdsim.navmesh.shortest.shortest_scratch.ShortestScratch`.
    """
    points = np.empty((0, 2))
    start, start_others = _free_triangle(m, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points, math.nan
    goal, goal_others = _free_triangle(m, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points, math.nan
    straight = False
    if least > 0.0:
        straight = is_free_way(m, scratch.stack, start, sx, sy, gx, gy, least)
    elif not start_others:
        straight = _sees(m, start, sx, sy, gx, gy)
    elif not goal_others:
        straight = _sees(m, goal, gx, gy, sx, sy)
    else:
        straight = _see_each_other(m, start, sx, sy, gx, gy)
    if straight:
        return OK, straight_path(sx, sy, gx, gy), _distance(gx - sx, gy - sy)
    last = NONE
    length = np.inf
    for longest in (_DETOUR * _distance(gx - sx, gy - sy), np.inf):
        last, length = _search(
            m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack, longest
        )
        if last >= 0:
            break
    if last < 0:
        return NO_PASSAGE, points, math.nan
    string = _string(graph, scratch.labels, last, sx, sy, gx, gy, radius)
    done, points = pull(m, scratch.stack, string, string.size, radius, least, start)
    return (OK, points, length) if done else (TANGLED, points, math.nan)


@kernel
def shortest_paths(m, graph, scratch, starts, goals, radius, least, slack, status, lengths, counts):
    """The points (k, 2) of the paths of :func:`shortest_path` for rows of ``starts`` and ``goals`` (n, 2), one by one.

    Fills ``status`` (n,), ``lengths`` (n,), nan where there is no path, and ``counts`` (n,) of points of each path.
    """
    points = np.empty((16 * status.size, 2))
    filled = np.int64(0)
    for i in range(status.size):
        found, path, length = shortest_path(
            m, graph, scratch, starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1], radius, least, slack
        )
        status[i] = found
        counts[i] = 0
        lengths[i] = length
        if found == OK:
            points, _ = append_path(points, filled, path)
            counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled]
