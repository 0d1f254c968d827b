"""One question to a planner: where from and to, through which layers, with which behaviors."""

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
    """Layers, what the behaviors need, their areas from wide to narrow, start and goal (2, 2), terms of changes."""

    meshes: tuple[NavMesh, ...]
    need: Requirements
    areas: tuple[BehaviorArea, ...]
    ends: NDArray[np.float64]
    terms: NDArray[np.float64]

    def annotated(self, points: NDArray[np.float64]) -> AnnotatedPath:
        """Algorithm 2: the polyline (n, 2) with its cheapest sections; none and infinite cost where nothing fits."""
        found, cost, _ = annotate(self.fitting(), points)
        return with_sections(points, found, cost)

    def fitting(self) -> Fitting:
        """What kernels of sections are given."""
        return self.need.fitting(layers_of(self.meshes), self.terms)


def with_sections(points: NDArray[np.float64], found: NDArray[np.float64], cost: float) -> AnnotatedPath:
    """The path along ``points`` (n, 2) with sections (k, 3), as of `annotate`."""
    return AnnotatedPath(points, arc_lengths(points), as_sections(found), float(cost))


def as_sections(found: NDArray[np.float64]) -> tuple[Section, ...]:
    """Sections from an array (k, 3), as kernels have them."""
    return tuple([Section(int(label), start, end) for label, start, end in found.tolist()])
