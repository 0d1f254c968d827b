"""Paths found with a guide are those of a search without, whatever is in the way by then."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import PathNotFound
from crowdsim.jit import kernel
from crowdsim.navmesh.detours import Detours
from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.detour_kernels import DONE, LOST, NO_ROOM, NOT_TRACED, find_detour
from crowdsim.navmesh.editing.point_kernels import INSERT, edit_point
from crowdsim.navmesh.editing.undo_kernels import copy_back
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays, trimmed
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.component_kernels import label_sides
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from tests.reference.navmesh_reference import random_area
from tests.reference.way_reference import side_distances


@kernel
def _mesh_at(places):
    return mesh_at(places)


@kernel
def _find_detour(search, x, y):
    return find_detour(search, x, y)


def _around(detours, place):
    """Points (k, 2) of the detour around ``place``, none if there is no way."""
    with detours.lent() as search:
        status, points = _find_detour(search, *map(float, place))
    assert status in (DONE, NOT_TRACED)
    return points


def _length(points):
    return np.hypot(*np.diff(points, axis=0).T).sum()


def _begin_at(detours, ends, radius):
    """The path between ``ends``, around which detours are looked for from now on."""
    detours.aim(*ends, radius)
    return detours.mesh.find_path(*ends, radius)


def _ends(rng, mesh, radius):
    while True:
        ends = rng.uniform(0.0, 9.0, (2, 2))
        if mesh.clearances(ends, 2.0 * radius).min() > radius and mesh.reachable(*ends, radius):
            return ends


def _along(rng, points):
    """A place on a polyline, off its ends."""
    arc = rng.uniform(0.2, 0.8) * (len(points) - 1)
    k = int(arc)
    return points[k] + (arc - k) * (points[k + 1] - points[k])


def _detours(kind, seed=5):
    rng = np.random.default_rng(seed)
    if kind == "comb":
        teeth = [shapely.box(0.2 * k, 1 + k % 2, 0.2 * k + 0.05, 7 + k % 2) for k in range(1, 45)]
        mesh = NavMesh(shapely.box(0, 0, 9, 9).difference(shapely.union_all(teeth)))
    else:
        mesh = NavMesh(random_area(rng, "boxes" if kind == "spares" else kind, size=9.0, count=25))
    if kind == "spares":
        # What is removed again leaves spare vertices, which the next edits take.
        shapes = [shapely.box(x, y, x + 0.3, y + 0.2) for x, y in rng.uniform(0.0, 8.5, (40, 2))]
        for handle in [mesh.insert_obstacle(shape) for shape in shapes]:
            mesh.remove(handle)
    return rng, mesh, Detours(mesh)


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_detours_are_as_short_as_paths_without_a_guide(kind):
    rng, mesh, detours = _detours(kind)
    ratios = []
    for radius in (0.05, 0.15, 0.25):
        for _ in range(12):
            plain = mesh.with_points(np.empty((0, 2)))
            ends = _ends(rng, mesh, radius)
            points = _begin_at(detours, ends, radius).points
            for _ in range(3):
                places = [_along(rng, points) for _ in range(3)]
                for place in places:
                    way = _around(detours, place)
                    handle = plain.insert_obstacle(place)
                    try:
                        expected = plain.find_path(*ends, radius)
                    except PathNotFound:
                        assert len(way) == 0
                    else:
                        assert len(plain.violations(way, radius)) == 0
                        ratios.append(_length(way) / expected.length)
                    plain.remove(handle)
                if len(way) == 0:
                    break
                points = way
    assert len(ratios) > 60
    assert np.mean(ratios) < 1.003
    # Beyond its limit the guide knows nothing, and searches are as greedy as without one.
    assert np.mean(np.array(ratios) > 1.03) < 0.03


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice", "comb", "spares"])
def test_what_was_put_in_is_taken_back_to_the_last_bit(kind):
    rng, mesh, detours = _detours(kind)
    detours.aim(*_ends(rng, mesh, 0.15), 0.15)
    corners = mesh.arrays.vertices[4:]
    corners = corners[corners["vref"] > 0]
    freed = changed = 0

    def seen(places):
        return [array.tobytes() for array in trimmed(MeshArrays(*_mesh_at(places)))]

    for round_ in range(120):
        with detours.lent() as (places, before, *_):
            now = seen(places)
            assert seen(before) == now
            place = rng.uniform(0.0, 9.0, 2)
            if round_ % 4 == 1:  # in a narrow place, whose feet are needed no longer
                a, b = corners[rng.integers(0, len(corners), 2)]
                place = np.array([a["x"] + b["x"], a["y"] + b["y"]]) / 2
            elif round_ % 4 == 2:  # on a corner
                place = corners[rng.integers(0, len(corners))][["x", "y"]].item()
            spare = _mesh_at(places).frame["spare"][0]
            assert edit_point(places, INSERT, *map(float, place), -1) >= 0
            freed += _mesh_at(places).frame["spare"][0] != spare
            changed += seen(places) != now
            assert copy_back(places, before)
            assert seen(places) == now
    assert changed > 80
    assert freed > 2 or kind == "lattice"  # whose feet corners need as well
    with detours.mesh.edited() as obstacles, detours.lent() as (places, before, *_):
        obstacles._work.progress["changed"] = len(obstacles._work.to_do) + 1  # more than were noted
        assert not copy_back(places, before)


def test_a_place_outside_of_the_mesh_is_in_nobodys_way():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = _begin_at(detours, ends, 0.15)
    for place in ((np.inf, np.inf), (100.0, 0.0)):
        assert _length(_around(detours, place)) == pytest.approx(path.length, rel=0.01)


def test_no_detour_is_looked_for_where_there_is_no_room():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = _begin_at(detours, ends, 0.15)
    with detours.mesh.edited() as obstacles:
        uses = int(obstacles._work.progress["uses"][0])
        obstacles._work.progress["uses"] = len(obstacles._work.uses)  # of which none is in use
        with detours.lent() as search:
            status, points = _find_detour(search, *path.points[1])
        assert (status, len(points)) == (NO_ROOM, 0)
        obstacles._work.progress["uses"] = uses
    with detours.lent() as search:
        assert _find_detour(search, *path.points[1])[0] not in (NO_ROOM, LOST)


def test_the_mesh_asked_about_stays_as_it_is():
    rng, mesh, detours = _detours("boxes", seed=6)
    revision = detours.mesh.revision
    detours.mesh.insert_obstacle(_ends(rng, mesh, 0.2)[0])
    assert detours.mesh.revision == revision + 1
    assert mesh.revision == 0


@pytest.mark.parametrize("radius", [0.2, 0.5])
def test_a_guide_knows_nothing_where_the_goal_is_out_of_reach(radius):
    """Through a gap of 0.8 m, wide enough for the one disc and not for the other."""
    wall = shapely.union_all([shapely.box(4.0, 0.0, 5.0, 4.0), shapely.box(4.0, 4.8, 5.0, 9.0)])
    detours = Detours(NavMesh(shapely.box(0.0, 0.0, 9.0, 9.0).difference(wall)))
    for start, goal in (((1.0, 1.0), (8.0, 8.0)), ((1.0, 1.0), (1.5, 8.0)), ((8.0, 1.0), (1.0, 4.0))):
        detours.aim(start, goal, radius)
        with detours.lent() as (*_, guide):
            limit = guide[-1]["left"]
            known = np.isfinite(guide["left"][:-1]) & (guide["side"][:-1] != 0)
        reachable = detours.mesh.reachable(start, goal, radius)
        assert reachable == (radius == 0.2 or goal == (1.5, 8.0))
        assert (limit > 0.0) == known.any() == reachable


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_a_guide_knows_how_far_sides_are_from_the_goal(kind):
    rng = np.random.default_rng(7)
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=15))
    radius = 0.2
    start, goal = _ends(rng, mesh, radius)
    m = mesh.arrays
    guide = np.zeros((1 << (6 * len(m.cover)).bit_length()) + 1, GUIDE)
    detour_kernels.begin_guide(m, guide)
    labels = np.empty(len(m.sides), np.int32)
    label_sides(m, 2.0 * radius, labels)
    with mesh.workspaces.lent(len(m.cover)) as work:
        detour_kernels.aim_guide(m, labels, work, *start, *goal, radius, radius, (0.0, 1e3), guide)
    rows = {int(row["side"]): (row["left"], row["right"]) for row in guide[:-1] if row["side"] != 0}
    expected = side_distances(m, goal, mesh.locate(goal), radius, 2.0 * radius)
    compared = about = 0
    for h in np.flatnonzero((m.sides["constraints"] == 0) & np.repeat(m.cover == 0, 3)).tolist():
        # Ways from the goal over h come back over its other half, whose right end is the left one of h.
        twin = int(m.sides["twin"][h])
        origin, end = m.sides["org"][twin], m.sides["org"][h]
        left, right = rows[(int(origin) + 1 << 32) + int(end)]
        if math.isinf(left):
            continue
        at_right, at_left = expected[h]
        compared += 1
        about += left <= at_right + 1e-9 and right <= at_left + 1e-9
        assert left >= 0.9 * at_right - 0.05
        assert right >= 0.9 * at_left - 0.05
    assert compared > 30
    assert about > 0.9 * compared  # some ways are led on only where they cannot be the shortest to a goal beyond


def test_a_polyline_keeps_off_a_place():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert detour_kernels.keeps_off(points, 0.5, 0.5, 0.5)
    assert not detour_kernels.keeps_off(points, 0.5, 0.4, 0.5)
    assert detour_kernels.keeps_off(points[:0], 0.5, 0.4, 0.5)
