"""The exact commit: move each agent so that no two bodies, and no body and wall, overlap at any time of the step.

Two disjoint convex bodies with gap g and closest points p and q are separated by the perpendicular line half way
between p and q. If both stay on their side of it, they cannot meet at any time of the step, whatever the other one
does. With n the unit vector from p to q, a body does so if its support along n grows by at most g / 2 less a margin. A
wall stands still, so the body may use the whole gap g less the margin; the same holds for a reserved segment of a
captured agent, whose disc may be anywhere along it.

Each neighbor so adds one half plane n . d <= room for the displacement d. Standing still (d = 0) satisfies all of them,
so a feasible step always exists; the one nearest to the wanted displacement is taken. All agents read the positions
before the step only, so the result depends neither on their order nor on the number of threads.

The body is a capsule: all points within a radius of its core, the segment from shoulder to shoulder (see
capsule_kernels). Its support along n is the largest n . x of its points x.

``lines`` (MOST_LINES, 4) float64 are the half planes, the first ``count`` of them in use: unit normal (nx, ny), room
[m], tolerance for rounding [m]; ``mine`` (ROW of row_kernels) is the agent, d its displacement [m].
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_core, core_to_segment
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL, FRAME_COLUMNS, FRAME_ROWS
from crowdsim.steering.stuck_kernels import WEDGED_AFTER, next_stuck
from crowdsim.steering.turn_kernels import fitting_turn, stands_still, turn_wedged
from crowdsim.steering.wall_kernels import WALL_CELL, WALL_REACH
from crowdsim.steering.way_kernels import gap_to_way

CROSSING = 1e-9
"""Distance between two cores, or between a core and a segment, below which they count as crossing [m]. If they cross,
rounding leaves some 1e-16."""

MARGIN = 1e-6
"""Part of each gap that no step uses [m]: above the rounding error of a step, below what is visible.

