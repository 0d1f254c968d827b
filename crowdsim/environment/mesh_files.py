"""Places from files of triangles: GLB, OBJ, STL, PLY and DAE; one solid for each part, in meters, z up.

Arguments of helpers: ``content``, the bytes of the file; ``ending``, that of its name, in small letters with the point;
``report``, lines for the user, to which helpers append. A ``mesh`` is one of trimesh.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.units import doubt_about_height, meters_per_unit
from crowdsim.errors import GeometryError, PlaceError, one_line
from crowdsim.geometry import planar
from crowdsim.geometry.products import dot
from crowdsim.whole_files import require_regular

Floats = NDArray[np.float64]

UP_AXES = {".glb": "y", ".obj": "y", ".stl": "z", ".ply": "z", ".dae": "y"}
"""The axis that points up by the ending of a file, unless the file or the caller says otherwise."""

FAR = 1000.0
"""Distance from the other parts of a place [m] beyond which a part is dropped."""

_MATRIX_DIGITS = 10
"""Decimals kept of matrices that trimesh multiplied, as their last bits depend on the processor."""

_Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

_MANY = 2000
"""Number of parts up to which the distances between all of them are computed."""


@dataclass(frozen=True)
class MeshScene:
    """The parts of a file as solids, and a report of what was assumed, dropped or looks wrong, one line each."""

    solids: tuple[MeshSolid, ...]
    report: tuple[str, ...]


def read_mesh_file(
    path: str | Path,
    *,
    content: bytes | None = None,
    up: str | None = None,
    units: str | None = None,
    scale: float = 1.0,
    rotation: float = 0.0,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> MeshScene:
    """Read the parts of a mesh file and place them.

    Parameters
    ----------
    path
        The file; its ending gives the format.
    content
        The bytes of the file if it is not on disk.
    up
        The file's axis that points up, "y" or "z". By default what the file says (DAE), else the custom of its format
        (:data:`UP_AXES`); the report says which.
    units
        Unit of the file (:data:`crowdsim.environment.units.METERS`). By default the number in the file (DAE), else
        meters. glTF files are in meters by definition; other units that their parts may note are not applied.
    scale, rotation, position
        How to place it, in this order: enlarge by ``scale``, turn by ``rotation`` [degrees] counter-clockwise about the
        vertical axis, and move by ``position`` [m].

    Raises
    ------
    PlaceError
        If the file cannot be read, is empty, damaged, of an unknown format, or holds no surfaces.
    GeometryError
        If an argument is not valid.
    """
    file = Path(path)
    ending = file.suffix.lower()
    _check_arguments(up, scale, rotation, position)
    if ending not in UP_AXES:
        hint = "; save it as .glb" if ending == ".gltf" else ""
        raise PlaceError(
            f"{file}: files ending in '{ending}' cannot be read as meshes; known are {', '.join(UP_AXES)}{hint}"
        )
    content = _content(file) if content is None else content
    report: list[str] = []
    axis = _up_axis(file.name, content, ending, up, report)
    meters = _meters(file.name, content, ending, units, report)
    place = _placement(axis, meters * scale, rotation, position)
    solids = []
    names: dict[str, int] = {}
    for name, matrix, mesh in _parts(file, content, ending, report):
        solid = _solid(file, _unique(name, names), mesh, _product(place, matrix), report)
        if solid is not None:
            solids.append(solid)
    if not solids:
        raise PlaceError(f"{file}: no part is usable:\n" + "\n".join(report))
    near = _without_far_parts(solids, report)
    doubt = doubt_about_height(max(s.top for s in near) - min(s.bottom for s in near), meters * scale)
    if doubt:
        report.append(f"{file.name}: {doubt}")
    return MeshScene(tuple(near), tuple(report))


def _check_arguments(up: str | None, scale: float, rotation: float, position: tuple[float, float, float]) -> None:
    """Raise GeometryError if an argument is not valid."""
    if up not in (None, "y", "z"):
        raise GeometryError(f"up: expected 'y' or 'z', got {up!r}")
    if not (math.isfinite(scale) and scale > 0.0):
        raise GeometryError(f"scale: expected a number above 0, got {scale}")
    if not math.isfinite(rotation):
        raise GeometryError(f"rotation: expected degrees, got {rotation}")
    if len(position) != 3 or not all(map(math.isfinite, position)):
        raise GeometryError(f"position: expected x, y and z in meters, got {position}")


def _content(file: Path) -> bytes:
    """Return the bytes of a file, or raise PlaceError."""
    require_regular(file, PlaceError)
    try:
        content = file.read_bytes()
    except OSError as error:
        raise PlaceError(f"{file}: cannot be read ({error.strerror or error}); check the path") from None
    if not content.strip():
        raise PlaceError(f"{file}: the file is empty; export it again")
    return content


def _up_axis(name: str, content: bytes, ending: str, up: str | None, report: list[str]) -> str:
    """Return the axis that points up, "y" or "z", and report the source unless it is ``up``.

    Raise PlaceError if the file says x. ``name`` is that of the file, for messages.
    """
    if up is not None:
        return up
    if ending == ".dae":
        said = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", content)
        axis = said[1].decode().lower() if said else UP_AXES[ending]
        if axis == "x":
            raise PlaceError(f"{name}: its x axis points up; export it with z up")
        report.append(f"{name}: {axis} is up, as {'the file says' if said else 'is the custom of this format'}")
        return axis
    axis = UP_AXES[ending]
    sure = "by definition of the format" if ending == ".glb" else "as is the custom of this format; give 'up' if not so"
    report.append(f"{name}: {axis} is up, {sure}")
    return axis


def _meters(name: str, content: bytes, ending: str, units: str | None, report: list[str]) -> float:
    """Return the meters of a unit of the file, and report the source unless it is ``units``.

    A file that gives none is in meters. Raise PlaceError if a DAE file gives one that is no number above 0. ``name`` is
    that of the file, for messages.
    """
    if units is not None:
        return meters_per_unit(units)
    if ending == ".dae":
        said = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)[\"']", content)
        try:
            meters = float(said[1]) if said else 1.0
        except ValueError:
            meters = math.nan
        if not (math.isfinite(meters) and meters > 0.0):
            raise PlaceError(f"{name}: its unit is not a number of meters; give 'units'")
        report.append(f"{name}: a unit is {meters:g} m, {'as the file says' if said else 'as the file names no other'}")
        return meters
    sure = "by definition of the format" if ending == ".glb" else "as the format knows no units; give 'units' if not so"
    report.append(f"{name}: in meters, {sure}")
    return 1.0


def _placement(axis: str, scale: float, rotation: float, position: tuple[float, float, float]) -> Floats:
    """Return the (4, 4) matrix from the file's coordinates to those of the place [m].

    ``axis`` of the file points up; ``scale`` is in meters for each unit of the file, ``rotation`` in degrees about the
    vertical, ``position`` in meters.
    """
    c, s = planar.rotation(rotation)
    turned = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    turned[:3, :3] *= scale
    turned[:3, 3] = position
    return _product(turned, _Y_UP_TO_Z_UP) if axis == "y" else turned


def _product(a: Floats, b: Floats) -> Floats:
    """Return the matrix product; unlike BLAS it adds in one order, so that it is the same on every processor."""
    return dot(a[:, None, :], b.T)


def _parts(file: Path, content: bytes, ending: str, report: list[str]) -> Iterator[tuple[str, Floats, Any]]:
    """Yield name, matrix (4, 4) and mesh (trimesh) of each part that has surfaces; report the others at the end.

    The matrix leads from the part to the file's coordinates.
    """
    scene = _loaded(file, content, ending)
    try:
        # By name, as the order of a scene graph is that of hash tables.
        parts = [(str(node), *scene.graph[node]) for node in sorted(scene.graph.nodes_geometry, key=str)]
    except Exception as error:
        raise PlaceError(f"{file}: its scene graph cannot be read ({_said(error)}); export it again") from None
    single = len(parts) == 1 and ending in (".stl", ".ply", ".obj")
    noted = set()
    without = 0
    for node, matrix, key in parts:
        mesh = scene.geometry[key]
        if len(getattr(mesh, "faces", ())) == 0:
            without += 1
            continue
        unit = mesh.metadata.get("units")
        if ending == ".glb" and unit not in (None, "meters", "meter", "m"):
            noted.add(str(unit))
        yield file.stem if single else node, np.asarray(np.round(matrix, _MATRIX_DIGITS), np.float64), mesh
    if noted:
        report.append(
            f"{file.name}: parts note other units ({', '.join(sorted(noted))}), which were not applied, as this format "
            f"is in meters; give 'units' if it is not"
        )
    if without:
        report.append(f"{file.name}: {without} parts are points or lines without surfaces and were dropped")


def _loaded(file: Path, content: bytes, ending: str) -> Any:
    """Return the trimesh scene of the bytes of a file, or raise PlaceError; ``file`` is for messages only."""
    import trimesh

    if ending == ".dae":
        try:
            import collada  # noqa: F401
        except ImportError:
            raise PlaceError(
                f"{file}: DAE files need pycollada; install it with: pip install 'crowdsim[dae]'"
            ) from None
    # In OBJ files, each object is one part, of whatever materials it is.
    kwargs: dict[str, Any] = {"split_objects": True, "group_material": False, "skip_materials": True}
    try:
        # From bytes, so that a file cannot cause others to be read.
        scene = trimesh.load_scene(
            io.BytesIO(content), file_type=ending[1:], process=False, **(kwargs if ending == ".obj" else {})
        )
    # The parser can raise anything on damaged files.
    except Exception as error:
        raise PlaceError(f"{file}: cannot be read as {ending[1:].upper()} ({_said(error)}); export it again") from None
    kinds = [type(geometry).__name__ for geometry in scene.geometry.values()]
    if not any(len(getattr(geometry, "faces", ())) for geometry in scene.geometry.values()):
        what = "a point cloud" if "PointCloud" in kinds else "lines only" if kinds else "nothing"
        raise PlaceError(f"{file}: holds {what}, no surfaces; export triangles")
    return scene


def _said(error: Exception) -> str:
    """Return the kind of an error, and what it says if it says anything."""
    text = one_line(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _unique(name: str, names: dict[str, int]) -> str:
    """Return ``name``, with a number appended from the second time on; count it in ``names``."""
    names[name] = names.get(name, 0) + 1
    return name if names[name] == 1 else _unique(f"{name}_{names[name]}", names)


def _solid(file: Path, name: str, mesh: Any, matrix: Floats, report: list[str]) -> MeshSolid | None:
    """Return a part, moved by ``matrix`` (4, 4), as a solid; None, and a line in ``report``, if it is unusable."""
    vertices = np.asarray(mesh.vertices, np.float64)
    triangles = np.asarray(mesh.faces, np.int64)
    x, y, z = vertices.T
    # Not by a matrix product, which may round equal points of different rows differently.
    with np.errstate(all="ignore"):
        placed = np.column_stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix[:3]])
    if _volume(matrix) < 0.0:
        # Mirrored: without this, outside would be inside.
        triangles = triangles[:, ::-1]
    try:
        return MeshSolid(name, placed, triangles)
    except GeometryError as error:
        report.append(f"{file.name}: dropped: {error}")
        return None


def _volume(matrix: Floats) -> float:
    """Return the determinant of a matrix's linear part (3, 3): the factor of volumes, negative if it mirrors."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = matrix[:3, :3].tolist()
    return float(ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx))


