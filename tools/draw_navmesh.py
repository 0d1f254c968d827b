"""Draw docs/images/navmesh.png: a mesh of two furnished rooms with a path. ``python tools/draw_navmesh.py``"""

from __future__ import annotations

from pathlib import Path

import shapely
from PIL import Image
from shapely import affinity

from crowdsim.navmesh.navmesh import NavMesh

FILE = Path(__file__).resolve().parents[1] / "docs" / "images" / "navmesh.png"
RADIUS = 0.25


def box(x: float, y: float, width: float, depth: float, turn: float = 0.0) -> shapely.Polygon:
    """A piece of furniture around (x, y), turned by ``turn`` degrees."""
    shape = shapely.box(x - 0.5 * width, y - 0.5 * depth, x + 0.5 * width, y + 0.5 * depth)
    return affinity.rotate(shape, turn)


def rooms() -> shapely.Polygon:
    """A living room with a table, and two smaller rooms behind doors of 1 m."""
    walls = [
        shapely.box(5.9, 0.0, 6.05, 2.3),
        shapely.box(5.9, 3.3, 6.05, 7.0),
        shapely.box(6.05, 4.4, 7.3, 4.55),
        shapely.box(8.3, 4.4, 10.0, 4.55),
    ]
    seats = [(2.2, 2.15, 15), (3.2, 2.25, 5), (2.4, 4.1, 18), (3.5, 4.2, 0), (1.5, 2.9, 40), (4.4, 3.1, -20)]
    things = [box(x, y, 0.45, 0.45, turn) for x, y, turn in [*seats, (8.6, 5.7, 30)]]
    things += [
        box(2.9, 3.1, 1.8, 1.0, 12),
        box(1.3, 0.42, 2.0, 0.86),
        box(0.45, 6.1, 0.9, 1.8),
        box(2.35, 6.75, 2.1, 0.5),
    ]
    things += [box(9.15, 1.45, 1.7, 1.9), box(9.75, 2.78, 0.5, 0.45), box(6.7, 0.27, 1.35, 0.56)]
    things += [box(7.1, 6.65, 2.15, 0.7), box(9.68, 5.8, 0.65, 1.6)]
    things += [shapely.Point(4.9, 6.3).buffer(0.35, quad_segs=4), shapely.Point(5.2, 0.6).buffer(0.3, quad_segs=4)]
    return shapely.box(0.0, 0.0, 10.0, 7.0).difference(shapely.union_all(walls + things))


def main() -> None:
    mesh = NavMesh(rooms())
    mesh.picture(mesh.find_path((0.6, 1.5), (7.3, 5.6), RADIUS), file=FILE)
    Image.open(FILE).convert("RGB").quantize(256).save(FILE, optimize=True)
    print(f"{FILE}: {FILE.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
