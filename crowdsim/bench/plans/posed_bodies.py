"""Bodies posed in 3D along plans, and how far they reach into obstacles.

In a bend, the front foot lands around it already. Legs are therefore bent along the path: each of their points moves to
where the path is as many meters ahead, or stays at an end of the path. The body above the hips keeps its shape and the
heading that followers give it, along the path smoothed over its corners. Clips begin and end standing with hanging
arms, as do paths. Before and after a section for which the body turns off its path, it is posed as in the clips that
turn, in the middle of the room that plans leave for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior, read_behavior
from crowdsim.environment.layers import AnySolid
from crowdsim.environment.solids import Solid
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.body_capsules import Capsules, body_capsules
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.planning.labels.annotated_path import TANGENT_REACH, AnnotatedPath
from crowdsim.planning.labels.labelling_kernels import TURN_ROOM

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SPACING = 0.05
"""Distance along a path between two poses [m]."""

LOWEST = 0.1
"""Height below which obstacles are ignored [m]."""

SLICE = 0.02
"""Height of the upright prisms that approximate a solid of triangles [m]."""

ENDS = 0.6
"""Length at both ends of a path along which bodies are posed as they set out and come to rest [m]."""

AT_REST = 0.1
"""Distance from the ends within which arms hang that are held elsewhere [m]."""

_ON_AXIS = np.linspace(0.0, 1.0, 5)
"""Positions on the axis of a capsule that are tested, from 0 to 1."""

_TURNED = 0.2
"""Frames whose heading differs by at most this from that before or after a turn are no part of the turn [rad]."""


class Walk(NamedTuple):
    """A clip from stand to stand.

    Attributes
    ----------
    body : Capsules
        Poses.
    arc : (F,) float64
        Distance walked up to each frame [m].
    steady : (float, float)
        Distances between which it is repeated [m].
    facing : float
        Heading relative to the direction of motion [rad].
    """

    body: Capsules
    arc: Floats
    steady: tuple[float, float]
    facing: float


class Turn(NamedTuple):
    """The part of a clip in which the body turns off its path or back.

    Attributes
    ----------
    body : Capsules
        Poses.
    arc : (F,) float64
        Distance up to each frame, from where the turn begins [m].
    facing : (F,) float64
        Heading relative to the path [rad].
    """

    body: Capsules
    arc: Floats
    facing: Floats


class Motions(NamedTuple):
    """Clips to pose: the walk of each behavior, and by behavior the turns into it and out of it, if there are any."""

    walks: tuple[Walk, ...]
    turns: dict[int, tuple[Turn, Turn]]


class Posed(NamedTuple):
    """Points on the bones of all poses along a path.

    Attributes
    ----------
    places : (n, 3) float64
        Points [m].
    reach : (n,) float64
        Radius of the body around each point [m].
    arc : (n,) float64
        Position of the body along the path [m].
    """

    places: Floats
    reach: Floats
    arc: Floats


def motions_of(behaviors: Sequence[Behavior]) -> Motions:
    """Return the clips with which bodies of ``behaviors`` are posed.

    These are the first clip of each behavior, in its first facing, and, of turned behaviors, the first clips that lead
    to this facing from the last behavior, and back.
    """
    walks, turns = [], {}
    for k, behavior in enumerate(behaviors):
        entry = read_behavior(behavior.name, behavior.folder.parent)
        facing = behavior.facings[0]
        walks.append(walk_of(read_clip(behavior.folder / entry.clips[0].file), facing))
        if not behavior.turned:
            continue
        pair = []
        for ends, sign in (((behaviors[-1].name, behavior.name), 1.0), ((behavior.name, behaviors[-1].name), -1.0)):
            clips = [read_clip(behavior.folder / t.file) for t in entry.transitions if (t.from_, t.to) == ends]
            pair += [turn_of(clip, facing, sign < 0.0) for clip in clips if _turned_by(clip) * sign * facing > 0.0][:1]
        if len(pair) == 2:
            turns[k] = (pair[0], pair[1])
    return Motions(tuple(walks), turns)


def walk_of(clip: Clip, facing: float) -> Walk:
    """Return a clip that faces ``facing`` [rad] off its direction as a walk; its middle half is repeated."""
    arc = _arc_of(clip)
    count = len(arc)
    return Walk(body_capsules(clip, 0, count), arc, (float(arc[count // 4]), float(arc[3 * count // 4])), facing)


def _arc_of(clip: Clip) -> Floats:
    """Return (F,) the length of the track up to each frame [m]."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(track_of(clip)[:, :2], axis=0).T)))


def _turned_by(clip: Clip) -> float:
    """Return the change of heading from the first frame to the last [rad]."""
    return float(np.diff(np.unwrap(track_of(clip)[:, 2])[[0, -1]])[0])