def _without_far_parts(solids: list[MeshSolid], report: list[str]) -> list[MeshSolid]:
    """Return ``solids`` without those far from most of the others; report the solids that are left out.

    Solids with a gap of at most :data:`FAR` between them are in one group. The group with the most solids is kept. Of
    more than _MANY solids, those are kept whose gap to the median of their middles is at most FAR; if none is, all.
    """
    low = np.array([solid.corners.min(axis=(0, 1)) for solid in solids])
    high = np.array([solid.corners.max(axis=(0, 1)) for solid in solids])
    # If all lie within FAR of each other, they are one group.
    groups = np.zeros(len(solids), np.int64)
    if np.ptp(np.concatenate([low, high]), axis=0).max() <= FAR:
        return solids
    # Of very many parts not every pair is compared, but each part with the median of all middles.
    if len(solids) > _MANY:
        center = np.median(0.5 * (low + high), axis=0)
        far = np.maximum(low - center, center - high).max(axis=1) > FAR
        kept = 0
        if not far.all():
            groups[far] = 1
    else:
        # The gap between two boxes around parts, along the axis in which it is widest.
        gap = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
        groups = connected_components(gap <= FAR, directed=False)[1]
        counts = np.bincount(groups)
        # Of groups with equally many parts, the one nearest to the origin.
        reach = [np.abs(np.concatenate([low[groups == k], high[groups == k]])).max() for k in range(len(counts))]
        kept = min(range(len(counts)), key=lambda k: (-counts[k], reach[k]))
    for number in np.flatnonzero(groups != kept):
        x, y, z = 0.5 * (low[number] + high[number])
        report.append(
            f"dropped: '{solids[number].name}' is more than {FAR:g} m off the others, at ({x:g}, {y:g}, {z:g})"
        )
    return [solid for solid, group in zip(solids, groups, strict=True) if group == kept]
