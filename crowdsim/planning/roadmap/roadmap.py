"""The roadmap of a place for a set of behaviors: made once for the meshes as they are, searched by any thread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.labels.labelling_kernels import CHANGE_COST, LEAST_SECTION, TERMS
from crowdsim.planning.query.query import with_sections
from crowdsim.planning.query.requirements import Requirements
from crowdsim.planning.roadmap import build_kernels, polishing_kernels, search_kernels

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh


LANDMARKS = 24
"""Points of the roadmap from which the costs to all others are kept, as bounds for the search. More: fewer states
searched, slower building, more memory."""

_NEVER = 1e9
"""Cost between two points without a way, as float32 differences of infinities would be NaN."""

_ENTRY = 0.05
"""Part of a section's least length that is charged, at the difference in cost, with each change of behavior [m]; the
rest is charged when a section ends too short."""


_WORTH = 0.03
"""Share of a path's cost that narrow sections may cost beyond their least lengths before stations are shifted."""


class Roadmap:
    """Points, ways and landmarks (:mod:`crowdsim.planning.roadmap.build_kernels`) of meshes as they are now.

    Parameters
    ----------
    meshes: one per layer, the legs' first.
    need: clearances and costs of the behaviors.
    terms: (4,) as :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.
    """

    def __init__(self, meshes: Sequence[NavMesh], need: Requirements, terms: NDArray[np.float64] = TERMS) -> None:
        self._kept = [mesh.arrays for mesh in meshes]  # the addresses are theirs
        self.layers = layers_of(meshes)
        self.need = need
        self.terms = terms
        radii = np.ascontiguousarray(need.radii)
        self._radii = radii
        # Clearance that the legs must keep: theirs less the tolerance of the mesh, as of `NavMesh.tolerance`.
        self._least = float(radii[0, 0] - 1e-6 * radii[0, 0] - 2.0 * self._kept[0].frame["cell"][0])
        self.fitting = need.fitting(self.layers, terms, meshes[0].tolerance(radii))
        self.points, self.spans = build_kernels.place_points(self.layers, radii)
        self.around = build_kernels.corner_radii(self.layers, radii)
        self.ways = build_kernels.join_points(self.layers, radii, self.around, self.points, self.spans)
        # A change costs what the terms say, and a part of the least section; without least lengths, no such part.
        steps = np.abs(need.costs[:, None] - need.costs)
        self.change = terms[CHANGE_COST] * need.costs[-1] + steps * (_ENTRY if terms[LEAST_SECTION] > 0.0 else 0.0)
        self._prices = search_kernels.Prices(need.costs, need.turned, terms, self.change)
        self._graph = search_kernels.RoadGraph(self.points, self.spans, self.ways, self._landmarks())
        self._more = (need.costs - need.costs[-1]).tolist()
        self._shortest = float(terms[LEAST_SECTION])
        self._idle: list[tuple[NDArray[Any], int]] = []

    def _landmarks(self) -> NDArray[np.float32]:
        """Return (states, l) costs from l landmarks: point 0, then always the point farthest from all before.

        State s is behavior s % n at point s // n; states that a landmark does not reach cost _NEVER.
        """
        n, count = self.need.count, len(self.points)
        costs = np.empty((min(LANDMARKS, count), count * n))
        nearest = np.full(count, np.inf)
        heap = np.empty(256, HEAP_ROW)
        source = 0
        for out in costs:
            heap = search_kernels.costs_from(
                self.points, self.ways, self.need.costs, self.need.turned, self.change, source, heap, out
            )
            least = np.minimum(nearest, out.reshape(count, n).min(axis=1))
            # While most points are unreached, the next landmark is in another component; later, unreached points are
            # ignored.
            reached = np.isfinite(least)
            nearest = least
            source = int(np.argmax(np.where(reached, least, np.inf if reached.mean() < 0.5 else -1.0)))
        return np.minimum(costs, _NEVER).T.astype(np.float32, order="C")

    def find(self, ends: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
        """Return about the cheapest way from ends[0] to ends[1], and its estimated cost.

        ``ends`` (2, 2) are x and y [m]. The way is rows (k, 2) of a point's number and the behavior on the way to it.
        The cost estimates :attr:`AnnotatedPath.cost`. Without a way there are no rows and the cost is infinite.
        """
        # States of an earlier search serve again: what it wrote bears its stamp, so nothing has to be cleared. A thread
        # takes states off the list in one atomic step, so no two threads use the same ones.
        try:
            states, stamp = self._idle.pop()
        except IndexError:
            states, stamp = np.zeros(len(self.points) * self.need.count, search_kernels.STATE), 0
        road, cost = search_kernels.find_road(
            self.layers, self._radii, self.around, self._prices, self._graph, states, stamp + 1, ends
        )
        self._idle.append((states, stamp + 1))
        return road, float(cost)

    def polish(self, road: NDArray[np.int64], ends: NDArray[np.float64]) -> AnnotatedPath | None:
        """Return the cheapest taut path found along a road; None if `polish_road` finds none.

        ``road`` (k, 2) is of :meth:`find`, ``ends`` (2, 2) are start and goal [m].
        """
        line, found, cost = polishing_kernels.polish_road(
            self.layers,
            self.fitting,
            self.points,
            road,
            self.around,
            np.empty(len(self.around)),
            ends,
            self.need.search_radius,
            self._least,
        )
        return with_sections(line, found, float(cost)) if len(found) else None

    def excess(self, path: AnnotatedPath) -> list[float]:
        """Return the excess cost of each section.

        That is its length beyond the least one, times the cost per meter of its behavior less the preferred one's.
        """
        return [self._more[s.behavior] * max(s.end - s.start - self._shortest, 0.0) for s in path.sections]

    def shifted(self, path: AnnotatedPath) -> AnnotatedPath:
        """Return the path with stations, points sampled closely along it, shifted aside if that is cheaper.

        It is unchanged if narrow sections cost little beyond their least lengths (:data:`_WORTH`), or if no shift makes
        it cheaper.
        """
        if math.fsum(self.excess(path)) <= _WORTH * path.cost:
            return path
        sections = np.array(path.sections)
        line, found, cost = polishing_kernels.shift_path(
            self.layers, self.fitting, path.points, sections, path.cost, self._radii, self._least
        )
        return with_sections(line, found, float(cost)) if cost < path.cost else path
