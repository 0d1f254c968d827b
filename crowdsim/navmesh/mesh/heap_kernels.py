"""A binary heap of (key, item) rows in an array that grows; the least row comes first.

``heap`` (n,) are records :data:`HEAP_ROW`, the first ``count`` of them in use.
"""

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.growing_kernels import longer

HEAP_ROW = np.dtype([("key", np.float64), ("item", np.int64)], align=True)
"""A row of a heap. Rows with equal keys leave in the order of their items, not of their arrival."""


@helper
def place(heap, count, key, item):
    """Add the row (key, item) to the first ``count`` rows of a heap that has room for it; return the new count."""
    i = count
    # Sift up: move parents that are greater one level down, until the row fits.
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
    """Add the row (key, item) to a heap, which grows if it is full; return (heap, count)."""
    if count == heap.size:
        heap = longer(heap)
    return heap, place(heap, count, key, item)


@helper
def pop(heap, count):
    """Remove the least of ``count`` rows, at least one, from a heap.

    The row is left at index ``count - 1``, where the caller reads it.
    """
    last = count - 1
    key = heap[last].key
    item = heap[last].item
    heap[last] = heap[0]
    # The former last row starts at the root. Sift it down: move the lesser child up, until the row fits.
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
        # The row is not greater than both children: its place is found.
        if key < low.key or (key == low.key and item <= low.item):
            break
        heap[i] = low
        i = child
    if last > 0:
        heap[i].key = key
        heap[i].item = item
