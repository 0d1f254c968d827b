"""A synthetic recording without a simulation: three people with swinging limbs between a few boxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.motion.clips.kinematics import about_axis, forward_kinematics, multiply
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.recording.header import (
    AgentsRecord,
    AgentState,
    BehaviorRecord,
    LayerRecord,
    MotionRecord,
    RecordedFrame,
    RecordingHeader,
    SolidRecord,
)
from crowdsim.recording.writer import RecordingWriter

X, Y, Z = np.eye(3)
CYCLE = 66
WALK_SPEED = 1.4 * 60 / CYCLE
NODE_NAMES = ("walk", "walk_arms_held", "side_step", "stand")

_JOINTS = [
    ("hips", None, (0.0, 0.0, 0.93)),
    ("left_hip", "hips", (0.0, 0.09, -0.04)),
    ("left_knee", "left_hip", (0.0, 0.0, -0.42)),
    ("left_ankle", "left_knee", (0.0, 0.0, -0.41)),
    ("left_toe", "left_ankle", (0.14, 0.0, -0.05)),
    ("right_hip", "hips", (0.0, -0.09, -0.04)),
    ("right_knee", "right_hip", (0.0, 0.0, -0.42)),
    ("right_ankle", "right_knee", (0.0, 0.0, -0.41)),
    ("right_toe", "right_ankle", (0.14, 0.0, -0.05)),
    ("spine", "hips", (0.0, 0.0, 0.12)),
    ("chest", "spine", (0.0, 0.0, 0.16)),
    ("neck", "chest", (0.0, 0.0, 0.22)),
    ("head", "neck", (0.02, 0.0, 0.1)),
    ("left_shoulder", "chest", (0.0, 0.18, 0.16)),
    ("left_elbow", "left_shoulder", (0.0, 0.29, 0.0)),
    ("left_wrist", "left_elbow", (0.0, 0.25, 0.0)),
    ("right_shoulder", "chest", (0.0, -0.18, 0.16)),
    ("right_elbow", "right_shoulder", (0.0, -0.29, 0.0)),
    ("right_wrist", "right_elbow", (0.0, -0.25, 0.0)),
]
_ENDS = [
    ("head", (0.0, 0.0, 0.17)),
    ("left_toe", (0.06, 0.0, 0.0)),
    ("right_toe", (0.06, 0.0, 0.0)),
    ("left_wrist", (0.0, 0.17, 0.0)),
    ("right_wrist", (0.0, -0.17, 0.0)),
]

# Mean joint angles of walking adults: percent of the cycle from heel strike, and degrees there.
_HIP = ([0, 10, 30, 50, 62, 75, 85, 100], [30, 25, 10, -10, -5, 25, 32, 30])
_KNEE = ([0, 12, 25, 40, 55, 70, 85, 95, 100], [5, 18, 5, 3, 35, 62, 25, 8, 5])
_ANKLE = ([0, 8, 25, 40, 55, 62, 70, 85, 100], [0, -5, 5, 10, 5, -15, -5, 0, 0])


def small_skeleton() -> Skeleton:
    """Return 19 joints in T-pose, with every role filled."""
    names = tuple(name for name, _, _ in _JOINTS)
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _ in _JOINTS], np.int32),
        offsets=np.array([offset for _, _, offset in _JOINTS]),
        end_parents=np.array([names.index(parent) for parent, _ in _ENDS], np.int32),
        end_offsets=np.array([offset for _, offset in _ENDS]),
        roles={name: index for index, name in enumerate(names) if name != "spine"},
    )


def _curve(curve: tuple[list[int], list[int]], percent: np.ndarray) -> np.ndarray:
    return np.radians(np.interp(np.mod(percent, 100.0), *curve))


def _node(skeleton: Skeleton, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return root positions (L + 1, 3) and rotations (L + 1, J, 4) relative to the track."""
    frames = np.arange(CYCLE + 1)
    phase = 100.0 * frames / CYCLE
    swing = np.sin(2 * np.pi * frames / CYCLE)
    still = np.zeros(len(frames))
    turns = {joint: np.tile([1.0, 0.0, 0.0, 0.0], (len(frames), 1)) for joint in skeleton.names}
    for side, sign, offset in (("left", 1.0, 0.0), ("right", -1.0, 50.0)):
        hang = about_axis(X, still - sign * np.radians(83.0))
        if name.startswith("walk"):
            turns[f"{side}_hip"] = about_axis(Y, -_curve(_HIP, phase + offset))
            turns[f"{side}_knee"] = about_axis(Y, _curve(_KNEE, phase + offset))
            turns[f"{side}_ankle"] = about_axis(Y, -_curve(_ANKLE, phase + offset))
        elif name == "side_step":
            spread = 0.16 * (1.0 - np.cos(2 * np.pi * frames / CYCLE))
            turns[f"{side}_hip"] = about_axis(X, sign * spread)
        arm = -sign * 0.45 * swing if name == "walk" else still
        turns[f"{side}_shoulder"] = multiply(about_axis(Y, -arm), hang)
        bend = 1.5 if name == "walk_arms_held" else 0.35
        turns[f"{side}_elbow"] = about_axis(Z, still - sign * bend)
        if name == "walk_arms_held":
            turns[f"{side}_shoulder"] = multiply(about_axis(Z, still - sign * 0.5), hang)
    turns["chest"] = about_axis(Z, 0.12 * swing if name == "walk" else still)
    rotations = np.stack([turns[joint] for joint in skeleton.names], axis=1)
    positions, _ = forward_kinematics(skeleton, np.zeros((len(frames), 3)), rotations)
    ankles = [skeleton.roles[f"{side}_ankle"] for side in ("left", "right")]
    root = np.zeros((len(frames), 3))
    root[:, 2] = 0.06 - positions[:, ankles, 2].min(axis=1)
    return root, rotations


