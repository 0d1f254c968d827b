"""Chains of nodes as searches find them, made ready to be played."""

from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import kernel


@kernel
def measure_offsets(node_motion, nodes, origins, offsets):
    """Fill ``offsets`` (P - 1, 3), the blend offsets of all P nodes of a chain but the first.

    The blend offset of a node is the pose at the end of the node before less its own origin. ``node_motion`` (nodes of
    the graph, 3) is the pose at the end of each node, relative to its begin. ``nodes`` (P,) are the chain, ``origins``
    (P, 3) the world poses at which its nodes begin. Poses and offsets are x, y [m] and heading [rad].
    """
    for k in range(len(nodes) - 1):
        node, following = nodes[k], k + 1
        ex, ey, eh = compose(
            origins[k, 0],
            origins[k, 1],
            origins[k, 2],
            node_motion[node, 0],
            node_motion[node, 1],
            node_motion[node, 2],
        )
        offsets[k, 0] = ex - origins[following, 0]
        offsets[k, 1] = ey - origins[following, 1]
        offsets[k, 2] = wrap_angle(eh - origins[following, 2])
