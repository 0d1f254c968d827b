"""The header of a recording: the scenario, the environment, the agents, and the motions they play."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.geometry.planar import shorter_ways
from crowdsim.motion.clips.skeleton import Skeleton

FORMAT_NAME = "crowdsim-recording"
FORMAT_VERSION = 3
"""1: captured agents. 2: also steered agents: the column ``phase`` and gaits; columns without information are left out.
3: ``frame`` may lie between two frames; the position of absent agents is nan.

Readers refuse files of a higher version. Raise it when a field changes its meaning or is removed.
"""


class AgentState(IntEnum):
    """State of an agent in one step.

    If it is ABSENT, x, y, heading and phase are nan and other columns mean nothing.
    """

    ABSENT = 0
    MOVING = 1
    WAITING = 2
    ARRIVED = 3


@dataclass(frozen=True)
class LayerRecord:
    """A clearance layer; solids between ``low`` and ``high`` [m] above the floor block it."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class BehaviorRecord:
    """A behavior: its color ``#rrggbb`` and its body radius on each layer [m]."""

    name: str
    color: str
    radii: tuple[float, ...]


@dataclass(frozen=True)
class SolidRecord:
    """A prism: footprint as WKT (POLYGON or MULTIPOLYGON), from ``bottom`` to ``top`` [m]."""

    name: str
    footprint: str
    bottom: float
    top: float


@dataclass(frozen=True)
class MeshRecord:
    """An obstacle of triangles.

    Attributes
    ----------
    name : str
        Name of the obstacle.
    points : (V, 3) float32
        Vertices [m].
    triangles : (T, 3) int32
        Indices of vertices, counter-clockwise seen from outside.
    """

    name: str
    points: NDArray[np.float32]
    triangles: NDArray[np.int32]


@dataclass(frozen=True)
class ShapeRecord:
    """A named area (POLYGON) or line (LINESTRING) of the scenario, as WKT, measured from ``start`` to ``end`` [s]."""

    name: str
    shape: str
    start: float = 0.0
    end: float = math.inf


@dataclass(frozen=True)
class AgentsRecord:
    """The N agents of a run; their number never changes.

    Attributes
    ----------
    groups : N str
        Name of each agent's group.
    start_times : (N,) float64
        Start times [s], NaN for agents on call.
    starts : (N, 3) float64
        x, y [m], heading [rad] at the start.
    goals : (N, 2) float64
        First goal of each agent [m].
    radii : (N,) float64
        Planned radius of the body on its narrowest layer [m].
    attributes : mapping of str to (N,) array
        float64 with nan for agents without the attribute, or str with empty text for them.
    routes : (m, 2) float64
        Goals of all agents in turn, agent after agent [m]; empty in older files.
    route_ends : (N,) int64
        End of each agent's goals in ``routes``; empty in older files.
    """

    groups: Sequence[str]
    start_times: NDArray[np.float64]
    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    radii: NDArray[np.float64]
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    routes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    route_ends: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    @property
    def count(self) -> int:
        """Return the number of agents."""
        return len(self.groups)


@dataclass(frozen=True)
class GaitRecord:
    """The captured clip that steered agents of one behavior are posed from; it is deformed at playback.

    Attributes
    ----------
    name : str
        Name of the clip.
    root : (F, 3) float32
        Positions of the root joint in the world [m]; F frames at CAPTURE_RATE.
    rotations : (F, J, 4) float32
        Quaternions (w, x, y, z) of J joints, each relative to its parent, the root to the world.
    """

    name: str
    root: NDArray[np.float32]
    rotations: NDArray[np.float32]


