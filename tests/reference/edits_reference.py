"""Slow, obvious twins of mesh edits: everything is computed again from the list of obstacles."""

import numpy as np
import shapely

from crowdsim.navmesh.editing.point_kernels import SETTLE, edit_point
from crowdsim.navmesh.mesh.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays, resized, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, KEPT, LOOKING, QUEUED, TOUCHED
from tests.reference.navmesh_reference import free_area, mesh_faults


def free_space(area, obstacles):
    """Return the part of ``area`` that no polygon among ``obstacles`` covers."""
    return area.difference(shapely.union_all([o for o in obstacles if o.area > 0.0]))


def walls_of(area, obstacles):
    """Return the boundary of the free space, and the lines and points in it."""
    return shapely.union_all([free_space(area, obstacles).boundary, *(o for o in obstacles if not o.area > 0.0)])


def edited_clearances(area, obstacles, points):
    """Return distances to walls, 0 if a polygon covers a point [m]."""
    distances = shapely.distance(shapely.points(points), walls_of(area, obstacles))
    return np.where(shapely.contains_xy(free_space(area, obstacles), points), distances, 0.0)


def edited_parts(area, obstacles, radius: float):
    """Return where the center of a disc can be, one polygon per component."""
    centers = free_space(area, obstacles).buffer(-radius, quad_segs=64)
    thin = [o.buffer(radius, quad_segs=64) for o in obstacles if not o.area > 0.0]
    return [part for part in shapely.get_parts(centers.difference(shapely.union_all(thin))) if part.area > 0.0]


def feet_missing(mesh: MeshArrays) -> int:
    """Return how many points (feet of perpendiculars) a refinement of the whole mesh adds to it."""
    copy = resized(mesh, 2 * len(mesh.vertices))
    work = workshop(len(copy.vertices))
    copy.sides["corner_clearance"] = -1.0  # negative: every triangle is to be refined and measured again
    corners = np.flatnonzero(copy.vertices["vhe"][: int(copy.frame["vertices"][0])] >= 0)
    # Queue every vertex for both stages of the refinement.
    work.to_do["waiting"][: len(corners)] = work.to_do["touched"][: len(corners)] = corners
    work.to_do["mark"][corners] = QUEUED | TOUCHED | LOOKING | KEPT | CHANGED
    work.progress["waiting"] = work.progress["touched"] = len(corners)
    assert edit_point(places_of(copy, work), SETTLE, 0.0, 0.0, -1) == 0
    return (int(copy.frame["triangles"][0]) - int(mesh.frame["triangles"][0])) // 2


def wrong_widths(mesh: MeshArrays) -> int:
    """Return how many corners have another width than their triangle gives."""
    count = 3 * int(mesh.frame["triangles"][0])
    sides = mesh.sides[:count].reshape(-1, 3)
    at = mesh.vertices[sides["org"]]
    place = np.stack([at["x"], at["y"]], axis=2)
    length = np.hypot(*np.moveaxis(np.roll(place, -1, axis=1) - place, 2, 0))
    double = np.abs(np.linalg.det(place[:, 1:] - place[:, :1]))
    closed = sides["constraints"] != 0
    wrong = 0
    for i in range(3):
        base, last = (i + 1) % 3, (i + 2) % 3
        width = np.minimum(length[:, i], length[:, last])
        height = double / length[:, base]
        width = np.where(
            closed[:, base], np.minimum(width, height), width
        )  # feet outside of a base: a side is as short
        width = np.where(closed[:, i] | closed[:, last] | (mesh.cover[: count // 3] != 0), 0.0, width)
        # If the foot of the height is outside of the base, its nearest point is an end: then widths are not compared.
        along = ((place[:, last] - place[:, base]) * (place[:, i] - place[:, base])).sum(axis=1)
        inside = (along >= 0.0) & (along <= length[:, base] ** 2)
        compared = inside | ~closed[:, base]
        wrong += int((np.abs(sides["corner_clearance"][:, i] - width) > 1e-5 * (1.0 + width))[compared].sum())
    return wrong


def edit_faults(mesh: NavMesh, area, obstacles) -> list[str]:
    """Return what is wrong with an edited mesh."""
    faults = mesh_faults(mesh.arrays)
    if faults:
        return faults
    expected = free_space(area, obstacles).area
    tolerance = 4.0 * mesh.arrays.frame["cell"][0] * (area.length + sum(o.length for o in obstacles)) + 1e-9
    if abs(free_area(mesh.arrays) - expected) > tolerance:
        faults.append(f"free area {free_area(mesh.arrays)} instead of {expected}")
    if wrong_widths(mesh.arrays):
        faults.append(f"{wrong_widths(mesh.arrays)} corners have wrong widths")
    if feet_missing(mesh.arrays):
        faults.append(f"{feet_missing(mesh.arrays)} feet are missing")
    return faults
