"""Sampling of a field at an agent's position: direction and length of its path, and the behavior to use.

The ground is divided into square boxes with a pin each. An anchor is what a way heads for next, in a straight line: the
pin of a box, or a point of the goal. Its number is that of the box, or that of the point plus the number of boxes.
``field.anchor[box]`` is the anchor of the way from the pin of any box, -1 if there is no way. Agents anywhere in a box
without a slot head for that anchor, too. A box with a slot (``field.slots[box]`` is 0 or more) has a row of
``field.heads``, in which each of its PARTS x PARTS parts has its own target. ``nobody`` is the Crowding of an empty
place: lines are tested against walls alone.

``ground`` (Ground) and ``field`` (Field) are those of the place; p = (px, py) and q = (qx, qy) are the ends of a line
[m].
"""

import math

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.steering.guidance.field_kernels import PARTS, UNKNOWN, anchor_cost, anchor_place, row_of
from crowdsim.steering.guidance.ground_kernels import (
    BOX,
    CORNER,
    FAR_UNIT,
    PACE,
    STEPS,
    box_at,
    line_cost,
    off_segment,
    pin_of,
    widest_at,
)

LOOK = 0.6
"""Length of the path ahead on which agents may be at points where no behavior fits [m]."""

REACHED = 0.15
"""Distance from a pin at which it counts as reached [m]. Agents hardly ever pass a point exactly; in narrow gaps,
agents that had to would walk to and fro."""

BESIDE = 0.24
"""Distance from a pin at which an agent goes on to the next anchor if the line there keeps CLEAR off all walls [m].

In a narrow passage agents push each other beside the pins. If they turned back to them, across the way of others, fewer
would get through.
"""

CLEAR = 0.16
"""Clearance of that line [m]: a body with turned shoulders needs 0.125 m, the rest is for deviations from the line."""

STRIDE = 0.1
"""Step along a line that is tested [m]."""

TOO_NARROW = 3.0
"""Factor on the length of a line at points where no behavior fits; a larger one makes agents that were pushed there
leave sooner."""

LIKE = 0.002
"""Costs that differ by less than this count as equal, and the first one found stays; in the unit of ``Field.cost``."""

TOUCHING = 0.11
"""A line that comes nearer than this to a wall counts as leading through it [m]."""

THICKNESS = 0.25
"""Width between walls below which no body gets through, however it turns its shoulders [m]."""

LOST = 1e9
"""Length that stands for "no path" in the state of an agent [m]."""


@helper
def is_pinched(ground, box, x, y, thickness):
    """Return True if walls on opposite sides of a position (x, y) in ``box`` are less than ``thickness`` apart [m].

    Sides are opposite if the nearest points of both walls are seen more than 120 degrees apart.
    """
    # The nearest point of all walls.
    nearest = thickness
    wx = 0.0
    wy = 0.0
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        dx, dy = off_segment(ground, ground.lists[entry], x, y)
        distance = math.sqrt(dx * dx + dy * dy)
        if distance < nearest:
            nearest = distance
            wx = dx
            wy = dy
    if nearest >= 0.5 * thickness:
        return False
    # A wall on the other side.
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        dx, dy = off_segment(ground, ground.lists[entry], x, y)
        distance = math.sqrt(dx * dx + dy * dy)
        if nearest + distance < thickness and dx * wx + dy * wy < -0.5 * nearest * distance:
            return True
    return False


