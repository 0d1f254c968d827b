"""Periodic floors: agents that leave at one end enter at the other, and both ends see each other.

The place is laid out three times side by side; agents are on the middle copy. In each step, those near an end are
copied beyond the other end, and the copies are dropped afterwards. All agents read the rows from before the step only,
so they step as if the floor had no ends, and do not touch each other across them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate

from crowdsim.ecs.records import joined
from crowdsim.ecs.world import View
from crowdsim.environment.layers import ClearanceLayer, polygons_only
from crowdsim.scenario.environment import Environment
from crowdsim.scenario.scenario import Scenario
from crowdsim.steering.guidance.guidance import PLAIN, Guidance

AHEAD = 4.0
"""Distance from an end within which agents are copied beyond the other end [m]: more than any agent sees."""

_SNAPPED = 1e-9
"""Grid to which the edges of two copies of the floor are snapped, so that they meet [m]."""


def laid_three_times(environment: Environment, span: tuple[float, float]) -> Environment:
    """Return an environment repeated beyond both ends of a periodic floor; the same if it is not periodic.

    ``span`` is the period along x and y [m], 0 for none.
    """
    if span == (0.0, 0.0):
        return environment

    def repeated(layer: ClearanceLayer) -> ClearanceLayer:
        """Return the layer with its free area three times, one period apart."""
        copies = [translate(layer.free, k * span[0], k * span[1]) for k in (-1, 0, 1)]
        return replace(layer, free=polygons_only(shapely.union_all(copies, grid_size=_SNAPPED)))

    return environment._replace(
        layers=tuple(map(repeated, environment.layers)), fixed_layers=tuple(map(repeated, environment.fixed_layers))
    )


class PeriodicBoundary:
    """Line at which both ends of a periodic floor meet; without effect on other floors."""

    def __init__(self, scenario: Scenario, guidance: Guidance) -> None:
        self._guidance = guidance
        self._name = scenario.floor.periodic
        if self._name is not None:
            xmin, ymin, xmax, ymax = scenario.floor.bounds
            self._axis = 0 if self._name == "x" else 1
            self._low, self._high = ((xmin, xmax), (ymin, ymax))[self._axis]
            self._span = self._high - self._low

    def with_copies(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return ``rows`` (ROW[n]), followed by copies of those near an end, moved beyond the other end.

        Copies have ids of their own and the guidance of their new places. On other floors, return ``rows`` itself.
        """
        if self._name is None:
            return rows
        at = rows[self._name]
        beyond, before = rows[at < self._low + AHEAD], rows[at >= self._high - AHEAD]
        beyond[self._name] += self._span
        before[self._name] -= self._span
        copies = np.concatenate((beyond, before))
        # Ids of copies differ from all others: those of rows are below ``most``.
        most = int(rows["id"].max(initial=0)) + 1
        copies["id"] += np.repeat((most, 2 * most), (len(beyond), len(before)))
        self._guide(copies)
        return joined(rows, copies)

    def wrap(self, view: View) -> None:
        """Move agents that have left at one end to the other end, with the anchors of their gait; guide them anew."""
        if self._name is None:
            return
        at = view.row[self._name]
        left = np.flatnonzero((at < self._low) | (at >= self._high))
        by = np.where(at[left] < self._low, self._span, -self._span)
        moved = view.row[left]
        moved[self._name] += by
        self._guide(moved)
        view.row[left] = moved
        view.anchor[left, self._axis] += by

    def _guide(self, rows: NDArray[Any]) -> None:
        """Write the guidance of ``rows`` (ROW[k]) that were moved, by the first field of their goals.

        The keys of those with a goal change by as much as their lengths to go.
        """
        before = rows["togo"].copy()
        walks = rows["goal"] >= 0
        self._guidance.write(rows, np.full(len(rows), PLAIN, np.int32))
        rows["key"][walks] += (rows["togo"] - before)[walks]
