"""A path made cheaper where only narrow behaviors fit: stations along it shift aside, by dynamic programming.

A taut path has one radius around each corner. The cheapest path through a gap often leaves its corner straight outward
and goes on around it as wide as the next behavior asks for: it refracts where the cost of a meter changes.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import sweep
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_near
from crowdsim.navmesh.mesh.mesh_arrays import NONE

STATION = 0.12
"""Meters between stations, at most."""

BESIDE = 0.6
"""Meters before and after a section of a narrow behavior where stations may shift."""

SHIFTS = 7
"""Places of a station: its own in the middle, and as many to both sides."""

CHORD = 0.008
"""Meters of clearance that shifted stations have left, for the straight pieces between them."""

_SINE = 1e-4
"""Meters that a place may lack where its station does not shift."""

_SPARE = 0.1
"""Share of the least length of a section that one is longer by at least where stations may shift."""

_REPAIRS = 3

PLACE = np.dtype(
    [(name, np.float64) for name in ("x", "y", "nx", "ny", "at", "most")]
    + [("piece", np.int64), ("near", np.int64), ("label", np.int64), ("shift", np.int64)],
    align=True,
)
"""A place on a path: where, the direction to its left, and how far along.

piece: of the polyline. near: whether it may shift. label: the widest behavior it is worth having there. shift: the
place that is chosen.
"""


@helper
def place_stations(points, sections, costs, least, stations):
    """Fill ``stations`` along the polyline (n, 2), whose sections (k, 3) are as of `annotate`; its length.

    Those closer than :data:`BESIDE` to a section of a narrow behavior may shift. The ``least`` length in the middle of
    such a section cannot be shortened: no wider behavior is worth having there.
    """
    top = costs.size - 1
    count = stations.size
    last = sections.shape[0] - 1
    length = sections[last, 2]
    piece = np.int64(0)
    before = 0.0
    size = hypot(points[1, 0] - points[0, 0], points[1, 1] - points[0, 1])
    k = 0
    for s in range(count):
        station = stations[s]
        at = length * s / (count - 1)
        while piece < points.shape[0] - 2 and before + size < at:
            before += size
            piece += 1
            size = hypot(points[piece + 1, 0] - points[piece, 0], points[piece + 1, 1] - points[piece, 1])
        share = (at - before) / size if size > 0.0 else 0.0
        station.x = points[piece, 0] + share * (points[piece + 1, 0] - points[piece, 0])
        station.y = points[piece, 1] + share * (points[piece + 1, 1] - points[piece, 1])
        station.at = at
        station.piece = piece
        station.near = 0
        station.label = top
        station.shift = SHIFTS // 2
        station.nx = 0.0
        station.ny = 0.0
        while k < last and sections[k, 2] < at:
            k += 1
        for j in range(max(k - 1, 0), min(k + 2, last + 1)):
            label = int(sections[j, 0])
            if sections[j, 2] - sections[j, 1] <= (1.0 + _SPARE) * least:
                continue  # it cannot get shorter
            if label < top and sections[j, 1] - BESIDE < at and at < sections[j, 2] + BESIDE:
                station.near = 1
                middle = 0.5 * (sections[j, 1] + sections[j, 2])
                if abs(at - middle) <= 0.5 * least:
                    station.label = label
    stations[0].x = points[0, 0]
    stations[0].y = points[0, 1]
    stations[0].near = 0
    stations[count - 1].x = points[points.shape[0] - 1, 0]
    stations[count - 1].y = points[points.shape[0] - 1, 1]
    stations[count - 1].near = 0
    for s in range(1, count - 1):
        dx = stations[s + 1].x - stations[s - 1].x
        dy = stations[s + 1].y - stations[s - 1].y
        d = hypot(dx, dy)
        stations[s].nx = -dy / d if d > 0.0 else 0.0
        stations[s].ny = dx / d if d > 0.0 else 0.0
    return length


@helper
def price_places(layers, hints, radii, costs, stations, spread, prices):
    """Fill ``prices`` (stations, SHIFTS): cost of a meter at each place, infinite where nothing fits."""
    top = costs.size - 1
    for s in range(stations.size):
        station = stations[s]
        if station.near == 0:
            prices[s, SHIFTS // 2] = costs[top]
            continue
        for k in range(SHIFTS):
            shift = spread * (k - SHIFTS // 2) / (SHIFTS // 2)
            x = station.x + shift * station.nx
            y = station.y + shift * station.ny
            more = CHORD if k != SHIFTS // 2 else -_SINE
            level = top
            for i in range(len(layers)):
                m = mesh_at(layers[i])
                distance, triangle = disc_clearance(m, x, y, radii[top, i] + CHORD, hints[i])
                if triangle >= 0:
                    hints[i] = triangle
                while level >= 0 and distance < radii[level, i] + more:
                    level -= 1
                if level < 0:
                    break
            prices[s, k] = costs[min(level, station.label)] if level >= 0 else math.inf
            if level < 0 and k == SHIFTS // 2:
                prices[s, k] = costs[0]


@helper
def choose_shifts(stations, spread, prices, befores):
    """Choose the shift of each station: the least sum of lengths times mean price. befores: scratch, as ``prices``."""
    count = stations.size
    totals = np.empty((2, SHIFTS))
    middle = SHIFTS // 2
    for k in range(SHIFTS):
        totals[0, k] = 0.0 if k == middle else math.inf
    now = 0
    # totals[now, k]: least cost up to station s - 1 where that takes place k (Bellman's recursion).
    for s in range(1, count):
        a = stations[s - 1]
        b = stations[s]
        for k in range(SHIFTS):
            totals[1 - now, k] = math.inf
            if (b.near == 0 and k != middle) or prices[s, k] == math.inf:
                continue
            shift = spread * (k - middle) / middle
            x = b.x + shift * b.nx
            y = b.y + shift * b.ny
            best = math.inf
            for j in range(SHIFTS):
                if totals[now, j] == math.inf:
                    continue
                shift = spread * (j - middle) / middle
                dx = x - a.x - shift * a.nx
                dy = y - a.y - shift * a.ny
                value = totals[now, j] + 0.5 * (prices[s - 1, j] + prices[s, k]) * math.sqrt(dx * dx + dy * dy)
                if value < best:
                    best = value
                    befores[s, k] = j
            totals[1 - now, k] = best
        now = 1 - now
    # Back from the end, which does not shift.
    k = middle
    moved = False
    for s in range(count - 1, 0, -1):
        stations[s].shift = k
        moved = moved or k != middle
        k = befores[s, k]
    stations[0].shift = middle
    return moved


@helper
def through_stations(points, stations, spread, line, owners):
    """Polyline through the stations as they are shifted, in ``line``; how many points it has.

    Where neither of two stations shifts it is the path itself. owners: the station before each point.
    """
    middle = SHIFTS // 2
    filled = 0
    for s in range(stations.size):
        station = stations[s]
        shift = spread * (station.shift - middle) / middle
        stays = station.shift == middle
        corner = s > 0 and s < stations.size - 1 and stays
        if corner and stations[s - 1].shift == middle and stations[s + 1].shift == middle:
            pass
        else:
            line[filled, 0] = station.x + shift * station.nx
            line[filled, 1] = station.y + shift * station.ny
            owners[filled] = s
            filled += 1
        if s + 1 < stations.size and stays and stations[s + 1].shift == middle:
            for i in range(station.piece + 1, stations[s + 1].piece + 1):
                line[filled, 0] = points[i, 0]
                line[filled, 1] = points[i, 1]
                owners[filled] = s
                filled += 1
    return filled


@helper
def shifted_path(layers, hints, radii, costs, points, sections, section, spread, stack, least):
    """The path (n, 2) with stations shifted aside by at most ``spread`` meters, where that is cheaper; else no rows.

    ``section``: least length of a section. ``least``: clearance that the legs must keep.
    """
    length = sections[sections.shape[0] - 1, 2]
    count = math.ceil(length / STATION) + 1
    line = np.empty((count + points.shape[0], 2))
    if count < 3:
        return line[:0]
    stations = np.empty(count, PLACE)
    place_stations(points, sections, costs, section, stations)
    prices = np.full((count, SHIFTS), math.inf)
    befores = np.zeros((count, SHIFTS), np.int64)
    price_places(layers, hints, radii, costs, stations, spread, prices)
    owners = np.empty(count + points.shape[0], np.int64)
    m = mesh_at(layers[0])
    middle = SHIFTS // 2
    for _ in range(_REPAIRS):
        if not choose_shifts(stations, spread, prices, befores):
            break
        size = through_stations(points, stations, spread, line, owners)
        free = True
        triangle = triangle_near(m, line[0, 0], line[0, 1], np.int64(NONE))
        for i in range(size - 1):
            a = owners[i]
            b = owners[i + 1]
            # Between stations that stay, the path is as it was, and clear.
            if stations[a].shift == middle and stations[b].shift == middle and b - a <= 1:
                triangle = triangle_near(m, line[i + 1, 0], line[i + 1, 1], triangle)
                continue
            # A straight piece between stations that cuts a corner: the stations at its ends stay from now on.
            open_, end = sweep(
                m.sides, m.vertices, stack, triangle, line[i, 0], line[i, 1], line[i + 1, 0], line[i + 1, 1], least
            )
            if not open_:
                free = False
                for s in range(a, b + 1):
                    stations[s].near = 0
                end = triangle_near(m, line[i + 1, 0], line[i + 1, 1], triangle)
            triangle = end
        if free:
            return line[:size]
    return line[:0]
