"""Grow motion maps: the tree of motions that can follow each node (2012 paper, algorithm 1).

An entry of a map is one node of that tree, stored by the pose at which the node *starts*, in the frame of the root's
own start. The root is entry 0.

A cell is numbered by (``ix``, ``iy``, ``heading_bin``) or, packed, by an int64 ``key``. The frontier is a hash table of
three columns, ``table_key``, ``table_node`` and ``table_stamp``, whose length is a power of two. A ``heap`` (n,) holds
entries, the first ``size`` of them in use, and ``cost`` is the search cost up to the end of each entry's node [m].
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import next_origin, node_end

CELL = 0.1
"""Side of a cell in x and y [m]."""

BIN = math.pi / 6.0
"""Height of a cell in heading [rad]."""

TURN_COST = 0.3
"""Search cost of turning [m/rad], so that turning in place is not free."""

NODE_COST = 0.1
"""Search cost per node [m], so that chains of idle shuffling do not fill a map."""

BLEND_OFFSET_WEIGHT = 2.0
"""Weight of the jump from the end of a node to the start of the next in the length of a branch. Many branches of deep
maps advance along a path only by their blend offsets; with this weight they seem to lag behind."""

IN_PLACE = 0.15
"""Distance from start to end below which a node counts as turning in place, so that any heading is allowed [m]."""

END_X, END_Y, WALKED, LEVEL, BEHAVIOR = range(5)
AHEAD_COLUMNS = 5
"""Columns of ``maps.ahead``: end of an entry's node, distance from the root's end to there (track, and blend offsets by
their weight) [m], edges since the root, and the node's behavior."""

_OFFSET = 1 << 19
"""Makes cell indices positive: 20 bits each for x and y."""


@helper
def pack_cell(ix, iy, heading_bin):
    """Return one int64 that sorts cells by x, then y, then heading bin (0 to 15; bins of headings are 0 to 11)."""
    return ((np.int64(ix) + _OFFSET) << 20 | (np.int64(iy) + _OFFSET)) * 16 + np.int64(heading_bin)


@helper
def cell_key(x, y, heading):
    """Return the cell of a pose (x, y [m], heading [rad]).

    Cells and bins are centered on multiples of their size, so that straight ahead is one bin.
    """
    ix = math.floor(x / CELL + 0.5)
    iy = math.floor(y / CELL + 0.5)
    return pack_cell(ix, iy, math.floor(heading / BIN + 0.5) % 12)


@helper
def _occupy(table_key, table_node, table_stamp, stamp, key, node):
    """Enter (cell, node) into the frontier of a map, a hash table; return False if it was there already.

    ``key`` is the packed cell, ``stamp`` the number of the map's root, which marks the slots in use.
    """
    # Fibonacci hashing, linear probing; slots with the stamp of an earlier map are free.
    mask = table_key.shape[0] - 1
    mixed = (key * 31 + node) * np.int64(-7046029254386353131)
    slot = (mixed >> 32) & mask
    while table_stamp[slot] == stamp:
        if table_key[slot] == key and table_node[slot] == node:
            return False
        slot = (slot + 1) & mask
    table_stamp[slot] = stamp
    table_key[slot] = key
    table_node[slot] = node
    return True


@helper
def _sift_up(heap, cost, at):
    """Restore the heap of entries, ordered by (cost, entry), after one was put at position ``at``."""
    entry = heap[at]
    while at > 0:
        above = (at - 1) >> 1
        other = heap[above]
        if cost[other] < cost[entry] or (cost[other] == cost[entry] and other < entry):
            break
        heap[at] = other
        at = above
    heap[at] = entry


@helper
def _sift_down(heap, cost, size):
    """Restore the heap of ``size`` entries, ordered by (cost, entry), after its top was replaced."""
    entry = heap[0]
    at = 0
    while 2 * at + 1 < size:
        child = 2 * at + 1
        if child + 1 < size:
            a, b = heap[child], heap[child + 1]
            if cost[b] < cost[a] or (cost[b] == cost[a] and b < a):
                child += 1
        other = heap[child]
        if cost[entry] < cost[other] or (cost[entry] == cost[other] and entry < other):
            break
        heap[at] = other
        at = child
    heap[at] = entry


