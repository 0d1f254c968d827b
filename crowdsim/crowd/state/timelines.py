"""Arguments of the kernels that reserve timelines: chains of nodes, timelines of all rows, obstacles."""

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
"""Array of float64."""

SLOWEST, FASTEST = 0.6, 1.15
"""Slowest and fastest rate at which nodes are played, as shares of the captured (natural) rate."""

RAMP = 1
"""Largest change of the rate in a second, as a share of the natural rate."""

_NO_WAYS = np.empty((0, 2, 2))


def slot_of(step: int, step_frames: int) -> int:
    """Return the slot of timelines in which a step of ``step_frames`` frames begins."""
    return step * step_frames // SLOT_FRAMES


class Chain(NamedTuple):
    """Consecutive nodes, with room for more."""

    nodes: NDArray[np.int32]
    """(C,) nodes of the motion graph."""
    origins: Floats
    """(C, 3) track pose at which each starts: x, y [m], heading [rad]."""
    blend_offsets: Floats
    """(C, 3) blend offset: pose at the end of the node before less the origin, which fades out along the node."""

    @classmethod
    def empty(cls, count: int) -> Chain:
        """Allocate a chain of ``count`` nodes."""
        return cls(np.zeros(count, np.int32), np.zeros((count, 3)), np.zeros((count, 3)))


class Playback(NamedTuple):
    """Time and rate at which a chain is played from now on; see :mod:`crowdsim.motion.graph.playback_kernels`."""

    clock: int
    """Frames of the world's clock until now."""
    slot_frames: int
    """Frames between two samples of a timeline."""
    step_frames: int
    """Frames of a step."""
    ramp: int
    """Largest change of the rate in a step [ticks/step]."""
    part: int
    """Part of the present frame that is played already [ticks]."""
    rate: int
    """Rate of the last step [ticks/step]."""
    wanted: int
    """Rate that is approached [ticks/step]."""

    @classmethod
    def natural(cls, step: int, step_frames: int) -> Playback:
        """Return the playback at the captured rate from ``step`` on, for steps of ``step_frames`` frames."""
        rate = FRAME_TICKS * step_frames
        # A step lasts step_frames / CAPTURE_RATE seconds. At least 1: with a ramp of 0, no rate could ever change.
        ramp = max(RAMP * rate * step_frames // CAPTURE_RATE, 1)
        return cls(step * step_frames, SLOT_FRAMES, step_frames, ramp, 0, rate, rate)


class Timelines(NamedTuple):
    """Reserved timelines of all N rows."""

    timeline: Floats
    """(N, K, SAMPLE) tracks and bodies at the slots: see :data:`crowdsim.crowd.state.components.SAMPLE`."""
    timeline_start: NDArray[np.int64]
    """(N,) slot of the first sample."""
    gone_slot: NDArray[np.int64]
    """(N,) slot from which on the row has left the world; the largest int64 (FOREVER) if it never leaves."""
    body_radius: Floats
    """(N,) radius of a disc that contains the body in any behavior [m]."""
    timeline_circle: Floats
    """(N, 3) x, y and radius of a circle that contains all positions of a timeline [m], for a quick rejection."""
    near: Neighbors
    """The rows, sorted by cells."""

    @classmethod
    def of(cls, view: View, near: Neighbors) -> Timelines:
        """Return the timelines of a view."""
        return cls(view.timeline, view.timeline_start, view.gone_slot, view.body_radius, view.timeline_circle, near)


class StandingBodies(NamedTuple):
    """Bodies of steered agents at their present places, sorted by cells.

    Timelines keep clear of these places for their whole duration, as any steered agent may stay in its place.
    """

    rows: NDArray[Any]
    """(n,) records ROW of :mod:`crowdsim.steering.row_kernels`."""
    starts: NDArray[np.int64]
    """(cells + 1,) index in ``rows`` at which each cell begins."""
    frame: tuple[float, float, int, int]
    """Grid: left and bottom edge [m], columns, rows."""
    broadest: float
    """Largest half breadth [m]."""


NO_BODIES = StandingBodies(np.zeros(0, ROW), np.zeros(2, np.int64), (0.0, 0.0, 1, 1), 0.0)
"""No steered agents."""


class Obstacles(NamedTuple):
    """What a body must keep clear of besides the timelines of others."""

    layers: NDArray[np.int64]
    """(m, 5, 2) addresses of the meshes of all layers, legs first: see
    :func:`crowdsim.navmesh.mesh.address_kernels.layers_of`."""
    radii: Floats
    """(B, layers) clearance that each behavior needs on each layer [m]."""
    breadths: Floats
    """(B, 2) body towards others in each behavior: radius of its capsule, and half length of its core, which lies
    across the direction that the body faces [m]."""
    kept_free: Floats
    """(M, 4) outlines of movables about to appear: segments, x and y of both ends [m]."""
    distance: float
    """Distance that the track keeps from these segments [m]."""
    bodies: StandingBodies
    """Bodies of steered agents."""
    agent: int
    """Number of the agent whose own body, if it is one of ``bodies``, does not count; NONE: all count."""
    body_radius: float
    """Radius of a disc that contains the body in any behavior [m]."""
    ways: Floats = _NO_WAYS
    """(W, P, 2) ways ahead of agents that go first [m]: the body may cross them, but not stop there; see
    `stops_in_way`."""
    way_width: float = 0.0
    """Distance from these ways at which an agent may stop [m]."""
    passages: Floats = np.empty((0, 4))
    """(S, 4) segments across narrow passages, x, y of both ends [m]: an agent stops there only if its plan offers no
    place before or behind them."""
    off_passages: float = 0.0
    """Distance from these segments at which an agent may stop [m]."""
