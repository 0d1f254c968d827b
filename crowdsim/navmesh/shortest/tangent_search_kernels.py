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
from crowdsim.navmesh.shortest.visibility_kernels import SLACK, set_ellipse

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
def _least_lost(graph, goals, stamp, gx, gy, n, cost, turned, kept_cost, kept_turned, kept_straight, radius):
    """A bound on the lengths of strings that one arrival at node n leads to and a cheaper one that is kept does not."""
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
                lost = min(lost, cost + link.cost + distance(gx - node.x, gy - node.y))
    goal = goals[n]
    seen = goal.stamp == stamp and goal.turned >= turned - SAME and goal.turned < until
    if seen and not _is_shorter(kept_turned - goal.turned, radius, kept_straight, goal.length):
        lost = min(lost, cost + radius * goal.turned + goal.length)
    return lost


@helper
def end_margin(radius, least):
    """Radians by which tangents of start and goal may miss an arc.

    A tangent dips into a circle by what ``radius`` is more than ``least`` where it is off by this angle.
    """
    return SLACK + (math.sqrt(2.0 * max(radius - least, 0.0) / radius) if least > 0.0 else 0.0)


@helper
def search_tangents(
    m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack, longest
):
    """(last node, length, lost) of the shortest path of at most ``longest`` meters; the labels lead back from its node.

    The node is -1 where there is none, with an infinite length. A path that is shorter yet is at least ``lost`` long.
    """
    links = graph.links
    nodes = graph.nodes
    labels = scratch.labels
    goals = scratch.goals
    ends = scratch.ends
    scratch.stamp[0] += 1
    stamp = scratch.stamp[0]
    set_ellipse(scratch.outlook.ellipse[0], sx, sy, gx, gy, longest + 2.0 * radius)
    margin = end_margin(radius, least)
    count = find_ends(m, graph, scratch, gx, gy, goal, goal_others, radius, slack, margin, np.bool_(True))
    for i in range(count):
        goals[ends[i].node] = ends[i]
        goals[ends[i].node].stamp = stamp
    lost = np.inf
    heap = scratch.heap
    size = np.int64(0)
    total = nodes.size
    count = find_ends(m, graph, scratch, sx, sy, start, start_others, radius, slack, margin, np.bool_(False))
    for k in range(count):
        node = nodes[ends[k].node]
        cost = ends[k].length - radius * ends[k].turned
        heap, size = push(heap, size, cost + distance(gx - node.x, gy - node.y), 2 * total + k)
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
                lost = min(
                    lost,
                    _least_lost(
                        graph,
                        goals,
                        stamp,
                        gx,
                        gy,
                        n,
                        cost,
                        end.turned,
                        label.cost,
                        label.turned,
                        label.straight,
                        radius,
                    ),
                )
                continue
            if least > 0.0 and not is_free_way(m, scratch.stack, start, sx, sy, end.x, end.y, least):
                continue
            if label.stamp == stamp:
                lost = min(
                    lost,
                    _least_lost(
                        graph, goals, stamp, gx, gy, n, label.cost, label.turned, cost, end.turned, end.length, radius
                    ),
                )
            label.stamp = stamp
            label.cost = cost
            label.turned = end.turned
            label.straight = end.length
            label.before = -1
        elif item >= total:  # a tangent to the goal
            n = item - total
            end = goals[n]
            if least <= 0.0 or is_free_way(m, scratch.stack, goal, gx, gy, end.x, end.y, least):
                return n, key, lost
            end.stamp = -1
            continue
        else:
            n = item
            label = labels[n]
            if key > label.cost + distance(gx - nodes[n].x, gy - nodes[n].y) + SAME:
                continue
        cost = label.cost
        turned = label.turned - SAME
        if goals[n].stamp == stamp and goals[n].turned >= turned:
            heap, size = push(heap, size, cost + radius * goals[n].turned + goals[n].length, total + n)
        for k in range(nodes[n].begin, nodes[n + 1].begin):
            link = links[k]
            if link.leave < turned:
                continue
            through = cost + link.cost
            straight = link.cost - radius * (link.leave - link.arrive)
            to = labels[link.to]
            node = nodes[link.to]
            if to.stamp == stamp:
                if not _is_better(through, link.arrive, to):
                    lost = min(
                        lost,
                        _least_lost(
                            graph,
                            goals,
                            stamp,
                            gx,
                            gy,
                            link.to,
                            through,
                            link.arrive,
                            to.cost,
                            to.turned,
                            to.straight,
                            radius,
                        ),
                    )
                    continue
                lost = min(
                    lost,
                    _least_lost(
                        graph, goals, stamp, gx, gy, link.to, to.cost, to.turned, through, link.arrive, straight, radius
                    ),
                )
            to.stamp = stamp
            to.cost = through
            to.turned = link.arrive
            to.straight = straight
            to.before = n
            heap, size = push(heap, size, through + distance(gx - node.x, gy - node.y), link.to)
    return NONE, np.inf, lost


@helper
def string_of(graph, labels, last, sx, sy, gx, gy, radius):
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
