"""Planted feet of captured bodies for a page: in the nodes that it plays, and in the first step of each chunk.

From step to step the viewer follows feet itself, as :mod:`crowdsim.motion.planted.follow_kernels` does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packed_poses import rows_of_nodes
from crowdsim.export.page.packing import Block, Ints, first_differences, zigzag
from crowdsim.export.page.tracks.track_chunks import FINE_PLACES, place_units
from crowdsim.geometry.elementary import atan2
from crowdsim.geometry.planar import Floats, compose, invert, shorter_ways, wrap_angle
from crowdsim.motion.clips.kinematics import rotate
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.planted.follow_feet import Played
from crowdsim.motion.planted.pin_kernels import COLUMNS, FADES, MODE, SINCE, STANDS, UNTIL, YAW, X
from crowdsim.motion.planted.planted_rows import FootTable
from crowdsim.recording.header import RecordedFrame
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.planted_feet import played_in

PLACES = 10_000
"""Integer units per meter and radian of feet in nodes."""
FRAMES = 100
"""Integer units per frame, for the frames between which the displacement of a foot fades."""
_NAMES = ("since", "fading", "x", "y", "yaws")
"""Columns of feet in the first step of each chunk, beside their modes; see :func:`pack_feet`."""
_ANGLES, _FINE_ANGLES = 1000, 10_000
"""Integer units per radian of feet in steps, and those of few agents."""


def feet_units(places: int) -> dict[str, int]:
    """Return the units per frame, meter and radian of feet in steps, if tracks have ``places`` units per meter."""
    return {"frame": FRAMES, "place": 2 * places, "angle": _FINE_ANGLES if places == FINE_PLACES else _ANGLES}


def pack_feet(block: Block, recording: Recording, chosen: Chosen, played: Ints, chunk: int) -> None:
    """Add the feet in the nodes ``played``, and those of the agents in each step that begins a ``chunk`` of steps.

    Places in nodes are packed column by column, as differences from row to row: ball x, y [m] and heading [rad] of the
    left foot, then of the right one, relative to the first row of their node. ``feet_stands`` has the bit 1 for a left
    foot that stands from the row to the next one, 2 for a right one. ``feet_across`` are the axes (2, 3) of the ankle
    joints that point to the left of their feet.

    Steps are packed one after the other, each with both feet of its captured agents. A foot has a mode (FREE, STANDS or
    FADES); the frame since which it fades, and for how many frames, both 0 in other modes; and a displacement (x, y
    [m], turn [rad]): what fades, or from where the body is posed to where the foot stands.
    """
    table = recording.foot_table
    if table is None or not len(played):
        pack_no_feet(block)
        return
    rows = rows_of_nodes(recording.header.motion, played)
    places = np.rint(table.places[rows] * PLACES).astype(np.int64)
    block.add_varints("feet_rows", zigzag(first_differences(places.reshape(len(rows), 6)).T.ravel()))
    block.add("feet_stands", (table.stands[rows] @ np.array([1, 2])).astype(np.uint8))
    block.add("feet_across", table.across.astype(np.float32))
    units = feet_units(place_units(chosen))
    scale = np.array([units["place"], units["place"], units["angle"]], np.float64)
    columns: list[list[Ints]] = [[] for _ in range(1 + len(_NAMES))]
    for first in range(0, chosen.steps, chunk):
        found = _feet_in_step(recording, table, chosen, chosen.first + first, scale)
        for column, values in zip(columns, found, strict=True):
            column.append(values)
    for name, column in zip(("modes", *_NAMES), columns, strict=True):
        block.add_varints(f"feet_{name}", np.concatenate(column))


def _feet_in_step(
    recording: Recording, table: FootTable, chosen: Chosen, step: int, scale: Floats
) -> tuple[Ints, Ints, Ints, Ints, Ints, Ints]:
    """Return the columns of :func:`pack_feet` of the m captured agents in a step, (2 m,) each, left foot first.

    They are mode, first frame and number of frames of a fading foot [1 / FRAMES of a frame], and the displacement x, y
    and turn, coded by zigzag. ``scale`` (3,) holds the units of the displacement, per meter, meter and radian.
    """
    now = played_in(RecordedFrame(*(getattr(recording, name)[step][chosen.agents] for name in RecordedFrame._fields)))
    some = np.flatnonzero(now.node != NONE)
    now = Played(now.node[some], now.previous[some], now.frame[some], now.track[some])
    states = recording.planted_feet.states_at(
        step / recording.steps_per_second, chosen.agents[some], now.node, now.frame
    )
    states = states.reshape(2 * len(some), COLUMNS)
    mode = states[:, MODE].astype(np.int64)
    since = np.where(mode == FADES, np.rint(states[:, SINCE] * FRAMES), 0.0).astype(np.int64)
    until = np.rint(states[:, UNTIL] * FRAMES).astype(np.int64)
    moved = np.where((mode == STANDS)[:, None], _moved(recording, table, now, states), states[:, X : YAW + 1])
    poses = np.where(mode[:, None] > 0, np.rint(moved * scale), 0.0).astype(np.int64)
    return mode, since, np.where(mode == FADES, np.maximum(until - since, 0), 0), *zigzag(poses).T


def _moved(recording: Recording, table: FootTable, now: Played, states: Floats) -> Floats:
    """Return the displacements (2 n, 3) of standing feet from where n bodies are posed: x, y [m] and turn [rad].

    ``states`` (2 n, COLUMNS) are those of both feet, left first, with the columns that
    :mod:`crowdsim.motion.planted.pin_kernels` names. Rows of feet that do not stand mean nothing.
    """
    poses = recording.pose_table
    positions = np.empty((len(now.node), len(poses.parents), 3), np.float32)
    rotations = np.empty((len(now.node), len(poses.parents), 4), np.float32)
    pose_joints(poses, now.node, now.previous, now.frame, now.track, positions, rotations)
    moved = np.zeros((len(now.node), 2, 3))
    for foot, (_, _, ankle, ball) in enumerate(table.legs.tolist()):
        own = states[foot::2]
        # From the place where it came to stand, a foot moves as it has moved in the clip since then. Its heading as
        # posed is that of the axis to its left, turned back by a right angle.
        begins, ends = (_place_in_clip(recording, table, now.node, frame, foot) for frame in (own[:, SINCE], now.frame))
        left = rotate(rotations[:, ankle].astype(np.float64), table.across[foot])
        posed = np.column_stack([positions[:, ball, :2], atan2(-left[:, 0], left[:, 1])])
        moved[:, foot] = compose(own[:, X : YAW + 1], compose(invert(begins), ends)) - posed
    for axis, span in enumerate(recording.header.spans.tolist()):
        moved[..., axis] = shorter_ways(moved[..., axis], span)
    moved[..., 2] = wrap_angle(moved[..., 2])
    return moved.reshape(-1, 3)


def _place_in_clip(recording: Recording, table: FootTable, node: NDArray[np.int32], frame: Floats, foot: int) -> Floats:
    """Return places (n, 3) of a foot in frames (n,) of nodes (n,), interpolated between rows: x, y [m], heading [rad].

    They are relative to the first rows of the nodes.
    """
    poses = recording.pose_table
    whole = np.minimum(np.floor(frame).astype(np.int64), poses.node_frames[node])
    first = poses.node_first[node].astype(np.int64)
    now = table.places[first + whole, foot]
    way = table.places[first + np.minimum(whole + 1, poses.node_frames[node]), foot] - now
    way[:, 2] = wrap_angle(way[:, 2])
    found: Floats = now + (frame - whole)[:, None] * way
    return found


def pack_no_feet(block: Block) -> None:
    """Add empty axes of feet, by which the viewer knows that it has no feet to keep in place."""
    block.add("feet_across", np.zeros(0, np.float32))
