"""A* over the sides of the free triangles: the channel that a disc passes through.

A state is a half-edge that the path crosses out of its triangle, with the point where it is crossed best. In a refined
mesh the widths of sides and corners decide exactly whether the disc fits; near its ends, `can_leave` does.
"""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.growing_kernels import longer_rows
from crowdsim.navmesh.triangulation_kernels import nxt, prv


@helper
def can_leave(m, h, x, y, width):
    """Whether a disc of diameter ``width`` that stands free at (x, y) in the triangle of side h fits out through h."""
    if m.cst[h] != 0:
        return False
    a = np.int64(m.org[h])
    b = np.int64(m.org[nxt(h)])
    if math.hypot(m.vx[b] - m.vx[a], m.vy[b] - m.vy[a]) < width:
        return False
    # A closed base with the corner opposite of it may leave too little between the disc and h.
    for base in (nxt(h), prv(h)):
        if m.cst[base] == 0:
            continue
        a = np.int64(m.org[base])
        b = np.int64(m.org[nxt(base)])
        v = np.int64(m.org[prv(base)])
        px = m.vx[v]
        py = m.vy[v]
        if point_segment_distance2(px, py, m.vx[a], m.vy[a], m.vx[b], m.vy[b]) < width * width:
            ux = m.vx[b] - m.vx[a]
            uy = m.vy[b] - m.vy[a]
            foot = (px - m.vx[a]) * ux + (py - m.vy[a]) * uy
            if foot > 0.0 and foot < ux * ux + uy * uy:
                along = (x - px) * ux + (y - py) * uy
                if (along < 0.0) != (h == prv(base)):
                    return False
    return True


@helper
def _crossing_point(m, h, radius, px, py, gx, gy):
    """Point of side h, a ``radius`` off its ends, on the shortest way from p over h to g."""
    a = np.int64(m.org[h])
    b = np.int64(m.org[nxt(h)])
    ax = m.vx[a]
    ay = m.vy[a]
    ux = m.vx[b] - ax
    uy = m.vy[b] - ay
    length = math.hypot(ux, uy)
    ux /= length
    uy /= length
    along_p = (px - ax) * ux + (py - ay) * uy
    along_g = (gx - ax) * ux + (gy - ay) * uy
    off_p = abs((px - ax) * uy - (py - ay) * ux)
    off_g = abs((gx - ax) * uy - (gy - ay) * ux)
    total = off_p + off_g
    at = (along_p * off_g + along_g * off_p) / total if total > 0.0 else along_p
    inset = min(radius, 0.5 * length)
    at = min(max(at, inset), length - inset)
    return ax + at * ux, ay + at * uy


@helper
def push(heap, count, key, item):
    """Add a row (key, item) to the binary heap; (heap, count). Equal keys leave in the order of their items."""
    if count == heap.shape[0]:
        heap = longer_rows(heap)
    i = count
    while i > 0:
        up = (i - 1) // 2
        if heap[up, 0] < key or (heap[up, 0] == key and heap[up, 1] <= item):
            break
        heap[i, 0] = heap[up, 0]
        heap[i, 1] = heap[up, 1]
        i = up
    heap[i, 0] = key
    heap[i, 1] = item
    return heap, count + 1


@helper
def pop(heap, count):
    """Take the least of ``count`` heap rows away, which is left in place ``count - 1``."""
    last = count - 1
    key = heap[last, 0]
    item = heap[last, 1]
    heap[last, 0] = heap[0, 0]
    heap[last, 1] = heap[0, 1]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        right = child + 1
        if right < last and (
            heap[right, 0] < heap[child, 0] or (heap[right, 0] == heap[child, 0] and heap[right, 1] < heap[child, 1])
        ):
            child = right
        if key < heap[child, 0] or (key == heap[child, 0] and item <= heap[child, 1]):
            break
        heap[i, 0] = heap[child, 0]
        heap[i, 1] = heap[child, 1]
        i = child
    if last > 0:
        heap[i, 0] = key
        heap[i, 1] = item


@helper
def find_channel(m, start, sx, sy, goal, gx, gy, radius, width):
    """Half-edges (k,) crossed from triangle ``start`` to ``goal`` on about the shortest way; none if too narrow.

    ``width`` is the least width passed, that of the disc of ``radius`` less what rounding may take.
    """
    states = np.empty((3 * m.counts[1], 3))  # cost and crossing point
    before = np.zeros(3 * m.counts[1], np.int32)  # the half-edge before, plus 2; 0 where not reached
    heap = np.empty((256, 2))
    count = np.int64(0)
    for h in range(3 * start, 3 * start + 3):
        if can_leave(m, h, sx, sy, width):
            x, y = _crossing_point(m, h, radius, sx, sy, gx, gy)
            cost = math.hypot(x - sx, y - sy)
            states[h, 0] = cost
            states[h, 1] = x
            states[h, 2] = y
            before[h] = 1
            heap, count = push(heap, count, cost + math.hypot(gx - x, gy - y), float(h))
    found = np.int64(-1)
    while count > 0:
        pop(heap, count)
        count -= 1
        h = np.int64(heap[count, 1])
        px = states[h, 1]
        py = states[h, 2]
        spent = states[h, 0]
        if heap[count, 0] > spent + math.hypot(gx - px, gy - py) + 1e-9:
            continue  # reached at less cost since
        g = np.int64(m.twin[h])
        if g // 3 == goal and can_leave(m, g, gx, gy, width):
            found = h
            break
        for e in (nxt(g), prv(g)):
            corner = e if e == nxt(g) else g  # the turn is around the vertex that e and g share
            if m.cst[e] != 0 or m.clr[corner] < width:
                continue
            x, y = _crossing_point(m, e, radius, px, py, gx, gy)
            cost = spent + math.hypot(x - px, y - py)
            if before[e] == 0 or cost < states[e, 0] - 1e-9:
                states[e, 0] = cost
                states[e, 1] = x
                states[e, 2] = y
                before[e] = h + 2
                heap, count = push(heap, count, cost + math.hypot(gx - x, gy - y), float(e))
    length = 0
    h = found
    while h >= 0:
        length += 1
        h = np.int64(before[h]) - 2
    channel = np.empty(length, np.int64)
    h = found
    while h >= 0:
        length -= 1
        channel[length] = h
        h = np.int64(before[h]) - 2
    return channel
