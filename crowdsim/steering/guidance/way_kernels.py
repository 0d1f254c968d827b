"""Paths of a field at positions, and those of agents written to their rows.

``ground`` (Ground) and ``field`` (Field) are those of the place; ``nobody`` is the Crowding of an empty place: lines
are tested against walls alone.
"""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import anchor_place, row_of
from crowdsim.steering.guidance.ground_kernels import box_at
from crowdsim.steering.guidance.sample_kernels import LOST, first_head, way_at

NEAR_BEND = 0.6
"""Distance of a bend below which the way counts as straight there [m]: agents pressed against a wall step back
first."""

ON_LENGTH = 1.5
"""Distance from a bend at which the direction of the way behind it is found [m], as a corner may have several bends."""

BENDS = 8
"""Largest number of bends that are looked at."""


@kernel
def end_of_way(ground, nobody, field, x, y):
    """Return x and y [m] of the point at which the path from the position (x, y) enters the goal.

    Return the position itself if its box counts as in the goal, and nan, nan if there is no path.
    """
    box = box_at(ground, x, y)
    if box < 0:
        return math.nan, math.nan
    # Cost 0: the box counts as in the goal, as in `way_at`.
    known = row_of(field, box)
    if known >= 0 and field.cost[known] == 0.0:
        return x, y
    head, _, _, _ = first_head(ground, nobody, field, box, x, y)
    if head < 0:
        return math.nan, math.nan
    # From a pin the path goes on to the anchor of that pin, whether its box has a slot or not. Follow the anchors up to
    # a point of the goal, or to a pin in the goal, which is its own anchor. Each costs less than the one before, so
    # none comes twice.
    boxes = len(ground.widest)
    for _ in range(boxes):
        ahead = head if head >= boxes else field.anchor[row_of(field, head)]
        if ahead == head:
            break
        head = ahead
    return anchor_place(ground, field.points, head)


@helper
def lead(ground, nobody, field, asked, me):
    """Write what a field gives at the position of the agent ``me`` (a row of ROW); return True if it has a path.

    That is gx, gy, togo, the course, turn and held; ``asked`` (n, 2) float64 is the body that each behavior prescribes.
    """
    gx, gy, _, to_go, behavior, head = way_at(ground, nobody, field, me.x, me.y)
    me.gx = gx
    me.gy = gy
    me.togo = LOST if to_go == math.inf else to_go
    # The course, to the first bend that is not quite near, and the direction from there on.
    me.cx = gx
    me.cy = gy
    me.ahead = 0.0
    me.onx = 0.0
    me.ony = 0.0
    boxes = len(ground.widest)
    sx = me.x
    sy = me.y
    begun = False
    for _ in range(BENDS):
        if head < 0:
            break
        ex, ey = anchor_place(ground, field.points, head)
        length = math.sqrt((ex - sx) * (ex - sx) + (ey - sy) * (ey - sy))
        if length > 0.0 and not begun:
            me.cx = (ex - sx) / length
            me.cy = (ey - sy) / length
            me.ahead = length
        elif length > 0.0:
            me.onx = (ex - sx) / length
            me.ony = (ey - sy) / length
        if length > (ON_LENGTH if begun else NEAR_BEND):
            if begun:
                break
            begun = True
            sx = ex
            sy = ey
        ahead = field.anchor[row_of(field, head)] if head < boxes else head
        head = -1 if ahead == head else ahead
    me.turn = asked[behavior, 0]
    me.held = min(me.rest, asked[behavior, 1])
    return to_go < math.inf


@kernel
def sample(ground, nobody, field, asked, agents, state):
    """Write gx, gy, togo, course, turn and held of the agents that follow a field to their rows.

    ``held`` is the smaller of what the behavior prescribes and ``rest``, and -1 if nothing is prescribed.

    Parameters
    ----------
    ground, nobody, field : Ground, Crowding, Field
        The place, an empty crowd (the field already contains the crowd's costs) and the field.
    asked : (n, 2) float64
        Turn [rad] and held half length [m] that each behavior prescribes, -1 for none.
    agents : (k,) int64
        Rows of ``state`` to write.
    state : ROW[m]
        All agents (ROW of steering.row_kernels).

    Returns
    -------
    int
        Number of agents without a path; they get no direction, and the length LOST.
    """
    lost = 0
    for n in range(len(agents)):
        lost += 0 if lead(ground, nobody, field, asked, state[agents[n]]) else 1
    return lost


@kernel
def ways_at(ground, nobody, field, places, out):
    """Fill ``out`` (float64[k, 5]) with the first five values of :func:`way_at` at ``places`` (float64[k, 2]) [m]."""
    for n in range(len(places)):
        gx, gy, cost, to_go, behavior, _ = way_at(ground, nobody, field, places[n, 0], places[n, 1])
        out[n, 0] = gx
        out[n, 1] = gy
        out[n, 2] = cost
        out[n, 3] = to_go
        out[n, 4] = behavior
