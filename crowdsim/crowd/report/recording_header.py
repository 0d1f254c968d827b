"""What a recording says once, gathered from the scenario and the assets of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.state.assets import Assets
from crowdsim.environment.layers import AnySolid
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import Solid
from crowdsim.geometry.elementary import atan2
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.recording.header import (
    AgentsRecord,
    BehaviorRecord,
    LayerRecord,
    MeshRecord,
    MotionRecord,
    RecordingHeader,
    SolidRecord,
)
from crowdsim.scenario.placement import Placement
from crowdsim.scenario.scenario import Scenario


def record_header(scenario: Scenario, assets: Assets, cast: Placement) -> RecordingHeader:
    """The header of the recording of one run."""
    rate = assets.steps_per_second
    timetable = scenario.environment.timetable
    goals = np.array([goals[0] for goals in cast.goals])
    toward = goals - cast.starts
    starts = np.column_stack([cast.starts, atan2(toward[:, 1], toward[:, 0])])
    poses = assets.motion.poses
    return RecordingHeader(
        scenario_name=scenario.name,
        scenario_text=scenario.text,
        seed=scenario.seed,
        steps_per_second=rate,
        behaviors=[BehaviorRecord(b.name, b.color, tuple(map(float, b.radii))) for b in assets.behaviors],
        layers=[LayerRecord(layer.name, layer.low, layer.high) for layer in assets.layers],
        floor=scenario.environment.floor.wkt,
        solids=[_record(solid) for solid in timetable.fixed if isinstance(solid, Solid)],
        meshes=[_mesh_record(solid) for solid in timetable.fixed if isinstance(solid, MeshSolid)],
        movables=[_record(solid) for movable in timetable.movables for solid in movable.solids],
        agents=AgentsRecord(
            groups=cast.groups,
            start_times=cast.start_steps / rate,
            starts=starts,
            goals=goals,
            radii=np.full(len(cast.starts), assets.personal_radius),
        ),
        motion=MotionRecord(
            skeleton=assets.motion.skeleton,
            node_names=assets.motion.node_names,
            node_behavior=assets.graph.node_behavior,
            node_first=poses.node_first,
            node_frames=poses.node_frames,
            pool_root=poses.pool_root,
            pool_rotations=poses.pool_rotations,
        ),
    )


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
