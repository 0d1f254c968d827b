"""Kernels that call helpers of kernels, which Python cannot call."""

from crowdsim.jit import kernel
from crowdsim.navmesh.clearance import clearance_kernels
from crowdsim.navmesh.mesh import half_edge_kernels
from crowdsim.navmesh.triangulation import triangulation_kernels

_insert_point = triangulation_kernels.insert_point
_find_half_edge = half_edge_kernels.find_half_edge
_disc_clearance = clearance_kernels.disc_clearance
_capsule_clearance = clearance_kernels.capsule_clearance


@kernel
def insert_point(m, x, y, hint, w):
    """Insert a point into a mesh."""
    return _insert_point(m, x, y, hint, w)


@kernel
def find_half_edge(sides, vertices, a, b):
    """Find the half-edge between two vertices."""
    return _find_half_edge(sides, vertices, a, b)


@kernel
def disc_clearance(m, x, y, limit, hint):
    """Measure the clearance of a place."""
    return _disc_clearance(m, x, y, limit, hint)


@kernel
def capsule_clearance(m, x0, y0, x1, y1, limit, hint):
    """Measure the clearance of a segment."""
    return _capsule_clearance(m, x0, y0, x1, y1, limit, hint)
