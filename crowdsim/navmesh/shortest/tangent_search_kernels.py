"""A* in the tangent graph, from the arcs that the start sees to those the goal sees, with one arrival at each node.

The cost of an arrival is the length up to its arc less radius * the angle turned there, so that arrivals at different
places of one arc compare. A string can leave an arc only behind its place of arrival. Compare an arrival with a cheaper
one that has turned by more. From the cheaper one the disc can go back along the arc, which is free, for twice the
radius * the angle back (once for the way, and once as the cost counts the angle). If the other arrival still costs
more, it leads to no shortest path. If it costs less, it may, but hardly ever does; then all arrivals have to be kept,
see :mod:`crowdsim.navmesh.shortest.complete_search_kernels`.

Arguments of all helpers: ``graph`` is the TangentGraph of :mod:`crowdsim.navmesh.shortest.tangent_graph_arrays`. Of
:mod:`crowdsim.navmesh.shortest.shortest_scratch` are ``scratch`` (ShortestScratch), ``disc`` (Disc), ``start`` and
``goal`` (Stand), ``label`` and ``labels`` (records LABEL), ``end``, ``ends`` and ``goals`` (records END; ``goals`` are
the tangents to the goal). ``stamp`` is the number of the query; ``n`` is a node: a way around an arc, counter-clockwise
if even. ``turned`` is the angle from the begin of the arc to the place of arrival [rad], ``straight`` the length of the
tangent before it [m]. ``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``longest`` is the
length beyond which no way is followed [m]; ``stack`` is scratch, (k,) SWEPT of
:mod:`crowdsim.navmesh.clearance.sweep_kernels`.
"""

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot, tan
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.sweep_kernels import is_free_way
from crowdsim.navmesh.mesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node
from crowdsim.navmesh.shortest.end_kernels import find_ends
from crowdsim.navmesh.shortest.visibility_kernels import set_ellipse

SAME = 1e-9
"""Difference [m] or [rad] below which lengths and angles count as equal."""


@helper
def _is_better(cost, turned, label):
    """Return True if an arrival is cheaper than the label of its node or, at equal cost, has turned by less."""
    return cost < label.cost - SAME or (cost < label.cost + SAME and turned < label.turned - SAME)


@helper
def _is_shorter(back, radius, one, other):
    """Return True if two tangents of one arc cross, so that a string can change from the first to the second.

    The string then need not go back along the arc, and a way over the crossing is shorter. ``back`` is the angle
    between the points of contact [rad]; ``one`` and ``other`` are the lengths of the tangents [m].
    """
    # Tangents at two points of a circle meet at this distance from both points; if these are nearly half a turn apart,
    # too far away.
    reach = radius * tan(0.5 * back) if back < 3.0 else np.inf
    return one >= reach and other >= reach


@helper
def _least_lost(graph, goals, stamp, goal, disc, n, cost, turned, kept_cost, kept_turned, kept_straight):
    """Return a lower bound of the lengths of strings that are lost with an arrival at node n [m]; infinite if none is.

    ``cost`` and ``turned`` belong to the lost arrival; kept_cost, kept_turned and kept_straight (length of its tangent)
    belong to the cheaper arrival, which is kept. Lost are the strings to which only the lost arrival leads.
    """
    radius = disc.radius
    # Tangents that leave between ``turned`` and ``until`` cost less with the lost arrival than with the kept one, which
    # would have to go back. A point (radius 0) goes back at no cost, so nothing is lost.
    until = kept_turned - (cost - kept_cost) / (2.0 * radius) if radius > 0.0 else turned
    lost = np.inf
    if until <= turned + SAME:
        return lost
    nodes = graph.nodes
    for k in range(nodes[n].begin, nodes[n + 1].begin):
        link = graph.links[k]
        # Of these tangents, the ones that the kept arrival's tangent does not cross are lost. The bound is A*'s
        # estimate.
        if link.leave >= turned - SAME and link.leave < until:
            straight = link.cost - radius * (link.leave - link.arrive)
            if not _is_shorter(kept_turned - link.leave, radius, kept_straight, straight):
                node = nodes[link.to]
                lost = min(lost, cost + link.cost + hypot(goal.x - node.x, goal.y - node.y))
    # Likewise the tangent to the goal, if the goal sees this arc.
    end = goals[n]
    seen = end.stamp == stamp and end.turned >= turned - SAME and end.turned < until
    if seen and not _is_shorter(kept_turned - end.turned, radius, kept_straight, end.length):
        lost = min(lost, cost + radius * end.turned + end.length)
    return lost


