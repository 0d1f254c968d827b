"""crowdsim: simulate agents that walk through cluttered places as people do."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from crowdsim.version import __version__ as __version__

if TYPE_CHECKING:
    from crowdsim.behaviors.library import BehaviorSet, load_behavior_set
    from crowdsim.crowd.live_poses import Poses
    from crowdsim.crowd.own_systems import Columns, System
    from crowdsim.crowd.simulation import Simulation
    from crowdsim.crowd.state.assets import load_behaviors
    from crowdsim.errors import ColumnError, CrowdSimError, PathNotFound, ScenarioError, StageError, SystemFailed
    from crowdsim.following.follower.character import Character
    from crowdsim.following.follower.follow_options import FollowOptions
    from crowdsim.following.follower.path_follower import follow_path
    from crowdsim.following.maps.motion_maps import MotionMaps
    from crowdsim.motion.graph.assembly import MotionGraph
    from crowdsim.motion.graph.motion_graph import build_motion_graph
    from crowdsim.motion.graph.nodes import MotionSource
    from crowdsim.navmesh.navmesh import NavMesh
    from crowdsim.planning.planner import Planner
    from crowdsim.recording.reader import Recording
    from crowdsim.scenario.loader import load_scenario
    from crowdsim.scenario.scenario import Scenario

_HOMES = {
    "BehaviorSet": "crowdsim.behaviors.library",
    "Character": "crowdsim.following.follower.character",
    "ColumnError": "crowdsim.errors",
    "Columns": "crowdsim.crowd.own_systems",
    "CrowdSimError": "crowdsim.errors",
    "FollowOptions": "crowdsim.following.follower.follow_options",
    "MotionGraph": "crowdsim.motion.graph.assembly",
    "MotionMaps": "crowdsim.following.maps.motion_maps",
    "MotionSource": "crowdsim.motion.graph.nodes",
    "NavMesh": "crowdsim.navmesh.navmesh",
    "PathNotFound": "crowdsim.errors",
    "Planner": "crowdsim.planning.planner",
    "Poses": "crowdsim.crowd.live_poses",
    "Recording": "crowdsim.recording.reader",
    "Scenario": "crowdsim.scenario.scenario",
    "ScenarioError": "crowdsim.errors",
    "Simulation": "crowdsim.crowd.simulation",
    "StageError": "crowdsim.errors",
    "System": "crowdsim.crowd.own_systems",
    "SystemFailed": "crowdsim.errors",
    "build_motion_graph": "crowdsim.motion.graph.motion_graph",
    "follow_path": "crowdsim.following.follower.path_follower",
    "load_behavior_set": "crowdsim.behaviors.library",
    "load_behaviors": "crowdsim.crowd.state.assets",
    "load_scenario": "crowdsim.scenario.loader",
}

__all__ = [
    "BehaviorSet",
    "Character",
    "ColumnError",
    "Columns",
    "CrowdSimError",
    "FollowOptions",
    "MotionGraph",
    "MotionMaps",
    "MotionSource",
    "NavMesh",
    "PathNotFound",
    "Planner",
    "Poses",
    "Recording",
    "Scenario",
    "ScenarioError",
    "Simulation",
    "StageError",
    "System",
    "SystemFailed",
    "build_motion_graph",
    "follow_path",
    "load_behavior_set",
    "load_behaviors",
    "load_scenario",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'crowdsim' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
