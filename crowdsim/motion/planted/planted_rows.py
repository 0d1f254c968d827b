"""When the feet of a motion graph's nodes stand, and where they are, row by row of the pose table."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import atan2
from crowdsim.motion.clips.kinematics import Floats, rotate
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.foot_contacts import Feet, feet_of, foot_direction, planted_steps, runs
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.between_kernels import NodeTracks

SHORTEST_SWING = 0.15
"""Duration below which a foot between two stances has not lifted [s]: it rolls, or its clip is noisy."""

NO_LANDING = 1 << 20
"""Frame of the next landing of a foot that does not land again in its node."""


class PlantedRows(NamedTuple):
    """Feet of all nodes, one after the other as in the pose table of T rows, each as in its clip.

    table: the pose table. feet: points (T, 2, P, 3) in the frame of the first row of each node [m]. stands: (T, 2, P)
    bool, True if a point stands from the row to the next one; never in the last row of a node. lifted: (T, 2, P) int32,
    number of rows before each row in which ``stands`` is False, over all nodes, the last row of each left out.
    """

    table: PoseTable
    feet: Feet
    stands: NDArray[np.bool_]
    lifted: NDArray[np.int32]

    def stayed(
        self, old_node: NDArray[np.int32], old_at: Floats, node: NDArray[np.int32], at: Floats
    ) -> NDArray[np.bool_]:
        """Return (n, 2, P): True for points of feet that stay planted in the clips between two frames.

        All arguments are (n,): ``old_node`` is played from its frame ``old_at`` on, until the frame ``at`` of ``node``.
        If ``node`` is another node, or the same one at an earlier frame, ``old_node`` is played to its end, and then
        ``node`` from its beginning. Frames need not be whole numbers.
        """
        table, lifted = self.table, self.lifted
        # Rows around both times. Prefix sums: a point stayed planted if its count did not change.
        begin = table.node_first[old_node] + np.floor(old_at).astype(np.int64)
        end = table.node_first[node] + np.ceil(at).astype(np.int64)
        goes_on = ((node == old_node) & (at >= old_at))[:, None, None]
        last, first = table.node_first[old_node] + table.node_frames[old_node], table.node_first[node]
        across = lifted[last] - lifted[begin] + lifted[end] - lifted[first]
        stayed: NDArray[np.bool_] = np.where(goes_on, lifted[end] - lifted[begin], across) == 0
        return stayed


class FootTable(NamedTuple):
    """What pinning the feet of captured bodies needs of T rows of nodes and J joints.

    places: (T, 2, 3) float64, ball (x, y [m]) and heading [rad] of each foot, relative to the first row of its node.
    stands: (T, 2) bool, True if the foot stands from the row to the next one; never in the last row of a node.
    landings: (T, 2) int32, frame of its node in which the foot lands next, after the row; NO_LANDING if it does not.
    legs: (2, 4) int32, joints of hip, knee, ankle and ball (the ankle again if there is no toe). across: (2, 3)
    float64, axis in the frame of the ankle joint that points to the left of its foot. bones: (J,) int32, 3 * foot + 0,
    1, 2 for joints that follow its thigh, shank or foot; -1 for others. tracks: those of all nodes, along which bodies
    go between steps.
    """

    places: Floats
    stands: NDArray[np.bool_]
    landings: NDArray[np.int32]
    legs: NDArray[np.int32]
    across: Floats
    bones: NDArray[np.int32]
    tracks: NodeTracks


def planted_rows(table: PoseTable, skeleton: Skeleton, tracks: Floats) -> PlantedRows:
    """Find the planted feet of all nodes.

    tracks: (T, 3) poses of the rows, x, y [m], heading [rad], relative to the first row of each node. A stance that
    reaches the first or the last row of its node counts however short it is: the node may show only a part of it.
    """
    positions, rotations = _row_joints(table, tracks)
    feet = feet_of(skeleton, positions, rotations)
    stands, lifted = np.zeros(feet.points.shape[:3], bool), np.zeros(feet.points.shape[:3], np.int32)
    for first, last in _spans(table):
        own = Feet(feet.points[first : last + 1], feet.lowest, feet.ankles)
        stands[first:last] = planted_steps(own, part=True)
        lifted[first + 1 : last + 1] = ~stands[first:last]
    return PlantedRows(table, feet, stands, np.cumsum(lifted, axis=0, dtype=np.int32))


def foot_table(table: PoseTable, skeleton: Skeleton, tracks: Floats) -> FootTable:
    """Return the places and stances of both feet in all rows of ``table``.

    skeleton: that of the table, with leg joints. tracks: as of :func:`planted_rows`. Unlike there, a foot is taken to
    stand through a swing shorter than SHORTEST_SWING.
    """
    legs = np.array([_leg(skeleton, side) for side in ("left", "right")], np.int32)
    positions, rotations = _row_joints(table, tracks)
    across = np.array([_across(skeleton, *leg[2:].tolist()) for leg in legs])
    places = np.empty((len(positions), 2, 3))
    for foot, (_, _, ankle, ball) in enumerate(legs.tolist()):
        left = rotate(rotations[:, ankle], across[foot])
        places[:, foot, :2], places[:, foot, 2] = positions[:, ball, :2], atan2(-left[:, 0], left[:, 1])
    stands = np.asarray(planted_rows(table, skeleton, tracks).stands.any(axis=2))
    landings = np.full(stands.shape, NO_LANDING, np.int32)
    for first, last in _spans(table):
        for foot in (0, 1):
            # ``mine`` is a view, so stances are joined in ``stands``. The landing after a row is the nearest later
            # beginning of a stance.
            mine = stands[first:last, foot]
            _join(mine)
            for begin, _ in reversed(runs(mine)):
                landings[first : first + begin, foot] = np.minimum(landings[first : first + begin, foot], begin)
    nodes = NodeTracks(table.node_first, table.node_frames, np.ascontiguousarray(tracks, np.float64))
    return FootTable(places, stands, landings, legs, across, _bones(skeleton, legs), nodes)


def _spans(table: PoseTable) -> list[tuple[int, int]]:
    """Return the first and the last row (included) of every node."""
    return list(zip(table.node_first.tolist(), (table.node_first + table.node_frames).tolist(), strict=True))


def _join(stands: NDArray[np.bool_]) -> None:
    """Join, in place, stances (F,) of one foot that are less than SHORTEST_SWING apart."""
    found = runs(stands)
    for (_, end), (begin, _) in pairwise(found):
        if begin - end < SHORTEST_SWING * CAPTURE_RATE:
            stands[end:begin] = True


def _row_joints(table: PoseTable, tracks: Floats) -> tuple[Floats, Floats]:
    """Return positions (T, J, 3) [m] and rotations (T, J, 4) of the joints of all rows at the poses ``tracks`` (T, 3).

    No node is before them, so no blend offset fades.
    """
    lengths = table.node_frames + 1
    node = np.repeat(np.arange(len(lengths), dtype=np.int32), lengths)
    at = np.concatenate([np.arange(length, dtype=np.float64) for length in lengths])
    positions = np.empty((len(node), len(table.parents), 3), np.float32)
    rotations = np.empty((len(node), len(table.parents), 4), np.float32)
    pose = np.ascontiguousarray(tracks, np.float64)
    pose_joints(table, node, np.full(len(node), -1, np.int32), at, pose, positions, rotations)
    return positions.astype(np.float64), rotations.astype(np.float64)


def _leg(skeleton: Skeleton, side: str) -> list[int]:
    """Return the joints of hip, knee, ankle and ball (the ankle again if there is no toe) of one side."""
    hip, knee, ankle = (skeleton.joint(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
    return [hip, knee, ankle, skeleton.roles.get(f"{side}_toe", ankle)]


def _across(skeleton: Skeleton, ankle: int, ball: int) -> Floats:
    """Return the axis (3,) to the left of a foot, in the frame of its ankle joint.

    The heading of a foot follows from it: a foot that stands steeply on its toes has no heading along its length.
    """
    ahead = foot_direction(skeleton, ankle, ball)
    return np.array([-ahead[1], ahead[0], 0.0])


def _bones(skeleton: Skeleton, legs: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return which bone of which leg each joint (J,) follows, as :class:`FootTable` numbers them."""
    bones = np.full(skeleton.joint_count, -1, np.int32)
    numbers = {int(joint): 3 * foot + bone for foot in (0, 1) for bone, joint in enumerate(legs[foot, :3])}
    for joint, parent in enumerate(skeleton.parents.tolist()):
        bones[joint] = numbers.get(joint, bones[parent] if parent >= 0 else -1)
    return bones
