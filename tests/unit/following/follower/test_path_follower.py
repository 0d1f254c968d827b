from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.following.follower.character import Character
from crowdsim.following.follower.follow_options import THOROUGH_BRANCHES, FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower, follow_path
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.follow_maps import pose_after, track_of
from tests.unit.following.walking_graph import ARMS_HELD, FACINGS, FRONTAL, LATERAL, RADII, graph_of, pieces

PARTS = pieces()
NAMES = [part.name for part in PARTS]
GRAPH = graph_of(PARTS)
IDLE = NAMES.index("idle S")
OPEN_GROUND = shapely.box(-30.0, -30.0, 60.0, 60.0)
HALL = shapely.box(-2.0, -1.2, 22.0, 1.2)


class Samples(NamedTuple):
    pose: NDArray[np.float64]
    arc: NDArray[np.float64]
    behavior: NDArray[np.int32]


class Scene(NamedTuple):
    legs: shapely.Polygon
    torso: shapely.Polygon
    meshes: tuple[NamedTuple, NamedTuple]


@pytest.fixture(scope="module")
def maps() -> MotionMaps:
    return MotionMaps.build(GRAPH)


def scene(legs: shapely.Polygon, torso: shapely.Polygon | None = None) -> Scene:
    torso = legs if torso is None else torso
    return Scene(legs, torso, (NavMesh(legs).arrays, NavMesh(torso).arrays))


def sample(line: list[tuple[float, float]], sections: list[tuple[float, float, int]] = ()) -> Samples:
    """Polyline at steps of a tenth of a meter; frontal but for the sections (from, to, behavior)."""
    string = shapely.LineString(line)
    count = int(np.ceil(string.length / 0.1)) + 1
    arc = np.linspace(0.0, string.length, count)
    points = shapely.get_coordinates(shapely.line_interpolate_point(string, arc))
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(string, np.minimum(arc + 0.25, string.length)))
    behind = shapely.get_coordinates(shapely.line_interpolate_point(string, np.maximum(arc - 0.25, 0.0)))
    chord = ahead - behind
    behavior = np.full(count, FRONTAL, np.int32)
    for low, high, b in sections:
        behavior[(arc >= low - 1e-9) & (arc <= high + 1e-9)] = b
    return Samples(np.column_stack([points, np.arctan2(chord[:, 1], chord[:, 0])]), arc, behavior)


def follow(
    maps: MotionMaps, world: Scene, path: Samples, start: tuple[float, float, float], node: int = IDLE, **options: float
) -> FollowResult:
    chosen = FollowOptions(**options)  # type: ignore[arg-type]
    return follow_path(Character(GRAPH, maps, RADII, FACINGS), path, world.meshes, np.array(start), node, chosen)


def check(result: FollowResult, world: Scene) -> NDArray[np.float64]:
    """Every transition is one of the graph's, within its range, and every disc of every frame is free."""
    assert result.edges[0] == -1
    for k in range(1, len(result.nodes)):
        edge = result.edges[k]
        assert GRAPH.edge_start[result.nodes[k - 1]] <= edge < GRAPH.edge_start[result.nodes[k - 1] + 1]
        assert GRAPH.edge_target[edge] == result.nodes[k]
        assert GRAPH.edge_low[edge] <= result.twists[k] <= GRAPH.edge_high[edge]
        end = compose(result.origins[k - 1], GRAPH.node_motion[result.nodes[k - 1]])
        expected = pose_after(GRAPH, int(edge), float(result.twists[k]), end)
        np.testing.assert_allclose(result.origins[k, :2], expected[:2], atol=1e-9)
        assert abs(wrap_angle(result.origins[k, 2] - expected[2])) < 1e-9
    track, behavior = track_of(GRAPH, result)
    points = shapely.points(track[:, :2])
    for layer, free in enumerate((world.legs, world.torso)):
        assert shapely.contains(free, points).all()
        gap = shapely.distance(shapely.boundary(free), points) - RADII[behavior, layer]
        assert gap.min() >= 0.0
    return track


def deviation(track: NDArray[np.float64], path: Samples) -> NDArray[np.float64]:
    """Distances from the path of the frames beside it, those beyond its end left out."""
    line, points = shapely.LineString(path.pose[:, :2]), shapely.points(track[:, :2])
    beside = shapely.line_locate_point(line, points) < line.length
    return shapely.distance(line, points[beside])


