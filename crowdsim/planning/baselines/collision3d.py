"""Baseline of table 1 of the 2018 paper: the published search, but with the whole body tested in 3D along paths.

Paths are found in the lowest layer as usual. Then, every :data:`SPACING` meters along them, the body of each behavior
is posed in its cycle and tested against all surfaces of the place.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior, read_behavior
from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.body_capsules import body_capsules
from crowdsim.motion.clips.tracks import track_of
from crowdsim.planning.baselines.collision_scene import CollisionScene, Stride
from crowdsim.planning.baselines.greedy import plan_step_by_step
from crowdsim.planning.labels.annotated_path import AnnotatedPath, arc_lengths, points_at
from crowdsim.planning.labels.labelling import label_path
from crowdsim.planning.query.query import Query

Floats = NDArray[np.float64]

SPACING = 0.05
"""Distance between two tested poses along a path [m]."""


class Bodies(NamedTuple):
    """Scene, and for each behavior a cycle of its motion and its facing: heading less direction of motion [rad]."""

    scene: CollisionScene
    strides: tuple[Stride, ...]
    facings: tuple[float, ...]


def make_bodies(scene: CollisionScene, behaviors: Sequence[Behavior]) -> Bodies:
    """Return the bodies of library behaviors: the middle half of each one's first clip, where it walks steadily.

    Raises
    ------
    BehaviorError, MotionError: if a behavior's files cannot be used.
    """
    strides, facings = [], []
    for behavior in behaviors:
        entry = read_behavior(behavior.name, behavior.folder.parent)
        clip = read_clip(behavior.folder / entry.clips[0].file)
        first, last = len(clip.root_positions) // 4, 3 * len(clip.root_positions) // 4
        way = np.diff(track_of(clip)[first:last, :2], axis=0)
        strides.append(Stride(body_capsules(clip, first, last), float(hypot(*way.T).sum())))
        facings.append(behavior.facings[0])
    return Bodies(scene, tuple(strides), tuple(facings))


def plan_collision3d(query: Query, bodies: Bodies) -> AnnotatedPath | None:
    """Run the published planner with tests in 3D; return None if no path fits any behavior."""
    return plan_step_by_step(query, lambda points: annotated_in_3d(query, bodies, points))


def annotated_in_3d(query: Query, bodies: Bodies, points: Floats) -> AnnotatedPath:
    """Return the polyline (n, 2) with its cheapest sections by collisions of bodies in 3D.

    No sections and infinite cost if no body fits somewhere.
    """
    arc = arc_lengths(points)
    count = max(int(np.ceil(arc[-1] / SPACING)), 1)
    at = np.linspace(0.0, arc[-1], count + 1)
    places = points_at(points, arc, at)
    ahead = np.gradient(places, axis=0)
    bearing = atan2(ahead[:, 1], ahead[:, 0])
    free = np.ones(count + 1, np.bool_)
    blocked = []
    # From the narrowest behavior on: where a narrower body collides, no wider one fits.
    for stride, facing in zip(bodies.strides, bodies.facings, strict=True):
        for k in np.flatnonzero(free):
            free[k] = not bodies.scene.collides(stride.body(at[k]), places[k, 0], places[k, 1], bearing[k] + facing)
        # A tested place stands for the path up to halfway to the next ones.
        half = 0.5 * arc[-1] / count
        hits = at[~free]
        blocked.append(np.column_stack([np.maximum(hits - half, 0.0), np.minimum(hits + half, arc[-1])]))
    sections, cost = label_path(blocked, query.need.costs, query.need.turned, float(arc[-1]), query.terms)
    return AnnotatedPath(points, arc, sections, cost)
