"""Kernels that show figures what helpers of the package compute on their way."""

import numpy as np

from crowdsim.jit import kernel
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.search_kernels import find_channel
from crowdsim.navmesh.paths.tangent_kernels import funnel
from crowdsim.planning.roadmap.funnel_kernels import road_channel
from crowdsim.planning.roadmap.gate_kernels import GATE, find_gates
from crowdsim.steering.capsule_kernels import core_to_core
from crowdsim.steering.direction_kernels import free_way
from crowdsim.steering.wall_kernels import free_ahead


@kernel
def channel_and_string(m, sx, sy, gx, gy, radius):
    """Return the half-edges that a disc crosses from s to g, and the nodes of the string pulled taut through them."""
    start = triangle_of(m, sx, sy, NONE)
    goal = triangle_of(m, gx, gy, NONE)
    channel = find_channel(m, start, sx, sy, goal, gx, gy, radius, 2.0 * radius)
    nodes, count = funnel(m, channel, channel.size, np.full(m.vertices.size, radius), sx, sy, gx, gy)
    return channel, nodes[:count]


@kernel
def gates_of_road(layers, points, road, around, ends, least, behaviors):
    """Return the half-edges that a road crosses, the behavior at each, and the gates in it."""
    m = mesh_at(layers[0])
    channel = np.empty(road.shape[0] + 1, np.int64)
    levels = np.empty(road.shape[0] + 1, np.int64)
    start = triangle_of(m, ends[0, 0], ends[0, 1], NONE)
    goal = triangle_of(m, ends[1, 0], ends[1, 1], NONE)
    count = road_channel(m, points, road, start, goal, behaviors - 1, channel, levels)
    gates = np.empty(8, GATE)
    found = find_gates(m, channel, levels, count, around, least, gates)
    return channel[:count], levels[:count], gates[:found]


@kernel
def free_ways(near, count, directions, speed, width, walls, x, y, horizon, wall_horizon):
    """Return how far each direction (n, 2) is free of others and of walls from (x, y) [m]."""
    ways = np.empty(len(directions))
    for k in range(len(directions)):
        ux = directions[k, 0]
        uy = directions[k, 1]
        ways[k] = free_way(near, count, ux, uy, speed, width, -1.0, horizon)
        traced = min(ways[k], wall_horizon)
        free = free_ahead(walls, x, y, ux, uy, width, traced)
        if free < traced:
            ways[k] = free
    return ways


@kernel
def nearest_points(one, other):
    """Return the vector from the core of row ``one`` to that of ``other`` and its length [m], at their closest."""
    px = other.x - one.x
    py = other.y - one.y
    return core_to_core(px, py, -one.hy, one.hx, one.half, -other.hy, other.hx, other.half)
