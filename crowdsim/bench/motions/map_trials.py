"""Random paths through a room of obstacles like that of figure 8 of the 2012 paper, and functions that follow them.

Paths are 10 to 18 m long, have a clearance of 0.5 m, and are walked from standing to within 10 cm of the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import facings_of
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
from crowdsim.bench.places.random_ground import GroundKind, random_ground
from crowdsim.constants import CAPTURE_PATTERNS, NONE
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.following.follower.body_reach import BodyReach, body_reach
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, follow_path
from crowdsim.following.graph_search.graph_search import SearchResult
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES
from crowdsim.motion.synthesis.library import motion_database
from crowdsim.motion.synthesis.styles import MANNERS
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath, PathSamples, Section, arc_lengths

Floats = NDArray[np.float64]
FOUND = FollowStatus.FOUND

SIDE = 30.0
"""Side of the square room [m]."""

DENSITY = 0.08
"""Share of the floor, without 0.5 m along its edge, that obstacles cover."""

SIZES = (0.5, 2.0)
"""Least and greatest extent of an obstacle [m]."""

CLEARANCE = 0.5
LENGTHS = (10.0, 18.0)
"""Distance of paths from obstacles, and their least and greatest length [m]."""

TOLERANCE = 0.1
"""Largest distance from the end of a path at which a motion has arrived [m]."""

PASSES = 3

CAPTURED = ("16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*")
"""Captured walks, straight and turning, of one person."""


class Trial(NamedTuple):
    """A path to walk: its points (n, 2) [m], its samples, and the pose at the start: x, y [m], heading [rad]."""

    points: Floats
    samples: PathSamples
    start: Floats


@dataclass(frozen=True)
class MotionSet:
    """A motion graph with what following paths needs.

    Attributes
    ----------
    name : str
        Name in the table.
    motion : MotionGraph
        The graph.
    radii : (B, 2) float64
        Body radii of the behaviors, legs and torso [m].
    facings : (B, F) float64
        Facings of the behaviors [rad].
    waiting : int
        Node in which a body waits; NONE without one.
    reach : BodyReach or None
        Extent of its joints, which all stay within the clearance of the path; None if they may leave it.
    """

    name: str
    motion: MotionGraph
    radii: Floats
    facings: Floats
    waiting: int
    reach: BodyReach | None

    @property
    def graph(self) -> GraphArrays:
        """Return the arrays of the graph."""
        return self.motion.arrays

    def character(self, maps: MotionMaps) -> Character:
        """Return a character that follows paths with ``maps``."""
        return Character(self.graph, maps, self.radii, self.facings, self.reach)


@dataclass(frozen=True)
class Ground:
    """Meshes for legs and torso, and trials on them."""

    meshes: tuple[NavMesh, NavMesh]
    trials: list[Trial]

    @property
    def arrays(self) -> tuple[Any, Any]:
        """Return the arrays of both meshes."""
        return self.meshes[0].arrays, self.meshes[1].arrays


def captured_walks(captures: Path) -> Sequence[str]:
    """Return patterns of the walks in a folder: CAPTURED if it has some of each, else all captures."""
    return CAPTURED if all(any(captures.glob(pattern)) for pattern in CAPTURED) else CAPTURE_PATTERNS


def load_behaviors(captures: Path | None, patterns: Sequence[str] | None = None) -> BehaviorSet:
    """Return the built-in behaviors, or frontal walking made of the walks in ``captures``."""
    bands = [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]
    if captures is None:
        return load_behavior_set(["lateral", "arm_constrained", "frontal"], bands)
    return load_behavior_set(
        ["frontal"], bands, captures=captures, capture_patterns=patterns or captured_walks(captures)
    )


def waiting_node(graph: GraphArrays) -> int:
    """Return the node in which a body of the preferred behavior waits for a search; NONE if there is none."""
    waits = np.flatnonzero(graph.node_idle & (graph.node_behavior == graph.node_behavior.max()))
    return int(waits[0]) if len(waits) else NONE


def load_set(name: str, captures: Path | None) -> MotionSet:
    """Return the behaviors of :func:`load_behaviors` with what following paths needs."""
    loaded = load_behaviors(captures)
    facings = facings_of(loaded.behaviors)
    graph = loaded.graph.arrays
    radii = np.array([behavior.radii for behavior in loaded.behaviors])
    reach = body_reach(graph, loaded.graph.poses, np.full(len(radii), CLEARANCE))
    return MotionSet(name, loaded.graph, radii, facings, waiting_node(graph), reach)


def load_standard(name: str, captures: Path | None, features: MotionSet) -> MotionSet:
    """Return the standard graph of the clips that ``features``, a feature-based graph, is made of.

    The clips are those in ``captures``, or the built-in ones, all as one behavior. The graph has no node to wait in.
    """
    clips = (
        motion_database(MANNERS["default"])
        if captures is None
        else read_clips(capture_paths(captures, captured_walks(captures)))
    )
    graph = build_standard_graph(as_sources(clips))
    reach = body_reach(graph.arrays, graph.poses, np.full(len(features.radii), CLEARANCE))
    return MotionSet(name, graph, features.radii, features.facings, NONE, reach)


def make_ground(behavior: int, trials: int, seed: int = 0) -> Ground:
    """Return a room of obstacles like that of the paper's figure 8, and ``trials`` random paths in it.

    ``behavior`` is the number of the behavior of all paths.
    """
    ground = random_ground(GroundKind(SIDE, SIZES, CLEARANCE, LENGTHS), DENSITY, trials, seed)
    return Ground((ground.legs, ground.torso), [as_trial(points, behavior) for points in ground.paths])


def as_trial(points: Floats, behavior: int) -> Trial:
    """Return the path through ``points`` (n, 2) [m] with one behavior, given by its number, as a trial."""
    arc = arc_lengths(points)
    samples = AnnotatedPath(points, arc, (Section(behavior, 0.0, float(arc[-1])),), 0.0).sample()
    return Trial(points, samples, samples.pose[0].copy())


def follow_trial(
    motions: MotionSet, maps: MotionMaps, ground: Ground, trial: Trial, options: FollowOptions
) -> FollowResult:
    """Follow the path of a trial."""
    character = motions.character(maps)
    return follow_path(character, trial.samples, ground.arrays, trial.start, motions.waiting, options)


def follow_all(motions: MotionSet, maps: MotionMaps, ground: Ground) -> list[tuple[FollowResult, float]]:
    """Return the result of the follower for each trial, and its time [ms]."""
    options = FollowOptions(goal_tolerance=TOLERANCE, budget=2_000)
    follow_trial(motions, maps, ground, ground.trials[0], options)  # compiles kernels
    return [best_of(partial(follow_trial, motions, maps, ground, trial, options)) for trial in ground.trials]


def best_of(search: Callable[[], Any], passes: int = PASSES) -> tuple[Any, float]:
    """Return the result of ``search``, which is called ``passes`` times, and its shortest time [ms]."""
    seconds = []
    for _ in range(passes):
        begin = time.perf_counter()
        result = search()
        seconds.append(time.perf_counter() - begin)
    return result, min(seconds) * 1e3


def walked(graph: GraphArrays, found: FollowResult | SearchResult, goal: Floats) -> float:
    """Return the length of the track up to where its last node is nearest to ``goal`` (2,) [m].

    Blend offsets between nodes count, as bodies move by them too.
    """
    node = int(found.nodes[-1])
    rows = int(graph.node_track[node]) + np.arange(int(graph.node_frames[node]) + 1)
    track = compose(found.origins[-1], graph.tracks[rows])[:, :2]
    arc = arc_lengths(track)
    last = arc[int(np.argmin(np.hypot(*(track - goal).T)))]
    blend_offsets = compose(found.origins[:-1], graph.node_motion[found.nodes[:-1]])[:, :2] - found.origins[1:, :2]
    return float(graph.node_length[found.nodes[:-1]].sum() + last + np.hypot(*blend_offsets.T).sum())


def most_excess(motions: MotionSet, trial: Trial, found: FollowResult) -> float:
    """Return by how much a joint leaves the clearance of the path on the floor, over all frames that are shown [m].

    Blend offsets fade out as in a recording. Frames in which no joint can come near the edge are skipped, so the result
    is never below -0.05.
    """
    graph, poses = motions.graph, motions.motion.poses
    tracks: list[Floats] = []
    nodes: list[NDArray[Any]] = []
    before: list[NDArray[Any]] = []
    frames: list[NDArray[Any]] = []
    end: Floats | None = None
    for k, (node, origin) in enumerate(zip(found.nodes, found.origins, strict=True)):
        frame = np.arange(int(graph.node_frames[node]) + 1)
        track = compose(origin, graph.tracks[graph.node_track[node] + frame])
        if end is not None:
            blend_offset = end - origin
            blend_offset[2] = wrap_angle(blend_offset[2])
            u = np.minimum(frame / BLEND_FRAMES, 1.0)
            track += (1.0 - u * u * (3.0 - 2.0 * u))[:, None] * blend_offset
        end = compose(origin, graph.node_motion[node])
        tracks.append(track)
        nodes.append(np.full(len(frame), node, np.int32))
        before.append(np.full(len(frame), found.nodes[k - 1] if k else NONE, np.int32))
        frames.append(frame.astype(np.float64))
    # The motion ends at the frame nearest to the goal.
    last = int(np.argmin(np.hypot(*(tracks[-1][:, :2] - trial.points[-1]).T)))
    count = sum(len(track) for track in tracks[:-1]) + last + 1
    pose = np.concatenate(tracks)[:count]
    node, previous, at = (np.concatenate(column)[:count] for column in (nodes, before, frames))
    line = shapely.LineString(trial.points)
    gap = shapely.distance(line, shapely.points(pose[:, :2]))
    reach = motions.reach or body_reach(graph, poses, np.full(len(motions.radii), CLEARANCE))
    near = gap + np.maximum(reach.node_most.max(), reach.edge_most.max()) > CLEARANCE - 0.05
    joints = len(poses.parents)
    places, turns = np.empty((near.sum(), joints, 3), np.float32), np.empty((near.sum(), joints, 4), np.float32)
    pose_joints(poses, node[near], previous[near], at[near], np.ascontiguousarray(pose[near]), places, turns)
    return float(shapely.distance(line, shapely.points(places[:, :, :2].reshape(-1, 2))).max(initial=0.45)) - CLEARANCE
