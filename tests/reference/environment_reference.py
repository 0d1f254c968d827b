"""Slow twin of mesh sections: which points of the floor a mesh covers in a band of heights, point by point."""

import math

import numpy as np


def covered(vertices, triangles, low, high, points):
    """Return (n,) whether vertical lines over ``points`` (n, 2) meet a triangle in the open band, or are inside.

    Inside means that the triangles wind around the line's point in the middle of the band part of the mesh. Strips
    under upright triangles are left out: such points lie next to the outline.
    """
    z = vertices[triangles][:, :, 2]
    middle = 0.5 * (max(low, z.min()) + min(high, z.max()))
    answers = []
    for x, y in points:
        meets = any(_height_over(vertices[t], x, y, low, high) for t in triangles)
        answers.append(meets or winding(vertices, triangles, (x, y, middle)) > 0.5)
    return np.array(answers)


def _height_over(corners, x, y, low, high):
    """Return whether the triangle has a point over (x, y) with a height in the open band."""
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = corners
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(area) < 1e-12:
        return False
    b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
    c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
    a = 1.0 - b - c
    return min(a, b, c) >= 0.0 and low < a * z0 + b * z1 + c * z2 < high


def winding(vertices, triangles, point):
    """Return how often closed, outward triangles wind around a point: sum of solid angles / 4 pi (van Oosterom)."""
    total = 0.0
    for t in triangles:
        a, b, c = (vertices[k] - np.asarray(point) for k in t)
        la, lb, lc = (float(np.linalg.norm(v)) for v in (a, b, c))
        above = float(a @ np.cross(b, c))
        below = la * lb * lc + float(a @ b) * lc + float(b @ c) * la + float(c @ a) * lb
        total += 2.0 * math.atan2(above, below)
    return total / (4.0 * math.pi)
