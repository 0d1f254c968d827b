"""Build the roadmap of a place: points on the sides of the lowest mesh's triangles, and straight ways between them.

Points lie where paths are likely to cross a side: at both ends of each stretch that is clear enough for the widest
behavior, because paths wind around corners there; between these ends; and at the widest place of each stretch that only
a narrower behavior passes. A way crosses one triangle. If it cuts the corner that its two sides share, its length is
measured around the corner, with an arc.

``layers`` (m, 5, 2), ``radii`` (n, m) and ``hints`` (m,) are those of
:mod:`crowdsim.planning.roadmap.measuring_kernels`, ``level`` is a behavior, ``points`` (p,) are records
:data:`ROAD_POINT` and ``spans`` (half-edges,) records :data:`SPAN_OF`; a = (ax, ay) is a place [m], u = (ux, uy) a unit
vector.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.planning.roadmap.measuring_kernels import SOFT, length_around, level_at, room_at, tight_share, way_level

ROAD_POINT = np.dtype(
    [("x", np.float64), ("y", np.float64), ("level", np.int64), ("begin", np.int64), ("side", np.int64)], align=True
)
"""Point of the roadmap.

level: widest behavior that fits there. begin: index of its first way in the list of ways. side: its half-edge, the
smaller of the two twins.
"""

ROAD_WAY = np.dtype([("to", np.int32), ("level", np.int32), ("length", np.float64), ("tight", np.float64)], align=True)
"""Way to point ``to`` for all behaviors up to ``level``.

