"""A binary heap in an array that grows."""

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.growing_kernels import longer

HEAP_ROW = np.dtype([("key", np.float64), ("item", np.int64)], align=True)
"""An element of a binary heap; equal keys leave in the order of their items."""


@helper
def place(heap, count, key, item):
    """Add a row (key, item) to the first ``count`` rows of a binary heap with room for it; the new count."""
    i = count
    while i > 0:
        up = (i - 1) // 2
        if heap[up].key < key or (heap[up].key == key and heap[up].item <= item):
            break
        heap[i].key = heap[up].key
        heap[i].item = heap[up].item
        i = up
    heap[i].key = key
    heap[i].item = item
    return count + 1


@helper
def push(heap, count, key, item):
    """Add a row (key, item) to a binary heap that grows where it is full; (heap, count)."""
    if count == heap.size:
        heap = longer(heap)
    return heap, place(heap, count, key, item)


@helper
def pop(heap, count):
    """Take the least of ``count`` heap rows away, which is left in place ``count - 1``."""
    last = count - 1
    key = heap[last].key
    item = heap[last].item
    heap[last] = heap[0]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        low = heap[child]
        if child + 1 < last:
            right = heap[child + 1]
            if right.key < low.key or (right.key == low.key and right.item < low.item):
                child += 1
                low = right
        if key < low.key or (key == low.key and item <= low.item):
            break
        heap[i] = low
        i = child
    if last > 0:
        heap[i].key = key
        heap[i].item = item
