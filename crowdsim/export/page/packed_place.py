"""The environment of a page as triangles and lines, with movables, planned paths, and a density map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.export.page.choice import Chosen
from crowdsim.export.page.packing import Block, Ints, zigzag
from crowdsim.export.page.tracks.track_chunks import place_units
from crowdsim.playback.scene import TALL
from crowdsim.playback.scenery import FlatMesh, floor_mesh, grid_lines, meshes_mesh, solids_mesh
from crowdsim.recording.header import RecordingHeader, SolidRecord
from crowdsim.recording.reader import Recording

CELL = 0.5
"""Side of the cells of the density map [m]."""

_SIMPLIFIED = 0.02
"""Largest deviation of a drawn path from the planned one [m]."""
_STEPS_AT_ONCE = 256
_MOST_CELLS = 1_000_000
"""Steps that are read at once, and largest number of cells of the density map."""


def pack_place(block: Block, recording: Recording, chosen: Chosen) -> dict[str, Any]:
    """Add floor, obstacles and movables to the block; return the bounds (low, high) of everything [m]."""
    return pack_scenery(block, recording.header, _pack_movables(block, recording, chosen))


def pack_scenery(
    block: Block, header: RecordingHeader, moving: NDArray[np.float64] | None = None
) -> dict[str, list[float]]:
    """Add the floor with its grid, and obstacles that never move, to the block.

    Obstacles up to :data:`TALL` and taller ones are separate meshes, ``low`` and ``tall``: tall ones are drawn as
    glass, so that they do not hide agents. Return the bounds (low, high) of all of them and the points ``moving``
    (n, 3) [m].
    """
    floor = floor_mesh(header)
    low_meshes = [mesh for mesh in header.meshes if mesh.points[:, 2].max(initial=0.0) <= TALL]
    tall_meshes = [mesh for mesh in header.meshes if mesh.points[:, 2].max(initial=0.0) > TALL]
    low = _joined(solids_mesh([s for s in header.solids if s.top <= TALL]), meshes_mesh(low_meshes))
    tall = _joined(solids_mesh([s for s in header.solids if s.top > TALL]), meshes_mesh(tall_meshes))
    block.add("grid_lines", np.asarray(grid_lines(header), np.float32))
    corners = [floor.points]
    for name, mesh in (("floor", floor), ("low", low), ("tall", tall)):
        _add_mesh(block, name, mesh)
        corners.append(mesh.points)
    if moving is not None:
        corners.append(moving)
    points = np.concatenate(corners)
    # With no geometry at all, bounds for the camera to look at; and never lower than a person.
    if not len(points):
        points = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])
    top = max(float(points[:, 2].max()), 1.8)
    low_corner, high_corner = points.min(axis=0), points.max(axis=0)
    return {"low": low_corner.round(3).tolist(), "high": [*high_corner[:2].round(3).tolist(), round(top, 3)]}


def _joined(a: FlatMesh, b: FlatMesh) -> FlatMesh:
    """Return two meshes as one."""
    triangles = np.concatenate([a.triangles, b.triangles + len(a.points)])
    return FlatMesh(np.concatenate([a.points, b.points]), triangles, np.concatenate([a.outline, b.outline]))


def _add_mesh(block: Block, name: str, mesh: FlatMesh) -> None:
    """Add the corners of the triangles, triangle by triangle, and the ends of the lines."""
    block.add(f"{name}_corners", mesh.points[mesh.triangles].reshape(-1, 3).astype(np.float32))
    block.add(f"{name}_lines", mesh.outline.astype(np.float32))


def _pack_movables(block: Block, recording: Recording, chosen: Chosen) -> NDArray[np.float64]:
    """Add the meshes of movables, one for each span of steps in which a movable has the same footprint.

    Each vertex comes with two steps, counted from the first of the page: the first one in which its mesh is shown, and
    the one after the last. Return the corners (n, 3) of all triangles [m].
    """
    header, last = recording.header, chosen.first + chosen.steps
    shown: list[tuple[SolidRecord, int, int]] = []
    # Step and footprint (None if it is absent) of the last change so far of each movable, shown up to its next change.
    since: dict[int, tuple[int, str | None]] = {}
    for change in recording.changes:
        _close(shown, header.movables, since, change.movable, change.step)
        since[change.movable] = change.step, change.footprint
    for movable in sorted(since):
        _close(shown, header.movables, since, movable, last)
    corners, spans, lines, line_spans = [], [], [], []
    for solid, begin, end in shown:
        first, stop = max(begin - chosen.first, 0), min(end, last) - chosen.first
        if first >= stop:
            continue
        mesh = solids_mesh([solid])
        triangles = mesh.points[mesh.triangles].reshape(-1, 3)
        corners.append(triangles)
        spans.append(np.tile([first, stop], (len(triangles), 1)))
        lines.append(mesh.outline)
        line_spans.append(np.tile([first, stop], (len(mesh.outline), 1)))
    nothing, no_span = np.zeros((0, 3)), np.zeros((0, 2))
    block.add("moving_corners", np.concatenate([nothing, *corners]).astype(np.float32))
    block.add("moving_spans", np.concatenate([no_span, *spans]).astype(np.float32))
    block.add("moving_lines", np.concatenate([nothing, *lines]).astype(np.float32))
    block.add("moving_line_spans", np.concatenate([no_span, *line_spans]).astype(np.float32))
    return np.concatenate([nothing, *corners])


def _close(
    shown: list[tuple[SolidRecord, int, int]],
    movables: Sequence[SolidRecord],
    since: dict[int, tuple[int, str | None]],
    movable: int,
    end: int,
) -> None:
    """Add to ``shown`` the footprint that a movable has had until step ``end``, with its steps, if it was present.

    since: step and footprint of the last change of each movable.
    """
    begin, footprint = since.get(movable, (0, None))
    if footprint is not None and end > begin:
        solid = movables[movable]
        shown.append((SolidRecord(solid.name, footprint, solid.bottom, solid.top), begin, end))


def pack_paths(block: Block, recording: Recording, chosen: Chosen) -> int:
    """Add the planned paths to the block, simplified within each behavior; return their number.

    Each path has an agent, a step and a number of pieces; each piece has a behavior and a number of points. The points
    of all pieces are packed as differences from one to the next, first all x, then all y, in units of places.
    """
    rows = {agent: row for row, agent in enumerate(chosen.agents.tolist())}
    last = chosen.first + chosen.steps
    # A path of one point has nothing to draw.
    paths = [path for path in recording.paths if path.agent in rows and path.step < last and len(path.points) > 1]
    # Keep the path that each agent follows at the first step, and all later ones.
    latest = {path.agent: path.step for path in paths if path.step <= chosen.first}
    paths = [path for path in paths if path.step >= latest.get(path.agent, 0)]
    pieces, owners, kinds = [], [], []
    for number, path in enumerate(paths):
        # Behaviors of the segments, and pieces of equal behavior; each piece ends with the first point of the next.
        kind = path.behaviors[:-1]
        cuts = np.flatnonzero(np.diff(kind)) + 1
        for first, end in zip([0, *cuts.tolist()], [*cuts.tolist(), len(kind)], strict=True):
            pieces.append(path.points[first : end + 1])
            owners.append(number)
            kinds.append(int(kind[first]))
    counts = np.zeros(0, np.int64)
    points = np.zeros((0, 2), np.int64)
    if pieces:
        index = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
        lines = shapely.simplify(shapely.linestrings(np.concatenate(pieces), indices=index), _SIMPLIFIED)
        counts = shapely.get_num_coordinates(lines).astype(np.int64)
        points = np.rint(shapely.get_coordinates(lines) * place_units(chosen)).astype(np.int64)
    block.add_varints("path_agents", np.array([rows[path.agent] for path in paths], np.int64))
    block.add_varints("path_steps", np.array([max(path.step - chosen.first, 0) for path in paths], np.int64))
    block.add_varints("path_pieces", np.bincount(owners, minlength=len(paths)).astype(np.int64))
    block.add("piece_behaviors", np.array(kinds, np.uint8))
    block.add_varints("piece_counts", counts)
    differences = np.diff(points, axis=0, prepend=np.zeros_like(points[:1]))
    block.add_varints("path_points", zigzag(differences.T.ravel()))
    return len(paths)


def density_cells(bounds: dict[str, Any]) -> dict[str, Any]:
    """Return the side of the cells of the density map [m], and their numbers along x (columns) and y (lines).

    ``bounds`` are those of :func:`pack_scenery`. Cells are enlarged until there are at most _MOST_CELLS.
    """
    low, high = np.array(bounds["low"][:2]), np.array(bounds["high"][:2])
    # One more along each axis than fit, for agents at the very end.
    cell = CELL
    while np.prod(np.ceil((high - low) / cell) + 1.0) > _MOST_CELLS:
        cell *= 2.0
    columns, lines = (int(n) for n in np.ceil((high - low) / cell) + 1.0)
    return {"cell": cell, "columns": columns, "lines": lines}


def pack_density(block: Block, recording: Recording, chosen: Chosen, bounds: dict[str, Any]) -> dict[str, Any]:
    """Add the mean density of agents in each cell over all steps of the page, (lines * columns,) float32 [1/m2].

    Return side and numbers of the cells, see :func:`density_cells`.
    """
    cells = density_cells(bounds)
    low, (cell, columns, lines) = bounds["low"], cells.values()
    total: Ints = np.zeros(columns * lines, np.int64)
    for first in range(chosen.first, chosen.first + chosen.steps, _STEPS_AT_ONCE):
        rows = slice(first, min(first + _STEPS_AT_ONCE, chosen.first + chosen.steps))
        x, y = recording.x[rows][:, chosen.agents], recording.y[rows][:, chosen.agents]
        here = recording.state[rows][:, chosen.agents] > 0  # 0 is ABSENT
        column = np.clip(((x[here] - low[0]) / cell).astype(np.int64), 0, columns - 1)
        line = np.clip(((y[here] - low[1]) / cell).astype(np.int64), 0, lines - 1)
        total += np.bincount(line * columns + column, minlength=len(total))
    block.add("density", (total / (chosen.steps * cell * cell)).astype(np.float32))
    return cells
