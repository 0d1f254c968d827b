"""Points of the feet of posed bodies, and how far feet that stand move."""

import math

from crowdsim.jit import kernel
from crowdsim.motion.deformed.body_kernels import quaternion, rotate


@kernel
def place_points(joints, offsets, lowest, positions, rotations, points):
    """Place the points of the feet of n bodies; return the least height of a point above its lowest one in clips [m].

    The height is negative if a point is lower than ever in the clips, infinite if n is 0.

    Parameters
    ----------
    joints, offsets: (2, P) int32 and (2, P, 3) float64 [m], for left and right foot: the joint that carries each of P
    points of the foot, and the position of the point in that joint's frame.
    lowest: (2, P) float64, lowest height of each point in the clips [m].
    positions, rotations: (n, J, 3) [m] and (n, J, 4), both float32, of the joints in the world.
    points: (n, 2, P, 3) float64 [m], filled.
    """
    least = math.inf
    for body in range(len(points)):
        for foot in range(joints.shape[0]):
            for number in range(joints.shape[1]):
                joint = joints[foot, number]
                offset = offsets[foot, number]
                x, y, z = rotate(quaternion(rotations[body], joint), offset[0], offset[1], offset[2])
                point = points[body, foot, number]
                point[0] = positions[body, joint, 0] + x
                point[1] = positions[body, joint, 1] + y
                point[2] = positions[body, joint, 2] + z
                least = min(least, point[2] - lowest[foot, number])
    return least


@kernel
def standing_distances(table, lifted, then, now, old, new):
    """Return the sum of the distances by which feet that stand have moved [m], and the number of these feet.

    A foot stands if one of its points is planted, and moves as far (in x and y) as the planted point that moves least.
    A point is planted if it stays so in the clips from the first moment to the second, as in
    :meth:`crowdsim.motion.planted.planted_rows.PlantedRows.stayed`.

    Parameters
    ----------
    table: :class:`crowdsim.motion.graph.pose_table.PoseTable`.
    lifted: (T, 2, P) int32 of :class:`crowdsim.motion.planted.planted_rows.PlantedRows`: how often each point was not
    planted before each row of the table.
    then, now: (m,) int64, rows of m bodies in ``old``, and rows of the same bodies in ``new``.
    old, new: nodes (n,) int32, frames in these (n,) float64, and points (n, 2, P, 3) float64 [m] of all bodies at the
    first and at the second moment; n may differ.
    """
    old_node, old_frame, old_points = old
    node, frame, points = new
    total = 0.0
    count = 0
    for k in range(len(now)):
        i = then[k]
        j = now[k]
        # Rows of the table around both moments, and between them the last row of the old node and the first of the new.
        begin = table.node_first[old_node[i]] + math.floor(old_frame[i])
        last = table.node_first[old_node[i]] + table.node_frames[old_node[i]]
        first = table.node_first[node[j]]
        end = first + math.ceil(frame[j])
        goes_on = node[j] == old_node[i] and frame[j] >= old_frame[i]
        for foot in range(lifted.shape[1]):
            least = math.inf
            for number in range(lifted.shape[2]):
                steps = lifted[end, foot, number] - lifted[begin, foot, number]
                # From one node to another (or to the same one again): leave out the rows between both.
                if not goes_on:
                    steps += lifted[last, foot, number] - lifted[first, foot, number]
                # The point was planted all the time.
                if steps == 0:
                    dx = points[j, foot, number, 0] - old_points[i, foot, number, 0]
                    dy = points[j, foot, number, 1] - old_points[i, foot, number, 1]
                    least = min(least, dx * dx + dy * dy)
            if least < math.inf:
                total += math.sqrt(least)
                count += 1
    return total, count
