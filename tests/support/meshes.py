"""Small meshes for tests: vertices (n, 3) and triangles (m, 3), faces outward."""

import numpy as np
from scipy.spatial import ConvexHull

from crowdsim.environment.mesh_solid import MeshSolid


def hull(points):
    """Return the convex hull of points (n, 3)."""
    points = np.asarray(points, np.float64)
    found = ConvexHull(points)
    corners = points[found.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * found.equations[:, :3]).sum(axis=1) < 0.0
    triangles = found.simplices.astype(np.int64)
    triangles[inward] = triangles[inward][:, ::-1]
    return points, triangles


def prism(outline, bottom, top):
    """Return the prism over a convex, counter-clockwise outline (n, 2)."""
    outline = np.asarray(outline, np.float64)
    n = len(outline)
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(n, bottom)]), np.column_stack([outline, np.full(n, top)])]
    )
    triangles = []
    for k in range(n):
        ahead = (k + 1) % n
        triangles += [(k, ahead, n + ahead), (k, n + ahead, n + k)]
    for k in range(1, n - 1):
        triangles += [(0, k + 1, k), (n, n + k, n + k + 1)]
    return vertices, np.array(triangles, np.int64)


def box(low, high):
    """Return the box between two opposite corners (3,)."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1)


def joined(*meshes):
    """Return several meshes as one."""
    vertices, triangles, count = [], [], 0
    for some_vertices, some_triangles in meshes:
        vertices.append(some_vertices)
        triangles.append(some_triangles + count)
        count += len(some_vertices)
    return np.concatenate(vertices), np.concatenate(triangles)


def inverted(mesh):
    """Return the mesh with its faces inward."""
    return mesh[0], mesh[1][:, ::-1]


def sheet(line, bottom, top):
    """Return upright sheets without thickness along a line (n, 2)."""
    line = np.asarray(line, np.float64)
    n = len(line)
    vertices = np.concatenate([np.column_stack([line, np.full(n, bottom)]), np.column_stack([line, np.full(n, top)])])
    return vertices, np.array([t for k in range(n - 1) for t in ((k, k + 1, n + k + 1), (k, n + k + 1, n + k))])


def solid(mesh, name="part"):
    """Return the mesh as a solid."""
    return MeshSolid(name, *mesh)
