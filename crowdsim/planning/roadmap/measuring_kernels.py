"""What behaviors fit at places of a roadmap and on straight ways between them."""

import math

from crowdsim.geometry.elementary_kernels import acos, atan2, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import sweep
from crowdsim.navmesh.mesh.address_kernels import mesh_at

_TIGHT_STEP = 0.06
"""Meters between places of a way that are looked at to tell how much of it is tight."""

REACH = 0.5
"""Meters beyond what is needed up to which clearance is measured."""

SOFT = 0.005
"""Meters by which a way may be too close: it is bent when a path is made of it."""


@helper
def room_at(layers, hints, radii, level, x, y):
    """Least clearance at (x, y) of all layers beyond what behavior ``level`` needs there, at most ``REACH``.

    ``hints`` (m,) are triangles near the place in each layer, and hold those of the place afterwards.
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
    """The widest behavior that fits at (x, y), -1 for none, and the room that the narrowest has there."""
    n = radii.shape[0]
    level = n - 1
    least = REACH
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        distance, triangle = disc_clearance(m, x, y, radii[n - 1, k] + REACH, hints[k])
        if triangle >= 0:
            hints[k] = triangle
        while level >= 0 and distance < radii[level, k]:
            level -= 1
        least = min(least, distance - radii[0, k])
    return level, least


@helper
def length_around(px, py, qx, qy, cx, cy, radius):
    """Length of the shortest way from p to q that keeps ``radius`` from c, which both do."""
    ax = px - cx
    ay = py - cy
    bx = qx - cx
    by = qy - cy
    straight = hypot(qx - px, qy - py)
    da = hypot(ax, ay)
    db = hypot(bx, by)
    if straight == 0.0 or da <= radius or db <= radius:
        return straight
    angle = abs(atan2(ax * by - ay * bx, ax * bx + ay * by))
    arc = angle - acos(radius / da) - acos(radius / db)
    if arc <= 0.0:
        return straight
    return math.sqrt(da * da - radius * radius) + math.sqrt(db * db - radius * radius) + radius * arc


@helper
def _is_open(layers, roots, stack, radii, level, px, py, qx, qy):
    """Whether a disc of behavior ``level`` moves straight from p, in triangles ``roots`` (m,), to q in all layers."""
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        if roots[k] < 0 or m.cover[roots[k]] != 0:
            return False
        free, _ = sweep(m.sides, m.vertices, stack, roots[k], px, py, qx, qy, radii[level, k])
        if not free:
            return False
    return True


@helper
def _pushed_off(x, y, cx, cy, radius):
    """The place at (x, y), or on the circle of ``radius`` around (cx, cy) if it is inside of that."""
    dx = x - cx
    dy = y - cy
    off = hypot(dx, dy)
    if off < radius and off > 0.0:
        return cx + dx * radius / off, cy + dy * radius / off
    return x, y


@helper
def way_level(layers, roots, hints, stack, radii, px, py, qx, qy, top, cx, cy, around):
    """The widest behavior, at most ``top``, that fits on the way from p to q, -1 for none.

    Where the way is closer to the corner c than ``around`` (n,) of the behavior, it is taken to wind around it.
    roots: (m,) triangles of p in each layer. stack: scratch for `sweep`.
    """
    length = hypot(qx - px, qy - py)
    for level in range(top, -1, -1):
        if _is_open(layers, roots, stack, radii, level, px, py, qx, qy):
            return level
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
    """Share of the way from p to q where the widest behavior does not fit; see `way_level`."""
    top = radii.shape[0] - 1
    steps = max(2, math.ceil(hypot(qx - px, qy - py) / _TIGHT_STEP))
    tight = 0
    for i in range(steps):
        k = (i + 0.5) / steps
        x = px + k * (qx - px)
        y = py + k * (qy - py)
        x, y = _pushed_off(x, y, cx, cy, around[top])
        if room_at(layers, hints, radii, top, x, y) < -SOFT:
            tight += 1
    return tight / steps
