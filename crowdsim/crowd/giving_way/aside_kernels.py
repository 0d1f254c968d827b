"""Steps to a wall: an agent that has waited long in a narrow place steps aside, so that others can pass.

``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`); ``obstacles`` (Obstacles),
``everyone`` (Timelines, those of all rows), ``playback`` and ``draft``, a scratch chain, are those of
:mod:`crowdsim.crowd.state.timelines`. The columns of ``everyone.timeline`` are those of
:data:`crowdsim.crowd.state.components.SAMPLE`.
"""

import math

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.giving_way.give_way_kernels import DETOUR_COST, give_timeline, lay_move, move_is_free
from crowdsim.crowd.near.neighbor_kernels import OF_TIMELINES, cells_within, rows_of_line
from crowdsim.crowd.state.body_kernels import meets_body
from crowdsim.crowd.state.components import RADIUS
from crowdsim.crowd.state.reservation_kernels import ROUNDING, meets_anyone
from crowdsim.crowd.state.sampling_kernels import sample_chain
from crowdsim.crowd.state.way_kernels import FOREVER
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.planar_kernels import compose
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.address_kernels import mesh_at

NARROW_ROOM = 0.6
"""A place is narrow if there is less room than this between a body and a wall [m]."""

LEFT_ROOM = 0.05
"""Least room that a step leaves to the wall [m]; an agent closer to the wall finds no motion that leads on."""

WORTH = 0.1
"""A step to a wall must end at least this much closer to it [m]."""

ROOM_COST = 10.0
"""Cost of each meter of room left between body and wall [s/m]."""

LEFT_COST = 2.0
"""Cost of a step to the left [s]: people who meet step to the right."""

SAME_SIDE_COST = 20.0
"""Cost of each meter by which the lane of the agent overlaps that of another agent nearby [s/m]; see `look_beside`."""

NEAR = 1.2
"""Distance between centers within which another agent leaves no room to turn and walk past [m]."""

POSTURE_COST = 20.0
"""Cost of each meter of the body's radius at the end of the step [s/m]: a narrow posture is cheaper."""

NEAR_COST = 4.0
"""Cost of each meter that the nearest other agent is closer than NEAR [s/m]."""

FARTHER = 0.2
"""A step that does not lead closer to a wall by WORTH must end this much farther from the nearest other agent [m]."""


@helper
def room_beside(obstacles, x, y):
    """Return the room between a body at (x, y) and the nearest wall of any layer [m], at most NARROW_ROOM.

    The body is as wide on each layer as the widest behavior is there. The room is negative if the body overlaps a wall,
    or if (x, y) is not in free space.
    """
    room = NARROW_ROOM
    for k in range(len(obstacles.layers)):
        mesh = mesh_at(obstacles.layers[k])
        # Clearance of the widest behavior on this layer.
        widest = 0.0
        for behavior in range(len(obstacles.radii)):
            widest = max(widest, obstacles.radii[behavior, k])
        distance, _ = disc_clearance(mesh, x, y, widest + NARROW_ROOM, np.int64(-1))
        room = min(room, distance - widest)
    return room


@helper
def look_beside(everyone, row, x, y, dx, dy, radius):
    """Return the largest overlap of a row's lane with the lanes of others, and the distance of the nearest other [m].

    A lane is the strip that a body covers if it moves along the unit vector (dx, dy). At the goal that vector is
    (0, 0), and lanes overlap by the sum of both radii. The row counts as if it were at (x, y) [m], with a body of
    ``radius`` [m]; the others count at the ends of their timelines, if these are within NEAR. The overlap is 0 if no
    lanes overlap; the distance is at most NEAR, also without others.
    """
    # Rows are sorted by where they are now, but count where their timelines end: search so much farther.
    low, high, first, last = cells_within(everyone.near, x, y, x, y, NEAR + everyone.near.spread[OF_TIMELINES])
    lacking = 0.0
    gap = NEAR
    for line in range(first, last + 1):
        number, after = rows_of_line(everyone.near, line, low, high)
        while number < after:
            other = everyone.near.order[number]
            number += 1
            ox, oy = everyone.timeline[other, -1, 0] - x, everyone.timeline[other, -1, 1] - y
            away = hypot(ox, oy)
            if other != row and away < NEAR:
                # Lanes overlap by the sum of the radii less their lateral distance.
                between = abs(dx * oy - dy * ox)
                lacking = max(lacking, radius + everyone.timeline[other, -1, RADIUS] - between)
                gap = min(gap, away)
    return lacking, gap


