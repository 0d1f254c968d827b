"""The nodes of a motion graph before they are joined: segments of clips and the feet they stand on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.geometry.planar import compose, invert, transform_points
from crowdsim.motion.clip import Clip
from crowdsim.motion.features import joint_speeds
from crowdsim.motion.frame_distance import point_cloud
from crowdsim.motion.kinematics import Floats
from crowdsim.motion.segmentation import Segment, require_locomotion, segment_clip
from crowdsim.motion.tracks import track_of

BOTH_FEET = 2
"""Planted foot of a standing cut; otherwise 0 is the left foot and 1 the right."""

_SHORTEST_TRACK = 0.01
_SMALLEST_CHANGE = 0.05
_SMALLEST_TURN = np.radians(2.0)


@dataclass(frozen=True)
class MotionSource:
    """A clip and how it enters the graph.

    behavior: index of the behavior that it performs.
    detectors: names of the feature detectors that cut it.
    idle: the whole clip is one node that waits in place.
    """

    clip: Clip
    behavior: int
    detectors: tuple[str, ...]
    idle: bool = False


@dataclass(frozen=True)
class Joint:
    """One end of a node, where it may meet another: everything relative to the track pose there.

    cloud: (P, 3) point cloud; foot: planted foot; pivot: (2,) where it stands.
    """

    cloud: Floats
    foot: int
    pivot: Floats


@dataclass(frozen=True)
class Node:
    """A segment with its track (L + 1, 3) relative to its first sample; see GraphArrays for the rest."""

    name: str
    source: int
    segment: Segment
    track: Floats
    length: float
    start: Joint
    end: Joint

    def leads_nowhere(self) -> bool:
        """Whether it neither moves nor turns nor ends in another pose, as holding the arms in does."""
        turn = float(np.ptp(np.unwrap(self.track[:, 2])))
        change = float(np.max(np.linalg.norm(self.start.cloud - self.end.cloud, axis=1)))
        return self.length < _SHORTEST_TRACK and turn < _SMALLEST_TURN and change < _SMALLEST_CHANGE


def make_nodes(sources: Sequence[MotionSource]) -> tuple[list[Node], list[Floats]]:
    """All segments of all sources in order, and the track of each source.

    MotionError where the clips differ in their skeleton or one leads nowhere.
    """
    if not sources:
        raise MotionError("a motion graph needs at least one clip")
    for source in sources[1:]:
        _require_same_skeleton(sources[0].clip, source.clip)
    nodes: list[Node] = []
    tracks: list[Floats] = []
    for index, source in enumerate(sources):
        clip, track = source.clip, track_of(source.clip)
        if source.idle:
            if clip.frame_count < 2:
                raise MotionError(f"idle clip '{clip.name}' has a single frame; waiting needs a clip that lasts")
            segments = [Segment(0, clip.frame_count - 1, True, True)]
        else:
            require_locomotion(clip, track)
            segments = segment_clip(clip, source.detectors)
        tracks.append(track)
        nodes.extend(_node(clip, track, index, segment) for segment in segments)
    return nodes, tracks


def _node(clip: Clip, track: Floats, source: int, segment: Segment) -> Node:
    samples = track[segment.first : segment.last + 1]
    relative = compose(invert(samples[0]), samples)
    length = float(np.sum(np.linalg.norm(np.diff(samples[:, :2], axis=0), axis=1)))
    return Node(
        f"{clip.name}:{segment.first}-{segment.last}", source, segment, relative, length,
        _joint(clip, track, segment.first, segment.starts_standing),
        _joint(clip, track, segment.last, segment.ends_standing),
    )  # fmt: skip


def _joint(clip: Clip, track: Floats, frame: int, standing: bool) -> Joint:
    feet = [_foot_joints(clip, side) for side in ("left", "right")]
    if standing:
        foot, joints = BOTH_FEET, feet[0] + feet[1]
    else:
        foot = int(np.argmin([np.mean([joint_speeds(clip, joint)[frame] for joint in joints]) for joints in feet]))
        joints = feet[foot]
    place = clip.joint_positions[frame, joints, :2].mean(axis=0)
    pivot = transform_points(invert(track[frame]), place)
    return Joint(point_cloud(clip, track, frame, standing), foot, pivot)


def _foot_joints(clip: Clip, side: str) -> list[int]:
    ankle = clip.skeleton.joint(f"{side}_ankle")
    return [ankle, clip.skeleton.roles.get(f"{side}_toe", ankle)]


def _require_same_skeleton(first: Clip, other: Clip) -> None:
    a, b = first.skeleton, other.skeleton
    if a is b:
        return
    if a.names != b.names or not np.array_equal(a.parents, b.parents):
        extra = sorted(set(a.names) ^ set(b.names))
        raise MotionError(
            f"clips '{first.name}' and '{other.name}' have different skeletons "
            f"({', '.join(extra) if extra else 'the same joints in another order'}); one graph needs one skeleton"
        )
    gaps = np.linalg.norm(a.offsets - b.offsets, axis=1)
    if gaps.max() > 1e-3:
        worst = int(np.argmax(gaps))
        raise MotionError(
            f"the bones of clips '{first.name}' and '{other.name}' differ by {gaps[worst] * 100:.1f} cm at "
            f"'{a.names[worst]}'; one graph needs one skeleton"
        )
