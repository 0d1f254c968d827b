from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.errors import MotionError
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus
from crowdsim.following.graph_search import graph_search_kernels
from crowdsim.following.graph_search.channel import make_channel
from crowdsim.following.graph_search.graph_search import SearchOptions, SearchResult, search_graph
from crowdsim.following.graph_search.probes import body_probes, joint_probes
from crowdsim.geometry.planar import compose, transform_points, wrap_angle
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.follow_maps import pose_after, track_of
from tests.reference.graph_search_reference import shortest_motion
from tests.unit.following.follower.test_path_follower import GRAPH, IDLE, OPEN_GROUND
from tests.unit.following.walking_graph import RADII, graph_of, pieces

Floats = NDArray[np.float64]

START = np.zeros(3)
PROBES = body_probes(GRAPH, RADII)
EAGER = SearchOptions(weight=1.2)
PLAIN = replace(EAGER, branch_kinematics=False)
FEW = graph_of(
    [
        p
        for p in pieces()
        if p.name.endswith(" C")
        and not p.name.startswith(("short", "stop", "turn 10", "turn -10", "turn 90", "turn -90"))
    ]
)
FEW_PROBES = body_probes(FEW, RADII)


def walls(free: shapely.Polygon) -> tuple:
    arrays = NavMesh(free).arrays
    return arrays, arrays


def check(graph, result: SearchResult | FollowResult, goal: Floats) -> Floats:
    """Every transition is one of the graph's within its range; returns the track."""
    assert result.edges[0] == -1
    for k in range(1, len(result.nodes)):
        edge = int(result.edges[k])
        assert graph.edge_start[result.nodes[k - 1]] <= edge < graph.edge_start[result.nodes[k - 1] + 1]
        assert graph.edge_target[edge] == result.nodes[k]
        assert graph.edge_low[edge] <= result.twists[k] <= graph.edge_high[edge]
        end = compose(result.origins[k - 1], graph.node_motion[result.nodes[k - 1]])
        expected = pose_after(graph, edge, float(result.twists[k]), end)
        np.testing.assert_allclose(result.origins[k, :2], expected[:2], atol=1e-9)
        assert abs(wrap_angle(result.origins[k, 2] - expected[2])) < 1e-9
    end = compose(result.origins[-1], graph.node_motion[result.nodes[-1]])
    if isinstance(result, SearchResult):
        assert result.gap == pytest.approx(np.hypot(*(end[:2] - goal[:2])), abs=1e-12)
        blend_offsets = compose(result.origins[:-1], graph.node_motion[result.nodes[:-1]]) - result.origins[1:]
        walked = graph.node_length[result.nodes].sum() + np.hypot(*blend_offsets.T[:2]).sum()
        assert result.length == pytest.approx(walked)
    return track_of(graph, result)[0]


@pytest.mark.parametrize("goal", [(4.9, 0.1), (3.7, 1.4), (3.4, -1.9), (4.0, 2.4)])
@pytest.mark.parametrize("column", [False, True])
def test_the_shortest_motion_is_that_of_trying_all(goal: tuple[float, float], column: bool) -> None:
    free = OPEN_GROUND.difference(shapely.Point(3.1, 0.2).buffer(0.2)) if column else OPEN_GROUND
    options = replace(PLAIN, weight=1.0, goal_tolerance=0.25, place_grain=0.001, heading_grain=0.02)
    found = search_graph(FEW, FEW_PROBES, START, 0, goal, meshes=walls(free), options=options)
    boundary, radius = free.boundary, RADII[2, 1] + 0.005

    def is_free(track: Floats) -> bool:
        return bool(shapely.distance(boundary, shapely.points(track[:, :2])).min() >= radius)

    best, nodes = shortest_motion(FEW, START, 0, np.array(goal), 0.25, 7.0, is_free)
    assert (found.status is FollowStatus.FOUND) == (best < np.inf)
    if best == np.inf:
        return
    assert found.length + found.gap == pytest.approx(best, abs=1e-6)
    assert len(found.nodes) == len(nodes)
    assert is_free(check(FEW, found, np.array(goal)))
    assert found.collision_tests > 0
    assert not found.bent


GOALS = [(6.0, 0.35), (4.1, -2.2), (-3.0, 1.5), (7.3, 4.4)]


