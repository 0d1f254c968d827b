"""Input that broke other triangulators and routers ends in a right mesh or in an error that says what to do."""

import json
import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError, GeometryWarning, PathNotFound
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh.mesh.mesh_arrays import Rings, empty_mesh, trimmed, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation import triangle_builder
from crowdsim.navmesh.triangulation.build_kernels import build
from crowdsim.navmesh.triangulation.builders import BUILDERS, mesh_frame
from tests.reference.navmesh_reference import free_area, mesh_faults

FILES = [
    "Capital A", "Hanging", "HangingIntersection", "OnEdge", "cdt", "crossing-edges", "ditch", "double-hanging",
    "guitar no box", "island", "issue-148-crossing-edges", "issue-42-hole-overlaps-bondary",
    "issue-42-multiple-boundary-overlaps", "kidney", "overlapping constraints2",
    "regression_issue_38_wrong_hull_small", "test_data_small", "triple-hanging",
]  # fmt: skip

POLYGONS = [
    "bowtie", "spike_out", "near_dup", "hole_touch_edge", "hole_crosses_shell", "overlap_holes", "sliver_gap_1mm",
    "collinear_ring", "empty", "inf", "huge_extent", "cm_units", "circle_2000", "disconnected", "goal_on_wall",
]  # fmt: skip


def segments_mesh(points, segments, builder):
    """A mesh of bare points and segments, each segment a ring of two points."""
    points = np.asarray(points, float)
    frame = mesh_frame(points)
    cell = frame["cell"][0]
    loose = snap(np.concatenate([points[np.asarray(segments, np.int64).ravel()], points]), cell)
    rings = Rings(loose, np.arange(2, 2 * len(segments) + 1, 2, dtype=np.int64))
    order, ids = np.arange(len(loose)), np.empty(len(loose), np.int64)
    room = 64 * len(loose) + 1000
    mesh = empty_mesh(room, frame)
    if builder == "triangle":
        found = triangle_builder.triangulation(rings, order, frame)
        triangle_builder.fill(mesh, found)
        rings, ids, order = found.rings, found.ids, order[:0]
    assert build(mesh, rings.points, ids, rings.ends, order, workshop(room)) == 0
    return trimmed(mesh)


def constrained_lines(mesh):
    half_edges = np.flatnonzero(mesh.sides["constraints"] > 0)
    following = np.where(half_edges % 3 == 2, half_edges - 2, half_edges + 1)
    ends = mesh.vertices[mesh.sides["org"][np.stack([half_edges, following], axis=1)]]
    return shapely.union_all(shapely.linestrings(np.stack([ends["x"], ends["y"]], axis=2)))


def check_segments(points, segments, builder):
    """Everything is there and nothing else: the mesh is Delaunay, its constraints are the segments, corners theirs."""
    mesh = segments_mesh(points, segments, builder)
    assert mesh_faults(mesh) == []
    cell = mesh.frame["cell"][0]
    points = np.asarray(points, float)
    ends = points[np.asarray(segments, np.int64)].reshape(-1, 2, 2)
    given = shapely.union_all(shapely.linestrings(ends)) if len(ends) else shapely.GeometryCollection()
    made = constrained_lines(mesh)
    if len(ends):
        # As far as snapped ends and crossings move and bend them.
        assert shapely.hausdorff_distance(made, given, densify=0.02) < 4.0 * cell
    else:
        assert made.is_empty
    # Corners are the points given and the crossings, no more; refinement adds to them.
    corners = shapely.points(
        np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])[4:][mesh.vertices["vref"][4:] > 0]
    )
    nodes = shapely.points(np.concatenate([points, shapely.get_coordinates(given)]))
    assert shapely.distance(corners, shapely.union_all(nodes)).max() < 4.0 * cell
    assert shapely.distance(nodes, shapely.union_all(corners)).max() < 4.0 * cell


def fault_file(shared, name):
    numbers = (shared / "faults" / "cdt" / f"{name}.txt").read_text().split()
    count, edges = int(numbers[0]), int(numbers[1])
    points = np.array(numbers[2 : 2 + 2 * count], float).reshape(-1, 2)
    return points, np.array(numbers[2 + 2 * count : 2 + 2 * count + 2 * edges], np.int64).reshape(-1, 2)


def test_no_file_is_left_out(shared):
    assert sorted(path.stem for path in (shared / "faults" / "cdt").glob("*.txt") if "LICENSE" not in path.name) == (
        sorted(FILES)
    )
    assert [fault["id"] for fault in json.loads((shared / "faults" / "polygons.json").read_text())] == POLYGONS


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("name", FILES)
def test_points_and_segments(shared, name, builder):
    points, segments = fault_file(shared, name)
    check_segments(points, segments, builder)


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("seed", range(8))
def test_crossing_and_collinear_segments(seed, builder):
    rng = np.random.default_rng(seed)
    check_segments(rng.uniform(0, 8, (10, 2)), np.arange(10).reshape(-1, 2), builder)
    line = np.repeat(rng.integers(0, 9, (8, 1)), 2, axis=1).astype(float)  # overlaps on one line
    check_segments(line, np.arange(8).reshape(-1, 2), builder)


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("name", POLYGONS)
def test_polygons(shared, name, builder):
    fault = next(f for f in json.loads((shared / "faults" / "polygons.json").read_text()) if f["id"] == name)
    wkt, expected = fault["wkt"], fault["expect"]
    area = shapely.Polygon([(0, 0), (math.inf, 0), (1, 1)]) if wkt == "INF" else shapely.from_wkt(wkt)
    if expected == "reject":
        with pytest.raises(GeometryError, match=r"area|polygon"):
            NavMesh(area, builder=builder)
        return
    if expected in ("accept_or_warn", "warn_units"):
        with pytest.warns(GeometryWarning, match="meters"):
            mesh = NavMesh(area, builder=builder)
    else:
        mesh = NavMesh(area, builder=builder)
    assert mesh_faults(mesh.arrays) == []
    expected_area = {"bowtie": 8.0, "spike_out": 100.0, "hole_touch_edge": 96.0, "hole_crosses_shell": 96.0}
    expected_area |= {"overlap_holes": 100.0 - 46.0, "near_dup": 100.0}
    assert free_area(mesh.arrays) == pytest.approx(expected_area.get(name, area.area), rel=1e-6)


