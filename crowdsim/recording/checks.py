"""Check the content of a recording before kernels use it as indices."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState, MotionRecord, RecordedFrame, RecordingHeader
from crowdsim.recording.storage.string_heaps import require_sound_heaps

AGAIN = "run the scenario again to the end"
"""What messages about damaged or incomplete files advise."""

CLOSED = "is closed; read it before close(), or within 'with Recording.open(...)'"
"""What messages say of a recording that was closed."""

UNREADABLE = (
    AttributeError,
    IndexError,
    KeyError,
    MemoryError,
    OSError,
    OverflowError,
    RuntimeError,
    TypeError,
    ValueError,
    shapely.errors.ShapelyError,
)
"""Exceptions that reading a damaged file may raise."""

_MOST_FRAMES = 1 << 17
"""Largest number of frames of a node: float32 then still resolves 1/64 of a frame."""

_STEPS_KEPT = 64
_MOST_KEPT = 250_000
"""Largest number of steps, and of values, of a column that stay in memory when steps are read one after another."""

_PACKED = 2000
"""Compression ratio that no filter of HDF5 reaches (gzip: about 1030); a dataset that claims more is damaged."""


class _Stored(Protocol):
    """A dataset of the file, or the ConstantColumn in place of one that is not stored."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the type of the values."""
        ...

    def __getitem__(self, key: Any, /) -> Any: ...