@pytest.mark.parametrize("goal", GOALS)
def test_bent_branches_arrive_within_a_millimeter_and_need_no_more_nodes(goal: tuple[float, float]) -> None:
    plain = search_graph(GRAPH, PROBES, START, IDLE, goal, options=PLAIN)
    bent = search_graph(GRAPH, PROBES, START, IDLE, goal, options=EAGER)
    assert plain.status is bent.status is FollowStatus.FOUND
    assert bent.bent
    assert not plain.bent
    assert bent.gap <= 1e-3
    assert plain.gap <= 0.1
    assert np.any(bent.twists != 0.0)
    assert not np.any(plain.twists)
    assert bent.expansions <= plain.expansions
    check(GRAPH, bent, np.array(goal))
    check(GRAPH, plain, np.array(goal))


def test_a_motion_stays_in_its_channel_without_a_collision_test() -> None:
    points, goal = [(0.0, 0.0), (4.0, 0.0), (6.5, 1.6)], (6.5, 1.6)
    channel = make_channel(points, 0.9)
    found = search_graph(GRAPH, PROBES, START, IDLE, goal, channel=channel, options=EAGER)
    assert found.status is FollowStatus.FOUND
    assert found.collision_tests == 0
    track, behavior = track_of(GRAPH, found)
    away = shapely.distance(shapely.LineString(points), shapely.points(track[:, :2]))
    assert np.all(away + RADII[behavior].max(axis=1) <= 0.9 + 1e-9)
    free = shapely.LineString(points).buffer(0.9)
    tested = search_graph(GRAPH, PROBES, START, IDLE, goal, meshes=walls(free), options=EAGER)
    assert tested.status is FollowStatus.FOUND
    assert tested.collision_tests > 100


def test_bent_branches_do_not_touch_what_stands_in_the_way() -> None:
    rng = np.random.default_rng(11)
    columns = [shapely.Point(*rng.uniform(-4.0, 10.0, 2)).buffer(0.25) for _ in range(60)]
    columns = [column for column in columns if column.distance(shapely.Point(0.0, 0.0)) > 0.8]
    free = shapely.box(-5.0, -5.0, 11.0, 11.0).difference(shapely.union_all(columns))
    clear = [g for g in rng.uniform(1.0, 9.0, (40, 2)) if free.boundary.distance(shapely.Point(g)) > 0.5]
    bent = 0
    for goal in clear[:10]:
        found = search_graph(GRAPH, PROBES, START, IDLE, goal, meshes=walls(free), options=replace(EAGER, budget=2_000))
        if found.status is not FollowStatus.FOUND:
            continue
        track, behavior = track_of(GRAPH, found)
        gap = shapely.distance(free.boundary, shapely.points(track[:, :2])) - RADII[behavior].max(axis=1)
        tested = len(track_of(GRAPH, replace(found, nodes=found.nodes[:1], origins=found.origins[:1]))[0])
        assert gap[tested:].min() >= 0.0  # what is played already is not tested
        bent += found.bent
    assert bent >= 3


def test_a_goal_may_ask_for_a_heading() -> None:
    for heading in (-1.5, 0.0, 0.8):
        goal = np.array([5.0, 1.0, heading])
        for options in (PLAIN, EAGER):
            found = search_graph(GRAPH, PROBES, START, IDLE, goal, options=options)
            assert found.status is FollowStatus.FOUND
            end = compose(found.origins[-1], GRAPH.node_motion[found.nodes[-1]])
            assert abs(wrap_angle(end[2] - heading)) <= (0.003 if found.bent else np.radians(15.0))


def test_standing_ends_stand_and_passing_counts_where_it_is_asked_for() -> None:
    goal = (5.2, 0.3)
    standing = search_graph(GRAPH, PROBES, START, IDLE, goal, options=replace(EAGER, end_standing=True))
    assert standing.status is FollowStatus.FOUND
    assert GRAPH.node_ends_standing[standing.nodes[-1]]
    passing = search_graph(GRAPH, PROBES, START, IDLE, goal, options=replace(PLAIN, on_the_way=True))
    track = check(GRAPH, passing, np.array(goal))
    assert np.hypot(*(track[:, :2] - goal).T).min() <= 0.1
    ending = search_graph(GRAPH, PROBES, START, IDLE, goal, options=PLAIN)
    assert passing.expansions <= ending.expansions


def test_any_node_but_waiting_may_begin_where_none_is_given() -> None:
    found = search_graph(GRAPH, PROBES, (1.0, 2.0, 0.5), -1, (5.0, 5.0), options=EAGER)
    assert found.status is FollowStatus.FOUND
    assert not GRAPH.node_idle[found.nodes].any()
    np.testing.assert_array_equal(found.origins[0], [1.0, 2.0, 0.5])
    assert found.edges[0] == -1


