"""Write and read the header of a recording as HDF5: arrays as datasets, names as strings, scalars as attributes."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.skeleton import Skeleton
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
from crowdsim.recording.storage.values import PACKED, values_of
from crowdsim.version import __version__

_STRINGS = h5py.string_dtype("utf-8")
_AGENT_ARRAYS = ("start_times", "starts", "goals", "radii")
_SKELETON_ARRAYS = {"parents": "int32", "offsets": "float64", "end_parents": "int32", "end_offsets": "float64"}
_MOTION_ARRAYS = {
    **dict.fromkeys(("node_behavior", "node_first", "node_frames"), "int32"),
    **dict.fromkeys(("pool_root", "pool_rotations"), "float32"),
}


def _write_strings(group: h5py.Group, name: str, values: Sequence[str]) -> None:
    """Write texts as a dataset (n,) in UTF-8."""
    group.create_dataset(name, data=np.array(list(values), dtype=object), dtype=_STRINGS, shape=(len(values),))


def _read_strings(group: h5py.Group, name: str) -> list[str]:
    """Return the texts of a dataset (n,)."""
    return list(values_of(group, name))


def _write_array(group: h5py.Group, name: str, values: object, dtype: str) -> None:
    """Write values as a dataset of type ``dtype``."""
    data = np.asarray(values, dtype=dtype)
    # Packing small arrays saves nothing.
    packing = PACKED if data.size > 256 else {}
    group.create_dataset(name, data=data, **packing)


def library_versions() -> dict[str, str]:
    """Return the versions of Python and the libraries that the numbers of a run depend on."""
    found = {name: version(name) for name in ("numba", "numpy")}
    return {"crowdsim": __version__, **found, "python": platform.python_version()}


def write_header(file: h5py.File, header: RecordingHeader) -> None:
    """Write ``header`` and the library versions of this process into an empty file.

    Optional parts that are empty are left out; :func:`read_header` returns them empty.
    """
    versions = file.create_group("versions")
    for name, text in library_versions().items():
        versions.attrs[name] = text

    scenario = file.create_group("scenario")
    scenario.attrs["name"] = header.scenario_name
    scenario.attrs["seed"] = header.seed
    scenario.attrs["steps_per_second"] = header.steps_per_second
    if header.ends is not None:
        scenario.attrs["ends"] = np.array(header.ends, np.float64)
    scenario.create_dataset("text", data=header.scenario_text, dtype=_STRINGS)
    if header.scenario_keys:
        scenario.create_dataset("keys", data=header.scenario_keys, dtype=_STRINGS)

    layers = file.create_group("layers")
    _write_strings(layers, "names", [layer.name for layer in header.layers])
    _write_array(layers, "low", [layer.low for layer in header.layers], "float64")
    _write_array(layers, "high", [layer.high for layer in header.layers], "float64")

    behaviors = file.create_group("behaviors")
    _write_strings(behaviors, "names", [behavior.name for behavior in header.behaviors])
    _write_strings(behaviors, "colors", [behavior.color for behavior in header.behaviors])
    radii = np.array([behavior.radii for behavior in header.behaviors], np.float64)
    _write_array(behaviors, "radii", radii.reshape(len(header.behaviors), len(header.layers)), "float64")

    environment = file.create_group("place")
    environment.create_dataset("floor", data=header.floor, dtype=_STRINGS)
    for kind, solids in (("solid", header.solids), ("movable", header.movables)):
        _write_solids(environment, kind, solids)

    if header.walkable:
        _write_strings(environment, "walkable", header.walkable)
    for kind, shapes in (("area", header.areas), ("line", header.lines)):
        _write_strings(environment, f"{kind}_names", [shape.name for shape in shapes])
        _write_strings(environment, f"{kind}_shapes", [shape.shape for shape in shapes])
        times = np.array([(shape.start, shape.end) for shape in shapes]).reshape(-1, 2)
        _write_array(environment, f"{kind}_times", times, "float64")

    _write_strings(environment, "mesh_names", [mesh.name for mesh in header.meshes])
    _write_array(environment, "mesh_counts", [(len(m.points), len(m.triangles)) for m in header.meshes], "int64")
    points = [np.empty((0, 3), np.float32), *(mesh.points for mesh in header.meshes)]
    triangles = [np.empty((0, 3), np.int32), *(mesh.triangles for mesh in header.meshes)]
    _write_array(environment, "mesh_points", np.concatenate(points), "float32")
    _write_array(environment, "mesh_triangles", np.concatenate(triangles), "int32")

    agents = file.create_group("agents")
    _write_strings(agents, "groups", header.agents.groups)
    for name in _AGENT_ARRAYS:
        _write_array(agents, name, getattr(header.agents, name), "float64")
    if len(header.agents.route_ends):
        _write_array(agents, "routes", header.agents.routes, "float64")
        _write_array(agents, "route_ends", header.agents.route_ends, "int64")
    for name, values in header.agents.attributes.items():
        attributes = agents.require_group("attributes")
        if np.issubdtype(values.dtype, np.number):
            _write_array(attributes, name, values, "float64")
        else:
            _write_strings(attributes, name, values.tolist())

    _write_motion(file.create_group("motion"), header.motion)


def rewrite_movables(file: h5py.File, movables: Sequence[SolidRecord]) -> None:
    """Replace the movables of a header that :func:`write_header` wrote."""
    environment = file["place"]
    for name in [name for name in environment if name.startswith("movable_")]:
        del environment[name]
    _write_solids(environment, "movable", movables)


def _write_solids(environment: h5py.Group, kind: str, solids: Sequence[SolidRecord]) -> None:
    """Write solids column by column; ``kind`` (solid or movable) begins the names of the columns."""
    _write_strings(environment, f"{kind}_names", [solid.name for solid in solids])
    _write_strings(environment, f"{kind}_footprints", [solid.footprint for solid in solids])
    _write_array(environment, f"{kind}_bottoms", [solid.bottom for solid in solids], "float64")
    _write_array(environment, f"{kind}_tops", [solid.top for solid in solids], "float64")


def _write_motion(group: h5py.Group, motion: MotionRecord) -> None:
    """Write skeleton, nodes and poses; also tracks and gaits if there are any, and phases if there are nodes and gaits.

    Tracks and phases are those of the pool's rows.
    """
    skeleton = motion.skeleton
    _write_strings(group, "joint_names", skeleton.names)
    for name, dtype in _SKELETON_ARRAYS.items():
        _write_array(group, name, getattr(skeleton, name), dtype)
    _write_strings(group, "role_names", list(skeleton.roles))
    _write_array(group, "role_joints", list(skeleton.roles.values()), "int32")
    _write_strings(group, "node_names", motion.node_names)
    for name, dtype in _MOTION_ARRAYS.items():
        _write_array(group, name, getattr(motion, name), dtype)
    if len(motion.pool_tracks):
        _write_array(group, "pool_tracks", motion.pool_tracks, "float32")
    if not motion.gaits:
        return
    if motion.mixed:
        _write_array(group, "pool_phases", motion.pool_phases, "float32")
    _write_strings(group, "gait_names", [gait.name for gait in motion.gaits])
    _write_array(group, "gait_frames", [len(gait.root) for gait in motion.gaits], "int32")
    _write_array(group, "gait_root", np.concatenate([gait.root for gait in motion.gaits]), "float32")
    _write_array(group, "gait_rotations", np.concatenate([gait.rotations for gait in motion.gaits]), "float32")


def read_versions(file: h5py.File) -> dict[str, str]:
    """Return the library versions of the process that wrote ``file``."""
    return {name: str(text) for name, text in file["versions"].attrs.items()}


def read_header(file: h5py.File) -> RecordingHeader:
    """Return the header of ``file``.

    Raise KeyError if a part of it is missing, ValueError if lists that belong together differ in length, RecordingError
    if a dataset cannot be read.
    """
    scenario, layers, behaviors, environment = file["scenario"], file["layers"], file["behaviors"], file["place"]
    layer_rows = zip(_read_strings(layers, "names"), values_of(layers, "low"), values_of(layers, "high"), strict=True)
    behavior_rows = zip(
        _read_strings(behaviors, "names"),
        _read_strings(behaviors, "colors"),
        values_of(behaviors, "radii"),
        strict=True,
    )
    agents = file["agents"]
    return RecordingHeader(
        scenario_name=str(scenario.attrs["name"]),
        scenario_text=values_of(scenario, "text"),
        seed=int(scenario.attrs["seed"]),
        steps_per_second=int(scenario.attrs["steps_per_second"]),
        behaviors=tuple(BehaviorRecord(name, color, tuple(map(float, radii))) for name, color, radii in behavior_rows),
        layers=tuple(LayerRecord(name, float(low), float(high)) for name, low, high in layer_rows),
        floor=values_of(environment, "floor"),
        solids=_read_solids(environment, "solid"),
        # Files from before movables and meshes were introduced have no such datasets.
        movables=_read_solids(environment, "movable") if "movable_names" in environment else (),
        meshes=_read_meshes(environment) if "mesh_names" in environment else (),
        agents=AgentsRecord(
            groups=tuple(_read_strings(agents, "groups")),
            **{name: values_of(agents, name) for name in _AGENT_ARRAYS},
            # The group is missing if no agent has attributes.
            attributes=_read_attributes(agents["attributes"]) if "attributes" in agents else {},
            # Older files hold only the first goal of each agent.
            **{name: values_of(agents, name) for name in ("routes", "route_ends") if name in agents},
        ),
        motion=_read_motion(file["motion"]),
        ends=_read_ends(scenario.attrs["ends"]) if "ends" in scenario.attrs else None,
        walkable=tuple(_read_strings(environment, "walkable")) if "walkable" in environment else (),
        areas=_read_shapes(environment, "area"),
        lines=_read_shapes(environment, "line"),
        scenario_keys=values_of(scenario, "keys") if "keys" in scenario else "",
    )


def _read_shapes(environment: h5py.Group, kind: str) -> tuple[ShapeRecord, ...]:
    """Return areas or lines; none if the file does not hold their shapes."""
    if f"{kind}_names" not in environment:
        return ()
    names, shapes = _read_strings(environment, f"{kind}_names"), _read_strings(environment, f"{kind}_shapes")
    # Older files lack the times.
    times = environment[f"{kind}_times"][:] if f"{kind}_times" in environment else [(0.0, np.inf)] * len(names)
    return tuple(
        ShapeRecord(name, shape, float(start), float(end))
        for name, shape, (start, end) in zip(names, shapes, times, strict=True)
    )


def _read_ends(ends: NDArray[np.float64]) -> Ends:
    """Return the ends of a periodic floor from the attribute (3,): axis, low, high."""
    axis, low, high = np.asarray(ends, np.float64).tolist()
    return Ends(int(axis), low, high)


def _read_attributes(group: h5py.Group) -> dict[str, NDArray[Any]]:
    """Return the attributes of all N agents by name: numbers (N,) float64, or texts (N,)."""
    return {
        name: np.array(_read_strings(group, name), np.str_)
        if h5py.check_string_dtype(values.dtype)
        else values_of(group, name)
        for name, values in group.items()
    }


def _read_solids(environment: h5py.Group, kind: str) -> tuple[SolidRecord, ...]:
    """Return the solids of a kind: name, footprint (WKT), bottom and top [m]."""
    rows = zip(
        _read_strings(environment, f"{kind}_names"),
        _read_strings(environment, f"{kind}_footprints"),
        values_of(environment, f"{kind}_bottoms"),
        values_of(environment, f"{kind}_tops"),
        strict=True,
    )
    return tuple(SolidRecord(name, wkt, float(low), float(top)) for name, wkt, low, top in rows)


def _read_meshes(environment: h5py.Group) -> tuple[MeshRecord, ...]:
    """Return the meshes of the environment; the file holds the points of all in one array, the triangles in another."""
    points, triangles = values_of(environment, "mesh_points"), values_of(environment, "mesh_triangles")
    ends = np.cumsum(values_of(environment, "mesh_counts").reshape(-1, 2), axis=0)
    cut_points, cut_triangles = np.split(points, ends[:, 0]), np.split(triangles, ends[:, 1])
    names = _read_strings(environment, "mesh_names")
    # Not strict: a split at the last end leaves an empty part after it.
    return tuple(MeshRecord(*row) for row in zip(names, cut_points, cut_triangles, strict=False))


def _read_motion(group: h5py.Group) -> MotionRecord:
    """Return skeleton, nodes, poses and gaits as :func:`_write_motion` wrote them."""
    skeleton = Skeleton(
        names=tuple(_read_strings(group, "joint_names")),
        **{name: values_of(group, name) for name in _SKELETON_ARRAYS},
        roles=dict(zip(_read_strings(group, "role_names"), map(int, values_of(group, "role_joints")), strict=True)),
    )
    return MotionRecord(
        skeleton=skeleton,
        node_names=tuple(_read_strings(group, "node_names")),
        **{name: values_of(group, name) for name in _MOTION_ARRAYS},
        # Datasets of gaits are missing if no agent is steered, of phases unless there are both nodes and gaits, of
        # tracks without nodes and in older files.
        gaits=_read_gaits(group) if "gait_names" in group else (),
        pool_phases=values_of(group, "pool_phases") if "pool_phases" in group else np.zeros(0, np.float32),
        pool_tracks=values_of(group, "pool_tracks") if "pool_tracks" in group else np.zeros((0, 3), np.float32),
    )


def _read_gaits(group: h5py.Group) -> tuple[GaitRecord, ...]:
    """Return the gaits; the file holds the frames of all in one array."""
    ends = np.cumsum(values_of(group, "gait_frames"))
    roots, rotations = (np.split(values_of(group, f"gait_{name}"), ends) for name in ("root", "rotations"))
    names = _read_strings(group, "gait_names")
    # Not strict: a split at the last end leaves an empty part after it.
    return tuple(GaitRecord(*row) for row in zip(names, roots, rotations, strict=False))