A wedged agent that turns past the corners of walls keeps half of it off them. A body pressed against a wall is just a
margin away, so that with the whole margin its turn would end at once (see turn_between_walls).
"""

ROUNDING = 1e-9
"""Tolerance for violating a half plane by rounding [m]; granted only while at least half of the margin is left."""

_NO_PROGRESS = 0.15
"""Speed along guidance, as a share of the free speed, below which the time stuck of an agent grows. A larger share
counts slow agents as stuck, too."""

MOST_LINES = 128
"""Capacity of the list of half planes of an agent. With more neighbors, walls and reserved segments in reach it stands
still."""


@helper
def set_line(line, nx, ny, room):
    """Set a half plane ``line`` (4,): unit normal (nx, ny), displacement ``room`` allowed along it, tolerance [m].

    A room below 0 (the gap is smaller than the margin) counts as 0, so that standing still stays feasible. There is no
    tolerance for rounding if less than half of the margin is left.
    """
    line[0] = nx
    line[1] = ny
    line[2] = max(room, 0.0)
    line[3] = ROUNDING if room > -0.5 * MARGIN else 0.0


@helper
def add_neighbors(crowd, me, most, broadest, order, steering, lines):
    """Add a half plane for each agent that the agent ``me`` could meet if its support grew by ``most`` [m] in the step.

    Parameters
    ----------
    crowd : (ROW[n], (n, 2) float64, (cells + 1,) int64, (float, float, int, int))
        Sorted rows, their positions [m], the first row of each cell, and the frame of the grid: left and bottom edge
        [m], columns and rows of cells.
    me : int
        Row of the agent.
    most : float
        Upper bound of the growth of its support in this step [m].
    broadest : float
        Largest half breadth of all agents [m].
    order : (n,) int32
        Agent number of each row.
    steering : int
        Number of steered agents; agents from that number on are captured, which :func:`add_ways` handles.
    lines : (k, 4) float64
        Gets the half planes as :func:`set_line` writes them.

    Returns
    -------
    int
        Number of half planes; -1 if there are more than k, or if the distance between the core of the agent and that of
        a neighbor is below :data:`CROSSING`. Bodies that overlap, but whose cores are farther apart than that, may move
        apart, but not nearer.
    """
    rows, places, starts, frame = crowd
    mine = rows[me]
    x = mine.x
    y = mine.y
    # A neighbor matters if gap / 2 - MARGIN < most, so if gap < 2 (most + MARGIN). Bounding discs give a lower bound of
    # the gap, with the broadest agent for the cells to search.
    own = mine.half + mine.radius + 2.0 * (most + MARGIN)
    farthest = own + broadest
    column, row = cell_of(frame, x, y)
    cells = math.ceil(farthest / CELL)
    count = 0
    for j in range(max(row - cells, 0), min(row + cells + 1, frame[FRAME_ROWS])):
        begin, end = rows_beside(starts, frame, column, j, cells)
        for number in range(begin, end):
            px = places[number, 0] - x
            py = places[number, 1] - y
            square = px * px + py * py
            # Cheap rejection by the broadest body of all, then by the bounding disc of this neighbor.
            if square >= farthest * farthest or number == me or order[number] >= steering:
                continue
            other = rows[number]
            apart = own + other.half + other.radius
            if square >= apart * apart:
                continue
            # Exact gap between the capsules. Both may move, so each gets half of it.
            dx, dy, distance = core_to_core(px, py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
            room = 0.5 * (distance - mine.radius - other.radius) - MARGIN
            if room < most:
                # Cores that cross have no separating line.
                if count == len(lines) or distance < CROSSING:
                    return -1
                set_line(lines[count], dx / distance, dy / distance, room)
                count += 1
    return count


@helper
def add_walls(walls, x, y, ux, uy, half, radius, most, lines, count):
    """Add a half plane for each wall segment of one layer that a body could meet.

    The room to a segment is the whole gap less the margin. It is below 0 if the body is nearer than the margin, or
    overlaps the segment; :func:`set_line` makes it 0, so that the body comes no nearer.

    Parameters
    ----------
    walls : Walls
        Wall segments of the layer, with a list of those near each cell.
    x, y, ux, uy, half, radius : float
        Body: center, unit vector and half length of its core, radius [m]. The disc of the legs has half length 0.
    most : float
        Upper bound of the growth of its support in this step [m].
    lines : (k, 4) float64
        Half planes, as :func:`set_line` writes them.
    count : int
        Number of half planes so far; -1 if they are incomplete, which is returned as it is.

    Returns
    -------
    int
        Number of half planes now; -1 if there are more than k, if the core is nearer to a wall than :data:`CROSSING`,
        or if the step could reach beyond :data:`WALL_REACH`, the distance up to which the lists are complete.
    """
    column = math.floor((x - walls.left) / WALL_CELL)
    row = math.floor((y - walls.bottom) / WALL_CELL)
    # The grid reaches two cells or more beyond all walls (build_walls, update_walls), 1 m: more than a body and its
    # step. So no wall is near a body outside of it.
    if count < 0 or not (0 <= column < walls.columns and 0 <= row < walls.rows):
        return count
    # The lists are complete only up to WALL_REACH: a body that could reach farther stands still.
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
        # A wall stands still: the whole gap is the agent's.
        room = distance - radius - MARGIN
        if room < most:
            # The core is on the wall, or there are too many lines.
            if count == len(lines) or distance < CROSSING:
                return -1
            set_line(lines[count], dx / distance, dy / distance, room)
            count += 1
    return count


@helper
def add_ways(ways, frame, mine, most, lines, count):
    """Add a half plane for each reserved segment that an agent could meet; return the number of half planes now.

    ``frame`` is left and bottom edge of the grid [m], columns and rows. ``ways`` (ListedWays) holds the reserved
    segments by cells of ``frame``, ``mine`` (ROW) is the agent; ``most``, ``lines`` (k, 4) and ``count`` are as for
    :func:`add_walls`. Return -1 if ``count`` is -1, if there are more than k half planes, or if the core is nearer to a
    segment than :data:`CROSSING`.
    """
    column, row = cell_of(frame, mine.x, mine.y)
    cell = row * frame[FRAME_COLUMNS] + column
    if count < 0:
        return count
    for entry in range(ways.starts[cell], ways.starts[cell + 1]):
        number = ways.lists[entry]
        dx, dy, distance, gap = gap_to_way(ways, number, mine.x, mine.y, -mine.hy, mine.hx, mine.half, mine.radius)
        # The disc on a reserved segment never leaves it: the agent may use the whole gap to the swept disc.
        room = gap - MARGIN
        # The agent could meet the disc in this step. Give up if its core is on the segment, or lines are too many.
        if room < most:
            if count == len(lines) or distance < CROSSING:
                return -1
            set_line(lines[count], dx / distance, dy / distance, room)
            count += 1
    return count


@helper
def nearest_feasible(wx, wy, lines, count):
    """Return the displacement nearest to ``(wx, wy)`` that satisfies the first ``count`` half planes [m].

    ``lines`` (k, 4) are half planes as :func:`set_line` writes them: normal, room, tolerance.
    Incremental linear programming in two dimensions (de Berg et al., Computational Geometry, section 4.3) with a
    quadratic objective, as in van den Berg et al., Reciprocal n-body Collision Avoidance (2011). The feasible set is
    convex and contains (0, 0), so a solution exists and is no longer than ``(wx, wy)``.
    """
    dx = wx
    dy = wy
    for k in range(count):
        # Invariant: (dx, dy) is the optimum for half planes 0 to k - 1. It stays so if it satisfies half plane k.
        nx = lines[k, 0]
        ny = lines[k, 1]
        if nx * dx + ny * dy <= lines[k, 2]:
            continue
        # Otherwise the optimum lies on the boundary of half plane k. Let s be the coordinate along this line, in the
        # direction (-ny, nx). Earlier half planes leave an interval [low, high] of it: half plane m requires slope * s
        # <= rest. One whose line is parallel (slope 0) does not bound s.
        low = -math.inf
        high = math.inf
        for m in range(k):
            slope = lines[m, 1] * nx - lines[m, 0] * ny
            rest = lines[m, 2] - lines[k, 2] * (lines[m, 0] * nx + lines[m, 1] * ny)
            if slope > 1e-12:
                high = min(high, rest / slope)
            elif slope < -1e-12:
                low = max(low, rest / slope)
        # Project the wanted displacement on the line, and clamp its coordinate to the interval.
        along = wy * nx - wx * ny
        along = max(min(along, high), low)
        dx = lines[k, 2] * nx - along * ny
        dy = lines[k, 2] * ny + along * nx
    # Rounding, for example with nearly parallel lines, may leave a half plane violated: then stand still, which is
    # safe.
    for k in range(count):
        if lines[k, 0] * dx + lines[k, 1] * dy > lines[k, 2] + lines[k, 3]:
            return 0.0, 0.0
    return dx, dy


@kernel
def commit_rows(crowd, first, last, order, moved, wanted, walls, ways, broadest, step, state):
    """Move the agents of rows ``first`` to ``last`` (exclusive) towards what they want, as far as they touch nothing.

    Parameters
    ----------
    crowd : (ROW[n], (n, 2) float64, (cells + 1,) int64, (float, float, int, int))
        Sorted rows, their positions [m], the first row of each cell, and the frame of the grid.
    first, last : int
        Rows to move.
    order : (n,) int32
        Agent number of each row.
    moved : int
        Number of agents that move. Further steered ones are copies of agents that are moved elsewhere.
    wanted : WANTED[n]
        Decision of each row (WANTED of decide_kernels): velocity [m/s], turn [rad], half length of the core [m], and
        fields that are copied.
    walls : tuple
        Walls of the legs' layer, walls of the torso's layers, radius of the legs [m].
    ways : ListedWays
        Reserved segments of captured agents.
    broadest : float
        Largest half breadth of all agents [m].
    step : float
        Duration of the step [s].
    state : ROW[m]
        Steered agents and copies (m <= n), by agent number; all fields that the commit decides are written.

    Returns
    -------
    int
        Number of agents that stood still: more than MOST_LINES, a core on something, or WALL_REACH exceeded.
    """
    rows = crowd[0]
    legs, torso, leg_radius = walls
    lines = np.empty((MOST_LINES, 4))
    crowded = 0
    for me in range(first, last):
        # Captured agents and copies are seen but not moved.
        if order[me] >= moved:
            continue
        mine = rows[me]
        want = wanted[me]
        dx = want.vx * step
        dy = want.vy * step
        turn = want.turn
        half = want.half

        # Upper bound of the growth of the body's support in this step: way, turn of the core (half length times angle)
        # and stretch. Bodies farther away than that cannot be met, so they need no half plane.
        growth = max(mine.half, half) * abs(turn) + max(0.0, half - mine.half)
        most = math.sqrt(dx * dx + dy * dy) + growth
        count = add_neighbors(crowd, me, most, broadest, order, len(state), lines)
        people = count
        # The capsule keeps off the walls of the torso's layers, a disc of the legs' radius off the legs' walls.
        count = add_walls(torso, mine.x, mine.y, -mine.hy, mine.hx, mine.half, mine.radius, most, lines, count)
        count = add_walls(legs, mine.x, mine.y, 1.0, 0.0, 0.0, leg_radius, most, lines, count)
        fixed = count
        count = add_ways(ways, crowd[3], mine, most, lines, count)
        # -1: the half planes are incomplete, so no displacement and no turn is safe. The core may still get shorter.
        if count < 0:
            crowded += 1
            count = 0
            dx, dy, turn = 0.0, 0.0, 0.0
            half = min(half, mine.half)
        # Without half planes the wanted step is free.
        if count > 0:
            dx, dy = nearest_feasible(dx, dy, lines, count)
        heading, hx, hy, half = fitting_turn(mine, turn, half, dx, dy, lines, count)
        # Wedged: long stuck without opposing traffic (``opposed`` is 0), and neither a move nor a turn is left. Turn on
        # the spot past the corners of walls, if others allow it. For half the margin see MARGIN.
        stuck_alone = mine.stuck > WEDGED_AFTER and want.opposed <= 0.0
        if count > 0 and stuck_alone and stands_still(mine, dx, dy, heading):
            spans = (people, fixed, count)
            heading, hx, hy, half = turn_wedged(mine, torso, mine.radius + 0.5 * MARGIN, turn, half, lines, spans)
            if heading != mine.heading:  # the turn was tested on the spot: drop the tiny move
                dx, dy = 0.0, 0.0

        # The time stuck grows if there is guidance but hardly any progress along it, else it shrinks twice as fast.
        progress = (dx * mine.gx + dy * mine.gy) / step
        stuck = mine.stuck - 2.0 * step
        if (mine.gx != 0.0 or mine.gy != 0.0) and progress < _NO_PROGRESS * mine.speed:
            stuck = mine.stuck + step

        # Write back by agent. The velocity is the one carried out, which neighbors will extrapolate.
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
        out.stuck = next_stuck(stuck)  # not below 0; at the upper limit, back by CYCLE
    return crowded
