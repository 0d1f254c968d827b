"""Arcs and tangents are exactly those that sampling and brute force find; the heap of the searches is one."""

import heapq
import math

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.batch import Batch
from crowdsim.navmesh.shortest.arc_kernels import find_arcs
from crowdsim.navmesh.shortest.shortest_kernels import shortest_paths
from crowdsim.navmesh.shortest.tangent_graph import RadiusGraph
from crowdsim.navmesh.shortest.tangent_graph_kernels import find_tangents, link_arcs
from crowdsim.navmesh.shortest.view_arrays import empty_view
from crowdsim.navmesh.shortest.visibility_kernels import TOLERANCE
from tests.reference.navmesh_reference import random_area

NEAR = 1e-4
"""Meters and radians around the borders of free places where sampling does not tell."""


def arcs_of(mesh, radius):
    """(arcs, arc_begin, least) of a mesh."""
    least = radius - mesh.tolerance(radius)
    return *find_arcs(mesh.arrays, radius, least), least


def offset_on(arc, nx, ny):
    """Radians from the begin of the arc to its direction n, from 0 to a full turn."""
    return math.atan2(arc["nx"] * ny - arc["ny"] * nx, arc["nx"] * nx + arc["ny"] * ny) % (2.0 * math.pi)


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_arcs_hold_exactly_the_places_that_are_free(kind):
    rng = np.random.default_rng(3)
    area = random_area(rng, kind, size=8.0, count=25)
    posts = np.round(64.0 * rng.uniform(0.0, 8.0, (6, 2))) / 64.0
    mesh = NavMesh(area).with_points(posts)
    obstacles = shapely.union_all([area.boundary, shapely.MultiPoint(posts)])
    shapely.prepare(obstacles)
    radius = 0.37
    arcs, begin, _ = arcs_of(mesh, radius)
    free = taken = 0
    bearings = rng.uniform(0.0, 2.0 * math.pi, 48)
    for v in range(4, len(begin) - 1):
        x, y = (float(mesh.arrays.vertices[name][v]) for name in ("x", "y"))
        places = np.column_stack([x + radius * np.cos(bearings), y + radius * np.sin(bearings)])
        distances = shapely.distance(shapely.points(places), obstacles)
        inside = shapely.contains_xy(area, places)
        for bearing, place, distance, within in zip(bearings, places, distances, inside, strict=True):
            normal = math.cos(bearing), math.sin(bearing)
            offsets = [(offset_on(arc, *normal), arc["extent"]) for arc in arcs[begin[v] : begin[v + 1]]]
            if any(NEAR < offset < extent - NEAR for offset, extent in offsets):
                assert within, (v, place)
                assert distance >= radius - 1e-5, (v, place)
                free += 1
            elif within and distance > radius - 1e-7:
                assert any(offset < extent + NEAR or offset > 2.0 * math.pi - NEAR for offset, extent in offsets), v
            else:
                taken += 1
    assert free > 100
    assert taken > 100


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.4])
def test_tangents_are_those_of_brute_force(radius):
    area = random_area(np.random.default_rng(8), "boxes", size=8.0, count=12)
    mesh = NavMesh(area)
    graph = RadiusGraph(mesh.arrays, radius, radius - mesh.tolerance(radius), 1)
    arcs, _, nodes, links = graph.arrays
    ways = set()
    for n in range(len(nodes) - 1):
        ways |= {(n, to) for to in links["to"][nodes["begin"][n] : nodes["begin"][n + 1]].tolist()}
    assert {(j ^ 1, i ^ 1) for i, j in ways} == ways
    room = area.buffer(1e-6)
    shapely.prepare(room)

    def is_clear(ends, tolerance):
        line = shapely.LineString(ends)
        return room.covers(line) and area.boundary.distance(line) >= radius - tolerance

    wanted = 0
    for i in range(0, 2 * len(arcs), 3):
        for j in range(2 * len(arcs)):
            one, other = arcs[i >> 1], arcs[j >> 1]
            if one["vertex"] == other["vertex"]:
                continue
            q, p = 1 - 2 * (i & 1), 1 - 2 * (j & 1)
            dx, dy = other["x"] - one["x"], other["y"] - one["y"]
            distance = math.hypot(dx, dy)
            sine = (p - q) * radius / distance
            if abs(sine) > 1.0:
                continue
            cosine = math.sqrt(1.0 - sine * sine)
            tx, ty = (dx * cosine + dy * sine) / distance, (dy * cosine - dx * sine) / distance
            ends = [
                (arc["x"] + side * radius * ty, arc["y"] - side * radius * tx) for arc, side in ((one, q), (other, p))
            ]
            offsets = [(offset_on(arc, side * ty, -side * tx), arc["extent"]) for arc, side in ((one, q), (other, p))]
            on_both = all(NEAR < offset < extent - NEAR for offset, extent in offsets)
            if on_both and is_clear(ends, 2e-7):
                assert (i, j) in ways
                wanted += 1
            if (i, j) in ways:
                assert is_clear(ends, 1e-5)
                # Taut: the angles turned on leaving and arriving are on the arcs.
                assert all(offset < extent + NEAR or offset > 2.0 * math.pi - NEAR for offset, extent in offsets)
    assert wanted > 8


