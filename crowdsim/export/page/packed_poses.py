"""Poses that the bodies of a page play: rows of captured nodes, and gait models of steered agents."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packing import Block, Ints, first_differences, zigzag
from crowdsim.export.page.tracks.track_chunks import PHASES, PackedStretches, node_tracks
from crowdsim.motion.clips.kinematics import rotation_vectors
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.deformed.deformed_clip import DeformedClip, on_legs_of
from crowdsim.recording.header import MotionRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.steered_poses import gait_clip
from crowdsim.recording.shown.steered_stretches import Stretches
from crowdsim.recording.shown.swing_times import swing_times_after

ROTATIONS = 10_000
"""Integer units per radian for rotation vectors: half a unit moves a wrist by 0.03 mm."""
ROOTS = 10_000
"""Integer units per meter for positions of the root."""

_SWITCH_SECONDS = 5
"""Time of a block of switches whose steps are read at once [s]."""
_FEET = 10_000
"""Integer units per second for the times of feet."""

# Fields of a gait's model that the viewer needs: arrays, and numbers.
_GAIT_FIELDS = ("mean", "upper", "swings", "waves", "root", "legs", "hips", "turns", "bones", "pitch", "lift", "prints")
_GAIT_NUMBERS = ("stride", "stand", "width", "spine")


def skeleton_facts(skeleton: Skeleton) -> dict[str, Any]:
    """Return parents (-1: none), offsets [m] and the joint of each role, for the page's JSON."""
    return {
        "parents": skeleton.parents.tolist(),
        "offsets": np.round(skeleton.offsets, 6).tolist(),
        "roles": dict(sorted(skeleton.roles.items())),
    }


def pack_nodes(block: Block, motion: MotionRecord, played: Ints) -> list[str]:
    """Add the poses of the nodes ``played`` (k,) to the block, as differences from row to row; return their names."""
    joints = motion.skeleton.joint_count
    frames = motion.node_frames[played].astype(np.int64)
    some = rows_of_nodes(motion, played)
    vectors = rotation_vectors(motion.pool_rotations[some].astype(np.float64))
    whole = np.rint(vectors * ROTATIONS).astype(np.int64)
    root = np.rint(motion.pool_root[some].astype(np.float64) * ROOTS).astype(np.int64)
    block.add_varints("node_frames", frames)
    block.add_varints("node_behaviors", motion.node_behavior[played].astype(np.int64))
    # One column after the other: the root's position, then the rotation vector of each joint.
    columns = np.concatenate([root, whole.reshape(len(some), 3 * joints)], axis=1)
    block.add_varints("node_rows", zigzag(first_differences(columns).T.ravel()))
    return [motion.node_names[node] for node in played.tolist()]


def pack_node_tracks(block: Block, motion: MotionRecord, played: Ints) -> None:
    """Add the tracks of the nodes ``played`` (k,) to the block, column by column, as differences from row to row."""
    rows = node_tracks(motion).rows[rows_of_nodes(motion, played)]
    block.add_varints("node_tracks", zigzag(first_differences(rows).T.ravel()))


def rows_of_nodes(motion: MotionRecord, played: Ints) -> Ints:
    """Return the rows (R,) of the pool that the nodes ``played`` have, one node after the other."""
    rows = [
        np.arange(motion.node_first[node], motion.node_first[node] + motion.node_frames[node] + 1) for node in played
    ]
    return np.concatenate(rows) if rows else np.zeros(0, np.int64)


def pack_gaits(block: Block, motion: MotionRecord) -> list[dict[str, Any]]:
    """Add the models of all gaits to the block; return their shapes and numbers, none if no agent is steered.

    All of them walk on the legs of the preferred behavior, the last one, as in playback.
    """
    facts = []
    clips: list[DeformedClip] = [gait_clip(motion, number) for number in range(len(motion.gaits))]
    for number, clip in enumerate(clips):
        model = on_legs_of(clip, clips[-1]).model
        shapes = {}
        for name in _GAIT_FIELDS:
            values: NDArray[Any] = getattr(model, name)
            shapes[name] = list(values.shape)
            kind = np.int32 if np.issubdtype(values.dtype, np.integer) else np.float32
            block.add(f"gait_{number}_{name}", values.astype(kind))
        facts.append({"shapes": shapes, **{name: float(getattr(model, name)) for name in _GAIT_NUMBERS}})
    return facts


