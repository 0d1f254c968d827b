"""What a run measures of every step."""

import math

import numpy as np

from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance


@kernel
def closest_pair(pose):
    """Smallest distance between the tracks of any two rows of ``pose`` (N, 3); infinite below two rows."""
    best = math.inf
    for i in range(len(pose)):
        for j in range(i):
            dx = pose[i, 0] - pose[j, 0]
            dy = pose[i, 1] - pose[j, 1]
            best = min(best, dx * dx + dy * dy)
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