@helper
def near_length(ground, px, py, qx, qy):
    """Return the weighted and the plain length of the first LOOK meters of the line from p to q [m].

    The line is tested at steps of STRIDE at most. Steps at which no behavior fits count TOO_NARROW times in the
    weighted length: an agent may be there, but should leave. The weighted length is infinite if the line leads through
    a wall (TOUCHING), through a gap too narrow for a body (THICKNESS), or out of the boxes.
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
        # Test the middle of each step.
        box = box_at(ground, x, y)
        if box < 0:
            return math.inf, length
        # Far from walls, all behaviors fit.
        row = box // ground.columns
        far_off = ground.far[row, box - row * ground.columns] * FAR_UNIT > ground.reach + CORNER
        if far_off or widest_at(ground, box, x, y) >= 0:
            weighed += step
            continue
        # No behavior fits: too near to a wall counts as through it.
        weighed += step * TOO_NARROW
        # A gap may be narrow for a short way only.
        for part in range(-1, 2):
            u = x + part * step / 3.0 * dx
            v = y + part * step / 3.0 * dy
            beside = box_at(ground, u, v)
            if beside < 0 or is_pinched(ground, beside, u, v, THICKNESS):
                return math.inf, length
        for entry in range(ground.starts[box], ground.starts[box + 1]):
            ax, ay, bx, by = ground.segments[ground.lists[entry]]
            if point_segment_distance2(x, y, ax, ay, bx, by) < TOUCHING * TOUCHING:
                return math.inf, length
    return weighed, length


@helper
def is_clear(ground, px, py, qx, qy):
    """Return True if the line from p to q keeps CLEAR off all walls and does not leave the boxes.

    It is tested at p, then at steps of PACE near walls, at longer ones far from them, and not at q.
    """
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
        # Step as far as no wall can be within CLEAR.
        row = box // ground.columns
        far_off = ground.far[row, box - row * ground.columns] * FAR_UNIT - CORNER - CLEAR
        along += max(PACE, far_off)
    return True


@helper
def cost_to(ground, nobody, px, py, qx, qy, meter, reached):
    """Return the cost of the line from p to q, of which a meter costs ``meter``; infinite if the line is blocked.

    The caller takes ``meter`` from the line of an adjacent pin to q, so that an agent a little off the middle of a gap
    need not go back to the pin. Walls on the first LOOK meters always block the line (:func:`near_length`). If
    ``reached`` is True (that pin is reached), nothing else counts. If it is False, points on the first LOOK meters at
    which no behavior fits raise the cost, and farther on some behavior must fit everywhere.
    """
    near, tested = near_length(ground, px, py, qx, qy)
    length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
    if near == math.inf:
        return near
    if reached:
        return length * meter
    # A short line is tested completely.
    if length <= tested:
        return near * meter
    # Beyond the first LOOK meters, some behavior must fit everywhere.
    share = tested / length
    fits = line_cost(ground, nobody, px + share * (qx - px), py + share * (qy - py), qx, qy, math.inf) < math.inf
    return (near + length - tested) * meter if fits else math.inf


@helper
def cheapest_around(ground, nobody, field, box, x, y, onwards):
    """Find the target to head for from (x, y) in ``box``: the cheapest anchor or pin that a free line leads to.

    Candidates are the anchors of the box and the eight around it, and their pins. The cost over a candidate is its cost
    to the goal plus that of the line to it, which is tested. If ``onwards`` is True, a pin within REACHED of (x, y)
    does not count, neither as a pin nor as an anchor, unless the path ends there.

    Return the number of the target (a box, or a point of the goal) and the cost; -1 and infinity if there is none.
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
        # A box without a path has no anchor.
        known = row_of(field, other)
        if known < 0 or field.asks[known] < 0:
            continue
        px, py = pin_of(ground, other)
        apart = math.sqrt((px - x) * (px - x) + (py - y) * (py - y))
        # Candidate 1: its anchor, at the cost per meter of the line from its pin. With ``onwards``, an anchor that is
        # reached counts only if the path ends there. A pin that is its own anchor is candidate 2.
        anchor = field.anchor[known]
        sx, sy = anchor_place(ground, field.points, anchor)
        length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
        ends = anchor >= boxes or field.anchor[row_of(field, anchor)] == anchor
        counts = ends or length > REACHED or not onwards
        if counts and anchor != other:
            paid = anchor_cost(field, boxes, anchor)
            beside = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
            # If pin and anchor coincide, no line tells the cost of a meter: take that with the widest behavior.
            meter = (float(field.cost[known]) - paid) / beside if beside > 0.0 else top
            # Test the line only if it could win.
            if paid + meter * length < best - LIKE:
                # Pushed beside the pin, but the line on from here is clear: it costs no more if no behavior fits here.
                if REACHED <= apart < BESIDE and is_clear(ground, x, y, sx, sy):
                    value = paid + length * meter
                else:
                    value = paid + cost_to(ground, nobody, x, y, sx, sy, meter, apart < REACHED)
                if value < best - LIKE:
                    best = value
                    head = anchor
        # Candidate 2: its pin, unless that is reached and leads on.
        if apart < REACHED and onwards and anchor != other:
            continue
        paid = float(field.cost[known])
        meter = ground.costs[ground.widest[other]]
        if paid + meter * apart < best - LIKE:
            value = paid + cost_to(ground, nobody, x, y, px, py, meter, False)
            if value < best - LIKE:
                best = value
                head = other
    return head, best


@helper
def look_around(ground, nobody, field, box, x, y):
    """Find the target to head for from (x, y) in ``box``, and the cost over it, in the form of :func:`cheapest_around`.

    A pin that is reached is the target only if no line to another target that is nearer to the goal, by cost, is free.
    """
    head, cost = cheapest_around(ground, nobody, field, box, x, y, True)
    pin, pin_cost = cheapest_around(ground, nobody, field, box, x, y, False)
    boxes = len(ground.widest)
    # From beside a pin the line on may be blocked, around a corner. A target that is no nearer to the goal than the pin
    # would lead to and fro.
    if head < 0 or (pin >= 0 and anchor_cost(field, boxes, head) >= anchor_cost(field, boxes, pin)):
        return pin, pin_cost
    return head, cost


