"""What follows a path: motions, and the body that makes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior, facings_of
from crowdsim.following.follower.body_reach import BodyReach
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Character:
    """Motions and body of a character that follows paths, with B behaviors.

    Attributes
    ----------
    graph : GraphArrays
        Motion graph.
    maps : MotionMaps
        Motion maps of that graph.
    radii : (B, layers) float64
        Radius of the body in each behavior on each layer [m].
    facings : (B, F) float64
        Angles off the direction of motion at which the body may face in each behavior [rad], padded with nan.
    reach : BodyReach or None
        Positions of the body's joints, to keep each of them in its section; None to test only the discs.

    Examples
    --------
    >>> motion = load_behavior_set(["lateral", "frontal"], [(0.0, 2.0)])
    >>> Character.of(motion.behaviors, motion.graph.arrays, MotionMaps.build(motion.graph.arrays)).radii.shape
    (2, 1)
    """

    graph: GraphArrays
    maps: MotionMaps
    radii: Floats
    facings: Floats
    reach: BodyReach | None = None

    @cached_property
    def behaviors(self) -> int:
        """Return the number of behaviors that the graph needs: one more than the largest behavior of a node."""
        return int(self.graph.node_behavior.max(initial=0)) + 1

    @cached_property
    def turned(self) -> tuple[int, ...]:
        """Return the numbers of the behaviors whose facings are all more than 45 degrees off their motion."""
        turned = ~(np.abs(self.facings) <= np.pi / 4.0).any(axis=1)
        return tuple(np.flatnonzero(turned).tolist())

    @classmethod
    def of(cls, behaviors: Sequence[Behavior], graph: GraphArrays, maps: MotionMaps) -> Character:
        """Return the character that walks with ``behaviors``, tested by its discs only (``reach`` is None).

        Parameters
        ----------
        behaviors : sequence of Behavior
            What it can do, in the order of the graph's numbers.
        graph : GraphArrays
            Its motion graph.
        maps : MotionMaps
            The motion maps of the graph.

        Returns
        -------
        Character
            The character.
        """
        radii = np.ascontiguousarray([behavior.radii for behavior in behaviors], np.float64)
        return cls(graph, maps, radii, facings_of(behaviors))