def test_straight_path_is_followed_to_the_centimeter(maps: MotionMaps) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (20.0, 0.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0))
    assert result.status is FollowStatus.FOUND
    assert result.nodes[0] == IDLE
    track = check(result, world)
    assert deviation(track, path).max() < 0.02
    assert np.hypot(*(track[:, :2] - [20.0, 0.0]).T).min() <= 0.35
    assert result.reached >= 19.6


def test_any_node_may_begin_where_none_is_given(maps: MotionMaps) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (6.0, 0.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0), node=-1)
    assert result.status is FollowStatus.FOUND
    assert not GRAPH.node_idle[result.nodes].any()
    np.testing.assert_array_equal(result.origins[0], [0.0, 0.0, 0.0])
    check(result, world)


@pytest.mark.parametrize("radius", [4.0, 8.0, -6.0])
def test_gentle_bends_are_followed_to_centimeters(maps: MotionMaps, radius: float) -> None:
    angle = np.linspace(0.0, 1.8, 200)
    line = [(abs(radius) * np.sin(a), radius * (1.0 - np.cos(a))) for a in angle]
    world, path = scene(OPEN_GROUND), sample(line)
    result = follow(maps, world, path, (0.0, 0.0, 0.0))
    assert result.status is FollowStatus.FOUND
    assert deviation(check(result, world), path).max() < 0.16


def test_right_angles_are_taken(maps: MotionMaps) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (12.0, 6.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0))
    assert result.status is FollowStatus.FOUND
    assert deviation(check(result, world), path).max() < 0.65


@pytest.mark.parametrize("heading", [-2.8, -2.0, -1.2, -0.5, 0.6, 1.3, 2.2, 3.1])
@pytest.mark.parametrize("aside", [-0.25, 0.25])
def test_any_start_heading_and_some_offset(maps: MotionMaps, heading: float, aside: float) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (8.0, 0.0)])
    result = follow(maps, world, path, (0.0, aside, heading))
    assert result.status is FollowStatus.FOUND
    track = check(result, world)
    assert deviation(track, path)[-60:].max() < 0.1


def corridor() -> tuple[Scene, Samples]:
    """Three narrow areas in a hall: shoulders' width, benches, and less than a shoulder's width."""
    tall = [shapely.box(4, 0.31, 6, 1.2), shapely.box(4, -1.2, 6, -0.31)]
    tall += [shapely.box(14, 0.23, 16, 1.2), shapely.box(14, -1.2, 16, -0.23)]
    benches = [shapely.box(9, 0.3, 11, 1.2), shapely.box(9, -1.2, 11, -0.3)]
    torso = HALL.difference(shapely.union_all(tall))
    legs = torso.difference(shapely.union_all(benches))
    sections = [(3.8, 6.2, ARMS_HELD), (13.7, 16.3, LATERAL)]
    return scene(legs, torso), sample([(0.0, 0.0), (20.0, 0.0)], sections)


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (0.0, 0.2, 1.0), (0.3, -0.1, 3.0), (0.1, 0.0, -1.7)])
def test_corridor_takes_each_area_in_its_way(maps: MotionMaps, start: tuple[float, float, float]) -> None:
    world, path = corridor()
    result = follow(maps, world, path, start)
    assert result.status is FollowStatus.FOUND
    check(result, world)
    track, behavior = track_of(GRAPH, result)
    assert set(behavior[(track[:, 0] > 4.0) & (track[:, 0] < 6.0)]) == {ARMS_HELD}
    assert set(behavior[(track[:, 0] > 9.0) & (track[:, 0] < 11.0)]) == {FRONTAL}
    assert set(behavior[(track[:, 0] > 14.0) & (track[:, 0] < 16.0)]) == {LATERAL}
    lateral = track[behavior == LATERAL, 0]
    assert lateral.min() >= 13.7 - 2.1
    assert lateral.max() <= 16.3 + 2.1
    assert behavior[-1] == FRONTAL


@pytest.mark.parametrize("before", [0.5, 0.8, 1.1, 1.5])
@pytest.mark.parametrize("heading", [0.0, 1.5, -3.0])
def test_starts_close_to_a_sideways_section(maps: MotionMaps, before: float, heading: float) -> None:
    world, whole = corridor()
    first = round((14.0 - before) / 0.1)
    path = Samples(whole.pose[first:].copy(), whole.arc[first:] - whole.arc[first], whole.behavior[first:].copy())
    result = follow(maps, world, path, (*path.pose[0, :2], heading))
    assert result.status is FollowStatus.FOUND
    check(result, world)