@helper
def _lost_beside(graph, goals, stamp, goal, disc, n, cost, turned, label):
    """Return the bound of :func:`_least_lost` for an arrival at node n that is not better than the node's label."""
    kept = label.straight
    return _least_lost(graph, goals, stamp, goal, disc, n, cost, turned, label.cost, label.turned, kept)


@helper
def _settle(graph, goals, stamp, goal, disc, n, label, cost, turned, straight, before):
    """Make a better arrival the label of node n; return the bound of :func:`_least_lost` for the arrival it replaces.

    The bound is infinite if the node had no arrival.
    """
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
    """Mark the arcs that the goal sees, and find the tangents from the start; return the number of the latter.

    In ``scratch``, ``stamp`` gets a new number, ``outlook`` the ellipse of the search, ``goals`` the tangents to the
    goal at their nodes, and ``ends`` the tangents from the start. ``longest`` may be infinite.
    """
    scratch.stamp[0] += 1
    # Only corners in the ellipse can be on a way of at most ``longest``; the discs widen it.
    set_ellipse(scratch.outlook.ellipse[0], start.x, start.y, goal.x, goal.y, longest + 2.0 * disc.radius)
    ends = scratch.ends
    # Copy each tangent to the goal into the row of its node, and mark that row as one of this query.
    for i in range(find_ends(m, graph, scratch, goal, disc, np.bool_(True))):
        end = scratch.goals[ends[i].node]
        scratch.goals[ends[i].node] = ends[i]
        end.stamp = scratch.stamp[0]
    return find_ends(m, graph, scratch, start, disc, np.bool_(False))


@helper
def is_free_end(m, stack, stand, disc, end):
    """Return True if the tangent between a stand and the place where ``end`` meets its arc is free.

    The tangent of a point always is: to be seen is to be free.
    """
    return disc.least <= 0.0 or is_free_way(m, stack, stand.triangle, stand.x, stand.y, end.x, end.y, disc.least)


@helper
def search_tangents(m, graph, scratch, start, goal, disc, longest):
    """Search for the shortest path of at most ``longest`` meters; return (last node, length, lost).

    The labels lead back from the last node. The node is -1 if there is no path, with an infinite length. A path that
    the search has lost is at least ``lost`` long [m]; this is infinite if none was lost.
    """
    nodes = graph.nodes
    labels = scratch.labels
    goals = scratch.goals
    ends = scratch.ends
    radius = disc.radius
    lost = np.inf
    heap = scratch.heap
    size = np.int64(0)
    # Items of the heap: nodes, then tangents from nodes to the goal, then tangents from the start.
    total = nodes.size
    count = begin_search(m, graph, scratch, start, goal, disc, longest)
    stamp = scratch.stamp[0]
    for k in range(count):
        node = nodes[ends[k].node]
        # Costs of nodes are counted at the begin of their arcs: less the part of the arc before the place of arrival.
        cost = ends[k].length - radius * ends[k].turned
        heap, size = push(heap, size, cost + hypot(goal.x - node.x, goal.y - node.y), 2 * total + k)
    while size > 0:
        pop(heap, size)
        size -= 1
        item = heap[size].item
        key = heap[size].key
        # All that is left is longer.
        if key > longest:
            break
        # A tangent from the start; it is checked only now that it is the best item.
        if item >= 2 * total:
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
        # A tangent to the goal: if it is free, the path is found.
        elif item >= total:
            n = item - total
            end = goals[n]
            if is_free_end(m, scratch.stack, goal, disc, end):
                return n, key, lost
            end.stamp = -1  # blocked: never tried again
            continue
        # A node, unless it was reached at less cost since.
        else:
            n = item
            label = labels[n]
            if key > label.cost + hypot(goal.x - nodes[n].x, goal.y - nodes[n].y) + SAME:
                continue
        # Extend to the goal and across all links that leave the arc behind the place of arrival.
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
            heap, size = push(heap, size, through + hypot(goal.x - node.x, goal.y - node.y), link.to)
    return NONE, np.inf, lost


@helper
def string_through(graph, ways, count, start, goal, radius):
    """Return the string (count + 2,) STRING_NODE from start to goal through ``count`` nodes of the graph.

    ``ways`` (count,) int64 lists these nodes backwards; STRING_NODE is of tangent_kernels.
    """
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
    """Return the string (k,) STRING_NODE from start to goal that passes the arc of node ``last`` at the end."""
    # Follow the labels back to the start.
    count = 0
    n = last
    while n >= 0:
        count += 1
        if count > labels.size:
            raise BoundExceeded
        n = labels[n].before
    ways = np.empty(count, np.int64)
    n = last
    for i in range(count):
        ways[i] = n
        n = labels[n].before
    return string_through(graph, ways, count, start, goal, radius)
