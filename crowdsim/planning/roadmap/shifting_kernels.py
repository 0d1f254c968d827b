"""Make a path cheaper where only narrow behaviors fit: shift stations along it aside, by dynamic programming.

A taut path has one radius around each corner. But the cheapest path through a gap often leaves the corner straight
outward and then goes around it as wide as the next behavior needs: it refracts where the cost per meter changes
(Snell's law).

``points`` (p, 2) is the polyline [m] and ``sections`` (k, 3) are its rows (behavior, start, end [m]); ``layers``
(m, 5, 2), ``radii`` (n, m) and ``hints`` (m,) are those of :mod:`crowdsim.planning.roadmap.measuring_kernels`;
``costs`` (n,) is the cost per meter of each behavior, the widest one last;
``spread`` is the largest shift [m]; ``stack`` is scratch of :mod:`crowdsim.navmesh.clearance.sweep_kernels`.
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
"""Largest distance between stations [m]."""

BESIDE = 0.6
"""Distance before and behind a narrow section within which stations may shift [m]."""

SHIFTS = 7
"""Places of each station: its own in the middle, and equally many to either side. Odd."""

CHORD = 0.008
"""Spare clearance of shifted stations for the straight pieces between them [m]."""

_SINE = 1e-4
"""Clearance that a place may lack if its station does not shift [m]."""

_SPARE = 0.1
"""Stations shift only at sections longer than the least length by at least this share."""

_REPAIRS = 3
"""Largest number of attempts; after each, stations whose pieces cut a corner are fixed."""

PLACE = np.dtype(
    [(name, np.float64) for name in ("x", "y", "nx", "ny", "at")]
    + [("piece", np.int64), ("near", np.int64), ("label", np.int64), ("shift", np.int64)],
    align=True,
)
"""Station on a path: place (x, y), unit vector (nx, ny) to the left, arc length ``at`` [m].

piece: index of its piece of the polyline. near: 1 if it may shift. label: widest behavior that pays there. shift:
number of the place chosen, SHIFTS // 2 for its own.
"""


@helper
def place_stations(points, sections, costs, least, stations):
    """Place ``stations``, PLACE[count], at equal steps along the polyline; return its length [m].

    ``least`` is the least length of a section [m]. A section can get shorter if it is narrow and longer than ``least``
    by the share :data:`_SPARE`. Stations in such a section, or within :data:`BESIDE` of one next to theirs, may shift;
    the two ends of the path stay. The middle ``least`` meters of the section stay narrow, so a wider behavior does not
    pay there.
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
        # Interpolate on the piece that contains the arc length.
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
        # The station's own section and its two neighbors.
        for j in range(max(k - 1, 0), min(k + 2, last + 1)):
            label = int(sections[j, 0])
            if sections[j, 2] - sections[j, 1] <= (1.0 + _SPARE) * least:
                continue  # it cannot get shorter
            if label < top and sections[j, 1] - BESIDE < at and at < sections[j, 2] + BESIDE:
                station.near = 1
                middle = 0.5 * (sections[j, 1] + sections[j, 2])
                if abs(at - middle) <= 0.5 * least:
                    station.label = label
    # Both ends stay in place, exactly.
    stations[0].x = points[0, 0]
    stations[0].y = points[0, 1]
    stations[0].near = 0
    stations[count - 1].x = points[points.shape[0] - 1, 0]
    stations[count - 1].y = points[points.shape[0] - 1, 1]
    stations[count - 1].near = 0
    for s in range(1, count - 1):
        # The normal of a station is that of the chord between its neighbors.
        dx = stations[s + 1].x - stations[s - 1].x
        dy = stations[s + 1].y - stations[s - 1].y
        d = hypot(dx, dy)
        stations[s].nx = -dy / d if d > 0.0 else 0.0
        stations[s].ny = dx / d if d > 0.0 else 0.0
    return length