class CheckedColumn:
    """A column of the file whose values are checked when they are read.

    RecordingError is raised if values are not within ``low`` to ``high``, or cannot be read. Infinite bounds are not
    checked.
    """

    def __init__(self, path: Path, name: str, stored: _Stored, low: float, high: float) -> None:
        self._path, self._name, self._stored, self._range = path, name, stored, (low, high)
        width = int(np.prod(stored.shape[1:], dtype=np.int64))
        # Steps of a block: as many as hold _MOST_KEPT values.
        self._kept = min(max(_MOST_KEPT // max(width, 1), 1), _STEPS_KEPT)
        # Number of the block that is in memory, -1 for none, and its rows.
        self._rows: tuple[int, NDArray[Any]] = -1, np.zeros(0)

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape (steps, N), or (steps,) of state hashes."""
        return self._stored.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the type of the values."""
        return self._stored.dtype

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any, /) -> Any:
        # Slices, and steps from the end or outside, go to HDF5 as they are. So do all steps if one is so large that no
        # second one is kept.
        if not isinstance(key, int | np.integer) or self._kept == 1 or not 0 <= key < len(self):
            return self._checked(self._read(key))
        # Steps are mostly read in sequence: keep a block, so that each chunk of the file is unpacked only once.
        block = int(key) // self._kept
        number, rows = self._rows
        if number != block:
            rows = self._read(slice(block * self._kept, (block + 1) * self._kept))
            self._rows = block, rows
        # A copy, because callers may change what they get.
        return self._checked(rows[int(key) - block * self._kept].copy())

    def _read(self, key: Any) -> Any:
        """Return values from the file, not checked; raise RecordingError if they cannot be read."""
        try:
            return self._stored[key]
        except (OSError, RuntimeError, MemoryError) as error:
            if isinstance(self._stored, h5py.Dataset) and not self._stored:
                raise RecordingError(f"{self._path} {CLOSED}") from None
            raise RecordingError(f"{self._path} is damaged: steps/{self._name} ({error}); {AGAIN}") from None

    def _checked(self, values: Any) -> Any:
        """Return values if they are within their bounds; raise RecordingError otherwise."""
        low, high = self._range
        bounded = np.isfinite([low, high]).all()  # columns of indices have finite bounds; others may hold nan
        if bounded and np.size(values) and not (np.min(values) >= low and np.max(values) <= high):
            raise RecordingError(
                f"{self._path} is damaged: steps/{self._name} holds values beyond {low:g} to {high:g}; {AGAIN}"
            )
        return values


def agent_rows(name: str, agents: ArrayLike, count: int) -> NDArray[np.int64]:
    """Return numbers of agents as an array (A,); raise RecordingError if they are no whole numbers below ``count``."""
    try:
        rows = np.asarray(agents)
    except ValueError:  # lists of different lengths
        rows = np.zeros((0, 0))
    if rows.ndim != 1 or (rows.size and (rows.dtype.kind not in "iu" or rows.min() < 0 or rows.max() >= count)):
        raise RecordingError(
            f"{name}: agents are given as a list of whole numbers from 0 to {count - 1}, not {agents!r}"
        )
    return rows.astype(np.int64)


def column_ranges(header: RecordingHeader) -> dict[str, tuple[float, float]]:
    """Return the least and the greatest value of each column that holds indices or counts."""
    nodes = len(header.motion.node_names)
    # The frame of an agent without a node means nothing, and may be NONE.
    return {
        "node": (NONE, nodes - 1),
        "previous": (NONE, nodes - 1),
        "frame": (NONE, int(np.max(header.motion.node_frames, initial=0))),
        "behavior": (-1, len(header.behaviors) - 1),
        "state": (0, max(AgentState)),
    }


def check_frames(path: Path, motion: MotionRecord, frame: RecordedFrame) -> None:
    """Raise RecordingError if an agent plays a frame that its node does not have, or is present without a position."""
    node = np.asarray(frame.node)
    present = np.asarray(frame.state) != AgentState.ABSENT
    somewhere = np.isfinite(frame.x) & np.isfinite(frame.y) & np.isfinite(frame.heading)
    if (present & ~somewhere).any():
        agent = int(np.flatnonzero(present & ~somewhere)[0])
        raise RecordingError(f"{path} is damaged: agent {agent} is present, but has no position; {AGAIN}")
    played = (node != NONE) & present
    # NONE (-1) finds the 0 at the end, which is not used.
    shown = np.asarray(frame.frame)
    over = played & ~((shown >= 0) & (shown <= np.append(motion.node_frames, 0)[node]))
    if over.any():
        agent = int(np.flatnonzero(over)[0])
        raise RecordingError(f"{path} is damaged: agent {agent} plays a frame that its node does not have; {AGAIN}")


def require_readable(path: Path, file: h5py.File) -> None:
    """Raise ValueError if a dataset claims more memory than its file can hold, or if strings are damaged.

    So it does if the file holds anything but groups and datasets.
    """
    require_sound_heaps(path)
    size = path.stat().st_size

    def visit(name: str, item: object) -> None:
        """Check a dataset or group of the file by its path ``name``."""
        if isinstance(item, h5py.Dataset):
            stored = item.id.get_storage_size()
            # A damaged stored size may be above that of the file. What was never written has no bytes in the file, and
            # is read as zeros: 64 * _PACKED of them do no harm.
            if stored > size or item.nbytes > _PACKED * (stored + 64):
                raise ValueError(f"{name} claims {item.nbytes} bytes in memory, {stored} of {size} in the file")
        elif not isinstance(item, h5py.Group):  # a recording has no named data types
            raise ValueError(f"{name} is neither a group nor a dataset")

    file.visititems(visit)


def check_header(header: RecordingHeader) -> None:
    """Raise RecordingError if parts of a header contradict each other; used for writing and for reading."""
    count = header.agents.count
    if count == 0:
        raise RecordingError("a recording needs at least one agent")
    _require(
        0 < header.steps_per_second <= CAPTURE_RATE and CAPTURE_RATE % header.steps_per_second == 0,
        f"{header.steps_per_second} steps a second do not divide {CAPTURE_RATE}",
    )
    # Shapes and types of arrays: those of agents, of nodes, and of the poses in the pool.
    motion = header.motion
    joints, nodes, rows = motion.skeleton.joint_count, len(motion.node_names), len(motion.pool_root)
    agents = {"start_times": (count,), "starts": (count, 3), "goals": (count, 2), "radii": (count,)}
    per_node = dict.fromkeys(("node_behavior", "node_first", "node_frames"), (nodes,))
    pool = {"pool_root": (rows, 3), "pool_rotations": (rows, joints, 4)}
    for part, shapes in (("agents", agents), ("motion", {**per_node, **pool})):
        for name, shape in shapes.items():
            values = np.asarray(getattr(getattr(header, part), name))
            if values.shape != shape:
                raise RecordingError(f"{part}.{name} has shape {values.shape}, not {shape}")
            _require(np.issubdtype(values.dtype, np.number), f"{part}.{name} holds {values.dtype}, not numbers")
    if header.ends is not None:
        axis, low, high = header.ends
        fits = axis in (0, 1) and bool(np.isfinite([low, high]).all()) and high - low > 0.0
        _require(fits, f"ends {tuple(header.ends)} are not an axis, 0 or 1, with a lower and a higher end")
    for name, values in header.agents.attributes.items():
        _require(np.shape(values) == (count,), f"agents.attributes.{name} has shape {np.shape(values)}, not {(count,)}")
    routes, ends = np.asarray(header.agents.routes), np.asarray(header.agents.route_ends)
    # Older files have no routes. Each agent has a goal or more, so the ends of its goals ascend.
    if ends.size:
        fits = ends.shape == (count,) and np.issubdtype(ends.dtype, np.integer) and routes.shape == (int(ends[-1]), 2)
        _require(fits and ends[0] > 0 and (np.diff(ends) > 0).all(), "agents.routes do not fit agents.route_ends")
    if header.walkable:
        found = len(header.walkable)
        _require(found == len(header.layers), f"{found} walkable areas for {len(header.layers)} layers")
    # Behaviors: a radius for each layer, and a color.
    for behavior in header.behaviors:
        if len(behavior.radii) != len(header.layers):
            raise RecordingError(
                f"behavior '{behavior.name}' gives {len(behavior.radii)} radii for {len(header.layers)} layers"
            )
        _require(re.fullmatch("#[0-9a-fA-F]{6}", behavior.color) is not None, f"{behavior.color!r} is not a color")
    _check_skeleton(motion)
    _check_gaits(header)
    # Nodes: their frames are rows of the pool, and they name behaviors that exist.
    first, frames = np.asarray(motion.node_first, np.int64), np.asarray(motion.node_frames, np.int64)
    wrong = np.flatnonzero((first < 0) | (frames < 0) | (first + frames >= rows))
    if wrong.size:
        raise RecordingError(f"node '{motion.node_names[wrong[0]]}' reaches beyond the {rows} poses of the pool")
    if np.any(frames > _MOST_FRAMES):
        raise RecordingError(
            f"node '{motion.node_names[int(frames.argmax())]}' has over {_MOST_FRAMES} frames; cut its clip"
        )
    _require(_within(motion.node_behavior, 0, len(header.behaviors)), "motion.node_behavior names no behavior")


def _require(right: object, wrong: str) -> None:
    """Raise RecordingError with the message ``wrong`` unless ``right``."""
    if not right:
        raise RecordingError(wrong)


def _within(values: Any, low: int, end: int) -> bool:
    """Return whether an array has a type of integers, and all of its values are from ``low`` to before ``end``."""
    values = np.asarray(values)
    whole = np.issubdtype(values.dtype, np.integer)
    return bool(whole and (values.size == 0 or (values.min() >= low and values.max() < end)))


def _check_skeleton(motion: MotionRecord) -> None:
    """Raise RecordingError if a skeleton's arrays do not fit together, or a joint comes before its parent."""
    skeleton = motion.skeleton
    joints = len(skeleton.names)
    _require(joints > 0, "motion: a skeleton needs joints")
    parents, end_parents = np.asarray(skeleton.parents), np.asarray(skeleton.end_parents)
    # K end sites: any number, also none.
    _require(end_parents.ndim == 1, f"motion.end_parents has shape {end_parents.shape}, not (K,)")
    shapes = {"parents": (joints,), "offsets": (joints, 3), "end_offsets": (len(end_parents), 3)}
    for name, shape in shapes.items():
        values = np.asarray(getattr(skeleton, name))
        _require(values.shape == shape, f"motion.{name} has shape {values.shape}, not {shape}")
        numbers = np.issubdtype(values.dtype, np.number) and bool(np.isfinite(values).all())
        _require(numbers, f"motion.{name} holds values of {values.dtype} that are not all finite numbers")
    # Only the first joint is a root (-1).
    in_order = parents[0] == -1 and _within(parents[1:], 0, joints) and (parents < np.arange(joints)).all()
    _require(in_order, "motion.parents: each joint but the first needs a parent before it")
    _require(_within(end_parents, 0, joints), "motion.end_parents names joints that do not exist")
    # Without roles, a valid index takes their place: an empty list becomes float64, which is no type of indices.
    _require(_within(list(skeleton.roles.values()) or [0], 0, joints), "motion.role_joints names no joint")


def _check_gaits(header: RecordingHeader) -> None:
    """Raise RecordingError unless there is no gait, or a valid one for each behavior, and the pool fits them.

    With nodes and gaits, the pool needs a phase for each row. Its tracks may be missing, as in older files.
    """
    gaits, joints = header.motion.gaits, header.motion.skeleton.joint_count
    if gaits and len(gaits) != len(header.behaviors):
        raise RecordingError(f"{len(gaits)} gaits for {len(header.behaviors)} behaviors; give each its own, or none")
    for gait in gaits:
        shapes = np.shape(gait.root), np.shape(gait.rotations)
        if shapes != ((len(gait.root), 3), (len(gait.root), joints, 4)):
            raise RecordingError(
                f"gait '{gait.name}' has shapes {shapes[0]}, {shapes[1]}, not (F, 3), (F, {joints}, 4)"
            )
        _require(
            len(gait.root) > 1,
            f"gait '{gait.name}' needs two or more poses, as bodies are posed between them; it has {len(gait.root)}",
        )
        finite = np.isfinite(gait.root).all() and np.isfinite(gait.rotations).all()
        _require(finite, f"gait '{gait.name}' has values that are not finite")
    phases, rows = np.asarray(header.motion.pool_phases), len(header.motion.pool_root)
    if header.motion.mixed and not (phases.shape == (rows,) and np.isfinite(phases).all()):
        raise RecordingError(
            f"motion.pool_phases has shape {phases.shape} or is not finite; give the {rows} phases of "
            "crowdsim.behaviors.entries.node_phases, or agents could not go over from one level to the other"
        )
    tracks = np.asarray(header.motion.pool_tracks)
    if len(tracks) and not (tracks.shape == (rows, 3) and np.isfinite(tracks).all()):
        raise RecordingError(f"motion.pool_tracks has shape {tracks.shape} or is not finite; give {rows} track poses")


def check_place(header: RecordingHeader) -> None:
    """Raise RecordingError for an invalid mesh, an error of shapely for text that is no outline.

    Outlines are those of floor, obstacles, movables, free areas, and of areas and lines of measurements.
    """
    footprints = (solid.footprint for solid in (*header.solids, *header.movables))
    shapes = (shape.shape for shape in (*header.areas, *header.lines))
    shapely.from_wkt([header.floor, *footprints, *header.walkable, *shapes])
    for mesh in header.meshes:
        fits = mesh.points.ndim == mesh.triangles.ndim == 2 and mesh.points.shape[1] == mesh.triangles.shape[1] == 3
        _require(
            fits and _within(mesh.triangles, 0, len(mesh.points)),
            f"mesh '{mesh.name}' refers to points that it does not have",
        )


def check_paths(
    counts: NDArray[Any],
    agents: NDArray[Any],
    points: NDArray[Any],
    behaviors: NDArray[Any],
    header: RecordingHeader,
) -> NDArray[np.int64]:
    """Return (p,) the row after the last point of each path; raise RecordingError if the columns contradict each other.

    counts, agents: (p,) number of points, and agent, of each path. points, behaviors: (n, 2) [m] and (n,) of all paths,
    one after the other.
    """
    whole = all(np.issubdtype(values.dtype, np.integer) for values in (counts, agents))
    fits = whole and np.all(counts >= 0) and int(counts.sum()) == len(points) and points.shape[1:] == (2,)
    _require(
        fits and _within(agents, 0, header.agents.count),
        "paths/count or paths/agent does not fit paths/points or the agents",
    )
    labeled = behaviors.shape == (len(points),) and _within(behaviors, 0, len(header.behaviors))
    _require(labeled, "paths/behaviors names no behavior, or does not fit paths/points")
    ends: NDArray[np.int64] = np.cumsum(counts)
    return ends
