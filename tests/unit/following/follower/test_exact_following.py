"""Following a path to its very end: what is bent arrives, keeps to the graph, and is tested as searches test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.following.follower.arrival_kernels import MOST_BENT
from crowdsim.following.follower.body_reach import body_reach
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.exact_following import follow_exactly
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import wrap_angle
from crowdsim.navmesh.mesh.address_kernels import places_of
from tests.reference.follow_maps import track_of
from tests.unit.following.follower.test_body_reach import BENDS, POSES, joints_of
from tests.unit.following.follower.test_path_follower import (
    GRAPH,
    IDLE,
    OPEN_GROUND,
    Samples,
    Scene,
    check,
    sample,
    scene,
)
from tests.unit.following.walking_graph import FACINGS, RADII

MAPS = MotionMaps.build(GRAPH)
WALKER = Character(GRAPH, MAPS, RADII, FACINGS)
FIELD = scene(OPEN_GROUND)


def search_for(path: Samples, world: Scene = FIELD, **options: float) -> PathFollower:
    chosen = FollowOptions(goal_tolerance=0.1, end_standing=True, budget=400, **options)  # type: ignore[arg-type]
    return PathFollower(WALKER, path, world.meshes, np.zeros(3), IDLE, chosen)


def check_bent(found: FollowResult, bent: FollowResult, world: Scene, path: Samples) -> np.ndarray:
    """The same nodes as found, turned at the last transitions alone, at the end of the path; returns their end."""
    np.testing.assert_array_equal(bent.nodes, found.nodes)
    np.testing.assert_array_equal(bent.edges, found.edges)
    kept = max(len(found.nodes) - MOST_BENT, 1)
    np.testing.assert_array_equal(bent.origins[:kept], found.origins[:kept])
    np.testing.assert_array_equal(bent.twists[:kept], found.twists[:kept])
    end = check(bent, world)[-1]
    assert np.hypot(*(end[:2] - path.pose[-1, :2])) <= 0.01
    assert abs(bent.reached - path.arc[-1]) <= 0.1, "nearer than samples of the path are to each other"
    return end


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(1.0, 7.0), st.floats(-2.0, 2.0), st.none() | st.floats(-0.6, 0.6))
def test_what_is_bent_arrives_and_holds_to_the_graph(along: float, aside: float, turn: float | None) -> None:
    path = sample([(0.0, 0.0), (2.0, 0.0), (2.0 + along, aside)])
    heading = None if turn is None else float(path.pose[-1, 2]) + turn
    search = search_for(path, goal_heading=heading, goal_heading_tolerance=0.5)
    for _ in range(8):
        found = search.next()
        if found.status is not FollowStatus.FOUND:
            return
        bent = search.arrive(0.01, 0.26)
        if bent is not None:
            end = check_bent(found, bent, FIELD, path)
            assert heading is None or abs(wrap_angle(end[2] - heading)) <= 0.26


def test_some_is_bent_and_the_search_goes_on_as_if_nothing_was() -> None:
    path = sample([(0.0, 0.0), (3.0, 0.0), (6.0, 1.3)])
    ours, plain = search_for(path), search_for(path)
    count = 0
    for _ in range(12):
        found, same = ours.next(), plain.next()
        np.testing.assert_array_equal(found.nodes, same.nodes)
        np.testing.assert_array_equal(found.origins, same.origins)
        count += ours.arrive(0.01) is not None
    assert count >= 2


def test_nothing_is_bent_to_where_discs_or_joints_would_not_be_free() -> None:
    """Bending swings bodies off the path: in a narrow hall or section less of it is taken than on open ground."""
    path = sample([(0.0, 0.0), (4.0, 0.0), (8.0, 0.5)])
    line = shapely.LineString(path.pose[:, :2])
    hall = scene(line.buffer(0.36))
    for world, reach, room in (
        (hall, None, np.inf),
        (FIELD, body_reach(GRAPH, POSES, np.full(3, 0.42)), 0.42),
    ):
        options = FollowOptions(goal_tolerance=0.1, end_standing=True, budget=4_000)
        arguments = replace(WALKER, reach=reach), path, world.meshes, np.zeros(3), IDLE, options
        search, taken, freely = PathFollower(*arguments), 0, 0
        wide = PathFollower(*arguments)
        layers = np.array([places_of(mesh) for mesh in FIELD.meshes])
        wide._arguments = (*wide._arguments[:4], layers, None, *wide._arguments[6:])
        for _ in range(30):
            found = search.next()
            if found.status is not FollowStatus.FOUND:
                break
            bent = search.arrive(0.01)
            wide._search.best_step[:], wide._search.best_place[:] = search._search.best_step, search._search.best_place
            wide._search.state[:] = search._search.state
            freely += wide.arrive(0.01) is not None
            if bent is not None:
                taken += 1
                check_bent(found, bent, world, path)
                off = shapely.distance(line, shapely.points(joints_of(bent).reshape(-1, 2)))
                first = int(GRAPH.node_frames[bent.nodes[0]]) + 1
                assert off[first * 3 :].max() <= room + 1e-6
        assert 0 < taken < freely


def test_most_paths_are_walked_to_their_end_within_a_centimeter() -> None:
    exact = 0
    goals = [(4.0 + 0.37 * k, 0.9 * np.sin(k)) for k in range(12)]
    for goal in goals:
        path = sample([(0.0, 0.0), (2.0, 0.0), goal])
        found, off = follow_exactly(WALKER, path, FIELD.meshes, np.zeros(3), IDLE)
        assert found.status is FollowStatus.FOUND
        assert GRAPH.node_ends_standing[found.nodes[-1]]
        track = check(found, FIELD)
        assert np.isclose(np.hypot(*(track[-1, :2] - goal)), off, atol=1e-6)
        assert off <= 0.1
        exact += off <= 0.01
    assert exact >= 11


@pytest.mark.parametrize("asked", [-2.0, 0.3, 1.5])
def test_a_heading_that_is_asked_for_is_held_where_the_end_is_met(asked: float) -> None:
    path = sample([(0.0, 0.0), (4.0, 0.0), (6.0, 3.0)])
    options = FollowOptions(goal_tolerance=0.1, goal_heading=asked)
    found, off = follow_exactly(WALKER, path, FIELD.meshes, np.zeros(3), IDLE, options)
    assert found.status is FollowStatus.FOUND
    assert off <= 0.01
    assert abs(wrap_angle(check(found, FIELD)[-1, 2] - asked)) <= np.radians(15.0)


def test_joints_are_kept_in_their_section_to_the_end() -> None:
    for line in BENDS[:2]:
        path = sample(line)
        reach = body_reach(GRAPH, POSES, np.full(3, 0.5))
        found, off = follow_exactly(replace(WALKER, reach=reach), path, FIELD.meshes, np.zeros(3), IDLE)
        assert found.status is FollowStatus.FOUND
        assert off <= 0.01
        places = joints_of(found)[int(GRAPH.node_frames[found.nodes[0]]) + 1 :].reshape(-1, 2)
        assert shapely.distance(shapely.LineString(path.pose[:, :2]), shapely.points(places)).max() <= 0.5 + 1e-6


def test_a_closed_way_gives_what_came_farthest() -> None:
    world = scene(shapely.box(-2.0, -1.2, 6.0, 1.2))
    path = sample([(0.0, 0.0), (9.0, 0.0)])
    options = FollowOptions(goal_tolerance=0.1, budget=200)
    found, off = follow_exactly(WALKER, path, world.meshes, np.zeros(3), IDLE, options)
    assert found.status is not FollowStatus.FOUND
    assert off > 2.0
    assert len(track_of(GRAPH, found)[0]) > 100
