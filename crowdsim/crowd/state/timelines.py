"""What reservations read and write, as kernels take it: chains of nodes, everyone's timelines, obstacles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.ecs.world import View
from crowdsim.steering.row_kernels import ROW

Floats = NDArray[np.float64]


class Chain(NamedTuple):
    """Nodes one after the other, with room for more: where each starts, and the blend offset that fades from there."""

    nodes: NDArray[np.int32]
    """(C,)"""
    origins: Floats
    """(C, 3)"""
    blend_offsets: Floats
    """(C, 3)"""

    @classmethod
    def room(cls, count: int) -> Chain:
        return cls(np.zeros(count, np.int32), np.zeros((count, 3)), np.zeros((count, 3)))


class Timelines(NamedTuple):
    """The reserved timelines of all N rows."""

    timeline: Floats
    """(N, K, 2) track positions at the slots."""
    timeline_start: NDArray[np.int64]
    """(N,) slot of the first of them."""
    gone_slot: NDArray[np.int64]
    """(N,) slot from which on the row is gone."""
    body_radius: Floats
    """(N,) meters."""
    timeline_circle: Floats
    """(N, 3) x, y and radius of a circle that holds all of a row's timeline, so that most are soon dismissed."""

    @classmethod
    def of(cls, view: View) -> Timelines:
        return cls(*(getattr(view, name) for name in cls._fields))


class StandingBodies(NamedTuple):
    """Bodies of steered characters, sorted by cells: where they stand now they may stay."""

    rows: NDArray[Any]
    """ROW[n]."""
    starts: NDArray[np.int64]
    """Where cells begin in the rows."""
    frame: tuple[float, float, int, int]
    """Left and bottom of the cells [m], columns and rows of them."""
    broadest: float
    """Largest half breadth of them all [m]."""


NO_BODIES = StandingBodies(np.zeros(0, ROW), np.zeros(2, np.int64), (0.0, 0.0, 1, 1), 0.0)


class Obstacles(NamedTuple):
    """What a body keeps clear of beside others."""

    layers: tuple[Any, ...]
    """Kernel arrays of the mesh of each layer."""
    radii: Floats
    """(B, layers) meters, the radius of the body in each behavior."""
    kept_free: Floats
    """(M, 4) segments, x and y of both ends, of what is about to come."""
    distance: float
    """Meters that the track stays away from these."""
    bodies: StandingBodies
    """Of steered characters."""
    agent: int
    """Whose own body among these does not count."""
    body_radius: float
    """Meters, of the disc that others keep clear of."""
