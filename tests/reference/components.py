"""Slow, obvious twin of the components: a flood from edge to edge, one turn around a corner at a time."""

import math

from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays


def side_components(mesh: MeshArrays, width: float) -> list[frozenset[tuple[int, int]]]:
    """Return sets of edges, as pairs of vertices, between which a disc of diameter ``width`` can move."""
    triangles = int(mesh.frame["triangles"][0])
    org, constraints = mesh.sides["org"].tolist(), mesh.sides["constraints"].tolist()
    place = [(float(vertex["x"]), float(vertex["y"])) for vertex in mesh.vertices]
    turns: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for t in range(triangles):
        if mesh.cover[t] != 0:
            continue
        corners = org[3 * t : 3 * t + 3]
        pairs = [(min(a, b), max(a, b)) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        opened = [not c for c in constraints[3 * t : 3 * t + 3]]
        for side, is_open in zip(pairs, opened, strict=True):
            if is_open:
                turns.setdefault(side, [])
        for i in range(3):
            last, base = (i + 2) % 3, (i + 1) % 3
            if not (opened[i] and opened[last]):
                continue
            # Room at corner v between its two open edges: their lengths, and the distance to the third edge if closed.
            v, a, b = (place[corners[k]] for k in (i, base, last))
            room = min(math.dist(v, a), math.dist(v, b))
            if not opened[base]:
                part = ((v[0] - a[0]) * (b[0] - a[0]) + (v[1] - a[1]) * (b[1] - a[1])) / math.dist(a, b) ** 2
                part = min(max(part, 0.0), 1.0)
                room = min(room, math.dist(v, (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]))))
            if room >= width:
                turns[pairs[i]].append(pairs[last])
                turns[pairs[last]].append(pairs[i])
    found, seen = [], set()
    for side in turns:
        if side in seen:
            continue
        part, waiting = {side}, [side]
        while waiting:
            fresh = [other for other in turns[waiting.pop()] if other not in part]
            part.update(fresh)
            waiting.extend(fresh)
        seen |= part
        found.append(frozenset(part))
    return found