@dataclass(frozen=True)
class MotionRecord:
    """Everything that turns (node, frame, track pose), or (behavior, track, phase), into a posed body.

    Attributes
    ----------
    skeleton : Skeleton
        Skeleton of all agents.
    node_names : sequence of str
        Names of the motion graph's nodes. Without nodes, no agent is captured.
    node_behavior : (nodes,) int32
        Behavior of each node, an index into the header's behaviors.
    node_first, node_frames : (nodes,) int32
        Node n has rows ``node_first[n]`` to ``node_first[n] + node_frames[n]`` of the pool, both included.
    pool_root : (P, 3) float32
        Root positions relative to the track pose [m].
    pool_rotations : (P, J, 4) float32
        Quaternions (w, x, y, z), each joint relative to its parent, the root to the track's heading.
    gaits : sequence of GaitRecord
        One clip per behavior, in their order. Without gaits, no agent is steered.
    pool_phases : (P,) float32
        Gait phase of each row of the pool [cycles], from :func:`~crowdsim.behaviors.entries.node_phases`; empty unless
        there are both nodes and gaits.
    pool_tracks : (P, 3) float32
        Track pose of each row relative to the first row of its node [m], [rad]; empty in older files, whose planted
        feet are not kept in place at playback.
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
    pool_tracks: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))

    @property
    def mixed(self) -> bool:
        """Return whether agents may switch between captured and steered."""
        return len(self.node_names) > 0 and len(self.gaits) > 0


class Ends(NamedTuple):
    """The ends of a periodic floor along ``axis``, 0 for x and 1 for y: ``high`` is the same place as ``low`` [m]."""

    axis: int
    low: float
    high: float

    def shorter(self, ways: NDArray[Any]) -> NDArray[Any]:
        """Return displacements along the axis, taken across the ends if that is shorter [m]."""
        return shorter_ways(ways, self.high - self.low)

    def inside(self, places: NDArray[Any]) -> NDArray[Any]:
        """Return coordinates along the axis, wrapped into the range from ``low`` to ``high`` [m]."""
        span = self.high - self.low
        return np.asarray(places - np.floor((places - self.low) / span) * span)


@dataclass(frozen=True)
class RecordingHeader:
    """Everything that does not change from step to step.

    Attributes
    ----------
    scenario_name, scenario_text : str
        Name and source text of the scenario.
    seed : int
        Seed of the run.
    steps_per_second : int
        Steps per second [1/s].
    behaviors : sequence of BehaviorRecord
        Behaviors, narrowest first.
    layers : sequence of LayerRecord
        Clearance layers, the ground layer first.
    floor : str
        Outline of the whole floor, as WKT.
    solids, meshes : sequences of SolidRecord, MeshRecord
        Obstacles that are always present.
    agents : AgentsRecord
        The agents.
    motion : MotionRecord
        Skeleton and poses.
    movables : sequence of SolidRecord
        Things that appear, move or disappear, as drawn in the scenario; see :class:`MovableChange`.
    ends : Ends or None
        Ends of a periodic floor: an agent that leaves at one end is at the other end in the same step.
    walkable : sequence of str
        Free floor of each layer between the obstacles that are always present, as WKT; empty in older files.
    areas, lines : sequences of ShapeRecord
        Areas and lines at which the run was measured.
    scenario_keys : str
        Text of a scenario file with overrides applied; its file names are relative to the folder of the recording.
        Empty in older files.
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
    walkable: Sequence[str] = ()
    areas: Sequence[ShapeRecord] = ()
    lines: Sequence[ShapeRecord] = ()
    scenario_keys: str = ""

    @property
    def spans(self) -> NDArray[np.float64]:
        """Return the lengths (2,) of a periodic floor along x and y [m], 0 without ends."""
        spans = np.zeros(2)
        if self.ends is not None:
            spans[self.ends.axis] = self.ends.high - self.ends.low
        return spans


class RecordedFrame(NamedTuple):
    """One step of all N agents, each field (N,).

    Attributes
    ----------
    x, y, heading
        Track pose [m], [rad].
    node
        Node of the motion graph that a captured agent plays; NONE for other agents.
    previous
        Node that ended before; NONE if there was none.
    frame
        Frame of the node, counted from its first row; a fraction lies between two frames.
    behavior
        Index into the header's behaviors; -1 for none.
    state
        An :class:`AgentState`.
    phase
        Gait cycles of a steered agent, never decreasing; nan for agents that are not steered.
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
        """Return (N,) whether each agent is steered in this step; the others are captured or absent."""
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
"""dtype of ``frame`` in files of versions 1 and 2, which have no fractions."""

LEFT_OUT = {"node": NONE, "previous": NONE, "frame": 0, "phase": np.nan}
"""Values of columns that are not stored because no agent can have any other."""


NOWHERE = frozenset({"x", "y", "heading", "phase"})
"""Columns that are nan while an agent is absent, so that it is not mistaken for an agent at the origin."""


def stored_columns(motion: MotionRecord) -> tuple[str, ...]:
    """Return the names of the columns that a file stores.

    ``node``, ``previous`` and ``frame`` are left out if there are no nodes, ``phase`` if there are no gaits.
    """
    left_out = set() if len(motion.node_names) else {"node", "previous", "frame"}
    if not motion.gaits:
        left_out.add("phase")
    return tuple(name for name in COLUMN_TYPES if name not in left_out)


@dataclass(frozen=True)
class PlannedPath:
    """A path that ``agent`` follows from ``step`` on.

    Attributes
    ----------
    points : (P, 2) float64
        Points of the path [m].
    behaviors : (P,) int8
        Behavior from point i to point i + 1, an index into the header's behaviors; the last one has no effect.
    """

    agent: int
    step: int
    points: NDArray[np.float64]
    behaviors: NDArray[np.int8]


@dataclass(frozen=True)
class MovableChange:
    """From ``step`` on, a movable (index in the header) has the outline ``footprint`` (WKT); it is absent if None."""

    movable: int
    step: int
    footprint: str | None
