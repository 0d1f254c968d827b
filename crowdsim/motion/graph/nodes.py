"""Nodes of a motion graph before they are joined: segments of clips and the feet that they stand on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.geometry.planar import compose, invert, transform_points
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import joint_speeds
from crowdsim.motion.graph.frame_distance import point_clouds
from crowdsim.motion.graph.segmentation import Segment, require_locomotion, segment_clip

BOTH_FEET = 2
"""Planted foot of a standing cut; otherwise 0 is the left foot and 1 the right one."""

# A node leads nowhere if its track is shorter [m], its pose changes less [m] and it turns less [rad].
_SHORTEST_TRACK = 0.01
_SMALLEST_CHANGE = 0.05
_SMALLEST_TURN = np.radians(2.0)


@dataclass(frozen=True)
class MotionSource:
    """A clip, and how it enters the graph.

    Attributes
    ----------
    clip : Clip
        The clip.
    behavior : int
        Index of the behavior that it performs.
    detectors : tuple of str
        Names of the feature detectors that cut it.
    idle : bool
        True if the whole clip is one node that waits in place.
    left_out : frozenset of (int, int)
        First and last frames of the segments that are not used.

    Examples
    --------
    >>> walk = load_behavior_set(["frontal"], [(0.0, 2.0)]).clips[0].clips[0]
    >>> source = MotionSource(walk, 0, ("crossing", "standing"))
    >>> source.clip.name, source.clip.frame_count
    ('walk', 684)
    """

    clip: Clip
    behavior: int
    detectors: tuple[str, ...]
    idle: bool = False
    left_out: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True)
class PreparedSource:
    """A source with the data that all its cuts need.

    track: (F, 3) track pose of every frame.
    foot_speed: (F, 2) mean speed of the joints of the left and the right foot [m/s].
    foot_places: (F, 3, 2) ball of the left foot, of the right foot, and the middle of both feet, relative to the track
    pose [m]. The ball, as a standing foot turns about it and its heel already rises where cycles are cut.
    """

    source: MotionSource
    track: Floats
    foot_speed: Floats
    foot_places: Floats

    @property
    def clip(self) -> Clip:
        """Return the source's clip."""
        return self.source.clip


@dataclass(frozen=True)
class Moment:
    """One end of a node, at which it may join another; all data relative to the track pose there.

    frame: of the clip. cloud: (P, 3) point cloud [m]. foot: planted foot, 0 left, 1 right, or BOTH_FEET; also the row
    of ``pivots`` about which a joined node turns. pivots: (3, 2) places of the left foot, of the right foot and of the
    middle between them [m].
    """

    frame: int
    cloud: Floats
    foot: int
    pivots: Floats


@dataclass(frozen=True)
class Node:
    """A segment of a source that may become a node of the graph.

    name: clip and frames, as ``walk:30-61``. source: index of its source. track: (L + 1, 3) track poses relative to the
    first. length: of the track [m]. start, end: its two ends.
    """

    name: str
    source: int
    segment: Segment
    track: Floats
    length: float
    start: Moment
    end: Moment

    def leads_nowhere(self) -> bool:
        """Return True if the node neither moves nor turns, and ends in the pose in which it starts.

        A node that pulls in the arms ends in another pose, so it leads somewhere.
        """
        turn = float(np.ptp(np.unwrap(self.track[:, 2])))
        change = float(np.max(np.linalg.norm(self.start.cloud - self.end.cloud, axis=1)))
        return self.length < _SHORTEST_TRACK and turn < _SMALLEST_TURN and change < _SMALLEST_CHANGE


def prepare_sources(sources: Sequence[MotionSource]) -> list[PreparedSource]:
    """Prepare the data of ``sources``.

    Raise MotionError if there are none, if their skeletons differ or lack ankles, if a clip is no locomotion and not
    idle, or if an idle one has a single frame.
    """
    if not sources:
        raise MotionError("a motion graph needs at least one clip")
    for source in sources[1:]:
        _require_same_skeleton(sources[0].clip, source.clip)
    return [_prepared(source) for source in sources]


