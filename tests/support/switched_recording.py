"""Recordings, without a simulation, of agents that switch between captured and steered with small mismatches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from crowdsim.behaviors.entries import Entries, entry_origins, find_entries, find_exits, node_phases
from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import NONE
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases, set_anchors
from crowdsim.motion.graph.track_kernels import next_origin, track_pose
from crowdsim.recording.header import (
    AgentState,
    BehaviorRecord,
    GaitRecord,
    LayerRecord,
    MotionRecord,
    RecordedFrame,
    RecordingHeader,
)
from tests.support.small_recording import small_header
from tests.support.steered_recording import write_frames

STEP, FRAMES = 0.1, 6


def mixed_motion(behaviors: BehaviorSet) -> MotionRecord:
    """Return a motion record of nodes with their phases, and a gait for each behavior."""
    graph = behaviors.graph
    gaits = tuple(
        GaitRecord(clip.name, clip.root_positions.astype(np.float32), clip.rotations.astype(np.float32))
        for clip in gait_clips(behaviors)
    )
    return MotionRecord(
        graph.skeleton,
        graph.node_names,
        graph.arrays.node_behavior,
        graph.poses.node_first,
        graph.poses.node_frames,
        graph.poses.pool_root,
        graph.poses.pool_rotations,
        gaits,
        node_phases(behaviors).astype(np.float32),
    )


def mixed_header(behaviors: BehaviorSet, agents: int) -> RecordingHeader:
    """Return a header of agents on both levels."""
    header = small_header(agents, 10)
    records = [BehaviorRecord(b.name, b.color, tuple(map(float, b.radii))) for b in behaviors.behaviors]
    layers = (LayerRecord("body", 0.0, 2.0),)
    return replace(header, layers=layers, behaviors=tuple(records), motion=mixed_motion(behaviors), solids=())


@dataclass
class Walk:
    """Description of an agent's walk.

    Attributes
    ----------
    segments : tuple of float
        Durations on each level in turn, captured first [s]. A captured one lasts until a frame that may be left.
    turn : float
        Turning rate [rad/s].
    phase_off : float
        Largest phase error of switches [cycles].
    seed : int
        Seed of random choices.
    stands : bool
        Whether the agent stands all the time.
    """

    segments: tuple[float, ...]
    turn: float = 0.0
    phase_off: float = 0.0
    seed: int = 0
    stands: bool = False


class Walker:
    """An agent that alternates between nodes and tracks."""

    def __init__(self, behaviors: BehaviorSet, entries: Entries, phases: np.ndarray, walk: Walk) -> None:
        self.graph, self.entries, self.phases, self.walk = behaviors.graph.arrays, entries, phases, walk
        self.random = np.random.default_rng(walk.seed)
        self.behavior = len(behaviors.behaviors) - 1
        self.idle = np.flatnonzero(self.graph.node_idle & (self.graph.node_behavior == self.behavior))
        self.walking = np.unique(entries.node[entries.first[-2] : entries.first[-1]])
        self.exits = find_exits(behaviors, entries, phases)
        self.pose = np.zeros(3)
        self.enter(int(self.random.integers(entries.first[-2], entries.first[-1])))
        self.velocity = np.array([float(entries.natural_speed[-1]), 0.0])

    def enter(self, row: int) -> None:
        """Enter a node at the entry ``row``."""
        entries = self.entries
        self.node, self.frame, self.previous = int(entries.node[row]), int(entries.frame[row]), NONE
        self.origin = entry_origins(entries, np.array([row]), self.pose[None])[0]
        self.offset = np.zeros(3)

    def stand(self) -> None:
        """Enter the idle node."""
        self.node, self.frame, self.previous = int(self.idle[0]), 0, NONE
        self.origin, self.offset = self.pose.copy(), np.zeros(3)

    def play(self) -> None:
        """Play the frames of one step."""
        graph = self.graph
        old = self.pose.copy()
        self.frame += FRAMES
        last = int(graph.node_frames[self.node])
        if self.frame >= last:
            self._follow(self.frame - last)
        self.pose = np.array(track_pose(graph, self.node, self.frame, *self.origin, *self.offset))
        self.velocity = (self.pose[:2] - old[:2]) / STEP

    def _follow(self, frame: int) -> None:
        graph = self.graph
        end = compose(self.origin, graph.node_motion[self.node])
        edges = np.arange(graph.edge_start[self.node], graph.edge_start[self.node + 1])
        if self.walk.stands:
            edges = edges[graph.edge_target[edges] == self.node]
        else:
            edges = edges[np.isin(graph.edge_target[edges], self.walking)]
        edge = int(self.random.choice(edges))
        wanted = self.walk.turn * graph.node_frames[graph.edge_target[edge]] / 60.0
        twist = float(np.clip(wanted, graph.edge_low[edge], graph.edge_high[edge]))
        self.origin = np.array(next_origin(graph, edge, twist, *end))
        self.offset = np.array([*(end - self.origin)[:2], wrap_angle(end[2] - self.origin[2])])
        self.previous, self.node, self.frame = self.node, int(graph.edge_target[edge]), frame

    def phase(self) -> float:
        """Return the gait phase of the current frame."""
        return float(self.phases[self.graph.node_track[self.node] + self.frame])

    def may_leave(self) -> bool:
        """Return whether the agent may become steered in the current frame."""
        return bool(self.exits[self.graph.node_track[self.node] + self.frame])

    def nearest_entry(self, phase: float) -> int:
        """Return the entry that fits best, with a phase error of up to that of the walk."""
        entries = self.entries
        rows = np.arange(entries.first[-2], entries.first[-1])
        miss = phase + self.walk.phase_off * self.random.choice([-1.0, 1.0])
        apart = np.abs(np.mod(entries.phase[rows] - miss + 0.5, 1.0) - 0.5)
        speed = np.abs(entries.speed[rows] - np.hypot(*self.velocity))
        return int(rows[np.argmin(apart + 0.1 * speed)])


def switched_frames(behaviors: BehaviorSet, walks: list[Walk]) -> list[RecordedFrame]:
    """Return frames of agents, one for each walk."""
    phases = node_phases(behaviors)
    entries = find_entries(behaviors, gait_clips(behaviors), phases)
    columns = [_columns(Walker(behaviors, entries, phases, walk)) for walk in walks]
    steps = min(len(rows) for rows in columns)
    table = np.array([rows[:steps] for rows in columns]).transpose(1, 2, 0)
    behavior = np.full(len(walks), len(behaviors.behaviors) - 1)
    moving = np.full(len(walks), AgentState.MOVING)
    return [
        RecordedFrame(x, 2.0 * np.arange(len(walks)) + y, h, *np.array([n, p, f]).astype(int), behavior, moving, phase)
        for x, y, h, n, p, f, phase in table
    ]


def _columns(walker: Walker) -> list[tuple[float, ...]]:
    """Return rows of x, y, heading, node, previous, frame, phase."""
    rows = []
    walk = walker.walk
    if walk.stands:
        walker.stand()
    for number, seconds in enumerate(walk.segments):
        steered = number % 2 == 1
        if steered:
            off = walk.phase_off * walker.random.choice([-1.0, 1.0])
            phase = np.array([STAND if walk.stands else walker.phase() + off])
            anchor = np.empty((1, 3))
            moving = walker.velocity[None] * (0.0 if walk.stands else 1.0)
            set_anchors(walker.pose[None], moving, np.array([0.0]), phase, anchor)
        elif number:
            if walk.stands:
                walker.stand()
            else:
                walker.enter(walker.nearest_entry(float(phase[0])))
        steps = round(seconds / STEP)
        if not steered:
            while steps > 0 or (number + 1 < len(walk.segments) and not walker.may_leave()):
                walker.play()
                rows.append((*walker.pose, walker.node, walker.previous, walker.frame, np.nan))
                steps -= 1
            continue
        for _ in range(steps):
            _steer(walker)
            moving = walker.velocity[None] * (0.0 if walk.stands else 1.0)
            advance_phases(walker.pose[None], moving, np.array([walk.turn]), STEP, phase, anchor)
            rows.append((*walker.pose, NONE, NONE, 0, phase[0]))
    return rows


def _steer(walker: Walker) -> None:
    """Advance by a step: gently to the natural speed and into the turn, straight ahead of the body."""
    if walker.walk.stands:
        return
    speed = np.hypot(*walker.velocity)
    speed += np.clip(walker.entries.natural_speed[-1] - speed, -0.05, 0.05)
    heading = walker.pose[2] + walker.walk.turn * STEP
    way = np.arctan2(walker.velocity[1], walker.velocity[0])
    way += 0.5 * float(wrap_angle(heading - way))
    walker.velocity = speed * np.array([np.cos(way), np.sin(way)])
    walker.pose = np.array([*(walker.pose[:2] + STEP * walker.velocity), heading])


def write_switched(path: Path, behaviors: BehaviorSet, walks: list[Walk]) -> Path:
    """Write a recording of walks."""
    return write_frames(path, mixed_header(behaviors, len(walks)), switched_frames(behaviors, walks))
