"""Slow, obvious twins of the navigation mesh, with whole numbers and shapely."""

import numpy as np
import shapely

from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays


def _integers(*points) -> list[list[int]]:
    """Return the coordinates of points in a unit of which all are whole multiples: exact, and quicker than fractions.

    A float is an integer over a power of two.
    """
    ratios = [[float(v).as_integer_ratio() for v in p] for p in points]
    unit = max(below for pair in ratios for _, below in pair)
    return [[above * (unit // below) for above, below in pair] for pair in ratios]


def orient_sign(a, b, c) -> int:
    """Return the sign of the area of the triangle abc."""
    (ax, ay), (bx, by), (cx, cy) = _integers(a, b, c)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (area > 0) - (area < 0)


def incircle_sign(a, b, c, d) -> int:
    """Return the sign of the in-circle determinant of d for the counter-clockwise triangle abc."""
    *corners, (dx, dy) = _integers(a, b, c, d)
    rows = [(x - dx, y - dy, (x - dx) ** 2 + (y - dy) ** 2) for x, y in corners]
    (ax, ay, al), (bx, by, bl), (cx, cy, cl) = rows
    det = ax * (by * cl - bl * cy) - ay * (bx * cl - bl * cx) + al * (bx * cy - by * cx)
    return (det > 0) - (det < 0)


def free_area(mesh: MeshArrays) -> float:
    """Return the area of the free triangles [m2]."""
    triangles = mesh.frame["triangles"][0]
    corners = mesh.vertices[mesh.sides["org"][: 3 * triangles]]
    corners = np.stack([corners["x"], corners["y"]], axis=1).reshape(-1, 3, 2)
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    return float(area[mesh.cover[:triangles] == 0].sum())


def mesh_faults(mesh: MeshArrays) -> list[str]:
    """Return what is wrong with a mesh: orientation, twins, constraints, winding, vertex links, Delaunay property."""
    faults = []
    vertices, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    point = [(float(vertex["x"]), float(vertex["y"])) for vertex in mesh.vertices[:vertices]]
    org, twin, constraints, winding = (
        mesh.sides[name][: 3 * triangles].tolist() for name in ("org", "twin", "constraints", "winding")
    )
    cover = mesh.cover.tolist()

    def after(h: int) -> int:
        return h - 2 if h % 3 == 2 else h + 1

    def before(h: int) -> int:
        return h + 2 if h % 3 == 0 else h - 1

    vhe = mesh.vertices["vhe"]
    present = [v for v in range(vertices) if vhe[v] >= 0]
    if triangles != 2 * len(present) - 6:
        faults.append(f"{triangles} triangles for {len(present)} vertices")
    spare, removed = int(mesh.frame["spare"][0]), 0
    while spare > 0 and removed <= vertices:
        spare, removed = -1 - int(vhe[spare]), removed + 1
    if spare != 0 or removed != vertices - len(present):
        faults.append("the list of removed vertices is broken")
    for t in range(triangles):
        a, b, c = org[3 * t : 3 * t + 3]
        if orient_sign(point[a], point[b], point[c]) <= 0:
            faults.append(f"triangle {t} is not counter-clockwise")
    for h in range(3 * triangles):
        g = twin[h]
        if g < 0:
            if org[h] >= 4 or org[after(h)] >= 4:
                faults.append(f"half-edge {h} has no twin")
            continue
        if twin[g] != h or org[g] != org[after(h)] or org[h] != org[after(g)]:
            faults.append(f"twins {h} and {g} do not match")
        if constraints[h] != constraints[g] or winding[h] != -winding[g] or abs(winding[h]) > constraints[h]:
            faults.append(f"constraints of {h} and {g} do not match")
        if cover[g // 3] != cover[h // 3] - winding[h]:
            faults.append(f"winding jumps across {h}")
        if h < g and constraints[h] == 0:
            corners = [point[org[k]] for k in (h, after(h), before(h))]
            if incircle_sign(*corners, point[org[before(g)]]) > 0:
                faults.append(f"side {h} is not Delaunay")
    strays = [f"vertex {v} points to a half-edge of another" for v in present if org[vhe[v]] != v]
    return faults + strays


def clearances(area, points) -> np.ndarray:
    """Return distances to the boundary of the free area, 0 outside of it [m]."""
    distances = shapely.distance(shapely.points(points), area.boundary)
    return np.where(shapely.contains_xy(area, points), distances, 0.0)


def reachable_parts(area, radius: float) -> np.ndarray:
    """Return where the center of a disc can be, one polygon per component."""
    return shapely.get_parts(area.buffer(-radius, quad_segs=64))


def part_of(parts, points) -> np.ndarray:
    """Return the index of the part that contains each point, -1 for none."""
    found = np.full(len(points), -1)
    for k, part in enumerate(parts):
        found[shapely.contains_xy(part, points)] = k
    return found


def narrow_places_missed(mesh: MeshArrays, area) -> list[tuple[int, int]]:
    """Return corners and closed edges (half-edges) with a bottleneck between them that no width of the mesh records.

    Every corner is compared with every edge: there is a bottleneck if the disc between the corner and its foot inside
    the edge is free. Only the triangle of the edge itself may record it, as its height.
    """
    triangles, cell = int(mesh.frame["triangles"][0]), float(mesh.frame["cell"][0])
    place = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
    sides = mesh.sides[: 3 * triangles]
    closed = np.flatnonzero((sides["constraints"] != 0) & (np.repeat(mesh.cover[:triangles], 3) == 0))
    after, before = (np.where(closed % 3 == k, closed + s, closed + t) for k, s, t in ((2, -2, 1), (0, 2, -1)))
    start, end = place[sides["org"][closed]], place[sides["org"][after]]
    along = end - start
    length = np.hypot(*along.T)
    missed = []
    for v in np.flatnonzero(mesh.vertices["vref"] > 0):
        part = ((place[v] - start) * along).sum(axis=1) / length**2
        foot = start + part[:, None] * along
        width = np.hypot(*(foot - place[v]).T)
        # If the foot is next to an end of the edge, the distance to that end is the same within the grid's resolution.
        aside = np.minimum(part, 1.0 - part) * length
        inside = (aside > 10.0 * cell) & (aside > 1e-3 * width) & (sides["org"][before] != v)
        middle = 0.5 * (foot + place[v])
        room = clearances(area, middle[inside])
        free = room >= 0.5 * width[inside] - 0.1 * cell
        missed += [(int(v), int(h)) for h in closed[inside][free & (width[inside] > 0.0)]]
    return missed


def random_area(rng: np.random.Generator, kind: str, size: float = 12.0, count: int = 30):
    """Return a square room with obstacles: "boxes" at any angle, "walls" thin and long, "lattice" of touching boxes."""
    obstacles = []
    for _ in range(count):
        x, y = rng.uniform(0.0, size, 2)
        if kind == "boxes":
            box = shapely.box(x, y, x + rng.uniform(0.2, 1.5), y + rng.uniform(0.2, 1.5))
            box = shapely.affinity.rotate(box, rng.uniform(0.0, 180.0))
        elif kind == "walls":
            box = shapely.box(x, y, x + rng.uniform(1.0, 4.0), y + 0.1)
            box = shapely.affinity.rotate(box, rng.choice([0.0, 90.0, rng.uniform(0.0, 180.0)]))
        else:
            x, y = np.floor((x, y))
            box = shapely.box(x, y, x + 0.5 * rng.integers(1, 4), y + 0.5 * rng.integers(1, 4))
        obstacles.append(box)
    return shapely.box(0.0, 0.0, size, size).difference(shapely.union_all(obstacles))


def region_tops(mesh: MeshArrays) -> tuple[np.ndarray, np.ndarray]:
    """Return a label of each free triangle's component, and of its region; -1 if it is not free.

    Two triangles are in one region if no single edge separates them: each edge is removed in turn.
    """
    triangles = int(mesh.frame["triangles"][0])
    free = mesh.cover[:triangles] == 0
    twin, constraints = mesh.sides["twin"].tolist(), mesh.sides["constraints"].tolist()
    open_sides = [h for h in range(3 * triangles) if free[h // 3] and constraints[h] == 0]

    def flood(start: int, closed: set[int], name: int, names: np.ndarray) -> None:
        stack = [start]
        names[start] = name
        while stack:
            t = stack.pop()
            for h in range(3 * t, 3 * t + 3):
                if constraints[h] == 0 and h not in closed and names[twin[h] // 3] != name:
                    names[twin[h] // 3] = name
                    stack.append(twin[h] // 3)

    def floods(closed: set[int]) -> np.ndarray:
        names = np.full(triangles, -1)
        for t in np.flatnonzero(free):
            if names[t] < 0:
                flood(int(t), closed, int(t), names)
        return names

    bridges = set()
    for h in open_sides:
        if h < twin[h]:
            names = np.full(triangles, -1)
            flood(h // 3, {h, twin[h]}, 0, names)
            if names[twin[h] // 3] < 0:
                bridges |= {h, twin[h]}
    return floods(set()), floods(bridges)
