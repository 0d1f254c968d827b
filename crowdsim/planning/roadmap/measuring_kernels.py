"""Measure which behaviors fit at points of the roadmap and along ways between them.

A behavior's number is called its level here: 0 is the narrowest, n - 1 the widest. ``layers`` (m, 5, 2) are the mesh
addresses of `layers_of`, ``radii`` (n, m) the clearances of all behaviors on all layers [m], ``hints`` (m,) triangles
near the last place on each layer, -1 for none.

The ends of a way are p = (px, py) and q = (qx, qy) [m], and c = (cx, cy) is the corner that it goes around [m];
``around`` (n,) is the distance that each behavior keeps from c [m];
``stack`` is scratch of :mod:`crowdsim.navmesh.clearance.sweep_kernels`.
"""

import math

from crowdsim.geometry.elementary_kernels import acos, atan2, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import sweep
from crowdsim.navmesh.mesh.address_kernels import mesh_at

_TIGHT_STEP = 0.06
"""Distance between samples of a way that tell how much of it is tight [m]."""

REACH = 0.5
"""Clearance is measured up to this much beyond the required one [m]; more makes measuring slower."""

SOFT = 0.005
"""Clearance that a way may lack [m]: pulling the path taut bends it away."""


@helper
def room_at(layers, hints, radii, level, x, y):
    """Return the least clearance at (x, y) over all layers beyond what behavior ``level`` needs [m], at most ``REACH``.

    It is negative if the behavior does not fit. ``hints`` (m,) are triangles near (x, y) in each layer, and are set to
    those that contain it, if it is not outside of the mesh.
    """
    least = REACH
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        need = radii[level, k]
        distance, triangle = disc_clearance(m, x, y, need + REACH, hints[k])
        if triangle >= 0:
            hints[k] = triangle
        least = min(least, distance - need)
    return least


@helper
def level_at(layers, hints, radii, x, y):
    """Return the widest behavior that fits at (x, y), -1 if none, and the narrowest one's spare clearance there [m].

    The spare clearance is the least over all layers, at most :data:`REACH`, and negative if the behavior does not fit.
    ``hints`` (m,) are set as by `room_at`.
    """
    n = radii.shape[0]
    level = n - 1
    least = REACH
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        distance, triangle = disc_clearance(m, x, y, radii[n - 1, k] + REACH, hints[k])
        if triangle >= 0:
            hints[k] = triangle
        # Each layer lowers the level to what fits it, too.
        while level >= 0 and distance < radii[level, k]:
            level -= 1
        least = min(least, distance - radii[0, k])
    return level, least


@helper
def length_around(px, py, qx, qy, cx, cy, radius):
    """Return the length of the shortest way from p to q that keeps ``radius`` from c [m].

    If one of the ends is nearer to c than the radius, it is the length of the straight line.
    """
    ax = px - cx
    ay = py - cy
    bx = qx - cx
    by = qy - cy
    straight = hypot(qx - px, qy - py)
    da = hypot(ax, ay)
    db = hypot(bx, by)
    if straight == 0.0 or da <= radius or db <= radius:
        return straight
    # Two tangents and the arc between their contact points: the angle p-c-q less those from each end to its contact.
    angle = abs(atan2(ax * by - ay * bx, ax * bx + ay * by))
    arc = angle - acos(radius / da) - acos(radius / db)
    # The tangent points lie the other way round: the straight line clears the circle.
    if arc <= 0.0:
        return straight
    return math.sqrt(da * da - radius * radius) + math.sqrt(db * db - radius * radius) + radius * arc


@helper
def _is_open(layers, roots, stack, radii, level, px, py, qx, qy):
    """Return True if a disc of behavior ``level`` moves straight from p to q on all layers; False in doubt.

    ``roots`` (m,) are the triangles that contain p in each layer, -1 if it is outside of the mesh.
    """
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        # A sweep can begin only in a free triangle.
        if roots[k] < 0 or m.cover[roots[k]] != 0:
            return False
        free, _ = sweep(m.sides, m.vertices, stack, roots[k], px, py, qx, qy, radii[level, k])
        if not free:
            return False
    return True


@helper
def _pushed_off(x, y, cx, cy, radius):
    """Return (x, y), or the nearest point on the circle of ``radius`` around c if (x, y) is inside it.

    At c itself no point is the nearest: it stays.
    """
    dx = x - cx
    dy = y - cy
    off = hypot(dx, dy)
    if off < radius and off > 0.0:
        return cx + dx * radius / off, cy + dy * radius / off
    return x, y


@helper
def way_level(layers, roots, hints, stack, radii, px, py, qx, qy, top, cx, cy, around):
    """Return the widest behavior, at most ``top``, that fits on the way from p to q; -1 if none.

    The way is the straight line from p to q. Where it passes the corner c at less than ``around[level]`` [m], it goes
    along the circle of that radius around c instead. It may lack :data:`SOFT` of a behavior's clearance. ``roots`` (m,)
    are the triangles that contain p in each layer, as of `_is_open`; ``hints`` are changed.
    """
    length = hypot(qx - px, qy - py)
    for level in range(top, -1, -1):
        # Cheap test first: the disc moves straight.
        if _is_open(layers, roots, stack, radii, level, px, py, qx, qy):
            return level
        # Else look at places along the way, wound around the corner. No obstacle is nearer than the need plus ``room``,
        # so the next place may be ``room`` farther on; it is at least 0.1 m farther on, so that there are few. At q
        # itself ``top`` fits, as the caller knows.
        at = 0.0
        free = True
        while at < length and free:
            k = at / length
            x = px + k * (qx - px)
            y = py + k * (qy - py)
            x, y = _pushed_off(x, y, cx, cy, around[level])
            room = room_at(layers, hints, radii, level, x, y)
            free = room >= -SOFT
            at += max(room, 0.1)
        if free:
            return level
    return -1


@helper
def tight_share(layers, hints, radii, px, py, qx, qy, cx, cy, around):
    """Return the share of the way from p to q, from 0 to 1, that the widest behavior does not fit.

    The way is that of `way_level` for the widest behavior: it goes around c on the circle of radius ``around[n - 1]``.
    The behavior fits at a place if it lacks at most :data:`SOFT` of its clearance there. ``hints`` are changed.
    """
    top = radii.shape[0] - 1
    steps = max(2, math.ceil(hypot(qx - px, qy - py) / _TIGHT_STEP))
    # Sample the middles of equal steps.
    tight = 0
    for i in range(steps):
        k = (i + 0.5) / steps
        x = px + k * (qx - px)
        y = py + k * (qy - py)
        x, y = _pushed_off(x, y, cx, cy, around[top])
        if room_at(layers, hints, radii, top, x, y) < -SOFT:
            tight += 1
    return tight / steps
