"""The exact commit: a step that touches nobody and no wall, whatever the others do in theirs.

Two convex bodies with gap g and closest points p, q are parted by the line half way between p and q. If each body stays
on its own side of that line, they cannot meet at any time of the step. So a step is feasible if for every neighbor,
with n the unit vector from p to q, the farthest reach of the body along n grows by at most g / 2 less a margin; for a
wall, which stands, by at most g less the margin; so for each piece of a way that somebody else has reserved, whose disc
may be anywhere along it. Standing still is always feasible. The step committed is the
feasible one nearest to what is wanted. Each agent reads old places only, so neither order nor threads matter.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_core, core_to_segment
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.wall_kernels import WALL_CELL, WALL_REACH
from crowdsim.steering.way_kernels import gap_to_way

MARGIN = 1e-6
"""What every step leaves of its share of a gap [m]: more than rounding takes, less than anybody sees."""

ROUNDING = 1e-9
"""By how much rounding may carry a step over a line [m], as long as half of the margin is left."""

HALVINGS = 5
"""How often a turn that does not fit is halved before it is given up."""

MOST_LINES = 128
"""Others and walls that an agent could meet in one step; if there are more, it stands."""

STUCK_MOST = 30.0
"""Time up to which being stuck is counted [s]."""


@helper
def set_line(line, nx, ny, room):
    """Set a line: its normal, how far the body may go along it, and how much farther rounding may carry it [m]."""
    line[0] = nx
    line[1] = ny
    line[2] = max(room, 0.0)
    line[3] = ROUNDING if room > -0.5 * MARGIN else 0.0


@helper
def add_neighbors(crowd, me, most, broadest, order, steering, lines):
    """Add the lines between an agent and those it could meet if its body grew by ``most`` in the step [m].

    ``crowd``: rows, their places, where cells begin in them, and the frame of the cells. ``broadest``: largest half
    breadth of all agents [m]. ``order``, ``steering``: those rows steer of which the agent is below that number.
    ``lines``: float64[k, 4], as :func:`set_line` sets them. Returns how many, -1 if there is no room for all.
    """
    rows, places, starts, frame = crowd
    mine = rows[me]
    x = mine.x
    y = mine.y
    own = mine.half + mine.radius + 2.0 * (most + MARGIN)
    farthest = own + broadest
    column, row = cell_of(frame, x, y)
    cells = math.ceil(farthest / CELL)
    count = 0
    for j in range(max(row - cells, 0), min(row + cells + 1, frame[3])):
        begin, end = rows_beside(starts, frame, column, j, cells)
        for number in range(begin, end):
            px = places[number, 0] - x
            py = places[number, 1] - y
            square = px * px + py * py
            if square >= farthest * farthest or number == me or order[number] >= steering:
                continue
            other = rows[number]
            apart = own + other.half + other.radius
            if square >= apart * apart:
                continue
            dx, dy, distance = core_to_core(px, py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
            room = 0.5 * (distance - mine.radius - other.radius) - MARGIN
            if room < most:
                if count == len(lines) or distance == 0.0:
                    return -1
                set_line(lines[count], dx / distance, dy / distance, room)
                count += 1
    return count


@helper
def add_walls(walls, x, y, ux, uy, half, radius, most, lines, count):
    """Add the lines between a core and the segments of one layer that it could meet.

    Returns how many lines there are; -1 if there is no room for all, if the core cuts a segment, or if the step could
    reach beyond what the lists of segments hold.
    """
    column = math.floor((x - walls.left) / WALL_CELL)
    row = math.floor((y - walls.bottom) / WALL_CELL)
    if count < 0 or not (0 <= column < walls.columns and 0 <= row < walls.rows):
        return count
    if half + radius + most > WALL_REACH:
        return -1
    cell = row * walls.columns + column
    for entry in range(walls.starts[cell], walls.starts[cell + 1]):
        number = walls.lists[entry]
        dx, dy, distance = core_to_segment(
            x,
            y,
            ux,
            uy,
            half,
            walls.segments[number, 0],
            walls.segments[number, 1],
            walls.segments[number, 2],
            walls.segments[number, 3],
        )
        room = distance - radius - MARGIN
        if room < most:
            if count == len(lines) or distance == 0.0:
                return -1
            set_line(lines[count], dx / distance, dy / distance, room)
            count += 1
    return count


@helper
def add_ways(ways, frame, mine, most, lines, count):
    """Add the lines between an agent and the reserved ways that it could meet; returns as :func:`add_walls`."""
    column, row = cell_of(frame, mine.x, mine.y)
    cell = row * frame[2] + column
    if count < 0:
        return count
    for entry in range(ways.starts[cell], ways.starts[cell + 1]):
        number = ways.lists[entry]
        dx, dy, distance, gap = gap_to_way(ways, number, mine.x, mine.y, -mine.hy, mine.hx, mine.half, mine.radius)
        room = gap - MARGIN
        if room < most:
            if count == len(lines) or distance == 0.0:
                return -1
            set_line(lines[count], dx / distance, dy / distance, room)
            count += 1
    return count


@helper
def nearest_feasible(wx, wy, lines, count):
    """The move nearest to ``(wx, wy)`` that crosses none of the lines (an incremental program in two dimensions).

    The set of feasible moves contains standing still, so there always is one; it is no longer than what is wanted.
    """
    dx = wx
    dy = wy
    for k in range(count):
        nx = lines[k, 0]
        ny = lines[k, 1]
        if nx * dx + ny * dy <= lines[k, 2]:
            continue
        # The nearest move lies on this line: the interval of the line that all lines before leave.
        low = -math.inf
        high = math.inf
        for m in range(k):
            slope = lines[m, 1] * nx - lines[m, 0] * ny
            rest = lines[m, 2] - lines[k, 2] * (lines[m, 0] * nx + lines[m, 1] * ny)
            if slope > 1e-12:
                high = min(high, rest / slope)
            elif slope < -1e-12:
                low = max(low, rest / slope)
        along = wy * nx - wx * ny
        along = max(min(along, high), low)
        dx = lines[k, 2] * nx - along * ny
        dy = lines[k, 2] * ny + along * nx
    for k in range(count):
        if lines[k, 0] * dx + lines[k, 1] * dy > lines[k, 2] + lines[k, 3]:
            return 0.0, 0.0
    return dx, dy


@helper
def reach_of_turn(hx, hy, ex, ey, nx, ny):
    """Largest |u . n| of the core's unit vector u while the heading turns from h to e, by less than a right angle.

    u is across the heading: |u . n| is 1 if the heading passes a right angle to n on the way.
    """
    if (hx * nx + hy * ny) * (ex * nx + ey * ny) <= 0.0:
        return 1.0
    return max(abs(hx * ny - hy * nx), abs(ex * ny - ey * nx))


@helper
def turn_fits(mine, ex, ey, half, dx, dy, lines, count):
    """Whether the body stays on its side of all lines if it moves by d, turns to e and its core gets ``half`` long."""
    longest = max(mine.half, half)
    for k in range(count):
        nx = lines[k, 0]
        ny = lines[k, 1]
        growth = longest * reach_of_turn(mine.hx, mine.hy, ex, ey, nx, ny)
        growth -= mine.half * abs(mine.hx * ny - mine.hy * nx)
        if growth > lines[k, 2] + lines[k, 3] - max(0.0, nx * dx + ny * dy):
            return False
    return True


@helper
def fitting_turn(mine, turn, half, dx, dy, lines, count):
    """The turn, or a part of it, and the half length of the core that fit beside a move by d.

    Returns heading [rad], its unit vector and the half length.
    """
    heading = wrap_angle(mine.heading + turn)
    ex, ey = cos_sin(heading)
    if count == 0 or turn_fits(mine, ex, ey, half, dx, dy, lines, count):
        return heading, ex, ey, half
    half = min(half, mine.half)
    for _ in range(HALVINGS):
        if turn_fits(mine, ex, ey, half, dx, dy, lines, count):
            return heading, ex, ey, half
        turn *= 0.5
        heading = wrap_angle(mine.heading + turn)
        ex, ey = cos_sin(heading)
    return mine.heading, mine.hx, mine.hy, half


@kernel
def commit_rows(crowd, first, last, order, wanted, walls, ways, broadest, step, state):
    """Move the agents of the rows from ``first`` to ``last`` as they want, as far as that touches nobody.

    ``crowd``: rows, their places, where cells begin in them, and the frame of the cells. ``walls``: those of the legs'
    layer, those of the torso's, and the radius of the legs [m]. ``ways``: those that others have reserved, a
    :class:`crowdsim.steering.ways.ListedWays`. ``broadest``: largest half breadth of all agents [m]. ``step``: its
    length [s]. ``state``: ROW[n] of those who steer, gets what changes, by agent as ``order`` says. Returns how many
    agents stood since more was near than the kernel has room for.
    """
    rows = crowd[0]
    legs, torso, leg_radius = walls
    lines = np.empty((MOST_LINES, 4))
    crowded = 0
    for me in range(first, last):
        if order[me] >= len(state):
            continue
        mine = rows[me]
        want = wanted[me]
        dx = want.vx * step
        dy = want.vy * step
        turn = want.turn
        half = want.half

        # What the body could meet if it grew by the most that the step can make its reach grow.
        growth = max(mine.half, half) * abs(turn) + max(0.0, half - mine.half)
        most = math.sqrt(dx * dx + dy * dy) + growth
        count = add_neighbors(crowd, me, most, broadest, order, len(state), lines)
        count = add_walls(torso, mine.x, mine.y, -mine.hy, mine.hx, mine.half, mine.radius, most, lines, count)
        count = add_walls(legs, mine.x, mine.y, 1.0, 0.0, 0.0, leg_radius, most, lines, count)
        count = add_ways(ways, crowd[3], mine, most, lines, count)
        if count < 0:
            crowded += 1
            count = 0
            dx = 0.0
            dy = 0.0
            turn = 0.0
            half = min(half, mine.half)
        if count > 0:
            dx, dy = nearest_feasible(dx, dy, lines, count)
        heading, hx, hy, half = fitting_turn(mine, turn, half, dx, dy, lines, count)

        # Without progress along its way an agent is stuck.
        progress = (dx * mine.gx + dy * mine.gy) / step
        stuck = mine.stuck - 2.0 * step
        if (mine.gx != 0.0 or mine.gy != 0.0) and progress < 0.15 * mine.speed:
            stuck = mine.stuck + step

        out = state[order[me]]
        out.x = mine.x + dx
        out.y = mine.y + dy
        out.hx = hx
        out.hy = hy
        out.heading = heading
        out.vx = dx / step
        out.vy = dy / step
        out.half = half
        out.ix = want.ix
        out.iy = want.iy
        out.rank = want.rank
        out.key = want.key
        out.opposed = want.opposed
        out.stuck = min(max(stuck, 0.0), STUCK_MOST)
    return crowded