@helper
def price_places(layers, hints, radii, costs, stations, spread, prices):
    """Fill ``prices`` (stations, SHIFTS) with the cost per meter at each place.

    It is infinite at a shifted place that fits no behavior; at a station's own place it is then the narrowest
    behavior's. Of a station that stays (``near`` is 0), only its own place is priced; its other prices are left as they
    are, so they have to be infinite. ``hints`` are changed; ``stations`` are records :data:`PLACE`.
    """
    top = costs.size - 1
    for s in range(stations.size):
        station = stations[s]
        # A station that stays has a single place. Its price only weighs the pieces to its neighbors: take the widest
        # behavior's, even in a narrow section that is too short to be shortened.
        if station.near == 0:
            prices[s, SHIFTS // 2] = costs[top]
            continue
        for k in range(SHIFTS):
            shift = spread * (k - SHIFTS // 2) / (SHIFTS // 2)
            x = station.x + shift * station.nx
            y = station.y + shift * station.ny
            # Shifted places need spare clearance; the place on the path may lack a little.
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
            # The widest behavior that fits, but none wider than pays here.
            prices[s, k] = costs[min(level, station.label)] if level >= 0 else math.inf
            # The path passes its own place, however narrow: there is always a choice.
            if level < 0 and k == SHIFTS // 2:
                prices[s, k] = costs[0]


@helper
def choose_shifts(stations, spread, prices, befores):
    """Choose the ``shift`` of each station with the least sum of length times mean price; return True if any shifts.

    stations: PLACE[n] along the path. spread: largest shift to either side [m]. prices: (n, SHIFTS) cost per meter at
    each place of each station, as of :func:`price_places`. befores: scratch, (n, SHIFTS) int64.
    """
    count = stations.size
    totals = np.empty((2, SHIFTS))
    middle = SHIFTS // 2
    for k in range(SHIFTS):
        totals[0, k] = 0.0 if k == middle else math.inf
    now = 0
    # Bellman's recursion: totals[now, k] is the least cost up to station s - 1 if that takes place k; befores[s, k] is
    # the best place of station s - 1.
    for s in range(1, count):
        a = stations[s - 1]
        b = stations[s]
        for k in range(SHIFTS):
            totals[1 - now, k] = math.inf
            # Stations that may not shift keep their own place: both ends, those away from narrow sections that can get
            # shorter, and those whose piece of the path cut a corner before.
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
    # Trace back from the end, which does not shift.
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
    """Write the polyline through the shifted stations to ``line``; return its number of points.

    Between two stations that do not shift it is the path itself. points: (p, 2) the path [m]. spread: as of
    :func:`choose_shifts`. line: (stations + p, 2) at least [m]. owners: as many int64, filled with the station at or
    before each point.
    """
    middle = SHIFTS // 2
    filled = 0
    for s in range(stations.size):
        station = stations[s]
        shift = spread * (station.shift - middle) / middle
        stays = station.shift == middle
        # A station that stays between two that stay adds no point: the path's own vertices suffice.
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
    """Return the path (q, 2) [m] with stations shifted aside by at most ``spread``; no rows if no shift is cheaper.

    No rows either if the path has less than three stations, or if its pieces still cut corners after _REPAIRS attempts.
    section: least length of a section [m]. least: clearance that the legs must keep [m]. hints: changed. Others as of
    `shift_path`.
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
        # Nothing to gain by a shift.
        if not choose_shifts(stations, spread, prices, befores):
            break
        size = through_stations(points, stations, spread, line, owners)
        free = True
        triangle = triangle_near(m, line[0, 0], line[0, 1], np.int64(NONE))
        for i in range(size - 1):
            a = owners[i]
            b = owners[i + 1]
            # The path between two stations that stay is as it was, and clear.
            if stations[a].shift == middle and stations[b].shift == middle:
                triangle = triangle_near(m, line[i + 1, 0], line[i + 1, 1], triangle)
                continue
            # A straight piece that cuts a corner: the stations at its ends stay from now on.
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
