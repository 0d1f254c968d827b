"""What a field tells an agent at its place: the direction of its way, how long it is, and what its body has to do."""

import math

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import CALM, TRICKY, UNTRIED, anchor_cost, anchor_place
from crowdsim.steering.guidance.ground_kernels import BOX, CORNER, FAR_UNIT, STEPS, box_at, margin_at, pin_of, widest_at

LOOK = 0.6
"""Length of the way ahead that is tested [m]."""

STRIDE = 0.15
"""Step of the test [m]."""

TOO_NARROW = 10.0
"""How many times as dear as the widest behavior a meter counts on which none fits: agents pushed there leave."""

DEARER = 1.2
"""How many times as dear as from the pin of its box the first stretch to an anchor may be from a corner of the box."""

INSIDE = 0.1
"""Distance to a wall below which no agent is [m]."""

TOUCHING = 0.05
"""A line that comes nearer than this to a wall leads through it [m]."""

LOST = 1e9
"""Length of the way of an agent that has none [m]."""


@helper
def near_cost(ground, px, py, qx, qy, most):
    """Cost and length of the first LOOK meters of a line from p to q; agents may stand where nothing fits."""
    top = len(ground.costs) - 1
    dx = qx - px
    dy = qy - py
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0.0, 0.0
    dx /= length
    dy /= length
    length = min(length, LOOK)
    # Nothing to test where no wall can come near.
    box = box_at(ground, px, py)
    if box >= 0:
        row = box // ground.columns
        column = box - row * ground.columns
        if ground.far[row, column] * FAR_UNIT > ground.reach + LOOK + BOX:
            return length * ground.costs[top], length
    count = math.ceil(length / STRIDE)
    step = length / count
    cost = 0.0
    for n in range(count):
        x = px + (n + 0.5) * step * dx
        y = py + (n + 0.5) * step * dy
        box = box_at(ground, x, y)
        if box < 0:
            return math.inf, length
        row = box // ground.columns
        if ground.far[row, box - row * ground.columns] * FAR_UNIT > ground.reach + CORNER:
            cost += step * ground.costs[top]
            continue
        label = widest_at(ground, box, x, y)
        if label >= 0:
            cost += step * ground.costs[label]
        else:
            cost += step * ground.costs[top] * TOO_NARROW
            for entry in range(ground.starts[box], ground.starts[box + 1]):
                ax, ay, bx, by = ground.segments[ground.lists[entry]]
                if point_segment_distance2(x, y, ax, ay, bx, by) < TOUCHING * TOUCHING:
                    return math.inf, length
        if cost > most:
            return math.inf, length
    return cost, length


