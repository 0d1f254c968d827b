"""Paths found with a guide are those of a search without, whatever is in the way by then."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import PathNotFound
from crowdsim.jit import kernel
from crowdsim.navmesh.detours import Detours
from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.editing.detour_kernels import DONE, LOST, NO_ROOM, NOT_TRACED, find_detour
from crowdsim.navmesh.editing.point_kernels import INSERT, edit_point
from crowdsim.navmesh.editing.undo_kernels import copy_edited
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays, trimmed
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.checked_kernels import add_dot
from crowdsim.navmesh.paths.component_kernels import label_sides
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from tests.reference.navmesh_reference import random_area
from tests.reference.way_reference import side_distances


@kernel
def _add_dot(checked, x, y):
    return add_dot(checked, x, y)


@kernel
def _mesh_at(places):
    return mesh_at(places)


@kernel
def _find_detour(places, before, work, checked, ends, guide, x, y):
    sx, sy, gx, gy, radius, least = ends
    points = np.empty((1, 2))
    status, points, filled, length = find_detour(
        places, before, mesh_at(places), workshop_at(places), work, checked, sx, sy, gx, gy, radius, least, guide,
        x, y, points, np.int64(0),
    )  # fmt: skip
    return status, points[:filled], length


def _around(detours, place):
    """Points (k, 2) and length of the detour around ``place``; no points and infinite for none."""
    with detours.lent() as search:
        status, points, length = _find_detour(*search, *map(float, place))
    assert status in (DONE, NOT_TRACED)
    return points, length


def _begin_at(detours, ends, radius):
    """The path between ``ends``, around which detours are looked for from now on."""
    detours.aim(*ends, radius)
    return detours.mesh.find_path(*ends, radius)


def _block(detours, place):
    """Put an obstacle in that stays."""
    with detours.lent() as (places, before, _, checked, *_):
        assert _add_dot(checked, *map(float, place))
        assert edit_point(places, INSERT, *map(float, place), -1) >= 0
        copy_edited(places, places, before)


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
        mesh = NavMesh(random_area(rng, kind, size=9.0, count=25))
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
                    way, length = _around(detours, place)
                    handle = plain.insert_obstacle(place)
                    try:
                        expected = plain.find_path(*ends, radius)
                    except PathNotFound:
                        assert (len(way), length) == (0, math.inf)
                    else:
                        assert len(plain.violations(way, radius)) == 0
                        assert length == pytest.approx(np.hypot(*np.diff(way, axis=0).T).sum())
                        ratios.append(length / expected.length)
                    plain.remove(handle)
                way, length = _around(detours, places[0])
                if not np.isfinite(length):
                    break
                _block(detours, places[0])
                plain.insert_obstacle(places[0])
                points = way
            assert detours.reset()
    assert len(ratios) > 60
    assert np.mean(ratios) < 1.003
    # Beyond its limit the guide knows nothing, and searches are as greedy as without one.
    assert np.mean(np.array(ratios) > 1.03) < 0.03


@pytest.mark.parametrize("kind", ["boxes", "walls"])
def test_what_is_remembered_of_checks_changes_no_path(kind):
    rng, mesh, detours = _detours(kind, seed=8)
    compared = 0
    for radius in (0.1, 0.2):
        for _ in range(8):
            ends = _ends(rng, mesh, radius)
            path = mesh.find_path(*ends, radius)
            blocker, *places = [_along(rng, path.points) for _ in range(6)]
            found = []
            for forgets in (False, True):
                _begin_at(detours, ends, radius)
                ways = []
                for place in (*places, blocker, *places):
                    detours._checked.numbers[0] += forgets  # what has another stamp
                    ways.append(_around(detours, place)[0])
                    if place is blocker:
                        _block(detours, place)
                found.append(ways)
                assert detours.reset()
            for way, other in zip(*found, strict=True):
                np.testing.assert_array_equal(way, other)
                compared += len(way) > 2
    assert compared > 50


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice", "comb"])
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
            if round_ % 10 == 9:  # this one stays
                assert copy_edited(places, places, before)
            else:
                assert copy_edited(places, before, places)
                assert seen(places) == now
    assert changed > 80
    assert freed > 5 or kind == "lattice"  # whose feet corners need as well
    assert detours.reset()
    with detours.mesh.edited() as obstacles, detours.lent() as (places, before, *_):
        obstacles._work.progress["changed"] = len(obstacles._work.to_do) + 1  # more than were noted
        assert not copy_edited(places, before, places)


def test_after_a_reset_all_is_as_it_was_to_the_last_bit():
    rng, mesh, detours = _detours("lattice")
    ends = _ends(rng, mesh, 0.15)
    path = mesh.find_path(*ends, 0.15)
    places = np.array([_along(rng, path.points) for _ in range(8)])
    before = [array.tobytes() for array in trimmed(detours.mesh.arrays)]
    found = []
    for _ in range(2):
        _begin_at(detours, ends, 0.15)
        ways = [_around(detours, place)[0].tobytes() for place in places]
        _block(detours, places[0])
        ways += [_around(detours, place)[0].tobytes() for place in places[1:]]
        found.append(ways)
        assert detours.reset()
        assert [array.tobytes() for array in trimmed(detours.mesh.arrays)] == before
    assert found[0] == found[1]


def test_a_place_outside_of_the_mesh_is_in_nobodys_way():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = _begin_at(detours, ends, 0.15)
    for place in ((np.inf, np.inf), (100.0, 0.0)):
        assert _around(detours, place)[1] == pytest.approx(path.length, rel=0.01)


def test_no_detour_is_looked_for_where_there_is_no_room():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = _begin_at(detours, ends, 0.15)
    with detours.mesh.edited() as obstacles:
        uses = int(obstacles._work.progress["uses"][0])
        obstacles._work.progress["uses"] = len(obstacles._work.uses)  # of which none is in use
        with detours.lent() as search:
            status, points, length = _find_detour(*search, *path.points[1])
        assert (status, len(points), length) == (NO_ROOM, 0, math.inf)
        obstacles._work.progress["uses"] = uses
        obstacles.make_room()
    with detours.lent() as search:
        while _add_dot(search[3], 0.0, 0.0):
            pass
        assert _find_detour(*search, *path.points[1])[0] == NO_ROOM
        search[3].numbers[2] = 0
        assert _find_detour(*search, *path.points[1])[0] != LOST
    assert not detours.reset()  # its arrays are others


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
    guide = np.zeros((1 << (6 * len(m.wind)).bit_length()) + 1, GUIDE)
    detour_kernels.begin_guide(m, guide)
    labels = np.empty(len(m.sides), np.int32)
    label_sides(m, 2.0 * radius, labels)
    with mesh.workspaces.lent(len(m.wind)) as work:
        detour_kernels.aim_guide(m, labels, work, *start, *goal, radius, radius, (0.0, 1e3), guide)
    rows = {int(row["side"]): (row["left"], row["right"]) for row in guide[:-1] if row["side"] != 0}
    expected = side_distances(m, goal, mesh.locate(goal), radius, 2.0 * radius)
    compared = about = 0
    for h in np.flatnonzero((m.sides["cst"] == 0) & np.repeat(m.wind == 0, 3)).tolist():
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
