"""The same search with every arrival at an arc that a shortest path may need, for the few queries where it matters."""

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.shortest.shortest_scratch import ARRIVAL
from crowdsim.navmesh.shortest.tangent_search_kernels import (
    SAME,
    begin_search,
    distance,
    is_free_end,
    string_through,
)


@helper
def _is_beaten(arrivals, k, first, radius):
    """Whether another arrival at the node of arrival k is as good wherever the string goes on.

    The disc of one that has turned by more could go back along the arc; see
    :mod:`crowdsim.navmesh.shortest.tangent_search_kernels`.
    """
    one = arrivals[k]
    i = first
    while i >= 0:
        other = arrivals[i]
        if i != k:
            off = other.cost + 2.0 * radius * max(other.turned - one.turned, 0.0) - one.cost
            if off < -SAME or (off <= SAME and i < k):  # of equals the first one stays
                return True
        i = other.next
    return False


@helper
def _arrive(arrivals, count, first, n, cost, turned, before, radius):
    """Add an arrival at node n unless it is beaten; (arrivals, grown where needed, their number)."""
    if count == arrivals.size:
        arrivals = longer(arrivals)
    arrival = arrivals[count]
    arrival.cost = cost
    arrival.turned = turned
    arrival.node = n
    arrival.before = before
    arrival.next = first[n]
    if _is_beaten(arrivals, count, first[n], radius):
        return arrivals, count
    first[n] = count
    return arrivals, count + 1


@helper
def search_all(m, graph, scratch, start, goal, disc, longest):
    """(arrivals, last arrival, length) of the shortest path of at most ``longest`` meters; -1 if there is none."""
    nodes = graph.nodes
    goals = scratch.goals
    radius = disc.radius
    count = begin_search(m, graph, scratch, start, goal, disc, longest)
    stamp = scratch.stamp[0]
    arrivals = np.empty(256, ARRIVAL)
    first = np.full(nodes.size, NONE)
    filled = np.int64(0)
    heap = scratch.heap
    size = np.int64(0)
    for i in range(count):
        end = scratch.ends[i]
        if is_free_end(m, scratch.stack, start, disc, end):
            k = filled
            cost = end.length - radius * end.turned
            arrivals, filled = _arrive(arrivals, filled, first, end.node, cost, end.turned, NONE, radius)
            if filled > k:
                node = nodes[end.node]
                heap, size = push(heap, size, cost + distance(goal.x - node.x, goal.y - node.y), 2 * k)
    while size > 0:
        pop(heap, size)
        size -= 1
        key = heap[size].key
        k = heap[size].item >> 1
        n = arrivals[k].node
        if key > longest:
            break
        if heap[size].item & 1:  # a tangent to the goal
            end = goals[n]
            if end.stamp == stamp:
                if is_free_end(m, scratch.stack, goal, disc, end):
                    return arrivals, k, key
                end.stamp = -1
            continue
        if _is_beaten(arrivals, k, first[n], radius):
            continue
        # On to the goal and over all links that leave the arc later than it is met.
        cost = arrivals[k].cost
        turned = arrivals[k].turned - SAME
        if goals[n].stamp == stamp and goals[n].turned >= turned:
            heap, size = push(heap, size, cost + radius * goals[n].turned + goals[n].length, 2 * k + 1)
        for i in range(nodes[n].begin, nodes[n + 1].begin):
            link = graph.links[i]
            if link.leave < turned:
                continue
            through = cost + link.cost
            node = nodes[link.to]
            estimate = through + distance(goal.x - node.x, goal.y - node.y)
            if estimate > longest:
                continue
            new = filled
            arrivals, filled = _arrive(arrivals, filled, first, link.to, through, link.arrive, k, radius)
            if filled > new:
                heap, size = push(heap, size, estimate, 2 * new)
    return arrivals, NONE, np.inf


@helper
def string_of_arrival(graph, arrivals, last, start, goal, radius):
    """Nodes of the string from the start to the goal whose last arc is that of arrival ``last``."""
    count = 0
    k = last
    while k >= 0:
        count += 1
        k = arrivals[k].before
    ways = np.empty(count, np.int64)
    k = last
    for i in range(count):
        ways[i] = arrivals[k].node
        k = arrivals[k].before
    return string_through(graph, ways, count, start, goal, radius)
