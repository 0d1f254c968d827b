"""A binary heap in an array that grows."""

import numpy as np

from crowdsim.jit import kernel
from crowdsim.navmesh.growing_kernels import longer

HEAP_ROW = np.dtype([("key", np.float64), ("item", np.int64)], align=True)
"""An element of a binary heap; equal keys leave in the order of their items."""


@kernel
def push(heap, count, key, item):
    """Add a row (key, item) to the binary heap; (heap, count)."""
    if count == heap.size:
        heap = longer(heap)
    i = count
    while i > 0:
        up = heap[(i - 1) // 2]
        if up.key < key or (up.key == key and up.item <= item):
            break
        heap[i] = up
        i = (i - 1) // 2
    heap[i].key = key
    heap[i].item = item
    return heap, count + 1


@kernel
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