length: [m]. tight: meters of it in which the widest behavior does not fit, or the whole length if it fits everywhere. A
narrower behavior pays its higher cost per meter on these only.
"""

SPAN_OF = np.dtype([("first", np.int64), ("last", np.int64)], align=True)
"""Points first <= k < last lie on a half-edge."""

_PAIR = np.dtype(
    [("a", np.int32), ("b", np.int32), ("level", np.int64), ("length", np.float64), ("tight", np.float64)], align=True
)
"""Way between points a and b, in both directions; fields as of :data:`ROAD_WAY`."""

_STEP = 0.08
"""Distance between the samples of a side [m]. Shorter steps find narrower stretches and take longer."""

_MOST_STEPS = 96
"""Largest number of steps between samples of one side."""

_BETWEEN = 0.4
"""Largest distance between points of a stretch [m], if :data:`_MOST_BETWEEN` of them suffice."""

_MOST_BETWEEN = 6
"""Largest number of points within one stretch, its ends not counted."""


@helper
def _add_point(points, count, x, y, level, h):
    """Append the point (x, y) [m] on half-edge ``h`` to ``points``, an array that grows; return (points, count).

    ``level`` is the widest behavior that fits there; ``begin`` is left for `join_points`.
    """
    if count == points.size:
        points = longer(points)
    point = points[count]
    point.x = x
    point.y = y
    point.level = level
    point.side = h
    return points, count + 1


@helper
def _border(layers, hints, radii, ax, ay, ux, uy, inside, outside):
    """Return the last s [m] for which the widest behavior, and so every one, fits at a + s * u, by bisection.

    It lies between s = ``inside``, at which it fits, and s = ``outside``, at which it does not [m]. ``hints`` are
    changed.
    """
    top = radii.shape[0] - 1
    # Halved six times, a step of _STEP leaves about a millimeter.
    for _ in range(6):
        middle = 0.5 * (inside + outside)
        if room_at(layers, hints, radii, top, ax + middle * ux, ay + middle * uy) >= 0.0:
            inside = middle
        else:
            outside = middle
    return inside


@kernel
def place_points(layers, radii):
    """Place the points of the roadmap on the free sides of the lowest mesh.

    Parameters
    ----------
    layers: (m, 5, 2) array of `layers_of`, the legs' layer first.
    radii: (n, m) float64, clearance of each behavior in each layer [m].

    Returns
    -------
    (points (k,) of :data:`ROAD_POINT`, spans (half-edges,) of :data:`SPAN_OF`)
    """
    m = mesh_at(layers[0])
    sides = m.sides
    vertices = m.vertices
    n = radii.shape[0]
    count = np.int64(0)
    points = np.empty(m.cover.size * 3 + 16, ROAD_POINT)
    spans = np.zeros(3 * m.frame[0].triangles, SPAN_OF)
    hints = np.full(len(layers), NONE)
    levels = np.empty(_MOST_STEPS + 1, np.int64)
    rooms = np.empty(_MOST_STEPS + 1)
    least = 2.0 * radii[0, 0]
    for h in range(3 * m.frame[0].triangles):
        g = sides[h].twin
        # Each pair of twins once; no sides of obstacles, and none inside of obstacles.
        if g < h or sides[h].constraints != 0 or m.cover[h // 3] != 0:
            continue
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        ax = a.x
        ay = a.y
        ux = b.x - ax
        uy = b.y - ay
        length = hypot(ux, uy)
        # Too short for the narrowest behavior to pass between its ends, even if it lacks SOFT at both, as a way may.
        if length < least - 2.0 * SOFT:
            continue
        ux /= length
        uy /= length
        hints[0] = h // 3
        # The level, and the room of the narrowest behavior, at samples along the side; an even number of steps, so that
        # the middle is one.
        steps = min(_MOST_STEPS, max(4, 2 * math.ceil(0.5 * length / _STEP)))
        for k in range(steps + 1):
            s = length * k / steps
            levels[k], rooms[k] = level_at(layers, hints, radii, ax + s * ux, ay + s * uy)
        first = count
        # A run of samples of at least this level gives points of it, unless it reaches the next level somewhere.
        for level in range(n):
            k = 0
            while k <= steps:
                if levels[k] < level:
                    k += 1
                    continue
                begin = k
                widest = level
                best = k
                while k <= steps and levels[k] >= level:
                    widest = max(widest, levels[k])
                    if rooms[k] > rooms[best]:
                        best = k
                    k += 1
                if widest > level:
                    continue
                # A narrower behavior gets only the widest place.
                if level < n - 1:
                    s = length * best / steps
                    points, count = _add_point(points, count, ax + s * ux, ay + s * uy, level, h)
                    continue
                # The widest behavior gets both ends of the stretch, found by bisection, and points between them.
                low = length * begin / steps
                high = length * (k - 1) / steps
                if begin > 0:
                    low = _border(layers, hints, radii, ax, ay, ux, uy, low, length * (begin - 1) / steps)
                if k <= steps:
                    high = _border(layers, hints, radii, ax, ay, ux, uy, high, length * k / steps)
                # A stretch of less than 5 cm, shorter than a step, gets one point, in its middle.
                parts = min(1 + _MOST_BETWEEN, math.ceil((high - low) / _BETWEEN))
                if high - low < 0.05:
                    s = 0.5 * (low + high)
                    points, count = _add_point(points, count, ax + s * ux, ay + s * uy, level, h)
                else:
                    for i in range(parts + 1):
                        s = low + (high - low) * i / parts
                        points, count = _add_point(points, count, ax + s * ux, ay + s * uy, level, h)
        # No sample fits, but by the mesh's corner clearances the legs may still turn around an end of the side: see
        # `join_points`.
        if first == count:
            points, count = _add_point(points, count, ax + 0.5 * length * ux, ay + 0.5 * length * uy, 0, h)
        spans[h].first = first
        spans[h].last = count
        spans[g].first = first
        spans[g].last = count
    return points[:count].copy(), spans


@kernel
def corner_radii(layers, radii):
    """Return (nv, n) float64: the distance [m] that each behavior keeps from each vertex of the lowest mesh.

    A vertex counts for a layer if an obstacle of that layer touches it; it always counts for the legs' layer.
    """
    vertices = mesh_at(layers[0]).vertices
    around = np.zeros((vertices.size, radii.shape[0]))
    for v in range(vertices.size):
        for k in range(len(layers)):
            stands = k == 0
            # On other layers, an obstacle counts that is within 1 mm of the vertex (looked for up to 1 cm) or covers it
            # (distance -1).
            if not stands:
                distance, _ = disc_clearance(mesh_at(layers[k]), vertices[v].x, vertices[v].y, 0.01, np.int64(NONE))
                stands = distance < 0.001
            if stands:
                for i in range(radii.shape[0]):
                    around[v, i] = max(around[v, i], radii[i, k])
    return around


@kernel
def join_points(layers, radii, around, points, spans):
    """Find the ways between the points on the sides of each free triangle.

    Parameters
    ----------
    layers, radii, points, spans: as of `place_points`; the ``begin`` of the points is filled.
    around: (nv, n) of `corner_radii`.

    Returns
    -------
    (k,) of :data:`ROAD_WAY`, sorted by the point from which they lead. The ways of point i end at the ``begin`` of
    point i + 1, those of the last point at the end of the array.
    """
    m = mesh_at(layers[0])
    sides = m.sides
    vertices = m.vertices
    hints = np.full(len(layers), NONE)
    roots = np.full(len(layers), NONE)
    stack = np.empty(64, SWEPT)
    pairs = np.empty(8 * points.size + 16, _PAIR)
    count = np.int64(0)
    # width: the diameter of the narrowest behavior's legs, less a millionth for rounding. legs_suffice: on every layer,
    # this behavior needs no more clearance than its legs do on theirs.
    width = 2.0 * radii[0, 0] * (1.0 - 1e-6)
    legs_suffice = True
    for k in range(1, len(layers)):
        legs_suffice = legs_suffice and radii[0, k] <= radii[0, 0]
    for t in range(m.frame[0].triangles):
        if m.cover[t] != 0:
            continue
        for h in range(3 * t, 3 * t + 3):
            # Side h and the side e before it share the corner v at the origin of h.
            e = nxt(nxt(h))
            v = sides[h].org
            cx = vertices[v].x
            cy = vertices[v].y
            for i in range(spans[h].first, spans[h].last):
                p = points[i]
                hints[0] = t
                # Called for its effect: hints become the triangles that contain p.
                level_at(layers, hints, radii, p.x, p.y)
                for k in range(hints.size):
                    roots[k] = hints[k]
                for j in range(spans[e].first, spans[e].last):
                    q = points[j]
                    top = min(p.level, q.level)
                    level = way_level(layers, roots, hints, stack, radii, p.x, p.y, q.x, q.y, top, cx, cy, around[v])
                    if level < 0:
                        # No way tried fits. But if the corner is wide enough by the mesh's own measure, the legs get
                        # around it. So does the narrowest behavior on all layers if it needs no more than its legs
                        # there, as the lowest mesh holds the obstacles of all layers.
                        if sides[h].corner_clearance < width or not legs_suffice:
                            continue
                        level = 0
                    if count == pairs.size:
                        pairs = longer(pairs)
                    pair = pairs[count]
                    pair.a = i
                    pair.b = j
                    pair.level = level
                    pair.length = length_around(p.x, p.y, q.x, q.y, cx, cy, around[v, level])
                    pair.tight = pair.length
                    if level < radii.shape[0] - 1:
                        pair.tight *= tight_share(layers, hints, radii, p.x, p.y, q.x, q.y, cx, cy, around[v])
                    count += 1
    # Both directions of each pair, sorted by their first point (counting sort).
    begins = np.zeros(points.size + 1, np.int64)
    for k in range(count):
        begins[pairs[k].a + 1] += 1
        begins[pairs[k].b + 1] += 1
    for i in range(points.size):
        begins[i + 1] += begins[i]
        points[i].begin = begins[i]
    ways = np.empty(2 * count, ROAD_WAY)
    for k in range(count):
        for turn in range(2):
            a = pairs[k].a if turn == 0 else pairs[k].b
            way = ways[begins[a]]
            begins[a] += 1
            way.to = pairs[k].b if turn == 0 else pairs[k].a
            way.level = pairs[k].level
            way.length = pairs[k].length
            way.tight = pairs[k].tight
    return ways


@helper
def see_points(layers, hints, radii, around, points, spans, x, y, seen):
    """Find the ways from (x, y) [m] to the points on the sides of its triangle; return (seen, count).

    The ways are the first ``count`` rows of ``seen``, an array of :data:`ROAD_WAY` that grows; there are none if no
    behavior fits at (x, y). ``hints`` are changed. Other parameters are as of `join_points`.
    """
    m = mesh_at(layers[0])
    sides = m.sides
    vertices = m.vertices
    count = 0
    level, _ = level_at(layers, hints, radii, x, y)
    if level < 0:
        return seen, count
    # `level_at` has set the hints to the triangles that hold (x, y). ``roots`` keeps them, as the hints move on.
    t = hints[0]
    roots = hints.copy()
    # Scratch. If a sweep needs more room, its answer is no, and `way_level` samples the way instead.
    stack = np.empty(64, SWEPT)
    for h in range(3 * t, 3 * t + 3):
        for k in range(spans[h].first, spans[h].last):
            point = points[k]
            # The way winds around the corner of the triangle that is nearest to the straight line.
            corner = NONE
            nearest = math.inf
            for e in range(3 * t, 3 * t + 3):
                v = sides[e].org
                off = point_segment_distance2(vertices[v].x, vertices[v].y, x, y, point.x, point.y)
                if off < nearest:
                    nearest = off
                    corner = v
            cx = vertices[corner].x
            cy = vertices[corner].y
            top = min(level, point.level)
            found = way_level(layers, roots, hints, stack, radii, x, y, point.x, point.y, top, cx, cy, around[corner])
            if found < 0:
                continue
            if count == seen.size:
                seen = longer(seen)
            seen[count].to = k
            seen[count].level = found
            seen[count].length = length_around(x, y, point.x, point.y, cx, cy, around[corner, found])
            seen[count].tight = seen[count].length
            if found < radii.shape[0] - 1:
                seen[count].tight *= tight_share(layers, hints, radii, x, y, point.x, point.y, cx, cy, around[corner])
            count += 1
    return seen, count
