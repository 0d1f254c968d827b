"""Pockets: gaps and corners from which no way leads, in which bodies just fit, and the ways out of them.

A pocket consists of cells, CELLS x CELLS in a box, that hang together. It ends where a way leads on. Its cells are
found when an agent is in one of them; those of a box are kept together, in one *slot*. The address of a cell is the
number of its slot times the cells of a slot, plus its number in the box, row by row. What is found for a cell depends
on the place alone, so it does not matter which agent is first. Boxes without a way around (AROUND) belong to no pocket:
so a crowd that is shut in causes no search for each of its agents.

``ground`` (Ground) and ``field`` (Field) are those of the place, ``nobody`` is the Crowding of an empty place, and
``pockets`` are the Pockets of :mod:`crowdsim.steering.guidance.ways_out`; ``column`` and ``row`` are those of a cell.
"""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import row_of
from crowdsim.steering.guidance.ground_kernels import BOX, STEPS, off_segment
from crowdsim.steering.guidance.sample_kernels import THICKNESS, is_pinched, way_at
from crowdsim.steering.guidance.way_kernels import lead

CELLS = 10
"""Number of cells along each side of a box."""

IN_SLOT = CELLS * CELLS
"""Number of cells of a box."""

FINE = BOX / CELLS
"""Side of a cell [m]."""

KEPT = 0.105
"""Clearance of the center of a cell of a pocket [m]: that of a body, 0.125 m, less half a diagonal of a cell, so that
the cell of an agent has it wherever it is."""

ROUNDING = 0.005
"""How much narrower than a body a gap may seem at the center of a cell in which one fits [m]."""

FITS = 0.12
"""Clearance from which on a body is sure to fit somewhere in the cell [m]."""

ROOMY = 0.16
"""Clearance from which on a cell costs no more than its length [m]."""

TIGHT_COST, HOPELESS_COST = 4.0, 100.0
"""Cost of a meter at clearances from FITS to ROOMY, and below FITS: agents squeeze out where there is most room."""

MOST_CELLS = 3200
"""Largest number of cells INSIDE of a pocket (2 m2). Nobody is led out of larger ones."""

AROUND = 12
"""Number of boxes around the box of a cell, in each direction, of which one must have a way."""

AHEAD = 4
"""Number of cells ahead that an agent heads for."""

NO_SLOT, NO_WAY_NEAR = -1, -2
"""Values of ``pockets.slots`` for boxes that have no slot yet, and for those without a way around."""

COMPLETE, TOO_LARGE, LACKS_SLOT = range(3)
"""Outcomes of listing the cells of a pocket."""

UNSEEN, BLOCKED, INSIDE, OUT, CLOSED = range(5)
"""Kinds of cells: not looked at yet; too near to a wall; in a pocket; a way leads on from here; in a pocket that is too
large."""