@pytest.mark.parametrize("builder", BUILDERS)
def test_who_is_let_through(builder):
    """Of the polygons above, those about passages."""
    gap = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(1.001, 0, 2, 1)])
    with pytest.raises(PathNotFound, match="no passage"):
        NavMesh(gap, builder=builder).find_path((0.5, 0.5), (1.5, 0.5), 0.001)
    rooms = NavMesh(shapely.MultiPolygon([shapely.box(0, 0, 5, 5), shapely.box(10, 0, 15, 5)]), builder=builder)
    with pytest.raises(PathNotFound, match="no passage"):
        rooms.find_path((2, 2), (12, 2), 0.3)
    room = NavMesh(shapely.box(0, 0, 10, 10), builder=builder)
    with pytest.raises(PathNotFound, match="goal blocked"):
        room.find_path((2, 2), (10, 5), 0.3)
    half = NavMesh(shapely.Polygon([(0, 0), (4, 4), (4, 0), (0, 4)]), builder=builder)  # the bowtie
    with pytest.raises(PathNotFound, match="no passage"):
        half.find_path((0.5, 2), (3.5, 2), 0.001)


NANO = 1e-9
ROOM = [(0, 0), (10, 0), (10, 10), (0, 10)]
CLOSED = {
    "wall as thin as a nanometer": ([[(5, 0), (5 + NANO, 0), (5 + NANO, 10), (5, 10)]], math.inf),
    "wall from below": ([[(5, 0), (5 + NANO, 0), (5, 9)]], 10.127),
    "slanted needle": ([[(2, 0), (8, 9.3), (8, 9.3 + NANO)]], 11.687),
    "corner on corner": ([[(4, 0), (6, 0), (5, 5)], [(5, 5), (6, 10), (4, 10)]], math.inf),
    "corner a nanometer off a corner": ([[(4, 0), (6, 0), (5, 5)], [(5, 5 + NANO), (6, 10), (4, 10)]], math.inf),
    "corner a nanometer into a corner": ([[(4, 0), (6, 0), (5, 5 + NANO)], [(5, 5), (6, 10), (4, 10)]], math.inf),
    "corner on a side": ([[(4, 0), (6, 0), (5, 5)], [(4, 5), (6, 5), (6, 10), (4, 10)]], math.inf),
    "corner a nanometer off a side": ([[(4, 0), (6, 0), (5, 5 - NANO)], [(4, 5), (6, 5), (6, 10), (4, 10)]], math.inf),
    "side a nanometer off a side": ([[(4, 0), (5, 0), (5, 6), (4, 6)],
        [(5 + NANO, 4), (6, 4), (6, 10), (5 + NANO, 10)]], math.inf),
    "twice the same": ([[(4, 0), (6, 0), (6, 9), (4, 9)]] * 2, 11.037),
    "nearly the same": ([[(4, 0), (6, 0), (6, 9), (4, 9)],
        [(4 + NANO, 0), (6, 0), (6 + NANO, 9 - NANO), (4, 9)]], 11.037),
}  # fmt: skip


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("name", CLOSED)
def test_nothing_leaks_through_what_snapping_moves(name, builder):
    """Obstacles thinner than the grid and contacts within it hold; the way around one has about the length given."""
    holes, length = CLOSED[name]
    mesh = NavMesh(shapely.Polygon(ROOM, holes), builder=builder)
    assert mesh_faults(mesh.arrays) == []
    if length == math.inf:
        with pytest.raises(PathNotFound, match="no passage"):
            mesh.find_path((2, 5), (8.2, 5), 0.001)
    else:
        assert mesh.find_path((2, 5), (8.2, 5), 0.001).length == pytest.approx(length, abs=0.01)


@pytest.mark.parametrize("builder", BUILDERS)
def test_nearly_duplicate_corners_become_one(builder):
    hole = [(3, 3), (3 + NANO, 3), (5, 3), (5, 5), (5, 5 - NANO), (3, 5)]
    mesh = NavMesh(shapely.Polygon(ROOM, [hole]), builder=builder).arrays
    assert mesh_faults(mesh) == []
    assert (mesh.vertices["vref"][4:] > 0).sum() == 8
    speck = NavMesh(shapely.Polygon(ROOM, [[(5, 5), (5 + NANO, 5), (5, 5 + NANO)]]), builder=builder)
    assert speck.clearance((5, 7)) == pytest.approx(2.0, abs=1e-6), "less than a cell is a point obstacle"
