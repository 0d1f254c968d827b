"""What reservations read and write, as kernels take it: chains of nodes, everyone's timelines, obstacles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.state.components import SLOT_FRAMES
from crowdsim.ecs.world import View
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.steering.row_kernels import ROW

Floats = NDArray[np.float64]

SLOWEST, FASTEST = 0.6, 1.15
"""Rates between which nodes are played, as shares of the natural one."""

RAMP = 1
"""Change of the rate at which nodes are played in a second, in natural rates."""

_NO_WAYS = np.empty((0, 2, 2))


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


class Playback(NamedTuple):
    """When and how fast a chain is played from now on; see :mod:`crowdsim.motion.graph.playback_kernels`."""

    clock: int
    """Frames of the world's clock until now."""
    slot_frames: int
    """Frames between two samples of a timeline."""
    step_frames: int
    """Frames of a step."""
    ramp: int
    """Ticks by which the rate changes in a step at most."""
    part: int
    """Ticks of a frame that are played already."""
    rate: int
    """Ticks in the step before."""
    wanted: int
    """Ticks a step that it goes over to."""

    @classmethod
    def natural(cls, step: int, step_frames: int) -> Playback:
        """As captured, from ``step`` on."""
        rate = FRAME_TICKS * step_frames
        ramp = max(RAMP * rate * step_frames // CAPTURE_RATE, 1)
        return cls(step * step_frames, SLOT_FRAMES, step_frames, ramp, 0, rate, rate)


class Timelines(NamedTuple):
    """The reserved timelines of all N rows."""

    timeline: Floats
    """(N, K, 5) tracks and bodies at the slots: see :data:`crowdsim.crowd.state.components.SAMPLE`."""
    timeline_start: NDArray[np.int64]
    """(N,) slot of the first of them."""
    gone_slot: NDArray[np.int64]
    """(N,) slot from which on the row is gone."""
    body_radius: Floats
    """(N,) meters, of a disc that holds the body whatever it does."""
    timeline_circle: Floats
    """(N, 3) x, y and radius of a circle that holds all tracks of a timeline, so that most are soon dismissed."""
    near: Neighbors
    """The rows by cells."""

    @classmethod
    def of(cls, view: View, near: Neighbors) -> Timelines:
        return cls(view.timeline, view.timeline_start, view.gone_slot, view.body_radius, view.timeline_circle, near)


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
    breadths: Floats
    """(B, 2) meters, the body towards others in each behavior: radius of its capsule and half the length of its core,
    which lies across the direction that the body faces."""
    kept_free: Floats
    """(M, 4) segments, x and y of both ends, of what is about to come."""
    distance: float
    """Meters that the track stays away from these."""
    bodies: StandingBodies
    """Of steered characters."""
    agent: int
    """Whose own body among these does not count."""
    body_radius: float
    """Meters, of the disc that holds the body whatever it does."""
    ways: Floats = _NO_WAYS
    """(W, P, 2) ways ahead of those who go first: nobody else stops there who is not there already."""
    way_width: float = 0.0
    """Meters from them where one may stop."""
    passages: Floats = np.empty((0, 4))
    """(S, 4) segments across narrow passages: nobody stops there who can stop before or behind."""
    off_passages: float = 0.0
    """Meters from them where one may stop."""