@kernel
def grow_maps(graph, begin, end, depth, reach, capacity, first, key, parent, edge, node, level, pose, length):
    """Grow the maps of the nodes ``begin`` to ``end - 1`` by Dijkstra's search; return the number of their entries.

    All children of an entry start where its node ends, at one cost: the queue holds the parents, by the cost at which
    their children start, and all children of a parent are entered together. Idle nodes are left out, but for roots.

    Parameters
    ----------
    graph: :class:`crowdsim.motion.graph.arrays.GraphArrays`.
    depth: largest number of edges of a branch. capacity: largest number of entries per map.
    reach: search cost up to which entries are expanded [m]; the root always is.
    first: (end - begin + 1,) int64, filled with the row of each map's entry 0, and the number of all rows.
    key, parent, edge, node, level, pose, length: columns of ((end - begin) * capacity,) rows, filled with one row for
    each entry, map after map. key: int64, cell of the entry. parent, edge, node, level: int32. The parent is an entry
    of the same map, counted from its entry 0; ``edge`` is the edge of the motion graph from the parent's node to this
    one; both are -1 for the root. ``level`` is the number of edges since the root. pose: (rows, 3) float32, start of
    the entry (x, y [m], heading [rad]). length: float32, length of the branch from the root's start to there [m], blend
    offsets by BLEND_OFFSET_WEIGHT.
    """
    # One hash table for all maps, at most a quarter full; the root's number is its stamp.
    table = 16
    while table < 4 * capacity:
        table *= 2
    table_key = np.empty(table, np.int64)
    table_node = np.empty(table, np.int32)
    table_stamp = np.full(table, -1, np.int32)
    heap = np.empty(capacity, np.int64)
    cost = np.empty(capacity, np.float64)
    total = 0
    for root in range(begin, end):
        first[root - begin] = total
        # The root, entry 0 of its map, at the origin.
        key[total] = cell_key(0.0, 0.0, 0.0)
        parent[total] = -1
        edge[total] = -1
        node[total] = root
        level[total] = 0
        pose[total, :] = 0.0
        length[total] = 0.0
        _occupy(table_key, table_node, table_stamp, root, key[total], root)
        cost[0] = graph.node_length[root] + TURN_COST * abs(graph.node_motion[root, 2]) + NODE_COST
        heap[0] = 0
        size = 1
        count = 1
        while size > 0 and count < capacity:
            # Take out the parent whose children start at the least cost.
            local = heap[0]
            size -= 1
            if size > 0:
                heap[0] = heap[size]
                _sift_down(heap, cost, size)
            above = total + local
            source = np.int64(node[above])
            # Its node's end, where its children start.
            x, y, heading = np.float64(pose[above, 0]), np.float64(pose[above, 1]), np.float64(pose[above, 2])
            x, y, heading = node_end(graph, np.int64(source), x, y, heading)
            for e in range(np.int64(graph.edge_start[source]), np.int64(graph.edge_start[source + 1])):
                target = graph.edge_target[e]
                if graph.node_idle[target] or count == capacity:
                    continue
                # A node enters each cell once. Successors of the root (entry 0) always enter: a small turn that
                # follows itself starts in the root's own cell.
                px, py, ph = next_origin(graph, np.int64(e), 0.0, x, y, heading)
                cell = cell_key(px, py, ph)
                if not _occupy(table_key, table_node, table_stamp, root, cell, target) and local > 0:
                    continue
                row = total + count
                key[row] = cell
                parent[row] = local
                edge[row] = e
                node[row] = target
                level[row] = level[above] + 1
                pose[row, 0] = px
                pose[row, 1] = py
                pose[row, 2] = ph
                length[row] = length[above] + graph.node_length[source] + BLEND_OFFSET_WEIGHT * hypot(px - x, py - y)
                cost[count] = (
                    cost[local] + graph.node_length[target] + TURN_COST * abs(graph.node_motion[target, 2]) + NODE_COST
                )
                # Queue the child as a parent, unless the map ends there.
                if level[row] < depth and cost[count] <= reach:
                    heap[size] = count
                    size += 1
                    _sift_up(heap, cost, size - 1)
                count += 1
        total += count
    first[end - begin] = total
    return total
