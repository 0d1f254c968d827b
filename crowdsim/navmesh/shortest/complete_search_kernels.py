"""The search for a shortest path that keeps all arrivals at an arc, for the few queries in which one is not enough.

Arguments are those of :mod:`crowdsim.navmesh.shortest.tangent_search_kernels`: ``m``, ``graph``, ``scratch``,
``start``, ``goal``, ``disc`` and ``longest``. ``arrivals`` (k,) are records ARRIVAL of
:mod:`crowdsim.navmesh.shortest.shortest_scratch`, the first ``count`` of them in use, and ``first`` (nodes,) int64 is
the index of the arrival last added at each node, -1 for none. ``radius`` is that of the disc [m]; ``cost``, ``turned``
and ``before`` are fields of an arrival.
"""

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.heap_kernels import pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.shortest.shortest_scratch import ARRIVAL
from crowdsim.navmesh.shortest.tangent_search_kernels import SAME, begin_search, is_free_end, string_through


@helper
def _is_beaten(arrivals, k, first, radius):
    """Return True if another arrival at the node of arrival k is as good, however the string goes on.

    ``first`` is here the index of the arrival last added at that node, -1 for none. An arrival that has turned by more
    can go back along the arc; see :mod:`crowdsim.navmesh.shortest.tangent_search_kernels`.
    """
    one = arrivals[k]
    i = first
    while i >= 0:
        other = arrivals[i]
        if i != k:
            # By how much the other costs more, with its way back along the arc. Of two equals the earlier one stays.
            off = other.cost + 2.0 * radius * max(other.turned - one.turned, 0.0) - one.cost
            if off < -SAME or (off <= SAME and i < k):
                return True
        i = other.next
    return False


@helper
def _arrive(arrivals, count, first, n, cost, turned, before, radius):
    """Add an arrival at node n, as the first of its list, unless it is beaten; return (arrivals, their number).

    The array grows as needed.
    """
    if count == arrivals.size:
        arrivals = longer(arrivals)
    # Fill the next row, which stays unused if the arrival is beaten.
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
    """Search for the shortest path of at most ``longest`` meters, which may be infinite.

    Return (arrivals, index of the last arrival, length [m]). If there is no path, the index is -1 and the length
    infinite.
    """
    nodes = graph.nodes
    goals = scratch.goals
    radius = disc.radius
    # Begin with the arcs that the start sees.
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
                # Even numbers in the heap are arrivals, odd ones their tangents to the goal.
                node = nodes[end.node]
                heap, size = push(heap, size, cost + hypot(goal.x - node.x, goal.y - node.y), 2 * k)
    while size > 0:
        pop(heap, size)
        size -= 1
        key = heap[size].key
        k = heap[size].item >> 1
        n = arrivals[k].node
        # All that is left is longer.
        if key > longest:
            break
        # A tangent to the goal. It is checked only now that it would be the end of the shortest path.
        if heap[size].item & 1:
            end = goals[n]
            if end.stamp == stamp:
                if is_free_end(m, scratch.stack, goal, disc, end):
                    return arrivals, k, key
                end.stamp = -1  # blocked: never tried again
            continue
        # Another arrival, found since, is better.
        if _is_beaten(arrivals, k, first[n], radius):
            continue
        # Extend to the goal and across all links that leave the arc behind the place of arrival.
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
            estimate = through + hypot(goal.x - node.x, goal.y - node.y)
            if estimate > longest:
                continue
            new = filled
            arrivals, filled = _arrive(arrivals, filled, first, link.to, through, link.arrive, k, radius)
            if filled > new:
                heap, size = push(heap, size, estimate, 2 * new)
    return arrivals, NONE, np.inf


@helper
def string_of_arrival(graph, arrivals, last, start, goal, radius):
    """Return the string (k,) STRING_NODE from start to goal that passes the arc of arrival ``last`` at the end."""
    # Follow the arrivals back to the start.
    count = 0
    k = last
    while k >= 0:
        count += 1
        if count > arrivals.size:
            raise BoundExceeded
        k = arrivals[k].before
    ways = np.empty(count, np.int64)
    k = last
    for i in range(count):
        ways[i] = arrivals[k].node
        k = arrivals[k].before
    return string_through(graph, ways, count, start, goal, radius)
