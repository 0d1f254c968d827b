"""Header of a recording, from the scenario and the assets of a run."""

from __future__ import annotations

import math
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
    ShapeRecord,
    SolidRecord,
)
from crowdsim.scenario.people.arrivals import NEVER
from crowdsim.scenario.people.attributes import draw_attributes
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.scenario.people.placement import Placement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.measured import Area, Line


def record_header(
    scenario: Scenario, behaviors: Sequence[Behavior], agents: AgentsRecord, motion: MotionRecord
) -> RecordingHeader:
    """Return the header of the recording of one run."""
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
        solids=[solid_record(solid) for solid in timetable.fixed if isinstance(solid, Solid)],
        meshes=[_mesh_record(solid) for solid in timetable.fixed if isinstance(solid, MeshSolid)],
        # Solids that commands insert are added to the recording when they come.
        movables=[solid_record(solid) for movable in timetable.movables for solid in movable.solids],
        agents=replace(agents, attributes=draw_attributes(scenario)),
        motion=motion,
        ends=_ends_of(scenario),
        walkable=[layer.free.wkt for layer in environment.fixed_layers],
        areas=[_shape_record(area) for area in scenario.areas],
        lines=[_shape_record(line) for line in scenario.lines],
    )


def _shape_record(place: Area | Line) -> ShapeRecord:
    """Return an area or a line as recordings hold it; its end is infinite [s] if it has none."""
    end = math.inf if place.until is None else place.until
    return ShapeRecord(place.name, place.shape().wkt, place.start_time, end)


def _ends_of(scenario: Scenario) -> Ends | None:
    """Return the ends of a periodic floor; None for a floor that is not periodic."""
    if scenario.floor.periodic is None:
        return None
    axis = 0 if scenario.floor.periodic == "x" else 1
    bounds = scenario.floor.bounds
    return Ends(axis, bounds[axis], bounds[axis + 2])


def _start_times(steps: NDArray[np.int64], steps_per_second: int) -> NDArray[np.float64]:
    """Return when agents start [s], from their start steps (n,); nan for those on call (NEVER)."""
    return np.where(steps == NEVER, np.nan, steps / steps_per_second)


def captured_agents(cast: Placement, steps_per_second: int, radius: float) -> AgentsRecord:
    """Return the agents of a captured crowd as recordings hold them; their bodies all have the ``radius`` [m]."""
    goals = np.array([goals[0] for goals in cast.goals])
    starts = _facing(cast.starts, goals)
    return AgentsRecord(
        cast.groups,
        _start_times(cast.start_steps, steps_per_second),
        starts,
        goals,
        np.full(len(goals), radius),
        routes=np.concatenate(cast.goals),
        route_ends=np.cumsum([len(goals) for goals in cast.goals]),
    )


def steered_agents(cast: CrowdPlacement, middles: NDArray[np.float64], steps_per_second: int) -> AgentsRecord:
    """Return the agents of a steered crowd as recordings hold them; ``middles`` (m, 2) are points in the goals [m]."""
    routes = [middles[cast.itineraries[number].goals] for number in cast.group.tolist()]
    goals = np.array([route[0] for route in routes])
    return AgentsRecord(
        [cast.names[number] for number in cast.group.tolist()],
        _start_times(cast.start_steps, steps_per_second),
        _facing(cast.starts, goals),
        goals,
        0.5 * cast.walkers.breadths,
        routes=np.concatenate(routes),
        route_ends=np.cumsum([len(route) for route in routes]),
    )


def captured_motion(assets: Assets) -> MotionRecord:
    """Return the data from which captured bodies are posed."""
    poses = assets.motion.poses
    return MotionRecord(
        skeleton=assets.motion.skeleton,
        node_names=assets.motion.node_names,
        node_behavior=assets.graph.node_behavior,
        node_first=poses.node_first,
        node_frames=poses.node_frames,
        pool_root=poses.pool_root,
        pool_rotations=poses.pool_rotations,
        pool_tracks=assets.graph.tracks.astype(np.float32),
    )


def steered_motion(skeleton: Skeleton, gaits: Sequence[Clip]) -> MotionRecord:
    """Return the data from which steered bodies are posed: a clip for each behavior."""
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
    """Return poses (n, 3) at ``starts`` (n, 2) [m] with the headings towards ``goals`` (n, 2) [rad]."""
    toward = goals - starts
    return np.column_stack([starts, atan2(toward[:, 1], toward[:, 0])])


def solid_record(solid: AnySolid) -> SolidRecord:
    """Return a solid as recordings hold it."""
    return SolidRecord(solid.name, solid.footprint.wkt, solid.bottom, solid.top)


def _mesh_record(solid: MeshSolid) -> MeshRecord:
    """Return a mesh as recordings hold it."""
    return MeshRecord(solid.name, solid.vertices.astype(np.float32), solid.triangles.astype(np.int32))


def labeled_points(route: AnnotatedPath) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Return points (P, 2) of a route [m], and the number of the behavior (P,) from each on.

    There is also a point at each change of behavior.
    """
    starts = np.array([section.start for section in route.sections])
    # Python's sort keeps the GIL; numpy's releases it and would then wait for other threads.
    arc = np.array(sorted({*route.arc.tolist(), *starts.tolist()}))
    # The section of each point is the last one that starts there or before; the first one if rounding leaves none.
    section = np.maximum(np.searchsorted(starts, arc, side="right") - 1, 0)
    behaviors = np.array([route.sections[k].behavior for k in section], np.int8)
    return route.at(arc), behaviors
