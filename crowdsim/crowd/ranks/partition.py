"""Regions of the floor, one for each rank: boxes of cells with about as many agents each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.errors import CrowdSimError
from crowdsim.scenario.people.arrivals import NEVER
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.steering.commit_kernels import MARGIN
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.rules import Rules

ENDLESS = 2**40
"""Edge, in cells, of a region at the border of the floor: it stands for none, as the region contains all beyond it."""

SAMPLES = 8
"""Number of points on the straight line to each goal of an agent, at which the agent is expected."""

CROWD_CELLS = 2
"""Cells around its own in which an agent counts others, to know how far it looks in a crowd; see ``look_rows``."""

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]


def halo_of(rules: Rules, fastest: float, broadest: float) -> int:
    """Return how many cells around its own cell the step of an agent reads.

    It is the largest of three distances: how far the agent looks; how far it counts the crowd around it; and the
    distance of the farthest body that the commit keeps off. The last one is both half breadths plus twice (as each body
    may use half of a gap) the length by which a body may reach farther after a step: by walking, by turning its
    shoulders, or by letting its arms hang again. The margin of the commit is added to that length.

    Parameters
    ----------
    rules : Rules
        Constants of the model.
    fastest : float
        Largest speed that any agent may reach [m/s].
    broadest : float
        Largest half breadth of a body, arms included [m].
    """
    grows = fastest * rules.step + broadest * rules.turn_rate * rules.step + broadest
    keeps_off = 2.0 * broadest + 2.0 * (grows + MARGIN)
    looks = max(rules.reach, rules.reach_in_crowd, rules.yield_reach)
    return max(math.ceil(looks / CELL), CROWD_CELLS, math.ceil(keeps_off / CELL))


def fastest_of(speeds: Floats, rules: Rules) -> float:
    """Return the largest speed that any agent may reach [m/s]; ``speeds`` (n,) are the free speeds of all [m/s].

    Rules can make an agent faster than it walks freely: to make room, or to step aside and back at the same time.
    """
    aside = math.sqrt(rules.yield_aside * rules.yield_aside + rules.yield_along * rules.yield_along)
    return max(float(speeds.max(initial=0.0)), rules.merge_speed, aside)


def cells_of(x: Floats, y: Floats) -> tuple[Cells, Cells]:
    """Return the column and the row of the cell, CELL meters wide, of each position [m]; any shape.

    Cells are numbered from the origin of the scenario, so numbers may be negative.
    """
    return np.floor(x / CELL).astype(np.int64), np.floor(y / CELL).astype(np.int64)


@dataclass(frozen=True)
class Regions:
    """Boxes of cells that cover the plane, one for each rank.

    Attributes
    ----------
    boxes : (r, 4) int64
        Left, bottom, right (exclusive) and top (exclusive) of each [cells]; -ENDLESS or ENDLESS if it has no edge.
    halo : int
        Width of the rim of cells around a region in which agents matter to those in the region.
    """

    boxes: Cells
    halo: int

    @property
    def count(self) -> int:
        """Return the number of regions."""
        return len(self.boxes)

    def within(self, rank: int, columns: Cells, rows: Cells, beyond: int = 0) -> NDArray[np.bool_]:
        """Return which cells, by column and row (any shape), are in a region, or at most ``beyond`` cells from it.

        If ``beyond`` is negative, return which cells are in the region, but not in its outer rim of that width.
        """
        left, bottom, right, top = self.boxes[rank].tolist()
        inside = (columns >= left - beyond) & (columns < right + beyond)
        return np.asarray(inside & (rows >= bottom - beyond) & (rows < top + beyond))

    def neighbors(self, rank: int) -> list[int]:
        """Return the ranks to which agents of ``rank`` may matter, even if they have just left its region."""
        left, bottom, right, top = self.boxes[rank].tolist()
        reach = self.halo + 1  # in a step, an agent comes into the next cell at most
        found = []
        for other, (west, south, east, north) in enumerate(self.boxes.tolist()):
            apart = max(west - right, left - east, south - top, bottom - north)
            if other != rank and apart < reach:
                found.append(other)
        return found

    def owner(self, places: Floats) -> NDArray[np.int64]:
        """Return the rank in whose region each place (k, 2) [m] is."""
        columns, rows = cells_of(*np.asarray(places, np.float64).T)
        owners = np.zeros(len(places), np.int64)
        for rank in range(self.count):
            owners[self.within(rank, columns, rows)] = rank
        return owners


def divide(expected: Floats, bounds: tuple[float, float, float, float], count: int, halo: int) -> Regions:
    """Cut a place into ``count`` boxes with about as many of the points ``expected`` (m, 2) [m] in each.

    Boxes are cut in two across their longer side, again and again; both parts are at least as wide as the halo.

    Parameters
    ----------
    expected : (m, 2) float64
        Points at which agents are expected [m], several for each.
    bounds : (float, float, float, float)
        Left, bottom, right and top of the place [m].
    count : int
        Number of regions.
    halo : int
        Width of the rim of cells around each region that matters to it, and least width of a region.

    Raises
    ------
    CrowdSimError
        If the place is too small for so many regions.
    """
    low = np.floor(np.array(bounds[:2]) / CELL).astype(np.int64)
    high = np.floor(np.array(bounds[2:]) / CELL).astype(np.int64) + 1
    columns, rows = cells_of(*expected.T)
    cells = np.column_stack((np.clip(columns, low[0], high[0] - 1), np.clip(rows, low[1], high[1] - 1)))
    boxes: list[tuple[int, ...]] = []
    _halve((*low.tolist(), *high.tolist()), cells, count, halo, boxes)
    edges = np.array(boxes, np.int64)
    # Regions at the border of the place have no edge there.
    for side, edge, endless in (
        (0, low[0], -ENDLESS),
        (1, low[1], -ENDLESS),
        (2, high[0], ENDLESS),
        (3, high[1], ENDLESS),
    ):
        edges[edges[:, side] == edge, side] = endless
    return Regions(edges, halo)


def expected_places(cast: CrowdPlacement, middles: Floats) -> Floats:
    """Return where the agents of a run are expected: points (m, 2) on straight lines to their goals [m].

    ``middles`` (g, 2) are points in the goals [m].
    """
    along = ((np.arange(SAMPLES) + 0.5) / SAMPLES)[None, :, None]
    found = [np.empty((0, 2))]
    for number, itinerary in enumerate(cast.itineraries):
        # Agents on call come only if a command adds them, and runs on several processes refuse commands.
        members = np.flatnonzero((cast.group == number) & (cast.start_steps != NEVER))
        here = cast.starts[members]
        for goal in itinerary.goals.tolist():
            there = np.broadcast_to(middles[goal], here.shape)
            if len(itinerary.exits) and goal == itinerary.goals[-1]:
                # The assigned exit, else the nearest in a straight line: which one agents choose is known later.
                away = here[:, None] - middles[itinerary.exits][None]
                nearest = itinerary.exits[np.argmin((away * away).sum(axis=2), axis=1)]
                assigned = cast.assigned[members]
                there = middles[np.where(assigned != NONE, assigned, nearest)]
            found.append((here[:, None] + along * (there - here)[:, None]).reshape(-1, 2))
            here = there
    return np.concatenate(found)


def _halve(box: tuple[int, ...], cells: Cells, count: int, least: int, boxes: list[tuple[int, ...]]) -> None:
    """Append the ``count`` parts of a box of cells to ``boxes``.

    Boxes are (left, bottom, right, top) [cells], right and top exclusive. ``cells`` (m, 2) are the column and row of
    each point expected in the box. No part may be narrower than ``least`` cells (of 1 m): raise CrowdSimError if the
    box is too small for that.
    """
    if count == 1:
        boxes.append(box)
        return
    first = count // 2  # parts before the cut
    wide, high = box[2] - box[0], box[3] - box[1]
    axis = 0 if wide >= high else 1
    low, end = box[axis], box[axis + 2]
    if end - low < 2 * least:
        raise CrowdSimError(
            f"the place is too small for so many ranks: a region would be {end - low} m wide and cannot be halved, as "
            f"each must be at least {least} m wide; start fewer with mpiexec -n"
        )
    # Cut so that the share of the points before the cut is nearest to the share of the regions before it.
    before = np.cumsum(np.bincount(cells[:, axis] - low, minlength=end - low))[:-1]
    wanted = len(cells) * first / count if len(cells) else 0.0
    cuts = np.arange(least, end - low - least + 1)
    # Without points, cut in proportion to the numbers of regions.
    if len(cells):
        cut = int(cuts[np.argmin(np.abs(before[cuts - 1] - wanted))]) + low
    else:
        cut = low + min(max((end - low) * first // count, least), end - low - least)
    left = cells[:, axis] < cut  # points to the left of the cut, or below it if it is across the height
    halves = [list(box), list(box)]
    halves[0][axis + 2] = halves[1][axis] = cut
    _halve(tuple(halves[0]), cells[left], first, least, boxes)
    _halve(tuple(halves[1]), cells[~left], count - first, least, boxes)