def pack_stretches(block: Block, parts: list[tuple[Ints, Stretches]]) -> PackedStretches:
    """Add the stretches in which agents are steered to the block; return them with the phases of their bodies.

    Each of ``parts`` holds agents (A,), as indices into those of the page, and their stretches, whose columns are
    indices into these (A,), and whose rows are steps of the page. Four steps of a stretch ascend: begin, first, end,
    stop. ``begin`` is written as it is, each other one as its difference from the one before. Phases are coded with the
    tracks.
    """
    columns: list[list[Ints]] = [[], [], [], [], []]
    phases: list[NDArray[np.float64]] = []
    for agents, stretches in parts:
        found = agents[stretches.columns], stretches.begins, stretches.firsts, stretches.ends, stretches.stops
        for column, values in zip(columns, found, strict=True):
            column.append(values.astype(np.int64))
        phases.append(stretches.phases * PHASES)
    none = np.zeros(0, np.int64)
    agent, begin, first, end, stop = (np.concatenate([none, *column]) for column in columns)
    block.add_varints("stretch_agents", agent)
    block.add_varints("stretch_begins", begin)
    block.add_varints("stretch_firsts", first - begin)
    block.add_varints("stretch_ends", end - first)
    block.add_varints("stretch_stops", stop - end)
    counts = stop - begin
    exact = np.concatenate([np.zeros(0), *phases])
    return PackedStretches(agent, begin, stop, np.cumsum(counts) - counts, exact)


def pack_switches(block: Block, recording: Recording, chosen: Chosen) -> None:
    """Add the switches between captured and steered to the block, and the times at which feet then lift and land.

    Only switches are taken that are shown after the first step of the page and before its end, and that have a steered
    step on the page. Others are left out: the page then shows the agent as captured for some more steps at its ends.

    The five times of a switch are counted from it in units of 1 / _FEET s: until when each foot keeps its place (left,
    right), when it has lost its offset (left, right), and when the agent disappears, 0 if it stays. Bits of the flags:
    1 for a switch to steered, 2 for a left and 4 for a right foot that takes a small step which is added, because the
    recorded foot does not lift.
    """
    switches = recording.switches
    shown = switches.shown - chosen.first
    # Rows of the agents on the page; an agent that is not on it finds the row of another one.
    rows = np.searchsorted(chosen.agents, switches.agents)
    rows = np.minimum(rows, len(chosen.agents) - 1)
    mine = (chosen.agents[rows] == switches.agents) & (shown > 0) & (shown < chosen.steps)
    steps = switches.steps - chosen.first
    some = np.flatnonzero(mine & np.where(switches.steered, steps < chosen.steps, steps > 0))
    feet = np.zeros((len(some), 5), np.int64)
    flags = switches.steered[some].astype(np.uint8)
    # Blocks of some seconds, because all steps of a block are in memory at once.
    blocks = switches.shown[some] // (_SWITCH_SECONDS * recording.steps_per_second)
    for number in np.unique(blocks).tolist():
        here = np.flatnonzero(blocks == number)
        times = swing_times_after(recording, switches, some[here])
        since = (switches.shown[some[here]] / recording.steps_per_second)[:, None]
        cut = np.where(np.isfinite(times.cut), times.cut - since[:, 0], 0.0)[:, None]
        seconds = np.concatenate([times.hold - since, times.end - since, cut], axis=1)
        # Round up: a hold shorter than a unit must not become 0, which means that the foot does not stand.
        feet[here] = np.ceil(_FEET * np.maximum(seconds, 0.0) - 1e-6).astype(np.int64)
        flags[here] += (2 * times.forced[:, 0] + 4 * times.forced[:, 1]).astype(np.uint8)
    block.add_varints("switch_agents", rows[some].astype(np.int64))
    block.add_varints("switch_steps", shown[some])
    block.add_varints("switch_feet", feet.ravel())
    block.add("switch_flags", flags)
