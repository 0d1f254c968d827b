"""Requests for a motion, and motion plans: the chains of nodes that searches return."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.state_hash import digest_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.scenario.schema.agents import STAND_WITHIN

Departure = tuple[int, NDArray[np.float64]]
"""The node behind which a motion begins, and the track pose (3,) at which that node started."""


@dataclass(frozen=True)
class Request:
    """Start and goal of a search for motion."""

    position: NDArray[np.float64]
    """(2,) start [m]."""
    goal: NDArray[np.float64]
    """(2,) goal [m]."""
    stays: bool
    """True if the motion must end standing."""
    departure: Departure | None = None
    """Node behind which the motion begins, and the pose at which it started; None before the agent has entered."""
    route: AnnotatedPath | None = None
    """Route that it follows already; None to plan one."""
    around: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    """(k, 3) poses [m, rad] of standing agents in the way, which the motion is to pass."""
    postures: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    """(k,) behavior in which each of them stands."""
    heading: float | None = None
    """Heading at the goal [rad], for an agent that stands there; None for any."""
    within: float = STAND_WITHIN
    """Distance to the goal at which a standing agent should come to rest [m]."""


@dataclass(frozen=True)
class MotionPlan:
    """A chain of P nodes along a route."""

    route: AnnotatedPath
    departure_node: int
    """Node before the first one."""
    departure: NDArray[np.float64]
    """(3,) track pose at which that node starts."""
    nodes: NDArray[np.int32]
    """(P,) int32 nodes of the motion graph."""
    origins: NDArray[np.float64]
    """(P, 3) track poses at which they start."""
    blend_offsets: NDArray[np.float64]
    """(P, 3) blend offset of each: pose at the end of the node before less its origin."""
    arrives: bool
    """True if the chain reaches the goal of ``route``."""
    passes: tuple[int, ...] = ()
    """Indices of nodes at whose end earlier goals are reached on the way."""

    @property
    def count(self) -> int:
        """Return the number of nodes."""
        return len(self.nodes)

    @property
    def digest(self) -> int:
        """Return 64 bits that identify the plan, for the state hash."""
        return digest_of(self.nodes.tobytes() + self.origins.tobytes())

    def until(self, last: int) -> MotionPlan:
        """Return the plan up to and including the node with index ``last``; a shortened plan does not arrive."""
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
        """Return a plan of nodes ``first`` to ``last`` of this one, and behind them those of ``more``.

        ``reaches``: the goal of this plan is reached at the end of node ``last``. ``more`` was found by a search from
        there, and passes no goals before its own; the route and ``arrives`` are those of ``more``. The departure stays
        that of this plan, also if ``first`` is not 0.
        """
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
