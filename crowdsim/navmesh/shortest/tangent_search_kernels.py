"""A* over the tangent graph, from the arcs that the start sees to those the goal sees, with one arrival at each node.

What an arrival at a node costs is the length up to its arc less radius * the angle turned there, so that arrivals at
different places of one arc compare. A string leaves an arc only where it has not passed yet. Still, the disc of a
cheaper arrival that has turned by more could go back along the arc, which is free, for twice the radius * the angle
back (there and, as it was counted, here): an arrival that costs more than this leads to no shortest path. One that
costs less may, though it hardly ever does; then all arrivals have to be kept, see
:mod:`crowdsim.navmesh.shortest.complete_search_kernels`.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import tan
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.sweep_kernels import is_free_way
from crowdsim.navmesh.mesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node
from crowdsim.navmesh.shortest.end_kernels import find_ends
from crowdsim.navmesh.shortest.visibility_kernels import set_ellipse

SAME = 1e-9
"""Meters and radians within which lengths and angles are equal."""


@helper
def distance(dx, dy):
    """Length of the vector d."""
    return math.sqrt(dx * dx + dy * dy)


@helper
def _is_better(cost, turned, label):
    """Whether an arrival is cheaper than the label of its node or, where they tie, leaves the arc from earlier on."""
    return cost < label.cost - SAME or (cost < label.cost + SAME and turned < label.turned - SAME)


@helper
def _is_shorter(back, radius, one, other):
    """Whether two tangents of one arc cross, so that who takes the first one need not go ``back`` to take the other."""
    reach = radius * tan(0.5 * back) if back < 3.0 else np.inf
    return one >= reach and other >= reach


@helper
def _least_lost(graph, goals, stamp, goal, disc, n, cost, turned, kept_cost, kept_turned, kept_straight):
    """A bound on the lengths of strings that one arrival at node n leads to and a cheaper one that is kept does not."""
    radius = disc.radius
    until = kept_turned - (cost - kept_cost) / (2.0 * radius) if radius > 0.0 else turned
    lost = np.inf
    if until <= turned + SAME:
        return lost
    nodes = graph.nodes
    for k in range(nodes[n].begin, nodes[n + 1].begin):
        link = graph.links[k]
        if link.leave >= turned - SAME and link.leave < until:
            straight = link.cost - radius * (link.leave - link.arrive)
            if not _is_shorter(kept_turned - link.leave, radius, kept_straight, straight):
                node = nodes[link.to]
                lost = min(lost, cost + link.cost + distance(goal.x - node.x, goal.y - node.y))
    end = goals[n]
    seen = end.stamp == stamp and end.turned >= turned - SAME and end.turned < until
    if seen and not _is_shorter(kept_turned - end.turned, radius, kept_straight, end.length):
        lost = min(lost, cost + radius * end.turned + end.length)
    return lost


@helper
def _lost_beside(graph, goals, stamp, goal, disc, n, cost, turned, label):
    """What the strings of an arrival at node n are at least long that is not better than the node's label."""
    kept = label.straight
    return _least_lost(graph, goals, stamp, goal, disc, n, cost, turned, label.cost, label.turned, kept)


@helper
def _settle(graph, goals, stamp, goal, disc, n, label, cost, turned, straight, before):
    """Make a better arrival the label of node n; what the strings of the one it replaces are at least long."""
    lost = np.inf
    if label.stamp == stamp:
        lost = _least_lost(graph, goals, stamp, goal, disc, n, label.cost, label.turned, cost, turned, straight)
    label.stamp = stamp
    label.cost = cost
    label.turned = turned
    label.straight = straight
    label.before = before
    return lost


@helper
def begin_search(m, graph, scratch, start, goal, disc, longest):
    """Mark the arcs that the goal sees, and find the tangents from the start; how many these are."""
    scratch.stamp[0] += 1
    set_ellipse(scratch.outlook.ellipse[0], start.x, start.y, goal.x, goal.y, longest + 2.0 * disc.radius)
    ends = scratch.ends
    for i in range(find_ends(m, graph, scratch, goal, disc, np.bool_(True))):
        end = scratch.goals[ends[i].node]
        scratch.goals[ends[i].node] = ends[i]
        end.stamp = scratch.stamp[0]
    return find_ends(m, graph, scratch, start, disc, np.bool_(False))


