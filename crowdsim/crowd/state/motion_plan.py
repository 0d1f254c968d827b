"""What is asked of a search for motion, and the chain of nodes that it comes to."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.state_hash import digest_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.scenario.schema.agents import STAND_WITHIN

Departure = tuple[int, NDArray[np.float64]]
"""The node behind which a motion begins, and the pose (3,) that started from."""


@dataclass(frozen=True)
class Request:
    """What a search starts from.

    position, goal: (2,) meters. stays: whether the motion must end standing. departure: the node behind which the
    motion begins and the pose (3,) that started from, or None before the character entered the world. route: the path
    it follows already, or None to plan one. around: (k, 3) poses of others who stand in the way and
    are to be passed; postures: (k,) the behavior that each stands in.
    heading: radians to face at the goal, None where any will do; within: meters from it to be reached, if that can be:
    both of those who stand there.
    """

    position: NDArray[np.float64]
    goal: NDArray[np.float64]
    stays: bool
    departure: Departure | None = None
    route: AnnotatedPath | None = None
    around: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    postures: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    heading: float | None = None
    within: float = STAND_WITHIN


@dataclass(frozen=True)
class MotionPlan:
    """A chain of P nodes.

    nodes: (P,) int32. origins: (P, 3) world poses where they start. blend_offsets: (P, 3), end of the node before minus
    origin. departure: the node before the first, and the pose (3,) it starts from. arrives: whether the chain reaches
    the goal of ``route``. passes: nodes at whose end earlier goals are reached, on the way.
    """

    route: AnnotatedPath
    departure_node: int
    departure: NDArray[np.float64]
    nodes: NDArray[np.int32]
    origins: NDArray[np.float64]
    blend_offsets: NDArray[np.float64]
    arrives: bool
    passes: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        return len(self.nodes)

    @property
    def digest(self) -> int:
        """64 bits that name the plan, for the state hash."""
        return digest_of(self.nodes.tobytes() + self.origins.tobytes())

    def until(self, last: int) -> MotionPlan:
        """The plan up to and with node ``last``."""
        if last == self.count - 1:
            return self
        end = last + 1
        return replace(
            self,
            nodes=self.nodes[:end],
            origins=self.origins[:end],
            blend_offsets=self.blend_offsets[:end],
            arrives=False,
            passes=tuple(p for p in self.passes if p <= last),
        )

    def joined(self, first: int, last: int, more: MotionPlan, reaches: bool) -> MotionPlan:
        """Nodes ``first`` to ``last``, then ``more``; ``reaches`` says that this plan's goal is on the way."""
        kept = slice(first, last + 1)
        passes = [p - first for p in self.passes if first <= p <= last]
        return replace(
            more,
            departure_node=self.departure_node,
            departure=self.departure,
            nodes=np.concatenate([self.nodes[kept], more.nodes]),
            origins=np.concatenate([self.origins[kept], more.origins]),
            blend_offsets=np.concatenate([self.blend_offsets[kept], more.blend_offsets]),
            passes=(*passes, *([last - first] if reaches else [])),
        )