def test_a_box_has_four_arcs_and_eight_links():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6)))
    arcs, begin, least = arcs_of(mesh, 0.5)
    np.testing.assert_allclose(arcs["extent"], 0.5 * math.pi, atol=TOLERANCE)
    view = empty_view(len(mesh.arrays.vertices), int(mesh.arrays.frame["triangles"][0]))
    tangents = find_tangents(mesh.arrays, arcs, begin, 0.5, least, 0.0, view, 0, 8)
    np.testing.assert_allclose(tangents["length"], 2.0)
    nodes, links = link_arcs(arcs, tangents, 0.5)
    assert np.diff(nodes["begin"]).tolist() == [1] * 8
    # Around the box once: four sides and a full turn.
    place, cost = 0, 0.0
    for _ in range(4):
        link = links[nodes["begin"][place]]
        place, cost = int(link["to"]), cost + float(link["cost"])
    assert place == 0
    assert cost == pytest.approx(8.0 + math.pi)


def test_searches_fill_what_they_are_given():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6)))
    graph = RadiusGraph(mesh.arrays, 0.5, 0.5 - 1e-7, 1)
    starts, goals = np.array([(1.0, 5.0), (5.0, 5.0)]), np.array([(9.0, 5.0), (1.0, 1.0)])
    status, lengths, counts = np.empty(2, np.int8), np.empty(2), np.empty(2, np.int64)
    with graph.scratch() as scratch:
        radii = np.full(2, 0.5)
        batch = Batch(starts, goals, radii, radii, status, lengths, counts)
        points = shortest_paths(mesh.arrays, graph.arrays, scratch, batch, graph.asked, graph.disc)
    assert status.tolist() == [0, 1]
    assert counts.tolist() == [len(points), 0]
    turn = math.atan2(1.0, 3.0) + math.asin(0.5 / math.sqrt(10.0))
    assert lengths[0] == pytest.approx(2.0 + 2.0 * math.sqrt(9.75) + turn)
    assert math.isnan(lengths[1])


@kernel
def _push(heap, count, key, item):
    return push(heap, count, key, item)


@kernel
def _pop(heap, count):
    pop(heap, count)


def test_the_heap_gives_rows_in_order():
    rng = np.random.default_rng(0)
    heap, count, twin = np.empty(2, HEAP_ROW), 0, []
    for step in range(400):
        if step % 3 or not twin:
            row = float(rng.integers(0, 9)), int(rng.integers(0, 9))
            heap, count = _push(heap, count, *row)
            heapq.heappush(twin, row)
        else:
            _pop(heap, count)
            count -= 1
            assert tuple(heap[count].item()) == heapq.heappop(twin)
    assert count == len(twin) > 50
