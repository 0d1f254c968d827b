"""Spots that keep their distance, found by throwing darts: a draw is taken if nobody stands too near."""

from crowdsim.jit import kernel


@kernel
def take_spots(draws, keep, distance, frame, heads, nexts, spots, filled, vain, most):
    """Take those of ``draws`` (float64[k, 2]) that keep ``keep`` meters from all spots taken before, in order.

    ``frame``: left and bottom [m] of cells of side ``distance`` (at least ``keep``), columns and rows of them.
    ``heads``, ``nexts``: int32, the list of spots in each cell. ``spots``: float64[n, 2], ``filled`` of them are taken.
    ``vain``: draws in a row that were not taken so far; ends after ``most`` of them, or if ``spots`` is full. Returns
    filled and vain.
    """
    left, bottom, columns, rows = frame
    for number in range(len(draws)):
        if filled == len(spots) or vain >= most:
            break
        x = draws[number, 0]
        y = draws[number, 1]
        column = min(max(int((x - left) // distance), 0), columns - 1)
        row = min(max(int((y - bottom) // distance), 0), rows - 1)
        # Look at all spots in the cells around.
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
        vain = 0
        spots[filled, 0] = x
        spots[filled, 1] = y
        nexts[filled] = heads[row * columns + column]
        heads[row * columns + column] = filled
        filled += 1
    return filled, vain