def small_header(agents: int = 3, steps_per_second: int = 20) -> RecordingHeader:
    """Return three behaviors, two layers, a floor of 8 m by 5 m with boxes, a bench and a wall with a doorway."""
    skeleton = small_skeleton()
    nodes = [_node(skeleton, name) for name in NODE_NAMES]
    motion = MotionRecord(
        skeleton=skeleton,
        node_names=NODE_NAMES,
        node_behavior=np.array([2, 1, 0, 2], np.int32),
        node_first=np.arange(len(nodes), dtype=np.int32) * (CYCLE + 1),
        node_frames=np.full(len(nodes), CYCLE, np.int32),
        pool_root=np.concatenate([root for root, _ in nodes]).astype(np.float32),
        pool_rotations=np.concatenate([rotations for _, rotations in nodes]).astype(np.float32),
    )
    starts = np.array([[-3.0, -1.4 + 1.5 * (a % 3) + 0.1 * (a // 3), 0.0] for a in range(agents)])
    return RecordingHeader(
        scenario_name="boxes",
        scenario_text="name: boxes\n# naïve: made by hand\n",
        seed=7,
        steps_per_second=steps_per_second,
        behaviors=(
            BehaviorRecord("lateral", "#c44e52", (0.17, 0.17)),
            BehaviorRecord("arm_constrained", "#dd9a33", (0.17, 0.26)),
            BehaviorRecord("frontal", "#3c78b4", (0.17, 0.32)),
        ),
        layers=(LayerRecord("legs", 0.1, 2.0), LayerRecord("torso", 0.8, 1.5)),
        floor="POLYGON ((-4 -2.5, 4 -2.5, 4 2.5, -4 2.5, -4 -2.5))",
        solids=(
            SolidRecord("bench", "POLYGON ((-1.6 -2.3, 0.4 -2.3, 0.4 -1.9, -1.6 -1.9, -1.6 -2.3))", 0.0, 0.45),
            SolidRecord("crate", "POLYGON ((-1 0.35, 0 0.35, 0 0.8, -1 0.8, -1 0.35))", 0.0, 0.8),
            SolidRecord("cupboard", "POLYGON ((0.6 2, 1.8 2, 1.8 2.4, 0.6 2.4, 0.6 2))", 0.0, 1.9),
            SolidRecord(
                "wall with a doorway",
                "MULTIPOLYGON (((2 -2.5, 2.15 -2.5, 2.15 -0.6, 2 -0.6, 2 -2.5)),"
                "((2 0.6, 2.15 0.6, 2.15 2.5, 2 2.5, 2 0.6)))",
                0.0,
                2.2,
            ),
        ),
        agents=AgentsRecord(
            groups=tuple("visitors" for _ in range(agents)),
            start_times=np.zeros(agents),
            starts=starts,
            goals=starts[:, :2] + [6.0, 0.0],
            radii=np.full(agents, 0.32),
        ),
        motion=motion,
    )


def small_frame(header: RecordingHeader, step: int) -> RecordedFrame:
    """Return one step: agent a walks along +x in behavior 2 - a % 3; the last starts late, one stands at the end."""
    count = header.agents.count
    kind = np.arange(count) % 3
    late = np.where(np.arange(count) == count - 1, 1.0, 0.0)
    seconds = np.maximum(step / header.steps_per_second - late, 0.0)
    speed = np.array([WALK_SPEED, 0.8 * WALK_SPEED, 0.5])[kind]
    facing = np.where(kind == 2, np.pi / 2, 0.0)
    frame = np.round(seconds * 60).astype(int)
    absent = step / header.steps_per_second < late
    state = np.where(absent, AgentState.ABSENT, AgentState.MOVING)
    return RecordedFrame(
        x=np.where(absent, np.nan, header.agents.starts[:, 0] + speed * seconds),
        y=np.where(absent, np.nan, header.agents.starts[:, 1]),
        heading=np.where(absent, np.nan, facing),
        node=kind,
        previous=np.where(frame > CYCLE, kind, -1),
        frame=frame % CYCLE,
        behavior=2 - kind,
        state=state,
        phase=np.full(count, np.nan),
    )


def write_small_recording(path: Path, steps: int = 90, agents: int = 3, steps_per_second: int = 20) -> Path:
    """Write a finished recording with one planned path per agent."""
    header = small_header(agents, steps_per_second)
    with RecordingWriter(path, header) as writer:
        for agent in range(agents):
            start, goal = header.agents.starts[agent, :2], header.agents.goals[agent]
            points = start + np.linspace(0.0, 1.0, 4)[:, None] * (goal - start)
            writer.add_path(agent, points, [2, 2 - agent % 3, 2 - agent % 3, 2])
        for step in range(steps):
            writer.append(small_frame(header, step), 2**63 + step)
        writer.finish({"arrived": np.int64(0), "seconds": 1.5})
    return path
