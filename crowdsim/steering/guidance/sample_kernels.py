"""What a field tells an agent at its place: the direction of its way, how long it is, and what its body has to do."""

import math

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import PARTS, UNKNOWN, anchor_cost, anchor_place
from crowdsim.steering.guidance.ground_kernels import (
    BOX,
    CORNER,
    FAR_UNIT,
    PACE,
    STEPS,
    box_at,
    line_cost,
    pin_of,
    widest_at,
)

LOOK = 0.6
"""Length of the way ahead on which agents may stand where nothing fits [m]."""

REACHED = 0.15
"""Who is this near to a pin goes on from there: passing it exactly is more than anybody can do [m]."""

BESIDE = 0.24
"""Who is this near to a pin goes on from there, whatever fits, if the line keeps CLEAR off walls all along [m].

In a neck people push each other beside the pins. If they turned back to these, across the way, fewer got through.
"""

CLEAR = 0.16
"""A body whose shoulders are turned fits at this distance from a wall [m]: 0.125 m, and what people are off a line."""

STRIDE = 0.1
"""Step of the test [m]."""

TOO_NARROW = 3.0
"""How many times as dear as the widest behavior a meter counts on which none fits: agents pushed there leave."""

LIKE = 0.002
"""Costs that differ by less than this are alike: the first one found stays."""

TOUCHING = 0.11
"""A line that comes nearer than this to a wall leads through it [m]."""

LOST = 1e9
"""Length of the way of an agent that has none [m]."""


@helper
def near_length(ground, px, py, qx, qy):
    """Length of the first LOOK meters of a line from p to q, infinite if it leads through a wall, and that of these.

    Meters on which nothing fits count TOO_NARROW times: agents may stand there, but leave.
    """
    dx = qx - px
    dy = qy - py
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0.0, 0.0
    dx /= length
    dy /= length
    length = min(length, LOOK)
    count = math.ceil(length / STRIDE)
    step = length / count
    weighed = 0.0
    for n in range(count):
        x = px + (n + 0.5) * step * dx
        y = py + (n + 0.5) * step * dy
        box = box_at(ground, x, y)
        if box < 0:
            return math.inf, length
        row = box // ground.columns
        far_off = ground.far[row, box - row * ground.columns] * FAR_UNIT > ground.reach + CORNER
        if far_off or widest_at(ground, box, x, y) >= 0:
            weighed += step
            continue
        weighed += step * TOO_NARROW
        for entry in range(ground.starts[box], ground.starts[box + 1]):
            ax, ay, bx, by = ground.segments[ground.lists[entry]]
            if point_segment_distance2(x, y, ax, ay, bx, by) < TOUCHING * TOUCHING:
                return math.inf, length
    return weighed, length


@helper
def is_clear(ground, px, py, qx, qy):
    """Whether a line from p to q keeps CLEAR off all walls; of its end, the last PACE is not tested."""
    dx = qx - px
    dy = qy - py
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return True
    dx /= length
    dy /= length
    along = 0.0
    while along < length:
        x = px + along * dx
        y = py + along * dy
        box = box_at(ground, x, y)
        if box < 0:
            return False
        for entry in range(ground.starts[box], ground.starts[box + 1]):
            ax, ay, bx, by = ground.segments[ground.lists[entry]]
            if point_segment_distance2(x, y, ax, ay, bx, by) < CLEAR * CLEAR:
                return False
        # Far from walls, step as far as none can be within CLEAR.
        row = box // ground.columns
        far_off = ground.far[row, box - row * ground.columns] * FAR_UNIT - CORNER - CLEAR
        along += max(PACE, far_off)
    return True


@helper
def cost_to(ground, nobody, px, py, qx, qy, meter, reached):
    """Cost of the line from p to q if each meter costs ``meter``, infinite if it is blocked somewhere.

    It costs as much as beside it, from a pin: who is a little off the middle of a gap need not go back to it. If the
    pin is ``reached``, only the first meters are tested, and it does not matter what fits there.
    """
    near, tested = near_length(ground, px, py, qx, qy)
    length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
    if near == math.inf:
        return near
    if reached:
        return length * meter
    if length <= tested:
        return near * meter
    share = tested / length
    fits = line_cost(ground, nobody, px + share * (qx - px), py + share * (qy - py), qx, qy, math.inf) < math.inf
    return (near + length - tested) * meter if fits else math.inf