@kernel
def step_to_wall(graph, obstacles, everyone, row, playback, draft, asking):
    """Let a standing row in a narrow place step to a wall, or away from others along it; return True if it does.

    The row is in an idle node. ``asking`` is a :class:`crowdsim.crowd.giving_way.asking.Asking`. If the row steps, it
    owns the timeline of its move, and the row and the number of the move are left in ``trail.rows[0]`` and
    ``trail.moves[0]``. ``trail.costs[0]`` and ``trail.candidate`` are scratch. ``playback`` is at the natural rate.
    """
    moves, standing, trail = asking.moves, asking.standing, asking.trail
    node, origin, goal = standing.node[row], standing.origin[row], standing.goal[row]
    x, y, h = node_end(graph, np.int64(node), origin[0], origin[1], origin[2])
    room = room_beside(obstacles, x, y)
    # Not a narrow place: others can pass.
    if room >= NARROW_ROOM - ROUNDING:
        return False

    # Price all moves that end closer to a wall, or as close to it and farther from others. The lanes lead to the goal,
    # along the unit vector (dx, dy); ROUNDING avoids a division by 0 at the goal.
    away = hypot(goal[0] - x, goal[1] - y)
    dx, dy = (goal[0] - x) / max(away, ROUNDING), (goal[1] - y) / max(away, ROUNDING)
    _, near = look_beside(everyone, row, x, y, dx, dy, 0.0)  # the radius matters to the overlap only
    first, count = moves.begin[node], moves.begin[node + 1] - moves.begin[node]
    costs = trail.costs[0]
    for k in range(count):
        shift = moves.shift[first + k]
        ex, ey, _ = compose(x, y, h, shift[0], shift[1], shift[2])
        left = room_beside(obstacles, ex, ey)
        costs[k] = math.inf
        # Radius of the body as it stands at the end of the move, in the behavior of the last node.
        last = graph.edge_target[moves.edges[first + k, moves.lengths[first + k] - 1]]
        radius = obstacles.breadths[graph.node_behavior[last], 0]
        lacking, gap = look_beside(everyone, row, ex, ey, dx, dy, radius)
        # Allowed moves; they cost their duration, the room left to the wall, the detour, and what keeps others from
        # passing.
        if left >= LEFT_ROOM and (left <= room - WORTH or (left <= room and gap >= near + FARTHER)):
            costs[k] = moves.frames[first + k] / CAPTURE_RATE + ROOM_COST * left
            costs[k] += DETOUR_COST * (hypot(goal[0] - ex, goal[1] - ey) - away)
            costs[k] += SAME_SIDE_COST * lacking + NEAR_COST * (NEAR - gap) + POSTURE_COST * radius
            # The move ends to the left of where the body faces.
            if shift[1] > 0.0:
                costs[k] += LEFT_COST

    # Take the cheapest move that meets no timeline, no steered body and no wall.
    slot = playback.clock // playback.slot_frames
    forever = np.int64(FOREVER)
    wait = graph.node_frames[node]  # from the end of the idle node: it sets out at once
    for _ in range(count):
        # Select the cheapest move left, and strike it out.
        best = 0
        for k in range(1, count):
            if costs[k] < costs[best]:
                best = k
        if costs[best] == math.inf:
            return False
        costs[best] = math.inf
        nodes = lay_move(graph, moves, first + best, node, origin, draft)
        if sample_chain(graph, draft, nodes, obstacles.breadths, wait, playback, trail.candidate) < 0:
            continue
        radius = everyone.body_radius[row]
        if meets_anyone(row, trail.candidate, slot, forever, slot, radius, everyone):
            continue
        # All steered bodies count: none is that of a captured row (-1). The end of the move needs no more clearance
        # than its way (0.0), as it is to lead close to a wall.
        if meets_body(-1, trail.candidate, obstacles.bodies) or not move_is_free(graph, obstacles, draft, nodes, 0.0):
            continue
        give_timeline(everyone, row, trail.candidate, slot, forever)
        trail.rows[0] = row
        trail.moves[0] = first + best
        return True
    return False
