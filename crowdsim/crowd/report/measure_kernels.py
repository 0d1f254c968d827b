"""What a run measures of every step."""

import math

import numpy as np

from crowdsim.crowd.near.neighbor_kernels import ROUNDED
from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.steering.look_kernels import cell_of
from crowdsim.steering.row_kernels import CELL


@kernel
def closest_pair(places, order, starts, frame, limit):
    """Smallest distance between any two of ``places`` (N, 2) if it is below ``limit`` [m]; else what is no smaller.

    order, starts, frame: the rows by cells, as :func:`crowdsim.crowd.near.neighbors.sorted_places` has them.
    """
    best = math.inf
    # Look at all cells within the limit, then within the least distance found so far.
    reach = min(limit, CELL * (frame[2] + frame[3]))
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        far = reach + ROUNDED
        low, first = cell_of(frame, x - far, y - far)
        high, last = cell_of(frame, x + far, y + far)
        for line in range(first, last + 1):
            for number in range(starts[line * frame[2] + low], starts[line * frame[2] + high + 1]):
                j = order[number]
                if j < i:
                    dx = x - places[j, 0]
                    dy = y - places[j, 1]
                    best = min(best, dx * dx + dy * dy)
        reach = min(reach, math.sqrt(best))
    return math.sqrt(best)


@kernel
def obstacle_margin(pose, behavior, mesh, radii, limit):
    """Smallest distance between a body disc and the obstacles of one layer; negative where they overlap.

    pose: (N, 3); behavior: (N,) int32; radii: (B,) meters on this layer. Distances are capped at ``limit``.
    """
    best = limit
    hint = np.int64(-1)
    for i in range(len(pose)):
        radius = radii[behavior[i]]
        distance, hint = disc_clearance(mesh, pose[i, 0], pose[i, 1], radius + limit, hint)
        best = min(best, distance - radius)
    return best
