"""What a recording says once, gathered from the scenario and the assets of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.crowd.state.assets import Assets
from crowdsim.environment.layers import AnySolid
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import Solid
from crowdsim.geometry.elementary import atan2
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.recording.header import (
    AgentsRecord,
    BehaviorRecord,
    Ends,
    GaitRecord,
    LayerRecord,
    MeshRecord,
    MotionRecord,
    RecordingHeader,
    SolidRecord,
)
from crowdsim.scenario.attributes import draw_attributes
from crowdsim.scenario.crowd_placement import CrowdPlacement
from crowdsim.scenario.placement import Placement
from crowdsim.scenario.scenario import Scenario


def record_header(
    scenario: Scenario, behaviors: Sequence[Behavior], agents: AgentsRecord, motion: MotionRecord
) -> RecordingHeader:
    """The header of the recording of one run."""
    environment = scenario.environment
    timetable = environment.timetable
    return RecordingHeader(
        scenario_name=scenario.name,
        scenario_text=scenario.text,
        seed=scenario.seed,
        steps_per_second=scenario.steps_per_second,
        behaviors=[BehaviorRecord(b.name, b.color, tuple(map(float, b.radii))) for b in behaviors],
        layers=[LayerRecord(layer.name, layer.low, layer.high) for layer in environment.layers],
        floor=environment.floor.wkt,
        solids=[_record(solid) for solid in timetable.fixed if isinstance(solid, Solid)],
        meshes=[_mesh_record(solid) for solid in timetable.fixed if isinstance(solid, MeshSolid)],
        movables=[_record(solid) for movable in timetable.movables for solid in movable.solids],
        agents=replace(agents, attributes=draw_attributes(scenario)),
        motion=motion,
        ends=_ends_of(scenario),
    )


def _ends_of(scenario: Scenario) -> Ends | None:
    """Where a periodic floor begins again."""
    if scenario.floor.periodic is None:
        return None
    axis = 0 if scenario.floor.periodic == "x" else 1
    bounds = scenario.floor.bounds
    return Ends(axis, bounds[axis], bounds[axis + 2])


def captured_agents(cast: Placement, steps_per_second: int, radius: float) -> AgentsRecord:
    """The agents of a captured crowd, of bodies that reach ``radius`` meters."""
    goals = np.array([goals[0] for goals in cast.goals])
    starts = _facing(cast.starts, goals)
    return AgentsRecord(cast.groups, cast.start_steps / steps_per_second, starts, goals, np.full(len(goals), radius))


def steered_agents(cast: CrowdPlacement, middles: NDArray[np.float64], steps_per_second: int) -> AgentsRecord:
    """The agents of a steered crowd, whose goals have ``middles`` (m, 2) [m]."""
    goals = middles[np.array([itinerary.goals[0] for itinerary in cast.itineraries])][cast.group]
    return AgentsRecord(
        [cast.names[number] for number in cast.group.tolist()],
        cast.start_steps / steps_per_second,
        _facing(cast.starts, goals),
        goals,
        0.5 * cast.walkers.breadths,
    )


def captured_motion(assets: Assets) -> MotionRecord:
    """What captured bodies are posed from."""
    poses = assets.motion.poses
    return MotionRecord(
        skeleton=assets.motion.skeleton,
        node_names=assets.motion.node_names,
        node_behavior=assets.graph.node_behavior,
        node_first=poses.node_first,
        node_frames=poses.node_frames,
        pool_root=poses.pool_root,
        pool_rotations=poses.pool_rotations,
    )


def steered_motion(skeleton: Skeleton, gaits: Sequence[Clip]) -> MotionRecord:
    """What steered bodies are posed from: a clip for each behavior."""
    none = np.zeros(0, np.int32)
    return MotionRecord(
        skeleton=skeleton,
        node_names=(),
        node_behavior=none,
        node_first=none,
        node_frames=none,
        pool_root=np.zeros((0, 3), np.float32),
        pool_rotations=np.zeros((0, skeleton.joint_count, 4), np.float32),
        gaits=tuple(
            GaitRecord(clip.name, clip.root_positions.astype(np.float32), clip.rotations.astype(np.float32))
            for clip in gaits
        ),
    )


def _facing(starts: NDArray[np.float64], goals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) starts with the headings towards the goals."""
    toward = goals - starts
    return np.column_stack([starts, atan2(toward[:, 1], toward[:, 0])])


def _record(solid: AnySolid) -> SolidRecord:
    return SolidRecord(solid.name, solid.footprint.wkt, solid.bottom, solid.top)


def _mesh_record(solid: MeshSolid) -> MeshRecord:
    return MeshRecord(solid.name, solid.vertices.astype(np.float32), solid.triangles.astype(np.int32))


def labeled_points(route: AnnotatedPath) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Points (P, 2) of a route, those where the behavior changes among them, and the behavior (P,) from each on."""
    starts = np.array([section.start for section in route.sections])
    # Not sorted by numpy, which would let other threads run and wait for them.
    arc = np.array(sorted({*route.arc.tolist(), *starts.tolist()}))
    section = np.maximum(np.searchsorted(starts, arc, side="right") - 1, 0)
    behaviors = np.array([route.sections[k].behavior for k in section], np.int8)
    return route.at(arc), behaviors
