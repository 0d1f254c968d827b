"""The clearances that a set of behaviors needs on the layers, as arrays."""

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
"""Distance by which a path may be closer than planned [m]: it touches corners at exactly its clearance."""


@dataclass(frozen=True)
class Requirements:
    """Clearances and costs of n behaviors on m layers, narrowest behavior first, the legs' layer first.

    radii: (n, m) float64, planned clearance [m]. On the legs' layer all are equal to the largest of the behaviors'; on
    the others each is at least that of the narrower ones.
    bodies: (n, m) float64, clearance of the body, without margin [m]. costs: (n,) float64, cost per meter. turned: (n,)
    bool, True if the body faces away from its direction of motion.
    turning: (n, 2, m) float64, reach of a body that turns into the behavior and out of it [m]; 0 if no clip turns.
    widest: clip and frame that determine the least clearance on each layer, () if they are not known.
    """

    radii: NDArray[np.float64]
    bodies: NDArray[np.float64]
    costs: NDArray[np.float64]
    turned: NDArray[np.bool_]
    turning: NDArray[np.float64]
    widest: tuple[str, ...] = ()

    @staticmethod
    def of(behaviors: Sequence[Behavior], layers: int, margin: float) -> Requirements:
        """Collect clearances and costs of ``behaviors`` on a number of ``layers``, planned with ``margin`` [m].

        Raise BehaviorError if there is no behavior, or if one was measured on another number of layers.
        """
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
        # All behaviors need the same on the legs' layer, so that one search there serves all of them.
        radii[:, 0] = radii[:, 0].max()
        # Ascending radii: wherever a behavior fits, all narrower ones fit.
        radii = np.maximum.accumulate(radii, axis=0)
        return Requirements(
            radii=radii,
            bodies=bodies,
            costs=np.array([behavior.cost_per_meter for behavior in behaviors]),
            turned=np.array([behavior.turned for behavior in behaviors]),
            turning=np.array(
                [np.zeros((2, layers)) if behavior.turning is None else behavior.turning for behavior in behaviors]
            ),
            widest=_widest(behaviors, bodies),
        )

    def fitting(self, layers: NDArray[np.int64], terms: NDArray[np.float64], tolerance: NDArray[np.float64]) -> Fitting:
        """Return the input of the labelling kernels.

        layers: (m, 5, 2) as of `layers_of`. tolerance: (n, m) `NavMesh.tolerance` of the radii [m]. terms: (4,) as
        :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.
        """
        first = min(1, len(layers) - 1)  # all behaviors need the same clearance on the legs' layer
        # Paths are found with the tolerance of the mesh, the larger one in places of more than a hundred meters.
        radii = self.radii - np.maximum(tolerance, CONTACT_TOLERANCE)
        return Fitting(layers[first:], np.ascontiguousarray(radii[:, first:]), self.costs, self.turned, terms)

    @property
    def count(self) -> int:
        """Return the number of behaviors."""
        return len(self.costs)

    @cached_property
    def narrowest_upright(self) -> NDArray[np.float64] | None:
        """Return the clearances (m,) of the narrowest behavior that is not turned [m]; None if all are."""
        upright = np.flatnonzero(~self.turned)
        return self.radii[upright[0]] if len(upright) else None

    @property
    def search_radius(self) -> float:
        """Return the clearance of the legs [m], the least that a path keeps from every obstacle."""
        return float(self.radii[0, 0])


def _widest(behaviors: Sequence[Behavior], bodies: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the clip and frame that determine the least clearance on each layer, for messages.

    On the legs' layer they are of the behavior with the largest clearance there, on the others of the narrowest one; ()
    if they are not known of all behaviors. bodies: (n, m) clearance of the bodies, without margin [m].
    """
    if not all(behavior.widest for behavior in behaviors):
        return ()
    legs = behaviors[int(np.argmax(bodies[:, 0]))]
    return legs.widest[0], *behaviors[0].widest[1:]