def test_backtracks_where_the_first_choice_leads_nowhere(maps: MotionMaps) -> None:
    """Walking up to the sideways section too far leaves no room to turn: with few candidates steps are taken back."""
    world, whole = corridor()
    tries = []
    for first in range(114, 138, 2):
        path = Samples(whole.pose[first:].copy(), whole.arc[first:] - whole.arc[first], whole.behavior[first:].copy())
        result = follow(maps, world, path, (path.pose[0, 0], 0.15, 2.0), candidates=1)
        assert result.status is FollowStatus.FOUND
        check(result, world)
        tries.append(result.expansions - len(result.nodes))
    assert max(tries) > 0


def test_a_closed_way_says_how_far_it_came(maps: MotionMaps) -> None:
    free = HALL.difference(shapely.box(10.0, -1.2, 10.5, 1.2))
    world, path = scene(free), sample([(0.0, 0.0), (20.0, 0.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0), budget=300)
    assert result.status is FollowStatus.OUT_OF_BUDGET
    assert result.expansions == 300
    assert 8.0 < result.reached < 10.0 - 0.17
    check(result, world)


def test_a_start_without_a_way_out_is_blocked(maps: MotionMaps) -> None:
    world, path = scene(shapely.box(-0.33, -0.33, 0.33, 0.33)), sample([(0.0, 0.0), (5.0, 0.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0))
    assert result.status is FollowStatus.BLOCKED
    assert result.nodes.tolist() == [IDLE]
    assert result.reached < 0.1


def test_standing_ends_stand_at_the_goal(maps: MotionMaps) -> None:
    world = scene(OPEN_GROUND)
    for length in (2.0, 3.3, 5.1, 7.4):
        path = sample([(0.0, 0.0), (length, 0.0)])
        result = follow(maps, world, path, (0.0, 0.0, 0.0), end_standing=True)
        assert result.status is FollowStatus.FOUND
        assert GRAPH.node_ends_standing[result.nodes[-1]]
        track = check(result, world)
        assert np.hypot(*(track[-1, :2] - [length, 0.0])) <= 0.35


def same(a: FollowResult, b: FollowResult) -> bool:
    columns = ("nodes", "edges", "twists", "origins")
    return a.status == b.status and all(np.array_equal(getattr(a, c), getattr(b, c)) for c in columns)


def test_two_threads_find_what_one_finds(maps: MotionMaps) -> None:
    world, path = corridor()
    starts = [(0.02 * i, 0.03 * (i % 5) - 0.06, 0.7 * i - 3.0) for i in range(8)]
    alone = [follow(maps, world, path, s) for s in starts]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda s: follow(maps, world, path, s), starts))
    assert all(same(a, b) for a, b in zip(alone, together, strict=True))
    assert len({len(a.nodes) for a in alone}) > 1


