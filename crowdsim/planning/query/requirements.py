"""The clearances that a set of behaviors asks of the layers, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.errors import BehaviorError
from crowdsim.planning.labels.fitting_kernels import Fitting

CONTACT_TOLERANCE = 8e-6
"""Meters a path may come closer than planned: it touches corners at exactly its clearance."""


@dataclass(frozen=True)
class Requirements:
    """n behaviors on m layers, narrowest behavior first, the searched layer (the legs') first.

    radii: (n, m) float64, planned clearance; on the searched layer all equal to the largest of the behaviors',
    on the others at least that of narrower ones.
    bodies: (n, m), the bodies' own clearance. costs: (n,) float64 a meter. turned: (n,) bool.
    turning: (n, 2, m) float64, what a body reaches while it turns off its way, and back onto it; 0 where no clip does.
    """

    radii: NDArray[np.float64]
    bodies: NDArray[np.float64]
    costs: NDArray[np.float64]
    turned: NDArray[np.bool_]
    turning: NDArray[np.float64]

    @staticmethod
    def of(behaviors: Sequence[Behavior], layers: int, margin: float) -> Requirements:
        """Planned clearances; BehaviorError where behaviors and layers do not go together."""
        if not behaviors:
            raise BehaviorError("a plan needs at least one behavior")
        for behavior in behaviors:
            if behavior.radii.shape != (layers,):
                raise BehaviorError(
                    f"behavior '{behavior.name}' was measured on {len(behavior.radii)} layers, the scene has {layers}"
                )
            if behavior.turning is not None and behavior.turning.shape != (2, layers):
                raise BehaviorError(
                    f"behavior '{behavior.name}' has turning of shape {behavior.turning.shape}, not (2, {layers}): "
                    "off the way and back onto it, on each layer of the scene"
                )
        bodies = np.array([behavior.radii for behavior in behaviors])
        radii = bodies + margin
        radii[:, 0] = radii[:, 0].max()
        # Wherever a behavior fits, all narrower ones count as fitting.
        radii = np.maximum.accumulate(radii, axis=0)
        return Requirements(
            radii=radii,
            bodies=bodies,
            costs=np.array([behavior.cost_per_meter for behavior in behaviors]),
            turned=np.array([behavior.turned for behavior in behaviors]),
            turning=np.array(
                [np.zeros((2, layers)) if behavior.turning is None else behavior.turning for behavior in behaviors]
            ),
        )

    def fitting(self, layers: NDArray[np.int64], terms: NDArray[np.float64]) -> Fitting:
        """What kernels of sections are given; ``layers`` as of `layers_of`."""
        first = min(1, len(layers) - 1)  # the legs' layer asks all behaviors for the same
        radii = np.ascontiguousarray(self.radii[:, first:] - CONTACT_TOLERANCE)
        return Fitting(layers[first:], radii, self.costs, self.turned, terms)

    @property
    def count(self) -> int:
        return len(self.costs)

    @cached_property
    def narrowest_upright(self) -> NDArray[np.float64] | None:
        """Clearances (m,) of the narrowest behavior that is not turned; None where all are."""
        upright = np.flatnonzero(~self.turned)
        return self.radii[upright[0]] if len(upright) else None

    @property
    def search_radius(self) -> float:
        """Clearance of the legs, the least that a path must keep from everything."""
        return float(self.radii[0, 0])
