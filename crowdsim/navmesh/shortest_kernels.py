"""The shortest path of a disc: A* over the tangent graph, from all corners the start sees to one the goal sees.

A node's label is the length up to its arc less radius * the angle turned there on arrival, so that arrivals at
different places of one arc compare; a string that arrives later on the arc and costs less is better for whatever comes,
as turning back would never pay.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import capsule_clearance, disc_clearance
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.search_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.tangent_graph_kernels import touches, turned_to
from crowdsim.navmesh.visibility_kernels import SIGHT, see_corners

_BACK = 1e-6
"""Radians that a string may turn back for rounding."""

LABEL = np.dtype(
    [("cost", np.float64), ("turned", np.float64), ("before", np.int64), ("stamp", np.int64)], align=True
)
"""How a node is reached best: cost (see above), angle turned on arrival, the node before it (-1: the start)."""

END = np.dtype([("node", np.int64), ("length", np.float64), ("turned", np.float64), ("stamp", np.int64)], align=True)
"""A tangent between the start or the goal and a node, where ``turned`` is turned of its arc."""


@helper
def _tangents_of(m, graph, x, y, triangle, radius, slack, sign, sights, seen, ends):
    """Tangents from the point (x, y) to arcs it sees (``sign`` 1) or from those to it (-1), not checked; the count."""
    arcs = graph.arcs
    found = np.int64(0)
    for h in range(3 * triangle, 3 * triangle + 3):
        found = see_corners(m, graph.arc_begin, x, y, 0.0, radius, h, slack, 0.0, 0.0, 0.0, 0.0, sights, seen, found)
    count = 0
    for i in range(found):
        sight = seen[i]
        q = int(math.copysign(1.0, sight.q))
        for k in range(graph.arc_begin[sight.vertex], graph.arc_begin[sight.vertex + 1]):
            arc = arcs[k]
            nx = q * sight.ty
            ny = -q * sight.tx
            if not touches(arc, nx, ny):
                continue
            angle = turned_to(arc, nx, ny)
            if angle < 0.0:
                continue
            forth = (q > 0) == (sign > 0)
            end = ends[count]
            count += 1
            end.node = 2 * k if forth else 2 * k + 1
            end.length = sight.length
            end.turned = angle if forth else arc.extent - angle
    return count


@helper
def _distance(dx, dy):
    return math.sqrt(dx * dx + dy * dy)


@helper
def _place(graph, node, turned, radius):
    """Where the disc stands at ``node`` when it has turned by so much."""
    arc = graph.arcs[node >> 1]
    angle = arc.extent - turned if node & 1 else turned
    c = math.cos(angle)
    s = math.sin(angle)
    return arc.x + radius * (arc.nx * c - arc.ny * s), arc.y + radius * (arc.ny * c + arc.nx * s)


@kernel
def shortest(m, graph, labels, goals, sights, seen, ends, stamp, sx, sy, gx, gy, radius, least, slack):
    """(length, nodes, counts)"""
    links = graph.links
    starts = graph.starts
    none = np.empty(0, np.int64)
    distance, start = disc_clearance(m, sx, sy, 2.0 * radius + 1.0, NONE)
    if distance < least:
        return -1.0, none, 0
    distance, goal = disc_clearance(m, gx, gy, 2.0 * radius + 1.0, NONE)
    if distance < least:
        return -2.0, none, 0
    distance, _ = capsule_clearance(m, sx, sy, gx, gy, 1.01 * least + 1e-3, start)
    if distance >= least and distance > 0.0:
        return math.hypot(gx - sx, gy - sy), none, 0
    count = _tangents_of(m, graph, gx, gy, goal, radius, slack, np.int64(-1), sights, seen, ends)
    for i in range(count):
        goals[ends[i].node] = ends[i]
        goals[ends[i].node].stamp = stamp
    nodes = starts.shape[0]
    heap = np.empty(256, HEAP_ROW)
    size = np.int64(0)
    count = _tangents_of(m, graph, sx, sy, start, radius, slack, np.int64(1), sights, seen, ends)
    for k in range(count):
        node = ends[k].node
        cost = ends[k].length - radius * ends[k].turned
        rest = _distance(gx - starts[node, 0], gy - starts[node, 1])
        heap, size = push(heap, size, cost + rest, 2 * nodes + k)
    expanded = 0
    found_node = NONE
    length = -3.0
    while size > 0:
        pop(heap, size)
        size -= 1
        item = heap[size].item
        key = heap[size].key
        n = item
        if item >= 2 * nodes:  # a tangent from the start
            end = ends[item - 2 * nodes]
            n = end.node
            cost = end.length - radius * end.turned
            if labels[n].stamp == stamp and labels[n].cost <= cost + 1e-9:
                continue
            x, y = _place(graph, n, end.turned, radius)
            if least > 0.0:
                free, _ = capsule_clearance(m, sx, sy, x, y, 1.01 * least, start)
                if free < least:
                    continue
            label = labels[n]
            label.stamp = stamp
            label.cost = cost
            label.turned = end.turned
            label.before = -1
        elif item >= nodes:  # a tangent to the goal
            n = item - nodes
            x, y = _place(graph, n, goals[n].turned, radius)
            if least > 0.0:
                free, _ = capsule_clearance(m, gx, gy, x, y, 1.01 * least, goal)
                if free < least:
                    goals[n].stamp = -1
                    continue
            found_node = n
            length = key
            break
        else:
            rest = _distance(gx - starts[n, 0], gy - starts[n, 1])
            if key > labels[n].cost + rest + 1e-9:
                continue
        expanded += 1
        label = labels[n]
        if goals[n].stamp == stamp and goals[n].turned >= label.turned - _BACK:
            heap, size = push(heap, size, label.cost + radius * goals[n].turned + goals[n].length, nodes + n)
        for k in range(graph.link_begin[n], graph.link_begin[n + 1]):
            link = links[k]
            if link.leave < label.turned - _BACK:
                continue
            cost = label.cost + link.cost
            to = labels[link.to]
            if to.stamp == stamp and to.cost <= cost + 1e-9:
                continue
            to.stamp = stamp
            to.cost = cost
            to.turned = link.arrive
            to.before = n
            rest = _distance(gx - starts[link.to, 0], gy - starts[link.to, 1])
            heap, size = push(heap, size, cost + rest, link.to)
    count = 0
    n = found_node
    while n >= 0:
        n = labels[n].before
        count += 1
    way = np.empty(count, np.int64)
    n = found_node
    while n >= 0:
        count -= 1
        way[count] = n
        n = labels[n].before
    return length, way, expanded


@kernel
def many(m, graph, labels, goals, sights, seen, ends, stamp, queries, radius, least, slack, out, exp):
    for i in range(queries.shape[0]):
        length, way, expanded = shortest(
            m, graph, labels, goals, sights, seen, ends, stamp + i,
            queries[i, 0], queries[i, 1], queries[i, 2], queries[i, 3], radius, least, slack,
        )  # fmt: skip
        out[i] = length
        exp[i] = expanded
