"""Random spots that keep a distance, found by dart throwing: a draw is taken if no other spot is too near."""

from crowdsim.jit import kernel


@kernel
def take_spots(draws, keep, distance, frame, heads, nexts, spots, filled, vain, most):
    """Take those draws, in order, that keep a distance from all spots taken before; return (filled, vain).

    Parameters
    ----------
    draws : (k, 2) float64
        Random places [m].
    keep : float
        Least distance between spots [m]; negative to take all draws.
    distance : float
        Side of the cells [m], at least ``keep``.
    frame : (left, bottom, columns, rows)
        Left and bottom edge of the cells [m], and their numbers.
    heads : (columns * rows,) int32
        First spot in each cell, row by row from the bottom; -1 if there is none. Updated.
    nexts : (n,) int32
        Next spot in the same cell after each spot; -1 after the last one. Updated.
    spots : (n, 2) float64
        The spots [m]; the first ``filled`` are taken. Updated.
    filled, vain, most : int
        Spots taken, and draws in a row that were not taken so far; the search ends after ``most`` of these, or if
        ``spots`` is full.
    """
    left, bottom, columns, rows = frame
    for number in range(len(draws)):
        if filled == len(spots) or vain >= most:
            break
        x = draws[number, 0]
        y = draws[number, 1]
        # Draws outside of the cells belong to the nearest one.
        column = min(max(int((x - left) // distance), 0), columns - 1)
        row = min(max(int((y - bottom) // distance), 0), rows - 1)
        # All spots that may be too near lie in the cells around.
        free = True
        for j in range(max(row - 1, 0), min(row + 2, rows)):
            for i in range(max(column - 1, 0), min(column + 2, columns)):
                other = heads[j * columns + i]
                while other >= 0 and free:
                    dx = x - spots[other, 0]
                    dy = y - spots[other, 1]
                    free = dx * dx + dy * dy >= keep * keep or keep < 0.0
                    other = nexts[other]
        if not free:
            vain += 1
            continue
        # Take the spot, and put it in front of the list of its cell.
        vain = 0
        spots[filled, 0] = x
        spots[filled, 1] = y
        nexts[filled] = heads[row * columns + column]
        heads[row * columns + column] = filled
        filled += 1
    return filled, vain