def test_a_closed_room_is_searched_through_and_what_came_nearest_is_told() -> None:
    free = shapely.box(-0.4, -0.4, 0.4, 0.4)
    coarse = SearchOptions(place_grain=0.3, heading_grain=0.5)
    closed = search_graph(GRAPH, PROBES, START, IDLE, (6.0, 0.0), meshes=walls(free), options=coarse)
    assert closed.status is FollowStatus.BLOCKED
    given_up = search_graph(GRAPH, PROBES, START, IDLE, (6.0, 0.0), meshes=walls(free), options=SearchOptions(budget=7))
    assert given_up.status is FollowStatus.OUT_OF_BUDGET
    assert given_up.expansions == 7
    for found in (closed, given_up):
        assert not found.bent
        assert found.gap > 4.0
        check(GRAPH, found, np.array([6.0, 0.0]))


def test_threads_find_what_one_finds() -> None:
    goals = [np.array([5.0 + 0.1 * k, 0.4 * k - 1.0]) for k in range(6)]

    def find(goal: Floats) -> SearchResult:
        return search_graph(GRAPH, PROBES, START, IDLE, goal, options=EAGER)

    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(find, goals))
    for one, other in zip(map(find, goals), together, strict=True):
        for field in fields(SearchResult):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_projected_joints_stand_for_the_body() -> None:
    loaded = load_behavior_set(["frontal"], [(0.0, 0.6), (0.6, 2.0)]).graph
    graph, joints = loaded.arrays, [loaded.skeleton.joint(f"{side}_wrist") for side in ("left", "right")]
    joints.append(loaded.skeleton.joint("left_toe"))
    probes = joint_probes(graph, loaded.poses, joints)
    columns = graph_search_kernels
    origin = np.array([2.0, -1.0, 0.7])
    for node in range(0, len(graph.node_frames), 9):
        rows = probes.row[probes.first[node] : probes.first[node + 1]]
        frames = np.array(sorted({*range(0, int(graph.node_frames[node]), 4), int(graph.node_frames[node])}), np.int32)
        count = len(loaded.poses.parents)
        positions = np.empty((len(frames), count, 3), np.float32)
        track = np.ascontiguousarray(compose(origin, graph.tracks[graph.node_track[node] + frames]))
        whose = np.full(len(frames), node, np.int32)
        nobody = np.full(len(frames), -1, np.int32)
        rotations = np.empty((len(frames), count, 4), np.float32)
        pose_joints(loaded.poses, whose, nobody, frames, track, positions, rotations)
        expected = positions[:, joints].reshape(-1, 3)
        places = rows[:, [columns.X, columns.Y]] + rows[:, [columns.ASIDE_X, columns.ASIDE_Y]]
        np.testing.assert_allclose(transform_points(origin, places), expected[:, :2], atol=1e-5)
        low = expected[:, 2] < 0.6
        np.testing.assert_array_equal(rows[:, columns.LEGS] > 0.0, low)
        np.testing.assert_array_equal(rows[:, columns.TORSO] > 0.0, ~low)
    found = search_graph(graph, probes, START, -1, (5.0, 1.0), channel=make_channel([(0.0, 0.0), (5.0, 1.0)], 0.8))
    assert found.status is FollowStatus.FOUND


def test_input_that_does_not_fit_is_refused() -> None:
    with pytest.raises(MotionError, match="each of the 3 behaviors"):
        body_probes(GRAPH, RADII[:2])
    with pytest.raises(MotionError, match="starts at x, y and a heading"):
        search_graph(GRAPH, PROBES, (0.0, np.nan, 0.0), IDLE, (1.0, 1.0))
    with pytest.raises(MotionError, match="a goal is x, y"):
        search_graph(GRAPH, PROBES, START, IDLE, (1.0, 1.0, 0.0, 0.0))
    with pytest.raises(MotionError, match="do not fit a graph of"):
        search_graph(GRAPH, PROBES, START, len(GRAPH.node_frames), (1.0, 1.0))
    with pytest.raises(MotionError, match="do not fit a graph of"):
        search_graph(GRAPH, FEW_PROBES, START, IDLE, (1.0, 1.0))
    with pytest.raises(MotionError, match=r"at least 1, not 0\.9"):
        search_graph(GRAPH, PROBES, START, IDLE, (1.0, 1.0), options=SearchOptions(weight=0.9))
    with pytest.raises(MotionError, match="budget of at least 1 node"):
        search_graph(GRAPH, PROBES, START, IDLE, (1.0, 1.0), options=SearchOptions(budget=0))
    for points, radius in (([(0.0, 0.0)], 0.5), ([(0.0, 0.0), (1.0, np.inf)], 0.5), ([(0.0, 0.0), (1.0, 0.0)], 0.0)):
        with pytest.raises(MotionError, match="a channel needs a path"):
            make_channel(points, radius)