def test_what_a_quick_search_cannot_find_is_searched_thoroughly(maps: MotionMaps) -> None:
    world, path = corridor()
    start = (0.0, 0.2, 1.0)
    quick = follow(maps, world, path, start, branches=1)
    # Without those of the search for a quicker motion.
    options = FollowOptions(branches=1, most_still=1)
    character = Character(GRAPH, maps, RADII, FACINGS)
    needed = PathFollower(character, path, world.meshes, np.array(start), IDLE, options).next().expansions
    short = follow(maps, world, path, start, branches=1, budget=3 * needed)
    assert short.status is FollowStatus.FOUND
    fewer = FollowOptions(branches=1, most_still=1, budget=3 * needed // 4)
    vain = PathFollower(character, path, world.meshes, np.array(start), IDLE, fewer).next()
    assert vain.status is FollowStatus.OUT_OF_BUDGET
    assert short.expansions > vain.expansions == 3 * needed // 4
    check(short, world)
    assert same(short, follow(maps, world, path, start, branches=THOROUGH_BRANCHES))
    assert not same(short, quick)


def test_a_search_goes_on_to_other_solutions(maps: MotionMaps) -> None:
    world, path = corridor()
    options = FollowOptions(end_standing=True, budget=400)
    arguments = (Character(GRAPH, maps, RADII, FACINGS), path, world.meshes, np.zeros(3), IDLE, options)
    search = PathFollower(*arguments)
    found = [search.next() for _ in range(5)]
    assert same(found[0], PathFollower(*arguments).next())
    for one, other in pairwise(found):
        assert other.status is FollowStatus.FOUND
        assert one.expansions <= other.expansions
        check(other, world)
    assert len({(*one.nodes.tolist(), *one.twists.tolist()) for one in found}) >= 3


@pytest.mark.parametrize("asked", [-2.5, -1.2, 0.4, 1.6, 3.0])
@pytest.mark.parametrize("standing", [True, False])
def test_a_heading_that_is_asked_for_is_held_at_the_goal(maps: MotionMaps, asked: float, standing: bool) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (4.0, 0.0), (6.0, 3.0)])
    result = follow(maps, world, path, (0.0, 0.0, 0.0), goal_heading=asked, end_standing=standing, goal_tolerance=0.2)
    assert result.status is FollowStatus.FOUND
    end = check(result, world)[-1]
    assert np.hypot(*(end[:2] - [6.0, 3.0])) <= 0.2
    assert abs(wrap_angle(end[2] - asked)) <= np.radians(15.0)


def test_few_looks_lead_there_too_and_all_of_them_are_as_many_as_one_asks(maps: MotionMaps) -> None:
    world, path = corridor()
    start = (0.0, 0.2, 1.0)
    for branches in (1, 6):
        result = follow(maps, world, path, start, branches=branches)
        assert result.status is FollowStatus.FOUND
        check(result, world)
    assert same(follow(maps, world, path, start, branches=2_500), follow(maps, world, path, start, branches=9_999))
    bend = sample([(0.0, 0.0), (6.0, 0.0), (9.0, 3.0), (9.0, 9.0)])
    field = scene(OPEN_GROUND)
    few, many = (follow(maps, field, bend, (0.0, 0.0, 0.0), branches=branches) for branches in (1, 200))
    assert deviation(check(many, field), bend).mean() < deviation(check(few, field), bend).mean()


def test_input_that_does_not_fit_is_refused(maps: MotionMaps) -> None:
    world, path = scene(OPEN_GROUND), sample([(0.0, 0.0), (5.0, 0.0)])
    with pytest.raises(MotionError, match="each of the 3 behaviors"):
        follow_path(Character(GRAPH, maps, RADII[:2], FACINGS[:2]), path, world.meshes, np.zeros(3))
    with pytest.raises(MotionError, match="at least one candidate and one branch"):
        follow(maps, world, path, (0.0, 0.0, 0.0), branches=0)
    short = Samples(path.pose[:1], path.arc[:1], path.behavior[:1])
    with pytest.raises(MotionError, match="two samples"):
        follow_path(Character(GRAPH, maps, RADII, FACINGS), short, world.meshes, np.zeros(3))


def test_more_branches_find_no_more_than_a_search_that_left_out_none(maps: MotionMaps) -> None:
    character, rng, ends = Character(GRAPH, maps, RADII, FACINGS), np.random.default_rng(3), {True: 0, False: 0}
    for _ in range(60):
        # The path leads through the end of the hall, so every search ends in vain.
        end, branches = rng.uniform(0.5, 2.5), int(rng.integers(1, 40))
        world, path = scene(shapely.box(-2.0, -1.2, end, 1.2)), sample([(0.0, 0.0), (end + 2.0, 0.0)])
        start, node = np.array([*rng.uniform(-0.2, 0.2, 2), rng.uniform(-1.0, 1.0)]), int(rng.integers(len(NAMES)))
        options = FollowOptions(branches=branches, budget=400)
        search = PathFollower(character, path, world.meshes, start, node, options)
        found = search.next()
        if found.status is not FollowStatus.BLOCKED:
            continue
        ends[search.left_out] += 1
        if not search.left_out:
            thorough = FollowOptions(branches=THOROUGH_BRANCHES, budget=4000)
            more = PathFollower(character, path, world.meshes, start, node, thorough).next()
            assert (more.status, more.reached, more.expansions) == (found.status, found.reached, found.expansions)
            np.testing.assert_array_equal(more.nodes, found.nodes)
    assert min(ends.values()) > 3, ends