def turn_of(clip: Clip, facing: float, back: bool) -> Turn:
    """Return the frames of a clip in which it turns from its path to ``facing`` [rad], or ``back``."""
    track = track_of(clip)
    heading = np.unwrap(track[:, 2])
    off = heading - heading[-1] if back else heading - heading[0]
    turning = np.flatnonzero((np.abs(off) > _TURNED) & (np.abs(off - facing) > _TURNED))
    first, last = int(turning[0]), int(turning[-1]) + 1
    arc = _arc_of(clip)[first:last]
    return Turn(body_capsules(clip, first, last), arc - arc[0], off[first:last])


def posed_along(path: AnnotatedPath, motions: Motions, stiff: bool = False) -> Posed:
    """Return bodies every :data:`SPACING` meters along a path; ``stiff`` keeps legs as on a straight path."""
    samples = path.sample(SPACING)
    arc, labels = samples.arc, samples.behavior.copy()
    # Where the body turns, it is posed from the clip that turns; beside that it stays turned up to the section.
    parts = []
    turning = np.zeros(len(arc), np.bool_)
    for behavior, turn, begin, (low, high) in turns_along(path, motions):
        labels[(arc >= low) & (arc <= high)] = behavior
        here = np.flatnonzero((arc >= begin) & (arc <= begin + turn.arc[-1]))
        turning[here] = True
        frames = np.searchsorted(turn.arc, arc[here] - begin).clip(0, len(turn.arc) - 1)
        parts.append(_posed(path, turn.body, frames, arc[here], turn.facing[frames], stiff))
    # At both ends, bodies that face ahead stand as in the last behavior, with hanging arms.
    rest = path.length - arc
    upright = np.array([abs(walk.facing) < np.pi / 4.0 for walk in motions.walks])
    labels[upright[labels] & (np.minimum(arc, rest) < AT_REST)] = len(motions.walks) - 1
    for k, walk in enumerate(motions.walks):
        here = np.flatnonzero((labels == k) & ~turning)
        # Distances in the clip: its steady part again and again, its own beginning and end at those of the path.
        low, high = walk.steady
        on = low + arc[here] % (high - low)
        on = np.where(arc[here] < ENDS, arc[here], on)
        on = np.where(rest[here] < np.minimum(ENDS, arc[here]), walk.arc[-1] - rest[here], on)
        frames = np.searchsorted(walk.arc, on).clip(0, len(walk.arc) - 1)
        parts.append(_posed(path, walk.body, frames, arc[here], np.full(len(here), walk.facing), stiff))
    return Posed(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def turns_along(path: AnnotatedPath, motions: Motions) -> list[tuple[int, Turn, float, tuple[float, float]]]:
    """Return the turns of a path.

    Each is (turned behavior, turn, arc length at which it begins, range of arc lengths outside of its section over
    which the body stays turned) [m].
    """
    # A turn lies in the middle of TURN_ROOM, the way that plans leave for it beside a section of a turned behavior.
    found = []
    for before, after in zip(path.sections[:-1], path.sections[1:], strict=True):
        if after.behavior in motions.turns:
            turn = motions.turns[after.behavior][0]
            end = before.end - 0.5 * (TURN_ROOM - float(turn.arc[-1]))
            found.append((after.behavior, turn, end - float(turn.arc[-1]), (end, before.end)))
        if before.behavior in motions.turns:
            turn = motions.turns[before.behavior][1]
            begin = before.end + 0.5 * (TURN_ROOM - float(turn.arc[-1]))
            found.append((before.behavior, turn, begin, (before.end, begin)))
    return found


def _posed(
    path: AnnotatedPath, body: Capsules, frames: Integers, arc: Floats, facing: Floats, stiff: bool
) -> tuple[Floats, Floats, Floats]:
    """Return a body in ``frames`` (s,) at arc lengths (s,) [m], with headings (s,) off the path [rad].

    The result is places, reach and arc of :class:`Posed`. A capsule's axis is given by its ends, in the frame of the
    body's track.
    """
    ends = body.ends[frames]
    points = ends[:, :, 0, None] + _ON_AXIS[:, None] * (ends[:, :, 1] - ends[:, :, 0])[:, :, None]
    cos, sin = np.cos(facing)[:, None, None], np.sin(facing)[:, None, None]
    along = cos * points[..., 0] - sin * points[..., 1]
    aside = sin * points[..., 0] + cos * points[..., 1]
    at = np.broadcast_to(arc[:, None, None], along.shape)
    bent = np.broadcast_to(body.legs[:, None] & (not stiff), along.shape)
    # Points of bent legs move along the path (onward) and keep nothing ahead; other points keep their offset ahead.
    onward = np.where(bent, np.clip(at + along, 0.0, path.length), at)
    ahead = np.where(bent, 0.0, along)
    bearing = _bearings(path, onward)
    cos, sin = np.cos(bearing), np.sin(bearing)
    floor = path.at(onward.ravel()).reshape(*onward.shape, 2)
    x = floor[..., 0] + cos * ahead - sin * aside
    y = floor[..., 1] + sin * ahead + cos * aside
    reach = np.broadcast_to(body.radii[:, None], along.shape)
    return np.stack([x, y, points[..., 2]], axis=-1).reshape(-1, 3), reach.ravel(), at.ravel()


def _bearings(path: AnnotatedPath, arc: Floats) -> Floats:
    """Return the direction of motion at arc lengths of any shape, smoothed as in :meth:`AnnotatedPath.sample` [rad]."""
    chord = path.at((arc + TANGENT_REACH).ravel()) - path.at((arc - TANGENT_REACH).ravel())
    return np.arctan2(chord[:, 1], chord[:, 0]).reshape(arc.shape)


class Obstacles:
    """Solids as upright prisms, those of triangles in slices, which answer how deep points are inside."""

    def __init__(self, solids: Sequence[AnySolid]) -> None:
        # Of each solid: how many prisms it has, the number of the first among all, and their common height.
        solids = [solid for solid in solids if solid.top > LOWEST]
        prisms = [_prisms(solid) for solid in solids]
        self._counts = np.array([len(own) for own in prisms])
        self._firsts = np.cumsum(self._counts) - self._counts
        self._bottoms = np.array([solid.bottom for solid in solids])
        self._heights = np.array([solid.top - solid.bottom for solid in solids]) / self._counts
        self._footprints = np.array([footprint for own in prisms for footprint in own], dtype=object)
        self._rims = shapely.boundary(self._footprints)
        shapely.prepare(self._footprints)
        self._tree = shapely.STRtree([solid.footprint for solid in solids])

    def depths(self, posed: Posed) -> Floats:
        """Return how far the body around each of n points reaches into a solid, (n,) [m]; -inf if it touches none."""
        depths = np.full(len(posed.reach), -np.inf)
        points = shapely.points(posed.places[:, :2])
        row, solid = self._tree.query(points, predicate="dwithin", distance=posed.reach)
        # Only prisms of the solid that are near enough in height.
        up = posed.places[row, 2] - self._bottoms[solid]
        reach, height = posed.reach[row], self._heights[solid]
        low = np.maximum(np.floor((up - reach) / height), 0).astype(np.int64)
        high = np.minimum(np.floor((up + reach) / height), self._counts[solid] - 1).astype(np.int64)
        many = np.maximum(high - low + 1, 0)
        # One row for each pair of a point and a prism, `level` prisms above the lowest of its solid; `above` is the
        # height of the point above or below it, negative within.
        pair = np.repeat(np.arange(len(row)), many)
        level = low[pair] + np.arange(len(pair)) - np.repeat(np.cumsum(many) - many, many)
        above = np.maximum(level * height[pair] - up[pair], up[pair] - (level + 1) * height[pair])
        row, prism = row[pair], self._firsts[solid[pair]] + level
        distance = prism_distances(self._footprints[prism], self._rims[prism], points[row], above)
        depth = posed.reach[row] - distance
        touched = depth > 0.0
        np.maximum.at(depths, row[touched], depth[touched])
        return depths


def prism_distances(footprints: NDArray[Any], rims: NDArray[Any], points: NDArray[Any], above: Floats) -> Floats:
    """Return distances (n,) of points from upright prisms [m], negative inside; nan for an empty footprint.

    Parameters
    ----------
    footprints, rims : (n,) shapely geometries
        Polygons and their boundaries.
    points : (n,) shapely points
        Points projected on the floor.
    above : (n,) float64
        Height above or below the prism [m], negative between bottom and top.
    """
    rim = shapely.distance(rims, points)
    beside = np.where(shapely.contains(footprints, points), -rim, rim)
    outside = np.hypot(np.maximum(beside, 0.0), np.maximum(above, 0.0))
    distance: Floats = np.where((beside < 0.0) & (above < 0.0), np.maximum(beside, above), outside)
    return distance


def _prisms(solid: AnySolid) -> list[shapely.Geometry]:
    """Return footprints of the equally high prisms that approximate a solid, from bottom to top; low ones are empty."""
    if isinstance(solid, Solid):
        return [solid.footprint]
    heights = np.linspace(solid.bottom, solid.top, max(int(np.ceil((solid.top - solid.bottom) / SLICE)), 1) + 1)
    return [
        solid.footprint_in(low, high) if high > LOWEST else shapely.Polygon()
        for low, high in zip(heights[:-1].tolist(), heights[1:].tolist(), strict=True)
    ]