@helper
def cheapest_around(ground, nobody, field, box, x, y, onwards):
    """What to head for from (x, y) in ``box``: an anchor or the pin of a box, and its cost; else -1, infinite.

    Of the anchors of the boxes around, and of their pins, take the cheapest one: what is still to pay there, and the
    cost of the line, which is tested all along, so that nobody heads for what it cannot see. With ``onwards``, pins
    that are reached do not count, but their anchors. Beside a pin it is enough that the line is clear.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    row = box // ground.columns
    column = box - row * ground.columns
    best = math.inf
    head = -1
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
        px, py = pin_of(ground, other)
        apart = math.sqrt((px - x) * (px - x) + (py - y) * (py - y))
        # Its anchor, along a line on which a meter costs as much as from the pin.
        anchor = field.anchor[other]
        sx, sy = anchor_place(ground, field.points, anchor)
        length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
        ends = anchor >= boxes or field.anchor[anchor] == anchor
        counts = ends or length > REACHED or not onwards
        if counts and anchor != other and anchor != head:
            paid = anchor_cost(field, boxes, anchor)
            beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
            meter = (float(field.cost[other]) - paid) / beside if beside > 0.0 else top
            if paid + meter * length < best - LIKE:
                # Pushed beside the pin, but the way on is clear: go on.
                if REACHED <= apart < BESIDE and is_clear(ground, x, y, sx, sy):
                    value = paid + length * meter
                else:
                    value = paid + cost_to(ground, nobody, x, y, sx, sy, meter, apart < REACHED)
                if value < best - LIKE:
                    best = value
                    head = anchor
        # The pin itself.
        if apart < REACHED and onwards and anchor != other:
            continue
        paid = float(field.cost[other])
        meter = ground.costs[ground.widest[other]]
        if paid + meter * apart < best - LIKE:
            value = paid + cost_to(ground, nobody, x, y, px, py, meter, False)
            if value < best - LIKE:
                best = value
                head = other
    return head, best


@helper
def look_around(ground, nobody, field, box, x, y):
    """What to head for from (x, y) in ``box``, and its cost: pins that are reached only if nothing else is free."""
    head, cost = cheapest_around(ground, nobody, field, box, x, y, True)
    if head < 0:
        head, cost = cheapest_around(ground, nobody, field, box, x, y, False)
    return head, cost


@helper
def head_for(ground, nobody, field, box, x, y):
    """What whoever is in the part of a box around (x, y) heads for; looked up when the first one is there.

    That is an anchor, or the pin of a box around, and what it costs from the middle of the part: -1 and infinite if
    there is none. It depends on the part alone, so it does not matter who asks first.
    """
    row = box // ground.columns
    column = box - row * ground.columns
    size = BOX / PARTS
    i = min(max(int((x - ground.left - column * BOX) / size), 0), PARTS - 1)
    j = min(max(int((y - ground.bottom - row * BOX) / size), 0), PARTS - 1)
    slot = field.slots[box]
    part = j * PARTS + i
    mx = ground.left + column * BOX + (i + 0.5) * size
    my = ground.bottom + row * BOX + (j + 0.5) * size
    if field.heads[slot, part] == UNKNOWN:
        head, cost = look_around(ground, nobody, field, box, mx, my)
        field.costs[slot, part] = cost
        field.heads[slot, part] = head
    return field.heads[slot, part], float(field.costs[slot, part]), mx, my


@helper
def way_at(ground, nobody, field, x, y):
    """Unit vector of the way at a place, its cost, its length to go [m] and the behavior it asks for.

    Zeros in the goal; no direction, infinite cost and length where there is no way.
    """
    top = len(ground.costs) - 1
    box = box_at(ground, x, y)
    if box < 0:
        return 0.0, 0.0, math.inf, math.inf, top
    boxes = len(ground.widest)
    if field.cost[box] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, top
    head = field.anchor[box]
    cost = float(field.cost[box])
    mx, my = pin_of(ground, box)
    if field.slots[box] >= 0:
        head, cost, mx, my = head_for(ground, nobody, field, box, x, y)
        if head < 0:
            # Nothing from the middle of this part of the box, which may be in a wall: from the place itself.
            mx = x
            my = y
            head, cost = look_around(ground, nobody, field, box, x, y)
            if head < 0:
                return 0.0, 0.0, math.inf, math.inf, top
    sx, sy = anchor_place(ground, field.points, head)
    length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
    middle = math.sqrt((sx - mx) * (sx - mx) + (sy - my) * (sy - my))
    to_go = length + (float(field.length[head]) if head < boxes else 0.0)
    paid = anchor_cost(field, boxes, head)
    meter = (cost - paid) / middle if middle > 0.0 else ground.costs[top]
    asked = top if field.asks[box] < 0 else field.asks[box]
    if length == 0.0:
        return 0.0, 0.0, paid, to_go, asked
    return (sx - x) / length, (sy - y) / length, paid + meter * length, to_go, asked


@kernel
def sample(ground, nobody, field, asked, agents, state):
    """Write gx, gy, togo, turn and held of agents that follow a field to their records.

    ``nobody``: an empty place, as lines are tested without the crowd; the field knows what it costs.
    ``asked``: float64[n, 2], turn and held that each behavior asks for, -1 for none. ``agents``: int64[k], rows of
    ``state``, records of ROW. Returns how many have no way: these get no direction and a length of LOST.
    """
    lost = 0
    for n in range(len(agents)):
        me = state[agents[n]]
        gx, gy, _, to_go, behavior = way_at(ground, nobody, field, me.x, me.y)
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
def ways_at(ground, nobody, field, places, out):
    """Fill ``out`` (float64[k, 5]: unit vector, cost, length to go, behavior) for ``places`` (float64[k, 2])."""
    for n in range(len(places)):
        gx, gy, cost, to_go, behavior = way_at(ground, nobody, field, places[n, 0], places[n, 1])
        out[n, 0] = gx
        out[n, 1] = gy
        out[n, 2] = cost
        out[n, 3] = to_go
        out[n, 4] = behavior
