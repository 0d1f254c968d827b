"""Measures of one step of a run.

``mesh`` is the mesh of a layer (MeshArrays). A grid of cells is a tuple ``frame``: left and bottom edge [m], columns,
rows; the cells are CELL meters long and numbered row by row from the bottom.
"""

import math

import numpy as np

from crowdsim.crowd.near.neighbor_kernels import ROUNDED
from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.steering.look_kernels import cell_of
from crowdsim.steering.row_kernels import CELL, FRAME_COLUMNS, FRAME_ROWS


@kernel
def closest_pair(places, order, starts, frame, limit):
    """Return the smallest distance between two of ``places`` (N, 2) [m]; ``limit`` or more [m] if none is below that.

    ``order`` (N,), ``starts`` (cells + 1,) and ``frame`` are the indices of places sorted by cells, as
    :func:`crowdsim.crowd.near.neighbors.sorted_places` returns them.
    """
    # ``best`` is the least squared distance so far.
    best = math.inf
    # Search the cells within the limit (or the whole grid, if that is smaller), then only within the least distance
    # found so far; each pair once (j < i).
    reach = min(limit, CELL * (frame[FRAME_COLUMNS] + frame[FRAME_ROWS]))
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        # The cells around the disc of this radius: columns ``low`` to ``high``, rows ``first`` to ``last`` of the grid.
        # ROUNDED covers the rounding of positions.
        far = reach + ROUNDED
        low, first = cell_of(frame, x - far, y - far)
        high, last = cell_of(frame, x + far, y + far)
        # Cells of one row of the grid are consecutive, so their agents are one range.
        for line in range(first, last + 1):
            for number in range(
                starts[line * frame[FRAME_COLUMNS] + low], starts[line * frame[FRAME_COLUMNS] + high + 1]
            ):
                j = order[number]
                if j < i:
                    dx = x - places[j, 0]
                    dy = y - places[j, 1]
                    best = min(best, dx * dx + dy * dy)
        reach = min(reach, math.sqrt(best))
    return math.sqrt(best)


@kernel
def obstacle_margin(pose, behavior, mesh, radii, limit):
    """Return the smallest distance between a body disc and the obstacles of one layer [m]; negative if they overlap.

    ``pose`` is (N, 3), of which x and y [m] are read, ``behavior`` (N,) int32; ``radii`` (B,) are those of the discs on
    this layer, by behavior [m]. The result is at most ``limit``; a center within an obstacle counts as -1 m from it.
    """
    best = limit
    hint = np.int64(-1)
    for i in range(len(pose)):
        radius = radii[behavior[i]]
        # ``hint``: the triangle found last is a good start for the next query.
        distance, hint = disc_clearance(mesh, pose[i, 0], pose[i, 1], radius + limit, hint)
        best = min(best, distance - radius)
    return best