@helper
def look_around(ground, field, box, x, y):
    """The place to head for from (x, y) in ``box``, with its cost and its length to go; no length for nowhere.

    Of the anchors of the boxes around, and of their pins, take the cheapest one: what is still to pay there, the cost
    of the line's first stretch, tested place by place, and the rest of the line as dear as it is from the box.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    row = box // ground.columns
    column = box - row * ground.columns
    best = math.inf
    best_length = math.inf
    hx = x
    hy = y
    taken = -1
    # The box's own anchor, if the line there begins as well as from the pin.
    anchor = field.anchor[box]
    if field.asks[box] >= 0 and anchor != box:
        sx, sy = anchor_place(ground, field.points, anchor)
        px, py = pin_of(ground, box)
        paid = anchor_cost(field, boxes, anchor)
        beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
        length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
        meter = (float(field.cost[box]) - paid) / beside if beside > 0.0 else top
        near, tested = near_cost(ground, x, y, sx, sy, DEARER * meter * min(length, LOOK))
        if near < math.inf:
            to_go = length + (float(field.length[anchor]) if anchor < boxes else 0.0)
            return sx, sy, paid + near + (length - tested) * meter, to_go
    for k in range(-1, 8):
        u = column
        v = row
        if k >= 0:
            u += STEPS[k, 0]
            v += STEPS[k, 1]
            if not (0 <= u < ground.columns and 0 <= v < ground.rows):
                continue
        other = v * ground.columns + u
        if not field.asks[other] >= 0:
            continue
        anchor = field.anchor[other]
        px, py = pin_of(ground, other)
        sx, sy = anchor_place(ground, field.points, anchor)
        if anchor != other and anchor != taken:
            # Along the line from the box a meter costs that much.
            paid = anchor_cost(field, boxes, anchor)
            beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
            meter = (float(field.cost[other]) - paid) / beside if beside > 0.0 else top
            length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
            if paid + length * top < best:
                near, tested = near_cost(ground, x, y, sx, sy, best - paid)
                value = paid + near + (length - tested) * meter
                if value < best:
                    best = value
                    best_length = length + (float(field.length[anchor]) if anchor < boxes else 0.0)
                    hx = sx
                    hy = sy
                    taken = anchor
        # To the pin itself: always possible from near by.
        length = math.sqrt((px - x) * (px - x) + (py - y) * (py - y))
        paid = float(field.cost[other])
        if paid + length * top < best:
            near, tested = near_cost(ground, x, y, px, py, best - paid)
            value = paid + near + (length - tested) * top
            if value < best:
                best = value
                best_length = length + float(field.length[other])
                hx = px
                hy = py
                taken = -1
    return hx, hy, best, best_length


@helper
def is_calm(ground, field, box):
    """Whether whoever is in a box may go straight to its anchor: from all corners that are free, the line begins well.

    That is, it is at most DEARER times as dear as from the pin if something fits at the corner, and leads through no
    wall otherwise. It depends on the box alone, so it does not matter who asks first.
    """
    anchor = field.anchor[box]
    if anchor == box or field.asks[box] < 0:
        return False
    boxes = len(ground.widest)
    sx, sy = anchor_place(ground, field.points, anchor)
    px, py = pin_of(ground, box)
    row = box // ground.columns
    cx = ground.left + (box - row * ground.columns + 0.5) * BOX
    cy = ground.bottom + (row + 0.5) * BOX
    beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
    if beside < 2.0 * BOX:
        return False
    meter = (float(field.cost[box]) - anchor_cost(field, boxes, anchor)) / beside
    for k in range(1, 8, 2):
        x = cx + 0.499 * BOX * STEPS[k, 0]
        y = cy + 0.499 * BOX * STEPS[k, 1]
        near, tested = near_cost(ground, x, y, sx, sy, math.inf)
        if widest_at(ground, box, x, y) >= 0:
            if near > DEARER * meter * tested:
                return False
        elif near == math.inf and margin_at(ground, box, x, y, 0) > INSIDE - ground.least:
            return False
    return True


@helper
def way_at(ground, field, x, y):
    """Unit vector of the way at a place, its cost, its length to go [m] and the behavior it asks for.

    Zeros in the goal; no direction, infinite cost and length where there is no way.
    """
    top = len(ground.costs) - 1
    box = box_at(ground, x, y)
    if box < 0:
        return 0.0, 0.0, math.inf, math.inf, top
    boxes = len(ground.widest)
    asked = field.asks[box]
    if field.cost[box] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, top
    calm = field.calm[box]
    if calm == UNTRIED:
        calm = CALM if is_calm(ground, field, box) else TRICKY
        field.calm[box] = calm
    if calm == CALM:
        anchor = field.anchor[box]
        sx, sy = anchor_place(ground, field.points, anchor)
        px, py = pin_of(ground, box)
        length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
        beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
        to_go = float(field.length[box]) - beside + length
        paid = anchor_cost(field, boxes, anchor)
        cost = paid + (float(field.cost[box]) - paid) * length / beside
        return (sx - x) / length, (sy - y) / length, cost, to_go, asked
    sx, sy, cost, to_go = look_around(ground, field, box, x, y)
    length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
    if cost == math.inf or length == 0.0:
        return 0.0, 0.0, cost, to_go, top
    if asked < 0:
        asked = top
    return (sx - x) / length, (sy - y) / length, cost, to_go, asked


@kernel
def sample(ground, field, asked, agents, state):
    """Write gx, gy, togo, turn and held of agents that follow a field to their records.

    ``asked``: float64[n, 2], turn and held that each behavior asks for, -1 for none. ``agents``: int64[k], rows of
    ``state``, records of ROW. Returns how many have no way: these get no direction and a length of LOST.
    """
    lost = 0
    for n in range(len(agents)):
        me = state[agents[n]]
        gx, gy, _, to_go, behavior = way_at(ground, field, me.x, me.y)
        if to_go == math.inf:
            lost += 1
            to_go = LOST
        me.gx = gx
        me.gy = gy
        me.togo = to_go
        me.turn = asked[behavior, 0]
        me.held = min(me.rest, asked[behavior, 1])
    return lost


@kernel
def ways_at(ground, field, places, out):
    """Fill ``out`` (float64[k, 5]: unit vector, cost, length to go, behavior) for ``places`` (float64[k, 2])."""
    for n in range(len(places)):
        gx, gy, cost, to_go, behavior = way_at(ground, field, places[n, 0], places[n, 1])
        out[n, 0] = gx
        out[n, 1] = gy
        out[n, 2] = cost
        out[n, 3] = to_go
        out[n, 4] = behavior
