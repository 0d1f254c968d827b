"""One query to a planner: start and goal, layers and behaviors."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.labels.fitting_kernels import Fitting, annotate
from crowdsim.planning.query.behavior_areas import BehaviorArea
from crowdsim.planning.query.requirements import Requirements

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh


class Query(NamedTuple):
    """Input of one plan.

    meshes: one per layer, the legs' first. need: clearances and costs of the behaviors. areas: behavior areas, widest
    first. ends: (2, 2) start and goal [m]. terms: (4,) as :data:`crowdsim.planning.labels.labelling_kernels.TERMS`.
    """

    meshes: tuple[NavMesh, ...]
    need: Requirements
    areas: tuple[BehaviorArea, ...]
    ends: NDArray[np.float64]
    terms: NDArray[np.float64]

    def annotated(self, points: NDArray[np.float64]) -> AnnotatedPath:
        """Return the path along ``points`` (n, 2) with its cheapest sections (2018 paper, algorithm 2).

        No sections and infinite cost if some place fits no behavior.
        """
        found, cost, _ = annotate(self.fitting(), points)
        return with_sections(points, found, cost)

    def fitting(self) -> Fitting:
        """Return the input of the labelling kernels."""
        tolerance = self.meshes[0].tolerance(self.need.radii)
        return self.need.fitting(layers_of(self.meshes), self.terms, tolerance)


def with_sections(points: NDArray[np.float64], found: NDArray[np.float64], cost: float) -> AnnotatedPath:
    """Return the path along ``points`` (n, 2) with sections (k, 3), as of `annotate`."""
    return AnnotatedPath(points, arc_lengths(points), as_sections(found), float(cost))


def as_sections(found: NDArray[np.float64]) -> tuple[Section, ...]:
    """Return sections from the rows (behavior, start, end) of a kernel's array (k, 3)."""
    return tuple([Section(int(label), start, end) for label, start, end in found.tolist()])