@helper
def _address(ground, pockets, column, row):
    """Return the address of a cell; if its box has no slot, NO_SLOT or NO_WAY_NEAR, the latter outside of the boxes."""
    if not (0 <= column < CELLS * ground.columns and 0 <= row < CELLS * ground.rows):
        return NO_WAY_NEAR
    slot = pockets.slots[row // CELLS * ground.columns + column // CELLS]
    return slot * IN_SLOT + row % CELLS * CELLS + column % CELLS if slot >= 0 else slot


@helper
def _place_of(ground, pockets, address):
    """Return column and row of the cell with an address."""
    box = pockets.owners[address // IN_SLOT]
    number = address % IN_SLOT
    column = box % ground.columns * CELLS + number % CELLS
    return column, box // ground.columns * CELLS + number // CELLS


@helper
def _look_at(ground, nobody, field, pockets, address, column, row):
    """Find out the kind of a cell, its cost per meter if it is INSIDE, and the length to go if it is OUT [m]."""
    x = ground.left + (column + 0.5) * FINE
    y = ground.bottom + (row + 0.5) * FINE
    box = pockets.owners[address // IN_SLOT]
    # Clearance from walls of any layer, as far as it counts.
    least = ROOMY
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        dx, dy = off_segment(ground, ground.lists[entry], x, y)
        least = min(least, math.sqrt(dx * dx + dy * dy))
    pockets.kinds[address] = BLOCKED
    if least < KEPT or is_pinched(ground, box, x, y, THICKNESS - ROUNDING):
        return
    pockets.kinds[address] = INSIDE
    pockets.lengths[address] = math.inf
    pockets.weights[address] = 1.0 if least >= ROOMY else (TIGHT_COST if least >= FITS else HOPELESS_COST)
    _, _, _, to_go, _, _ = way_at(ground, nobody, field, x, y)
    if to_go < math.inf:
        pockets.kinds[address] = OUT
        pockets.lengths[address] = to_go


@helper
def _is_way_near(ground, field, box):
    """Return True if a box up to AROUND from ``box`` has a way."""
    row = box // ground.columns
    column = box - row * ground.columns
    for j in range(max(row - AROUND, 0), min(row + AROUND + 1, ground.rows)):
        for i in range(max(column - AROUND, 0), min(column + AROUND + 1, ground.columns)):
            known = row_of(field, j * ground.columns + i)
            if known >= 0 and field.asks[known] >= 0:
                return True
    return False


@helper
def _take_slot(ground, field, pockets, used, column, row):
    """Give the box of a cell, which has NO_SLOT, the next slot, or mark it if no way is near.

    Return the address of the cell then, and the number of slots that are taken; the address is NO_SLOT if there is no
    slot left. ``used`` slots are taken before.
    """
    box = row // CELLS * ground.columns + column // CELLS
    if not _is_way_near(ground, field, box):
        pockets.slots[box] = NO_WAY_NEAR
    elif used < len(pockets.owners):
        pockets.slots[box] = used
        pockets.owners[used] = box
        used += 1
    return _address(ground, pockets, column, row), used


@helper
def _flood(ground, nobody, field, pockets, used, cells):
    """List the cells INSIDE that hang together with ``cells[0]``; ``used`` slots are taken.

    Return COMPLETE, TOO_LARGE, or LACKS_SLOT if none is left for another box; the number of cells in the list, and that
    of slots taken.
    """
    count = 1
    for read in range(len(cells)):
        if read == count:
            break
        column, row = _place_of(ground, pockets, cells[read])
        for k in range(8):
            i = column + STEPS[k, 0]
            j = row + STEPS[k, 1]
            other = _address(ground, pockets, i, j)
            if other == NO_SLOT:
                other, used = _take_slot(ground, field, pockets, used, i, j)
                if other == NO_SLOT:
                    return LACKS_SLOT, count, used
            if other == NO_WAY_NEAR:
                continue
            if pockets.kinds[other] == CLOSED:
                return TOO_LARGE, count, used
            if pockets.kinds[other] != UNSEEN:
                continue
            _look_at(ground, nobody, field, pockets, other, i, j)
            if pockets.kinds[other] != INSIDE:
                continue
            if count == len(cells):
                pockets.kinds[other] = CLOSED
                return TOO_LARGE, count, used
            cells[count] = other
            count += 1
    return COMPLETE, count, used


@helper
def _relax(ground, pockets, address):
    """Lower the cost of a cell to the least over the cells around it; return True if it fell, and the cell over which.

    The cell is the first of several at the same cost; -1 if none leads out.
    """
    column, row = _place_of(ground, pockets, address)
    least = math.inf
    over = -1
    for k in range(8):
        other = _address(ground, pockets, column + STEPS[k, 0], row + STEPS[k, 1])
        if other < 0 or (pockets.kinds[other] != INSIDE and pockets.kinds[other] != OUT):
            continue
        step = FINE * math.sqrt(2.0) if k % 2 == 1 else FINE
        value = pockets.lengths[other] + step * pockets.weights[address]
        if value < least:
            least = value
            over = other
    falls = least < pockets.lengths[address]
    if falls:
        pockets.lengths[address] = least
    return falls, over


@kernel
def find_pocket(ground, nobody, field, pockets, used, x, y, cells):
    """Find the pocket around a position, and the way out of each of its cells.

    Parameters
    ----------
    ground, nobody, field : Ground, Crowding, Field
        The place, an empty crowd, and the field that tells where ways lead on.
    pockets : Pockets
        Gets the cells; empty slots have UNSEEN cells.
    used : int
        Number of slots that are taken.
    x, y : float
        The position [m].
    cells : (MOST_CELLS,) int64
        Scratch.

    Returns
    -------
    int
        Number of slots that are taken now; -1 if another one is needed. Then call it again, with more of them.
    """
    # The first cell.
    column = math.floor((x - ground.left) / FINE)
    row = math.floor((y - ground.bottom) / FINE)
    first = _address(ground, pockets, column, row)
    if first == NO_SLOT:
        first, used = _take_slot(ground, field, pockets, used, column, row)
        if first == NO_SLOT:
            return -1
    if first == NO_WAY_NEAR or pockets.kinds[first] != UNSEEN:
        return used
    _look_at(ground, nobody, field, pockets, first, column, row)
    if pockets.kinds[first] != INSIDE:
        return used
    cells[0] = first
    # All others. If they cannot be listed, those that are known are unseen again, or closed.
    outcome, count, used = _flood(ground, nobody, field, pockets, used, cells)
    if outcome != COMPLETE:
        for n in range(count):
            pockets.kinds[cells[n]] = UNSEEN if outcome == LACKS_SLOT else CLOSED
        return -1 if outcome == LACKS_SLOT else used
    # Their costs: relax all cells, to and fro, until none falls any more.
    for sweep in range(count):
        falls = False
        for n in range(count):
            fell, _ = _relax(ground, pockets, cells[n] if sweep % 2 == 0 else cells[count - 1 - n])
            falls = falls or fell
        if not falls:
            break
    # The ways out.
    for n in range(count):
        _, pockets.onwards[cells[n]] = _relax(ground, pockets, cells[n])
    return used


@kernel
def write_ways_out(ground, nobody, field, asked, pockets, agents, state, seen):
    """Write guidance out of their pockets to the rows of agents without a path.

    Parameters
    ----------
    ground, nobody, field, pockets : Ground, Crowding, Field, Pockets
        As of :func:`find_pocket`.
    asked : (n, 2) float64
        Turn [rad] and held half length [m] that each behavior prescribes, -1 for none.
    agents : (k,) int64
        Rows of ``state`` to write.
    state : ROW[m]
        All agents; those that are not led out are left as they are.
    seen : (k,) uint8
        Gets the kind of the cell in which each agent is; CLOSED, too, if no way out is known from there.

    Returns
    -------
    int
        Number of agents that are not led out.
    """
    lost = 0
    for n in range(len(agents)):
        me = state[agents[n]]
        column = math.floor((me.x - ground.left) / FINE)
        row = math.floor((me.y - ground.bottom) / FINE)
        address = _address(ground, pockets, column, row)
        seen[n] = pockets.kinds[address] if address >= 0 else (UNSEEN if address == NO_SLOT else CLOSED)
        if seen[n] == INSIDE and pockets.onwards[address] < 0:
            seen[n] = CLOSED
        if seen[n] != INSIDE and seen[n] != OUT:
            lost += 1
            continue
        # The length of the way out, and the center s of the cell to head for.
        length = 0.0
        x = me.x
        y = me.y
        sx = x
        sy = y
        for step in range(MOST_CELLS):
            i, j = _place_of(ground, pockets, address)
            u = ground.left + (i + 0.5) * FINE
            v = ground.bottom + (j + 0.5) * FINE
            length += math.sqrt((u - x) * (u - x) + (v - y) * (v - y))
            x = u
            y = v
            if step <= AHEAD:
                sx = u
                sy = v
            if pockets.kinds[address] == OUT:
                break
            address = pockets.onwards[address]
        length += pockets.lengths[address]
        if seen[n] == OUT:
            # The way of the cell's center leads on; lines from beside it may be blocked.
            u = me.x
            v = me.y
            me.x = sx
            me.y = sy
            lead(ground, nobody, field, asked, me)
            me.x = u
            me.y = v
            continue
        # Head for that cell; the length to go is that of the way out and of the way from there.
        apart = math.sqrt((sx - me.x) * (sx - me.x) + (sy - me.y) * (sy - me.y))
        me.gx = me.cx = (sx - me.x) / apart
        me.gy = me.cy = (sy - me.y) / apart
        me.ahead = me.onx = me.ony = 0.0
        me.togo = length
        # Nothing is prescribed.
        me.turn = asked[len(asked) - 1, 0]
        me.held = min(me.rest, asked[len(asked) - 1, 1])
    return lost
