"""Recordings of steered agents without a simulation, from tracks or from a drill."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from shapely.geometry.base import BaseGeometry

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
from crowdsim.bench.crowds.drills import LEG_RADIUS, Drill, draw_agents
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases
from crowdsim.planning.query.requirements import Requirements
from crowdsim.recording.header import (
    AgentsRecord,
    AgentState,
    BehaviorRecord,
    GaitRecord,
    LayerRecord,
    MotionRecord,
    RecordedFrame,
    RecordingHeader,
)
from crowdsim.recording.writer import RecordingWriter
from crowdsim.steering.guidance.field import asked_of
from crowdsim.steering.guidance.ground import build_ground
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.guidance.place_walls import outline_segments
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.support.small_recording import small_header

BANDS = ((0.0, 2.0),)
LATERAL, HELD, FRONTAL = 0, 1, 2


@cache
def behavior_set(name: str = "default") -> BehaviorSet:
    """Return the behaviors of a motion set."""
    return load_behavior_set(("lateral", "arm_constrained", "frontal"), BANDS, motion_set=name)


def steered_motion(name: str = "default") -> MotionRecord:
    """Return a motion record without nodes, with a gait for each behavior."""
    behaviors = behavior_set(name)
    skeleton, none = behaviors.graph.skeleton, np.zeros(0, np.int32)
    gaits = tuple(
        GaitRecord(clip.name, clip.root_positions.astype(np.float32), clip.rotations.astype(np.float32))
        for clip in gait_clips(behaviors)
    )
    root, rotations = np.zeros((0, 3), np.float32), np.zeros((0, skeleton.joint_count, 4), np.float32)
    return MotionRecord(skeleton, (), none, none, none, root, rotations, gaits)


def steered_header(agents: int, steps_per_second: int = 10, floor: BaseGeometry | None = None) -> RecordingHeader:
    """Return a header of steered agents."""
    header = small_header(agents, steps_per_second)
    records = [BehaviorRecord(b.name, b.color, tuple(map(float, b.radii))) for b in behavior_set().behaviors]
    layers = (LayerRecord("body", 0.0, 2.0),)
    header = replace(header, layers=layers, behaviors=tuple(records), motion=steered_motion(), solids=())
    return header if floor is None else replace(header, floor=floor.wkt, scenario_name="drill")


def track_frames(tracks: np.ndarray, behaviors: np.ndarray, present: np.ndarray) -> list[RecordedFrame]:
    """Return frames of tracks (steps, N, 4) of x, y, heading, phase, with behaviors and presence (steps, N)."""
    nobody = np.full(tracks.shape[1], -1)
    frames = []
    for track, behavior, here in zip(tracks, behaviors, present, strict=True):
        state = np.where(here, AgentState.MOVING, AgentState.ABSENT)
        phase = np.where(here, track[:, 3], np.nan)
        turned = wrap_angle(track[:, 2])
        frames.append(
            RecordedFrame(*track.T[:2], turned, nobody, nobody, nobody + 1, np.where(here, behavior, -1), state, phase)
        )
    return frames


def write_frames(path: Path, header: RecordingHeader, frames: list[RecordedFrame]) -> Path:
    """Write a recording of frames."""
    with RecordingWriter(path, header) as writer:
        for number, frame in enumerate(frames):
            writer.append(frame, number)
        writer.finish({})
    return path


def walked_drill(drill: Drill, seed: int = 1, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return tracks (steps, N, 4) of a drill and presence (steps, N); agents leave on arrival."""
    behaviors = behavior_set().behaviors
    segments = outline_segments(drill.area)
    walls = build_walls(segments)
    ground = build_ground([segments], Requirements.of(behaviors, 1, 0.0))
    guidance = Guidance(ground, [group.goal for group in drill.groups], asked_of(behaviors))
    state = draw_agents(drill, seed)
    count = len(state)
    following = np.full(count, PLAIN, np.int32)
    phases, places = np.full(count, STAND), np.column_stack([state["x"], state["y"], state["heading"]])
    anchors = places.copy()
    tracks, present = [], []
    with Steering(walls, walls, leg_radius=LEG_RADIUS, threads=threads) as steering:
        dt = steering.rules.step
        for _ in range(round(drill.seconds / dt)):
            here = np.zeros(count, bool)
            here[state["id"]] = True
            tracks.append(np.column_stack([places, phases]))
            present.append(here)
            guidance.write(state, following)
            steering.step(state)
            agents = state["id"]
            new = np.column_stack([state["x"], state["y"], state["heading"]])
            turns = wrap_angle(new[:, 2] - places[agents, 2]) / dt
            own, feet = phases[agents], anchors[agents]
            advance_phases(new, np.column_stack([state["vx"], state["vy"]]), turns, dt, own, feet)
            places[agents], phases[agents], anchors[agents] = new, own, feet
            stays = state["togo"] > 0.0
            state, following = state[stays], following[stays]
            if not len(state):
                break
    return np.stack(tracks), np.stack(present)


def record_drill(
    path: Path, drill: Drill, seed: int = 1, behaves: Callable[[np.ndarray], np.ndarray] | None = None
) -> Path:
    """Write a recording of a drill; ``behaves`` gives behaviors (steps, N) of tracks, by default all frontal."""
    tracks, present = walked_drill(drill, seed)
    behaviors = np.full(tracks.shape[:2], FRONTAL) if behaves is None else behaves(tracks)
    header = steered_header(tracks.shape[1], floor=drill.area)
    agents = header.agents
    header = replace(
        header,
        agents=AgentsRecord(
            agents.groups, agents.start_times, tracks[0, :, :3], tracks[0, :, :2] + 1.0, np.full(agents.count, 0.25)
        ),
    )
    return write_frames(path, header, track_frames(tracks, behaviors, present))