@helper
def is_free_end(m, stack, stand, disc, end):
    """Whether the tangent between a stand and the place where ``end`` meets its arc is free; for a point it is."""
    return disc.least <= 0.0 or is_free_way(m, stack, stand.triangle, stand.x, stand.y, end.x, end.y, disc.least)


@helper
def search_tangents(m, graph, scratch, start, goal, disc, longest):
    """(last node, length, lost) of the shortest path of at most ``longest`` meters; the labels lead back from its node.

    The node is -1 where there is none, with an infinite length. A path that is shorter yet is at least ``lost`` long.
    """
    nodes = graph.nodes
    labels = scratch.labels
    goals = scratch.goals
    ends = scratch.ends
    radius = disc.radius
    lost = np.inf
    heap = scratch.heap
    size = np.int64(0)
    # Items of the heap: nodes, tangents from nodes to the goal, then tangents from the start.
    total = nodes.size
    count = begin_search(m, graph, scratch, start, goal, disc, longest)
    stamp = scratch.stamp[0]
    for k in range(count):
        node = nodes[ends[k].node]
        cost = ends[k].length - radius * ends[k].turned
        heap, size = push(heap, size, cost + distance(goal.x - node.x, goal.y - node.y), 2 * total + k)
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
            if label.stamp == stamp and not _is_better(cost, end.turned, label):
                lost = min(lost, _lost_beside(graph, goals, stamp, goal, disc, n, cost, end.turned, label))
                continue
            if not is_free_end(m, scratch.stack, start, disc, end):
                continue
            other = _settle(graph, goals, stamp, goal, disc, n, label, cost, end.turned, end.length, NONE)
            lost = min(lost, other)
        elif item >= total:  # a tangent to the goal
            n = item - total
            end = goals[n]
            if is_free_end(m, scratch.stack, goal, disc, end):
                return n, key, lost
            end.stamp = -1
            continue
        else:
            n = item
            label = labels[n]
            if key > label.cost + distance(goal.x - nodes[n].x, goal.y - nodes[n].y) + SAME:
                continue
        # On to the goal and over all links that leave the arc later than it is met.
        cost = label.cost
        turned = label.turned - SAME
        if goals[n].stamp == stamp and goals[n].turned >= turned:
            heap, size = push(heap, size, cost + radius * goals[n].turned + goals[n].length, total + n)
        for k in range(nodes[n].begin, nodes[n + 1].begin):
            link = graph.links[k]
            if link.leave < turned:
                continue
            through = cost + link.cost
            straight = link.cost - radius * (link.leave - link.arrive)
            to = labels[link.to]
            node = nodes[link.to]
            if to.stamp == stamp and not _is_better(through, link.arrive, to):
                lost = min(lost, _lost_beside(graph, goals, stamp, goal, disc, link.to, through, link.arrive, to))
                continue
            other = _settle(graph, goals, stamp, goal, disc, link.to, to, through, link.arrive, straight, n)
            lost = min(lost, other)
            heap, size = push(heap, size, through + distance(goal.x - node.x, goal.y - node.y), link.to)
    return NONE, np.inf, lost


@helper
def string_through(graph, ways, count, start, goal, radius):
    """Nodes of the string from the start to the goal through ``count`` nodes of the graph, backwards in ``ways``."""
    string = np.empty(count + 2, STRING_NODE)
    set_node(string[0], start.x, start.y, 0.0, NONE)
    set_node(string[count + 1], goal.x, goal.y, 0.0, NONE)
    for i in range(count):
        n = ways[i]
        arc = graph.arcs[n >> 1]
        set_node(string[count - i], arc.x, arc.y, -radius if n & 1 else radius, arc.vertex)
    return string


@helper
def string_of(graph, labels, last, start, goal, radius):
    """Nodes of the string from the start to the goal whose last arc is that of node ``last``."""
    count = 0
    n = last
    while n >= 0:
        count += 1
        n = labels[n].before
    ways = np.empty(count, np.int64)
    n = last
    for i in range(count):
        ways[i] = n
        n = labels[n].before
    return string_through(graph, ways, count, start, goal, radius)
