"""Everything that a run reads and never changes: what of the environment stands still, the bodies, the motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
from crowdsim.constants import CAPTURE_RATE, NONE, TRACKING_MARGIN
from crowdsim.environment.layers import ClearanceLayer
from crowdsim.errors import MotionError, ScenarioError
from crowdsim.following.follower.path_follower import Character
from crowdsim.following.maps.map_file import maps_in_file
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.elementary import sin
from crowdsim.jit import cache_folder
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.planning.baselines.collision3d import Bodies, make_bodies
from crowdsim.planning.baselines.collision_scene import CollisionScene
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Timetable

SIDEWAYS = 0.7
"""Sine of the angle between where a body faces and where it goes from which on it goes sideways."""


@dataclass(frozen=True)
class Assets:
    """Layers without what moves (legs first), behaviors (least preferred first), the motion graph and its maps.

    Meshes, and where movables stand, are in :class:`crowdsim.crowd.state.environment.EnvironmentState`. planner: what
    finds routes; bodies: what it moves through the environment in 3D, if it does.
    """

    layers: tuple[ClearanceLayer, ...]
    behaviors: tuple[Behavior, ...]
    motion: MotionGraph
    maps: MotionMaps
    timetable: Timetable
    steps_per_second: int
    planner: str = "layered"
    bodies: Bodies | None = None

    @property
    def graph(self) -> GraphArrays:
        return self.motion.arrays

    @property
    def frames_per_step(self) -> int:
        return CAPTURE_RATE // self.steps_per_second

    @cached_property
    def body_radii(self) -> NDArray[np.float64]:
        """(B, layers) meters, the body's own clearance of every behavior on every layer."""
        return np.ascontiguousarray([behavior.radii for behavior in self.behaviors], np.float64)

    @cached_property
    def breadths(self) -> NDArray[np.float64]:
        """(B, 2) meters, the body towards others in each behavior: radius of a capsule, and half its core.

        The core lies across the direction that the body faces. Who faces ahead, arms held in or not, is a disc; who
        walks sideways is as narrow as the behavior and as long as the widest. A behavior in which nobody can come to
        rest counts as the widest, as who stops in it stands otherwise.
        """
        breadths = np.zeros((len(self.behaviors), 2))
        breadths[:, 0] = self.body_radii.max(axis=1)
        sideways = np.array([np.abs(sin(np.array(b.facings))).min() > SIDEWAYS for b in self.behaviors])
        breadths[sideways, 1] = self.personal_radius - breadths[sideways, 0]
        ends = np.flatnonzero(self.graph.node_ends_standing)
        after = np.array([self.idle_after(int(node)) for node in ends], np.int64)
        rests = (after != NONE) & (self.graph.node_behavior[after] == self.graph.node_behavior[ends])
        breadths[self.graph.node_behavior[ends[~rests]]] = self.personal_radius, 0.0
        return breadths

    @cached_property
    def need(self) -> Requirements:
        """The clearances with which paths are planned."""
        return Requirements.of(self.behaviors, len(self.layers), TRACKING_MARGIN)

    @cached_property
    def facings(self) -> NDArray[np.float64]:
        """(B, F) radians the body may face off its direction of motion, nan where a behavior has fewer."""
        widest = max(len(behavior.facings) for behavior in self.behaviors)
        rows = [[*behavior.facings, *[np.nan] * (widest - len(behavior.facings))] for behavior in self.behaviors]
        return np.array(rows, np.float64)

    @cached_property
    def character(self) -> Character:
        """What every character follows paths with."""
        return Character(self.graph, self.maps, self.body_radii, self.facings)

    @property
    def personal_radius(self) -> float:
        """Radius of the disc that encloses a body whatever it does: that of the widest behavior."""
        return float(self.body_radii.max())

    @property
    def passing_width(self) -> float:
        """Meters that somebody needs who passes another who stands, both facing along the way, one with its arms in."""
        facing = self.body_radii.max(axis=1)[self.breadths[:, 1] == 0.0]
        return 2.0 * (self.personal_radius + float(facing.min()))

    @cached_property
    def idle_nodes(self) -> NDArray[np.int32]:
        """(B,) node in which a character of each behavior waits standing, -1 where there is none."""
        nodes = np.full(len(self.behaviors), NONE, np.int32)
        for node in np.flatnonzero(self.graph.node_idle)[::-1]:
            nodes[self.graph.node_behavior[node]] = node
        return nodes

    def idle_after(self, node: int) -> int:
        """Idle node that may follow ``node``, of the same behavior if there is one; -1 where there is none."""
        graph = self.graph
        targets = graph.edge_target[graph.edge_start[node] : graph.edge_start[node + 1]]
        idle = targets[graph.node_idle[targets]]
        same = idle[graph.node_behavior[idle] == graph.node_behavior[node]]
        return int(next(iter([*same, *idle]), NONE))


def load_behaviors(scenario: Scenario) -> BehaviorSet:
    """The behaviors of a scenario, measured on its layers, with their motion graph.

    Raises BehaviorError or MotionError where something cannot be used.
    """
    bands = [(layer.low, layer.high) for layer in scenario.environment.layers]
    captures = scenario.captures_folder()
    if captures is None:
        # A scenario names a set or captures, never both.
        return load_behavior_set(scenario.behaviors, bands, motion_set=str(scenario.motion.set))
    return load_behavior_set(scenario.behaviors, bands, captures=captures, capture_patterns=scenario.motion.clips)


def prepare(
    scenario: Scenario,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    behavior_set: BehaviorSet | None = None,
) -> Assets:
    """Build layers, motion graph and motion maps for a scenario.

    Maps that were built before are mapped from a file. Else so many ``workers`` build them, and ``progress`` is called
    with the nodes whose map is done and their number. ``behavior_set`` is that of the scenario if it is loaded already.

    Raises ScenarioError, GeometryError, BehaviorError or MotionError where something cannot be used.
    """
    behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
    if not behavior_set.graph.arrays.node_ends_standing.any():
        raise MotionError("no clip of the motion set ends standing, so no character could ever wait; add one that does")
    shortest = int(behavior_set.graph.arrays.node_frames.min())
    if scenario.steps_per_second * shortest < CAPTURE_RATE:
        message = (
            f"a step of {1.0 / scenario.steps_per_second:g} s is longer than the shortest movement of the motion set "
            f"({shortest / CAPTURE_RATE:.2f} s); take more steps"
        )
        raise ScenarioError([scenario.problem(("steps_per_second",), message)])
    bodies = None
    if scenario.planner == "collision3d":
        bodies = make_bodies(CollisionScene(scenario.environment.timetable.fixed), behavior_set.behaviors)
    return Assets(
        layers=scenario.environment.fixed_layers,
        behaviors=behavior_set.behaviors,
        motion=behavior_set.graph,
        maps=maps_in_file(cache_folder() / "maps", behavior_set.graph.arrays, progress=progress, workers=workers),
        timetable=scenario.environment.timetable,
        steps_per_second=scenario.steps_per_second,
        planner=scenario.planner,
        bodies=bodies,
    )