def _prepared(source: MotionSource) -> PreparedSource:
    """Return a source with the data that its cuts need.

    Raise MotionError for a clip that is no locomotion and not idle, or an idle one of a single frame.
    """
    clip, track = source.clip, track_of(source.clip)
    if not source.idle:
        require_locomotion(clip, track)
    elif clip.frame_count < 2:
        raise MotionError(f"idle clip '{clip.name}' has a single frame; waiting needs a clip that lasts")
    feet = [_foot_joints(clip, side) for side in ("left", "right")]
    speed = np.stack([np.mean([joint_speeds(clip, joint) for joint in joints], axis=0) for joints in feet], axis=1)
    ground = clip.joint_positions[..., :2]
    balls = [[joints[-1]] for joints in feet]
    places = np.stack([ground[:, joints].mean(axis=1) for joints in (*balls, feet[0] + feet[1])], axis=1)
    return PreparedSource(source, track, speed, transform_points(invert(track)[:, None], places))


def feature_segments(prepared: PreparedSource) -> list[Segment]:
    """Return the segments between the feature cuts of a source, without those that it leaves out.

    An idle clip is one segment, standing at both ends.
    """
    if prepared.source.idle:
        return [Segment(0, prepared.clip.frame_count - 1, True, True)]
    segments = segment_clip(prepared.clip, prepared.source.detectors)
    return [segment for segment in segments if (segment.first, segment.last) not in prepared.source.left_out]


def make_nodes(
    prepared: PreparedSource, source: int, segments: Sequence[Segment], hold_standing: bool = True
) -> list[Node]:
    """Return a node for each of ``segments`` of the source with index ``source``.

    ``hold_standing``: use a standing cut's pose for its whole window; see :func:`point_clouds`.
    """
    if not segments:
        return []
    starts = _moments(prepared, [s.first for s in segments], [s.starts_standing for s in segments], hold_standing)
    ends = _moments(prepared, [s.last for s in segments], [s.ends_standing for s in segments], hold_standing)
    return [_node(prepared, source, *parts) for parts in zip(segments, starts, ends, strict=True)]


def _node(prepared: PreparedSource, source: int, segment: Segment, start: Moment, end: Moment) -> Node:
    """Return the node of a segment."""
    samples = prepared.track[segment.first : segment.last + 1]
    relative = compose(invert(samples[0]), samples)
    length = float(np.sum(np.linalg.norm(np.diff(samples[:, :2], axis=0), axis=1)))
    name = f"{prepared.clip.name}:{segment.first}-{segment.last}"
    return Node(name, source, segment, relative, length, start, end)


def _moments(prepared: PreparedSource, frames: list[int], standing: list[bool], hold_standing: bool) -> list[Moment]:
    """Return one end of each of several nodes, at ``frames`` of the clip; ``standing`` says which are standing cuts.

    The planted foot is the slower one, or both if standing. hold_standing: as of :func:`make_nodes`.
    """
    clouds = point_clouds(prepared.clip, prepared.track, np.array(frames), np.array(standing) & hold_standing)
    moments = []
    for frame, stands, cloud in zip(frames, standing, clouds, strict=True):
        foot = BOTH_FEET if stands else int(np.argmin(prepared.foot_speed[frame]))
        moments.append(Moment(frame, cloud, foot, prepared.foot_places[frame]))
    return moments


def _foot_joints(clip: Clip, side: str) -> list[int]:
    """Return the joints of ankle and toe of one foot, the ankle twice if there is no toe."""
    ankle = clip.skeleton.joint(f"{side}_ankle")
    return [ankle, clip.skeleton.roles.get(f"{side}_toe", ankle)]


def _require_same_skeleton(first: Clip, other: Clip) -> None:
    """Raise MotionError if two clips differ in joints, or by more than 1 mm in a bone."""
    a, b = first.skeleton, other.skeleton
    # Most clips of a folder share one skeleton.
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
