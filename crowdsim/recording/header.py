"""What a recording says once: the scenario, the place, the agents and the motions they play."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.motion.clips.skeleton import Skeleton

FORMAT_NAME = "crowdsim-recording"
FORMAT_VERSION = 3
"""1: captured agents. 2: steered agents, too: the column ``phase`` and gaits; columns that nobody needs are left out.
3: ``frame`` may lie between two frames; the place of who is absent is nan.

Readers refuse files of a higher version; raise it when a field changes its meaning or goes away."""


class AgentState(IntEnum):
    """What an agent does in one step. Absent agents are nowhere: x, y, heading and phase are nan, other columns mean
    nothing."""

    ABSENT = 0
    MOVING = 1
    WAITING = 2
    ARRIVED = 3


@dataclass(frozen=True)
class LayerRecord:
    """A clearance layer: solids between ``low`` and ``high`` meters above the floor block it."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class BehaviorRecord:
    """A behavior: its color ``#rrggbb`` and its body radius in meters on each layer."""

    name: str
    color: str
    radii: tuple[float, ...]


@dataclass(frozen=True)
class SolidRecord:
    """An obstacle: its footprint as WKT (POLYGON or MULTIPOLYGON) from ``bottom`` to ``top`` meters."""

    name: str
    footprint: str
    bottom: float
    top: float


@dataclass(frozen=True)
class MeshRecord:
    """An obstacle of triangles: points (V, 3) float32, meters, and their indices (T, 3) int32, outside to the left."""

    name: str
    points: NDArray[np.float32]
    triangles: NDArray[np.int32]


@dataclass(frozen=True)
class AgentsRecord:
    """The N agents of a run, which stay the same from its first step to its last.

    groups: N group names. start_times: (N,) seconds. starts: (N, 3) x, y, heading. goals: (N, 2).
    radii: (N,) meters, the planned radius of the body on its narrowest layer. attributes: by name, (N,) float64 with
    nan for agents without it, or (N,) texts that are empty for them.
    """

    groups: Sequence[str]
    start_times: NDArray[np.float64]
    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    radii: NDArray[np.float64]
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        return len(self.groups)


@dataclass(frozen=True)
class GaitRecord:
    """The clip that steered agents of one behavior are posed from, as it was captured: what is deformed at playback.

    root: (F, 3) float32, places of the root joint in the world [m]. rotations: (F, J, 4) float32 (w, x, y, z), each
    joint relative to its parent, the root to the world; F frames at CAPTURE_RATE.
    """

    name: str
    root: NDArray[np.float32]
    rotations: NDArray[np.float32]


@dataclass(frozen=True)
class MotionRecord:
    """All that turns (node, frame, track pose), or (behavior, track, phase), into the joints of a body.

    Node n holds rows ``node_first[n]`` to ``node_first[n] + node_frames[n]`` of the pool, poses relative to the track:
    pool_root (P, 3) float32 is the root's place, pool_rotations (P, J, 4) float32 are (w, x, y, z), each joint relative
    to its parent and the root relative to the track's heading.
    node_behavior: (nodes,) int32, index into the header's behaviors. Without nodes, no agent is captured.
    gaits: a clip for each behavior of the header, in its order. Without gaits, no agent is steered.
    pool_phases: (P,) float32, phase of the gait in each row of the pool [cycles], as of
    :func:`~crowdsim.behaviors.entries.node_phases`; empty unless there are both nodes and gaits.
    """

    skeleton: Skeleton
    node_names: Sequence[str]
    node_behavior: NDArray[np.int32]
    node_first: NDArray[np.int32]
    node_frames: NDArray[np.int32]
    pool_root: NDArray[np.float32]
    pool_rotations: NDArray[np.float32]
    gaits: Sequence[GaitRecord] = ()
    pool_phases: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))

    @property
    def mixed(self) -> bool:
        """Whether agents may be captured and steered in turn."""
        return len(self.node_names) > 0 and len(self.gaits) > 0