@helper
def head_for(ground, nobody, field, box, x, y):
    """Return the target of all agents in the part of a box around (x, y), the cost from its middle, and the middle [m].

    The result is four values: target, cost, x and y of the middle of the part. The first agent in a part looks it up
    and stores it in ``field.heads`` and ``field.costs``, if the field remembers targets. It depends on the part alone,
    so it does not matter which agent is first. The target is -1 and the cost infinite if no line is free. The box must
    have a slot.
    """
    row = box // ground.columns
    column = box - row * ground.columns
    # Number of the part in the box, and its middle.
    size = BOX / PARTS
    i = min(max(int((x - ground.left - column * BOX) / size), 0), PARTS - 1)
    j = min(max(int((y - ground.bottom - row * BOX) / size), 0), PARTS - 1)
    slot = field.slots[row_of(field, box)]
    part = j * PARTS + i
    mx = ground.left + column * BOX + (i + 0.5) * size
    my = ground.bottom + row * BOX + (j + 0.5) * size
    if len(field.heads) == 0:
        head, cost = look_around(ground, nobody, field, box, mx, my)
        return head, cost, mx, my
    # Look it up once. The target is stored last, as it marks the entry as known.
    if field.heads[slot, part] == UNKNOWN:
        head, cost = look_around(ground, nobody, field, box, mx, my)
        field.costs[slot, part] = cost
        field.heads[slot, part] = head
    return field.heads[slot, part], float(field.costs[slot, part]), mx, my


@helper
def first_head(ground, nobody, field, box, x, y):
    """Return the target to head for from (x, y) in ``box``, the cost to the goal over it, and where that cost holds.

    Without a path the target is -1, and the cost infinite. The cost holds at the position (mx, my) [m], which is the
    pin of the box, the middle of the part with (x, y), or (x, y) itself.
    """
    known = row_of(field, box)
    # A box that the field does not know, beside those that it does: look from the position itself.
    if known < 0:
        head, cost = look_around(ground, nobody, field, box, x, y)
        return head, cost, x, y
    # Boxes without a slot: all agents in the box head for its anchor.
    if field.slots[known] < 0:
        mx, my = pin_of(ground, box)
        return field.anchor[known], float(field.cost[known]), mx, my
    head, cost, mx, my = head_for(ground, nobody, field, box, x, y)
    if head < 0:
        # No free line from the middle of this part, which may be inside of a wall: look from the position itself.
        mx = x
        my = y
        head, cost = look_around(ground, nobody, field, box, x, y)
    return head, cost, mx, my


@helper
def way_at(ground, nobody, field, x, y):
    """Return what a field gives at a position: unit vector of the path, cost, length [m], behavior and target.

    The vector is (0, 0) in the goal, exactly at the point headed for, and without a path. Cost and length are 0 in the
    goal, and infinite without a path. In the goal and without a path the behavior is the widest, and the target -1;
    else the target is a box, or a point of the goal.
    """
    top = len(ground.costs) - 1
    box = box_at(ground, x, y)
    if box < 0:
        return 0.0, 0.0, math.inf, math.inf, top, -1
    boxes = len(ground.widest)
    # Cost 0: the pin of the box is in the goal, so all of the box counts as in it.
    known = row_of(field, box)
    if known >= 0 and field.cost[known] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, top, -1
    head, cost, mx, my = first_head(ground, nobody, field, box, x, y)
    if head < 0:
        return 0.0, 0.0, math.inf, math.inf, top, -1
    sx, sy = anchor_place(ground, field.points, head)
    length = math.sqrt((sx - x) * (sx - x) + (sy - y) * (sy - y))
    # Scale the cost of the line, which holds at (mx, my), to the distance from the position.
    middle = math.sqrt((sx - mx) * (sx - mx) + (sy - my) * (sy - my))
    to_go = length + (float(field.length[row_of(field, head)]) if head < boxes else 0.0)
    paid = anchor_cost(field, boxes, head)
    meter = (cost - paid) / middle if middle > 0.0 else ground.costs[top]
    # The box has no path from its pin (-1), though one leads on from here: nothing is prescribed.
    asked = top if known < 0 or field.asks[known] < 0 else field.asks[known]
    if length == 0.0:
        return 0.0, 0.0, paid, to_go, asked, head
    return (sx - x) / length, (sy - y) / length, paid + meter * length, to_go, asked, head
