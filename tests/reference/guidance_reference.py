"""Slow and obvious twins of the guidance kernels: shapely's distances, lines in steps of 2 mm, sums over pairs."""

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def widest(areas, radii, places):
    """Return the widest behavior (n,) that fits at places (n, 2), -1 for none; only distances to walls count."""
    points = shapely.points(np.asarray(places, np.float64))
    fits = np.full(len(points), -1)
    for number, row in enumerate(radii):
        clear = np.ones(len(points), bool)
        for area, radius in zip(areas, row, strict=True):
            clear &= shapely.distance(points, area.boundary) >= radius
        fits[clear] = number
    return fits


def line_cost(areas, radii, costs, change, start, end, step=0.002):
    """Return the cost of a straight line, infinite if no behavior fits somewhere on it."""
    length = float(np.hypot(*(end - start)))
    count = max(int(length / step), 1)
    share = (np.arange(count) + 0.5) / count
    labels = widest(areas, radii, start + share[:, None] * (end - start))
    if (labels < 0).any():
        return np.inf
    return float(np.sum(np.asarray(costs)[labels]) * length / count + change * np.sum(labels[1:] != labels[:-1]))


def clearance(areas, starts, ends):
    """Return distances (n,) of straight lines from the walls of all layers [m]."""
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    return np.min([shapely.distance(lines, area.boundary) for area in areas], axis=0)


def density(places, centers, radius=1.0):
    """Return the density of agents (n,) at centers (n, 2), smoothed by Epanechnikov's kernel [1/m2]."""
    out = np.zeros(len(centers))
    for place in places:
        share = 1.0 - np.sum((centers - place) ** 2, axis=1) / radius**2
        out += 2.0 / (np.pi * radius**2) * np.maximum(share, 0.0)
    return out


def shortest_lengths(area, clearance, start, goals):
    """Return path lengths (n,) from goals (n, 2) to start [m], by a visibility graph of the shrunk area's corners."""
    room = area.buffer(-clearance, quad_segs=8).buffer(1e-6)
    shapely.prepare(room)
    corners = shapely.get_coordinates(shapely.simplify(room, 1e-3))
    points = np.concatenate([[start], goals, corners])
    lines = shapely.linestrings(np.stack(np.broadcast_arrays(points[:, None], points[None]), axis=2).reshape(-1, 2, 2))
    sees = shapely.covers(room, lines).reshape(len(points), len(points))
    apart = np.where(sees, np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)), np.inf)
    best = np.full(len(points), np.inf)
    best[0] = 0.0
    done = np.zeros(len(points), bool)
    for _ in range(len(points)):
        at = int(np.argmin(np.where(done, np.inf, best)))
        done[at] = True
        best = np.minimum(best, best[at] + apart[at])
    return best[1 : 1 + len(goals)]


def parts(ground, steps):
    """Return the part of each box (boxes,) of a ground, as connected components of its ways; -1 where nothing fits."""
    boxes = ground.columns * ground.rows
    box, k = np.nonzero(ground.ways[:, None] >> np.arange(8) & 1)
    ahead = box + steps[k, 1] * ground.columns + steps[k, 0]
    linked = coo_array((np.ones(len(box), bool), (box, ahead)), shape=(boxes, boxes))
    _, found = connected_components(linked, directed=False)
    return np.where(ground.widest >= 0, found, -1)


def way_begin(areas, radii, ground, pins, place, touching=0.11, stride=0.1, look=0.6):
    """Return the box at which a way from a place begins: its own, else the nearest one beside it that no wall hides.

    ``pins`` (boxes, 2) are those of the ground; the number of boxes stands for none.
    """
    size = 0.25
    column, row = (int(each) for each in (np.asarray(place) - (ground.left, ground.bottom)) // size)
    if not (0 <= column < ground.columns and 0 <= row < ground.rows):
        return len(pins)
    own = row * ground.columns + column
    if ground.widest[own] >= 0:
        return own
    found = []
    for v in range(max(row - 1, 0), min(row + 2, ground.rows)):
        for u in range(max(column - 1, 0), min(column + 2, ground.columns)):
            box = v * ground.columns + u
            away = pins[box] - place
            apart = float(np.hypot(*away))
            if ground.widest[box] < 0:
                continue
            # The first meters of the line, in the middle of steps: nothing fits so near to a wall.
            length = min(apart, look)
            count = int(np.ceil(length / stride))
            line = place + ((np.arange(count) + 0.5) / count * length)[:, None] * away / apart
            off = np.min([shapely.distance(shapely.points(line), area.boundary) for area in areas], axis=0)
            narrow = widest(areas, radii, line) < 0
            thirds = np.array([-1.0, 0.0, 1.0])[:, None] * away / apart * length / count / 3.0
            pinched = [any(is_pinched(ground.segments, each + third) for third in thirds) for each in line]
            if not (narrow & ((off < touching) | pinched)).any():
                found.append((apart, box))
    return min(found)[1] if found else len(pins)


def is_pinched(segments, place, thickness=0.25):
    """Return True if a wall opposite to the nearest one leaves less than a thickness [m] between them at a place."""
    lines = shapely.linestrings(np.asarray(segments).reshape(-1, 2, 2))
    to_walls = np.diff(
        shapely.get_coordinates(shapely.shortest_line(shapely.Point(*place), lines)).reshape(-1, 2, 2), axis=1
    )
    to_walls = to_walls[:, 0]
    apart = np.hypot(*to_walls.T)
    first = int(np.argmin(apart))
    opposite = to_walls @ to_walls[first] < -0.5 * apart * apart[first]
    return bool((opposite & (apart + apart[first] < thickness)).any())


def course(place, bends, near=0.6, on=1.5, most=8):
    """Return course (2,), distance of its end [m], and direction from there on (2,), of a way over ``bends`` (n, 2)."""
    ways = [np.asarray(bend) for bend in bends][:most]
    if not ways:
        return np.zeros(2), 0.0, np.zeros(2)
    first = next((k for k, bend in enumerate(ways) if np.hypot(*(bend - place)) > near), len(ways) - 1)
    ahead = ways[first] - place
    length = float(np.hypot(*ahead))
    behind = [bend - ways[first] for bend in ways[first + 1 :]]
    far = next((each for each in behind if np.hypot(*each) > on), behind[-1] if behind else np.zeros(2))
    return ahead / length, length, far / max(float(np.hypot(*far)), 1e-300)


def are_apart(segments, path, other):
    """Return True if the first end of a wall (k, 4) is enclosed by two paths (n, 2) from one place and their ends."""
    ring = [*map(tuple, path), *map(tuple, other[::-1])]
    for x, y in segments[:, :2].tolist():
        crossings = 0
        for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
            if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
                crossings += 1
        if crossings % 2:
            return True
    return False
