"""A* over the tangent graph, from the arcs that the start sees to those the goal sees.

What an arrival at a node costs is the length up to its arc less radius * the angle turned there, so that arrivals at
different places of one arc compare. A string leaves an arc only where it has not passed yet. Still, the disc of a
cheaper arrival that has turned by more could go back along the arc, which is free, for twice the radius * the angle
back (there and, as it was counted, here): an arrival that costs more than this leads to no shortest path.
"""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.clearance.sweep_kernels import is_free_way
from crowdsim.navmesh.growing_kernels import longer
from crowdsim.navmesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node
from crowdsim.navmesh.shortest.end_kernels import find_ends
from crowdsim.navmesh.shortest.visibility_kernels import SLACK, set_ellipse

_SAME = 1e-9
"""Meters and radians within which lengths and angles are equal."""


@helper
def distance(dx, dy):
    """Length of the vector d."""
    return math.sqrt(dx * dx + dy * dy)


@helper
def is_beaten(labels, k, cost, turned, radius):
    """Whether one of the arrivals from label k on is as good wherever the string goes on."""
    while k >= 0:
        other = labels[k]
        if other.cost + 2.0 * radius * max(other.turned - turned, 0.0) <= cost + _SAME:
            return True
        k = other.next
    return False


@helper
def _arrive(labels, count, arrivals, stamp, n, cost, turned, before):
    """Label an arrival at node n; (labels, grown where needed, their number)."""
    arrival = arrivals[n]
    if count == labels.size:
        labels = longer(labels)
    label = labels[count]
    label.cost = cost
    label.turned = turned
    label.node = n
    label.before = before
    label.next = arrival.first if arrival.stamp == stamp else NONE
    arrival.first = count
    arrival.stamp = stamp
    return labels, count + 1


@helper
def _until(labels, i, k, radius):
    """The angle from which on an arrival of label i or its next is as good as that of label k; -1.0 if always."""
    label = labels[k]
    until = np.inf
    while i >= 0:
        other = labels[i]
        more = label.cost - other.cost
        if i != k and (more > 0.0 or (more == 0.0 and (other.turned < label.turned or i < k))):
            # The other one pays to go back as much as it is cheaper.
            back = more / (2.0 * radius) if radius > 0.0 else np.inf
            until = min(until, other.turned - back)
        i = other.next
    return until if until > label.turned else -1.0


@helper
def search_tangents(
    m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack, longest
):
    """(labels, last label, length) of the shortest path of at most ``longest`` meters; -1 for the label if none is."""
    links = graph.links
    nodes = graph.nodes
    labels = scratch.labels
    arrivals = scratch.arrivals
    goals = scratch.goals
    ends = scratch.ends
    scratch.stamp[0] += 1
    stamp = scratch.stamp[0]
    set_ellipse(scratch.outlook.ellipse[0], sx, sy, gx, gy, longest + 2.0 * radius)
    margin = SLACK
    if least > 0.0:
        # A tangent dips into a circle by the tolerance where it is off by this angle.
        margin += math.sqrt(2.0 * max(radius - least, 0.0) / radius)
    count = find_ends(m, graph, scratch, gx, gy, goal, goal_others, radius, slack, margin, np.bool_(True))
    for i in range(count):
        goals[ends[i].node] = ends[i]
        goals[ends[i].node].stamp = stamp
    heap = scratch.heap
    size = np.int64(0)
    count = find_ends(m, graph, scratch, sx, sy, start, start_others, radius, slack, margin, np.bool_(False))
    for k in range(count):
        node = nodes[ends[k].node]
        cost = ends[k].length - radius * ends[k].turned
        heap, size = push(heap, size, cost + distance(gx - node.x, gy - node.y), 3 * k)
    count = np.int64(0)
    while size > 0:
        pop(heap, size)
        size -= 1
        key = heap[size].key
        if key > longest:
            break
        kind = heap[size].item % 3
        k = heap[size].item // 3
        if kind == 0:  # a tangent from the start
            end = ends[k]
            cost = end.length - radius * end.turned
            arrival = arrivals[end.node]
            if arrival.stamp == stamp and is_beaten(labels, arrival.first, cost, end.turned, radius):
                continue
            if least > 0.0 and not is_free_way(m, scratch.stack, start, sx, sy, end.x, end.y, least):
                continue
            k = count
            labels, count = _arrive(labels, count, arrivals, stamp, end.node, cost, end.turned, NONE)
        elif kind == 2:  # a tangent to the goal
            end = goals[labels[k].node]
            if end.stamp == stamp:
                if least <= 0.0 or is_free_way(m, scratch.stack, goal, gx, gy, end.x, end.y, least):
                    return labels, k, key
                end.stamp = -1
            continue
        n = labels[k].node
        until = np.inf
        if arrivals[n].first != k or labels[k].next >= 0:
            until = _until(labels, arrivals[n].first, k, radius)
            if until < 0.0:
                continue
        cost = labels[k].cost
        turned = labels[k].turned - _SAME
        until += _SAME
        end = goals[n]
        if end.stamp == stamp and end.turned >= turned and end.turned <= until:
            heap, size = push(heap, size, cost + radius * end.turned + end.length, 3 * k + 2)
        for i in range(nodes[n].begin, nodes[n + 1].begin):
            link = links[i]
            if link.leave < turned or link.leave > until:
                continue
            through = cost + link.cost
            arrival = arrivals[link.to]
            if arrival.stamp == stamp and is_beaten(labels, arrival.first, through, link.arrive, radius):
                continue
            node = nodes[link.to]
            heap, size = push(heap, size, through + distance(gx - node.x, gy - node.y), 3 * count + 1)
            labels, count = _arrive(labels, count, arrivals, stamp, link.to, through, link.arrive, k)
    return labels, NONE, np.inf


@helper
def string_of(graph, labels, last, sx, sy, gx, gy, radius):
    """Nodes of the string from the start to the goal whose last arc is that of label ``last``."""
    count = 2
    k = last
    while k >= 0:
        count += 1
        k = labels[k].before
    string = np.empty(count, STRING_NODE)
    set_node(string[0], sx, sy, 0.0, NONE)
    set_node(string[count - 1], gx, gy, 0.0, NONE)
    k = last
    for i in range(count - 2, 0, -1):
        n = labels[k].node
        arc = graph.arcs[n >> 1]
        set_node(string[i], arc.x, arc.y, -radius if n & 1 else radius, arc.vertex)
        k = labels[k].before
    return string
