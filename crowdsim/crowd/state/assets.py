"""Constant data of a run: immovable parts of the environment, behaviors, motion graph and motion maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.behaviors.entries import find_entries, node_phases
from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
from crowdsim.constants import CAPTURE_RATE, NONE, TRACKING_MARGIN
from crowdsim.environment.layers import ClearanceLayer, dropped_solids
from crowdsim.errors import BehaviorError, CrowdSimError, MotionError, ScenarioError
from crowdsim.following.follower.character import Character
from crowdsim.following.maps.map_file import maps_in_file
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.elementary import sin
from crowdsim.jit import cache_folder
from crowdsim.motion.captures.reader import UNITS
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.planning.baselines.collision3d import Bodies, make_bodies
from crowdsim.planning.baselines.collision_scene import CollisionScene
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.people.walkers import mean_speed
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Timetable

SIDEWAYS = 0.7
"""Sine of the angle between facing and walking direction above which a body walks sideways."""


@dataclass(frozen=True)
class Assets:
    """Layers without movables (legs first), behaviors (least preferred first), motion graph and motion maps.

    Meshes and positions of movables are in :class:`crowdsim.crowd.state.environment.EnvironmentState`.
    """

    layers: tuple[ClearanceLayer, ...]
    behaviors: tuple[Behavior, ...]
    motion: MotionGraph
    maps: MotionMaps
    timetable: Timetable
    steps_per_second: int
    planner: str = "layered"
    """Name of the planner that finds routes."""
    bodies: Bodies | None = None
    """Bodies that the planner ``collision3d`` moves through the environment; None for the other planners."""

    @property
    def graph(self) -> GraphArrays:
        """Return the motion graph as kernels take it."""
        return self.motion.arrays

    @property
    def frames_per_step(self) -> int:
        """Return the number of frames of a step."""
        return CAPTURE_RATE // self.steps_per_second

    @property
    def body_radii(self) -> NDArray[np.float64]:
        """Return the clearance that each behavior needs on each layer, (B, layers) [m]."""
        return self.character.radii

    @cached_property
    def breadths(self) -> NDArray[np.float64]:
        """Return the body towards others in each behavior, (B, 2): radius of a capsule, half length of its core [m].

        The core lies across the direction that the body faces. In a behavior that faces ahead, arms held in or not, the
        body is a disc. In one that walks sideways it is a capsule with the radius of the behavior, as long as the
        widest behavior is broad. A behavior in which an agent may stop, but not stand, gives the disc of the widest
        one: a node of it ends standing, and no idle node of the same behavior may follow.
        """
        breadths = np.zeros((len(self.behaviors), 2))
        breadths[:, 0] = self.body_radii.max(axis=1)
        # A behavior walks sideways if each of its facings does.
        sideways = np.array([np.abs(sin(np.array(b.facings))).min() > SIDEWAYS for b in self.behaviors])
        breadths[sideways, 1] = self.personal_radius - breadths[sideways, 0]
        ends = np.flatnonzero(self.graph.node_ends_standing)
        after = np.array([self.idle_after(int(node)) for node in ends], np.int64)
        rests = (after != NONE) & (self.graph.node_behavior[after] == self.graph.node_behavior[ends])
        breadths[self.graph.node_behavior[ends[~rests]]] = self.personal_radius, 0.0
        return breadths

    @cached_property
    def need(self) -> Requirements:
        """Return the clearances with which paths are planned."""
        return Requirements.of(self.behaviors, len(self.layers), TRACKING_MARGIN)

    @property
    def facings(self) -> NDArray[np.float64]:
        """Return the angles that the body may face off its direction of motion, (B, F) [rad], filled up with nan."""
        return self.character.facings

    @cached_property
    def character(self) -> Character:
        """Return the data with which every agent follows paths."""
        return Character.of(self.behaviors, self.graph, self.maps)

    @property
    def personal_radius(self) -> float:
        """Return the radius of the disc that contains a body in any behavior, that of the widest [m]."""
        return float(self.body_radii.max())

    @property
    def passing_width(self) -> float:
        """Return the least width of a passage in which the narrowest agent that faces ahead passes a standing one [m].

        It is the sum of two diameters: of the widest body, which stands, and of the narrowest one that faces ahead (a
        disc).
        """
        facing = self.body_radii.max(axis=1)[self.breadths[:, 1] == 0.0]
        return 2.0 * (self.personal_radius + float(facing.min()))

    @cached_property
    def idle_nodes(self) -> NDArray[np.int32]:
        """Return the node in which an agent of each behavior waits standing, (B,) int32, -1 if there is none."""
        nodes = np.full(len(self.behaviors), NONE, np.int32)
        # In reverse, so that the first idle node of each behavior is the one that is kept.
        for node in np.flatnonzero(self.graph.node_idle)[::-1]:
            nodes[self.graph.node_behavior[node]] = node
        return nodes

    @cached_property
    def rest_nodes(self) -> NDArray[np.bool_]:
        """Return in which nodes (N,) agents wait: idle nodes, and nodes that end standing if no idle node may follow.

        On a node of the second kind, an agent waits on the last frame.
        """
        ends = [each and self.idle_after(node) == NONE for node, each in enumerate(self.graph.node_ends_standing)]
        rests: NDArray[np.bool_] = self.graph.node_idle | np.array(ends, bool)
        return rests

    def idle_after(self, node: int) -> int:
        """Return the idle node that may follow ``node``, of the same behavior if possible; -1 if there is none."""
        graph = self.graph
        targets = graph.edge_target[graph.edge_start[node] : graph.edge_start[node + 1]]
        idle = targets[graph.node_idle[targets]]
        same = idle[graph.node_behavior[idle] == graph.node_behavior[node]]
        return int(next(iter([*same, *idle]), NONE))


def load_behaviors(scenario: Scenario) -> BehaviorSet:
    """Load the behaviors of a scenario, measured on its layers, with their motion graph.

    Runs may share what it returns, in turn or in threads, if their scenarios agree in ``behaviors``, ``layers`` and
    ``motion``, and name files from the same folder; with captures also in the mean ``speed`` that their groups give.
    Runs do not change it.

    Parameters
    ----------
    scenario : Scenario
        The scenario.

    Returns
    -------
    BehaviorSet
        The behaviors.

    Raises
    ------
    BehaviorError, MotionError
        If a file cannot be used.

    Examples
    --------
    >>> motion = load_behaviors(load_scenario("doorway"))
    >>> for seed in (1, 2):
    ...     scenario = load_scenario("doorway", [f"seed={seed}", "agents.0.count=1"])
    ...     with Simulation(scenario, behavior_set=motion) as simulation:
    ...         simulation.step()
    """
    require_scenario(scenario)
    bands = [(layer.low, layer.high) for layer in scenario.environment.layers]
    captures = scenario.captures_folder()
    if captures is None:
        # A scenario names a set or captures, never both.
        return load_behavior_set(scenario.behaviors, bands, motion_set=str(scenario.motion.set), beside=scenario.folder)
    motion = scenario.motion
    return load_behavior_set(
        scenario.behaviors,
        bands,
        captures=captures,
        capture_patterns=motion.clips,
        meters_per_unit=None if motion.unit is None else UNITS[motion.unit],
        joints=motion.joints,
        speed=mean_speed(scenario),
    )


def require_scenario(scenario: object) -> None:
    """Raise CrowdSimError if ``scenario`` is not a Scenario, for example the name or the file of one."""
    if isinstance(scenario, str | Path):
        raise CrowdSimError(
            f"expected a Scenario, got '{scenario}'; crowdsim.load_scenario({str(scenario)!r}) reads one"
        )
    if not isinstance(scenario, Scenario):
        raise CrowdSimError(
            f"expected a Scenario, got a {type(scenario).__name__}; crowdsim.Scenario(...) makes one, and "
            "crowdsim.load_scenario reads one"
        )


def require_workers(workers: object) -> None:
    """Raise CrowdSimError if ``workers`` is not a number of threads."""
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise CrowdSimError(f"workers is {workers!r}; give a whole number of threads, 1 or more")


def require_fitting(behavior_set: BehaviorSet, scenario: Scenario) -> BehaviorSet:
    """Return ``behavior_set`` as it is, if it was loaded for a scenario like this one.

    Raises
    ------
    BehaviorError
        If it has other behaviors, or clearances on another number of layers.
    """
    names = [Path(name).name for name in scenario.behaviors]
    found = [behavior.name for behavior in behavior_set.behaviors]
    layers = len(scenario.environment.layers)
    if sorted(found) != sorted(names) or any(len(behavior.radii) != layers for behavior in behavior_set.behaviors):
        raise BehaviorError(
            f"{scenario.name}: the behavior set has {', '.join(found)}, measured on "
            f"{len(behavior_set.behaviors[0].radii)} layers; the scenario has {', '.join(names)} on {layers}; "
            "call load_behaviors(scenario)"
        )
    return behavior_set


def require_usable(behavior_set: BehaviorSet, scenario: Scenario) -> None:
    """Refuse behaviors that the agents of a scenario cannot move with.

    Parameters
    ----------
    behavior_set : BehaviorSet
        What :func:`load_behaviors` returned for the scenario.
    scenario : Scenario
        The scenario.

    Raises
    ------
    ScenarioError
        If captured agents need shorter steps.
    MotionError
        If captured agents can never stand, if a behavior has no cycle for steered bodies, or if steered agents can not
        become captured.
    """
    levels = scenario.locomotions()
    if levels != {"steered"}:
        _require_waiting(behavior_set, scenario)
    # gait_clips and find_entries raise MotionError if the set lacks what they look for.
    if levels != {"captured"}:
        gaits = gait_clips(behavior_set)
        if levels != {"steered"}:
            find_entries(behavior_set, gaits, node_phases(behavior_set))


def _require_waiting(behavior_set: BehaviorSet, scenario: Scenario) -> None:
    """Raise an error if captured agents can never stand, or if a step is longer than their shortest movement.

    A step enters one node at most, so none may be shorter than a step.
    """
    if not behavior_set.graph.arrays.node_ends_standing.any():
        raise MotionError("no clip of the motion set ends standing, so no agent could ever wait; add one that does")
    shortest = int(behavior_set.graph.arrays.node_frames.min())
    if scenario.steps_per_second * shortest < CAPTURE_RATE:
        message = (
            f"a step of {1.0 / scenario.steps_per_second:g} s is longer than the shortest movement of the motion set "
            f"({shortest / CAPTURE_RATE:.2f} s); take more steps"
        )
        raise ScenarioError([scenario.problem(("steps_per_second",), message)])


def motion_key(scenario: Scenario) -> tuple[Any, ...]:
    """Return the data on which :func:`load_behaviors` depends: scenarios with equal keys may share its result."""
    speed = None if scenario.motion.captures is None else mean_speed(scenario)
    bands = tuple((layer.low, layer.high) for layer in scenario.environment.layers)
    return tuple(scenario.behaviors), bands, scenario.motion.model_dump_json(), scenario.folder.resolve(), speed


def prepare(
    scenario: Scenario,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    behavior_set: BehaviorSet | None = None,
) -> Assets:
    """Build layers, motion graph and motion maps for a scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    workers : int
        Threads that build motion maps, unless they were built before and are in the cache.
    progress : callable, optional
        Called with the number of maps done and the number of all.
    behavior_set : BehaviorSet, optional
        That of the scenario, if it is loaded already.

    Returns
    -------
    Assets
        The constant data of the run.

    Raises
    ------
    ScenarioError, GeometryError, BehaviorError, MotionError
        If a file cannot be used, captured agents could never stand, or a step is longer than their shortest movement.
    """
    behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
    _require_waiting(behavior_set, scenario)
    arrays, maps_folder = behavior_set.graph.arrays, cache_folder() / "maps"
    bodies = None
    if scenario.planner == "collision3d":
        # As for the other planners, solids that meet no layer have no effect: feet would touch carpets and thresholds.
        bands = [layer.band() for layer in scenario.bands]
        solids = [solid for solid in scenario.environment.timetable.fixed if not dropped_solids([solid], bands)]
        bodies = make_bodies(CollisionScene(solids), behavior_set.behaviors)
    return Assets(
        layers=scenario.environment.fixed_layers,
        behaviors=behavior_set.behaviors,
        motion=behavior_set.graph,
        maps=behavior_set.once("maps", lambda: maps_in_file(maps_folder, arrays, progress=progress, workers=workers)),
        timetable=scenario.environment.timetable,
        steps_per_second=scenario.steps_per_second,
        planner=scenario.planner,
        bodies=bodies,
    )