class Ends(NamedTuple):
    """Where a floor without ends begins again along an ``axis``, 0 for x and 1 for y: ``high`` is ``low`` [m]."""

    axis: int
    low: float
    high: float

    def shorter(self, ways: NDArray[Any]) -> NDArray[Any]:
        """Ways along the axis from one place to another as they are, or across the ends where that is shorter [m]."""
        span = self.high - self.low
        return np.asarray(ways - np.rint(ways / span) * span)

    def inside(self, places: NDArray[Any]) -> NDArray[Any]:
        """Places along the axis from the low end to the high one [m]."""
        span = self.high - self.low
        return np.asarray(places - np.floor((places - self.low) / span) * span)


@dataclass(frozen=True)
class RecordingHeader:
    """Everything but the steps; ``floor`` is the walkable outline as WKT.

    solids, meshes: what stands all the time. movables: what comes, moves or goes, as it is drawn in the scenario;
    where it is when, :class:`MovableChange` says. ends: of a periodic floor; who leaves it there comes in at the other
    end in the same step.
    """

    scenario_name: str
    scenario_text: str
    seed: int
    steps_per_second: int
    behaviors: Sequence[BehaviorRecord]
    layers: Sequence[LayerRecord]
    floor: str
    solids: Sequence[SolidRecord]
    agents: AgentsRecord
    motion: MotionRecord
    movables: Sequence[SolidRecord] = ()
    meshes: Sequence[MeshRecord] = ()
    ends: Ends | None = None


class RecordedFrame(NamedTuple):
    """One step of all N agents, each field (N,).

    x, y (meters) and heading (radians) are the track's pose; ``node`` is played since ``previous`` ended (-1 for none)
    and ``frame`` of it is shown, or what is between two frames; ``behavior`` indexes the header's behaviors; ``state``
    holds :class:`AgentState`.
    ``phase`` counts the cycles of a steered agent's gait and never decreases; nan for agents that are not steered.
    """

    x: NDArray[Any]
    y: NDArray[Any]
    heading: NDArray[Any]
    node: NDArray[Any]
    previous: NDArray[Any]
    frame: NDArray[Any]
    behavior: NDArray[Any]
    state: NDArray[Any]
    phase: NDArray[Any]

    @property
    def steered(self) -> NDArray[np.bool_]:
        """(N,) whether each agent is steered in this step; the others are captured, or absent."""
        steered: NDArray[np.bool_] = np.isfinite(self.phase) & (np.asarray(self.state) != AgentState.ABSENT)
        return steered


COLUMN_TYPES: dict[str, str] = {
    "x": "float32",
    "y": "float32",
    "heading": "float32",
    "node": "int32",
    "previous": "int32",
    "frame": "float32",
    "behavior": "int8",
    "state": "int8",
    "phase": "float32",
}
"""dtype of each field of :class:`RecordedFrame` in the file."""

WHOLE_FRAMES = "int16"
"""dtype of ``frame`` in files of version 2."""

LEFT_OUT = {"node": NONE, "previous": NONE, "frame": 0, "phase": np.nan}
"""What columns hold where no agent can have anything else; such columns are not stored."""


NOWHERE = frozenset({"x", "y", "heading", "phase"})
"""Columns that are nan for agents who are absent, so that nobody takes them for standing at the origin."""


def stored_columns(motion: MotionRecord) -> tuple[str, ...]:
    """Columns that a file stores: those of captured agents if there are nodes, ``phase`` if there are gaits."""
    left_out = set() if len(motion.node_names) else {"node", "previous", "frame"}
    if not motion.gaits:
        left_out.add("phase")
    return tuple(name for name in COLUMN_TYPES if name not in left_out)


@dataclass(frozen=True)
class PlannedPath:
    """A path that ``agent`` follows from ``step`` on; ``behaviors[i]`` holds from point i to the next.

    points: (P, 2) float64 meters. behaviors: (P,) int8, indices into the header's behaviors.
    """

    agent: int
    step: int
    points: NDArray[np.float64]
    behaviors: NDArray[np.int8]


@dataclass(frozen=True)
class MovableChange:
    """From ``step`` on a movable (index in the header) has the outline ``footprint`` (WKT), or is not there (None)."""

    movable: int
    step: int
    footprint: str | None
