"""Paths found with a guide are those of a search without, whatever is in the way by then."""

import math

import numpy as np
import pytest

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.editing import detour_kernels
from crowdsim.navmesh.editing.detours import Detours
from crowdsim.navmesh.mesh_arrays import trimmed
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.workspace import workspace
from tests.reference.navmesh_reference import random_area
from tests.reference.way_reference import side_distances


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
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=25))
    return rng, mesh, Detours(mesh)


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_detours_are_as_short_as_paths_without_a_guide(kind):
    rng, mesh, detours = _detours(kind)
    ratios = []
    for radius in (0.05, 0.15, 0.25):
        for _ in range(12):
            ends = _ends(rng, mesh, radius)
            path = mesh.find_path(*ends, radius)
            detours.aim(*ends, radius, path.length)
            points = path.points
            for _ in range(3):
                places = np.array([_along(rng, points) for _ in range(3)])
                ways = detours.around(places)
                for i, place in enumerate(places):
                    handle = detours.mesh.insert_obstacle(place)
                    try:
                        expected = detours.mesh.find_path(*ends, radius)
                    except PathNotFound:
                        assert (len(ways[i]), ways.lengths[i]) == (0, math.inf)
                    else:
                        assert len(detours.mesh.violations(ways[i], radius)) == 0
                        assert ways.lengths[i] == pytest.approx(np.hypot(*np.diff(ways[i], axis=0).T).sum())
                        ratios.append(ways.lengths[i] / expected.length)
                    detours.mesh.remove(handle)
                if not np.isfinite(ways.lengths[0]):
                    break
                detours.mesh.insert_obstacle(places[0])
                points = ways[0]
            assert detours.reset()
    assert len(ratios) > 60
    assert np.mean(ratios) < 1.002
    # Beyond its limit the guide knows nothing, and searches are as greedy as without one.
    assert np.mean(np.array(ratios) > 1.03) < 0.03


def test_after_a_reset_all_is_as_it_was_to_the_last_bit():
    rng, mesh, detours = _detours("lattice")
    ends = _ends(rng, mesh, 0.15)
    path = mesh.find_path(*ends, 0.15)
    places = np.array([_along(rng, path.points) for _ in range(8)])
    before = [array.tobytes() for array in trimmed(detours.mesh.arrays)]
    found = []
    for _ in range(2):
        detours.aim(*ends, 0.15, path.length)
        ways = detours.around(places)
        detours.mesh.insert_obstacle(places[0])
        found.append((ways.points[: ways.ends[-1]].tobytes(), detours.around(places[1:]).lengths.tolist()))
        assert detours.reset()
        assert [array.tobytes() for array in trimmed(detours.mesh.arrays)] == before
    assert found[0] == found[1]


def test_no_places_have_no_ways():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    detours.aim(*ends, 0.15, mesh.find_path(*ends, 0.15).length)
    assert len(detours.around(np.empty((0, 2))).lengths) == 0


def test_detours_go_on_where_the_mesh_runs_out_of_room():
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = mesh.find_path(*ends, 0.15)
    detours.aim(*ends, 0.15, path.length)
    places = np.array([_along(rng, path.points) for _ in range(4)])
    expected = detours.around(places)
    with detours.mesh.edited() as obstacles:
        obstacles._work.progress["uses"] = len(obstacles._work.uses)  # of which none is in use
    ways = detours.around(places)
    np.testing.assert_allclose(ways.lengths, expected.lengths, rtol=1e-9)
    assert not detours.reset()  # its arrays are others


def test_detours_go_on_where_an_edit_loses_the_mesh(monkeypatch):
    rng, mesh, detours = _detours("boxes")
    ends = _ends(rng, mesh, 0.15)
    path = mesh.find_path(*ends, 0.15)
    detours.aim(*ends, 0.15, path.length)
    blocker, *places = [_along(rng, path.points) for _ in range(4)]
    detours.mesh.insert_obstacle(blocker)
    expected = detours.around(np.array(places))
    plan, calls = detour_kernels.plan_detours, []

    def lose_it(*arguments):
        calls.append(arguments)
        return plan(*arguments) if len(calls) > 1 else (detour_kernels.LOST, 0, np.empty((0, 2)))

    monkeypatch.setattr(detour_kernels, "plan_detours", lose_it)
    ways = detours.around(np.array(places))
    assert len(calls) == 2
    np.testing.assert_allclose(ways.lengths, expected.lengths, rtol=1e-9)


def test_the_mesh_asked_about_stays_as_it_is():
    rng, mesh, detours = _detours("boxes", seed=6)
    revision = detours.mesh.revision
    detours.mesh.insert_obstacle(_ends(rng, mesh, 0.2)[0])
    assert detours.mesh.revision == revision + 1
    assert mesh.revision == 0


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_a_guide_knows_how_far_sides_are_from_the_goal(kind):
    rng = np.random.default_rng(7)
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=15))
    radius = 0.2
    start, goal = _ends(rng, mesh, radius)
    m = mesh.arrays
    guide = np.zeros((1 << (6 * len(m.wind)).bit_length()) + 1, GUIDE)
    detour_kernels.begin_guide(m, guide)
    with workspace(len(m.wind)) as work:
        detour_kernels.aim_guide(m, work, *start, *goal, radius, radius, 1e3, guide)
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
