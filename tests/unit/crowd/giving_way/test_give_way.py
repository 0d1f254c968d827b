"""Ways that are kept free, passages, and who gives way to whom: kernels against what they say, looked up one by one."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.asking import Asking, Standing, Trail
from crowdsim.crowd.giving_way.give_way_kernels import clear_way, lay_move, reserve_by_asking, step_aside
from crowdsim.crowd.giving_way.moves import LEAST_MOVE, MOVE_NODES, moves_of
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.state.components import SAMPLE
from crowdsim.crowd.state.passages import narrow_passages
from crowdsim.crowd.state.reservation_kernels import next_met, pair_meets
from crowdsim.crowd.state.timelines import NO_BODIES, Chain, Obstacles, Playback, Timelines
from crowdsim.crowd.state.way_kernels import (
    lay_way,
    meets_oncoming,
    next_in_way,
    rank_at,
    rank_behind,
    stops_in_passage,
    stops_in_way,
    ways_before,
)
from crowdsim.geometry.planar import compose
from crowdsim.jit import kernel
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.crowd import FOREVER, discs_along, off_way, walking_graph
from tests.support.kept_meshes import layers_kept

GRAPH = walking_graph()
MOVES = moves_of(GRAPH)
RADIUS = 0.3
NOW = Playback.natural(0, 2)
SLOTS = 48


def standing_crowd(spots: np.ndarray, headings: np.ndarray) -> tuple[Timelines, Standing, np.ndarray]:
    """Rows that stand for good, ranked in their order, and where they stand (N, 3)."""
    count = len(spots)
    timeline = discs_along(np.repeat(spots[:, None], SLOTS, axis=1), RADIUS)
    circles = np.column_stack([spots, np.zeros(count)])
    radii = np.full(count, RADIUS)
    near = Neighbors.of(spots, circles, radii)
    everyone = Timelines(timeline, np.zeros(count, np.int64), np.full(count, FOREVER), radii, circles, near)
    origin = np.column_stack([spots, headings])
    standing = Standing(
        np.zeros(count, np.int32),
        origin,
        spots + [5.0, 0.0],
        np.full((count, 8, 2), np.nan),
        np.ones(count, bool),
        np.arange(count, dtype=np.int64),
    )
    return everyone, standing, origin


def room(side: float) -> Obstacles:
    mesh = NavMesh(shapely.box(-side, -side, side, side))
    radii, breadths = np.array([[RADIUS]]), np.array([[RADIUS, 0.0]])
    return Obstacles(layers_kept(mesh), radii, breadths, np.empty((0, 4)), 0.0, NO_BODIES, NONE, RADIUS)


def asking(standing: Standing, tries: int = 500) -> Asking:
    trail = Trail.empty(8, SLOTS, max(int(np.diff(MOVES.begin).max()), 1))
    trail.tries[0] = tries
    return Asking(MOVES, standing, trail, trail.tries)


def through(x: float, until: float) -> np.ndarray:
    """A timeline that walks along y = 0 from ``x`` to ``until`` and stands there."""
    tracks = np.column_stack([np.minimum(x + 0.25 * np.arange(SLOTS), until), np.zeros(SLOTS)])
    return discs_along(tracks, RADIUS)


def nobody_meets(everyone: Timelines, first: int = 0) -> bool:
    rows = range(len(everyone.timeline))
    return not any(
        pair_meets(
            *(everyone.timeline[a], everyone.timeline_start[a], everyone.gone_slot[a]),
            *(everyone.timeline[b], everyone.timeline_start[b], everyone.gone_slot[b]),
            *(first, 2.0 * RADIUS, True),
        )
        for a in rows
        for b in rows
        if a < b
    )


def test_moves_lead_from_a_stand_to_a_stand() -> None:
    begin, end = MOVES.begin[0], MOVES.begin[1]
    assert end > begin
    assert MOVES.begin[-1] == end, "only the idle node has moves"
    chain = Chain.empty(MOVE_NODES + 1)
    for move in range(begin, end):
        start = np.array([1.0, 2.0, 0.7])
        count = lay_move(GRAPH, MOVES, move, 0, start, chain)
        last = int(chain.nodes[count - 1])
        assert GRAPH.node_ends_standing[last]
        found = compose(chain.origins[count - 1], GRAPH.node_motion[last])
        assert found[:2] == pytest.approx(compose(start, MOVES.shift[move])[:2], abs=1e-12)
        assert MOVES.frames[move] == GRAPH.node_frames[chain.nodes[1:count]].sum()
        assert np.hypot(*MOVES.shift[move, :2]) >= LEAST_MOVE


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_either_all_give_way_and_meet_nobody_or_nothing_changes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spots = np.array([[0.0, 0.0], [1.2, 0.0], *rng.uniform(-2.2, 2.2, (4, 2))])
    everyone, standing, _ = standing_crowd(spots, rng.uniform(-3, 3, len(spots)))
    standing.may_move[rng.integers(1, 6)] = rng.random() < 0.5
    before = [column.copy() for column in everyone[:-1]]
    ask = asking(standing, int(rng.integers(0, 60)))
    want = through(0.0, float(rng.uniform(0.5, 2.5)))
    count = clear_way(GRAPH, room(3.0), everyone, 0, want, FOREVER, NOW, Chain.empty(20), ask)
    if count < 0:
        for column, old in zip(everyone[:-1], before, strict=True):
            np.testing.assert_array_equal(column, old)
        return
    np.testing.assert_array_equal(everyone.timeline[0], want)
    moved = ask.trail.rows[:count].tolist()
    assert len(set(moved)) == count
    assert all(standing.may_move[row] and standing.rank[row] > 0 for row in moved)
    for row in range(1, len(spots)):
        if row not in moved:
            np.testing.assert_array_equal(everyone.timeline[row], before[0][row])
    assert nobody_meets(everyone)


def test_who_stands_in_the_way_walks_on_and_nobody_gives_way_to_who_ranks_behind() -> None:
    everyone, standing, _ = standing_crowd(np.array([[0.0, 0.0], [1.4, 0.0]]), np.array([0.0, 1.5]))
    want, draft = through(0.0, 0.75), Chain.empty(20)
    assert clear_way(GRAPH, room(4.0), everyone, 0, want, FOREVER, NOW, draft, asking(standing)) == 1
    everyone, standing, _ = standing_crowd(np.array([[0.0, 0.0], [1.4, 0.0]]), np.array([0.0, 1.5]))
    standing.rank[:] = [1, 0]
    assert clear_way(GRAPH, room(4.0), everyone, 0, want, FOREVER, NOW, draft, asking(standing)) == -1


def test_who_is_asked_early_leaves_the_way_or_stays() -> None:
    for heading, leaves in ((np.pi / 2, True), (0.0, False)):
        everyone, standing, _ = standing_crowd(np.array([[-2.0, 0.0], [0.0, 0.0]]), np.array([0.0, heading]))
        standing.way[0] = np.column_stack([np.linspace(-2.0, 2.0, 8), np.zeros(8)])
        pose = np.column_stack([everyone.timeline[:, 0, :2], np.zeros(2)])
        found = next_in_way(standing.way, standing.rank, standing.may_move, 0, pose, 2 * RADIUS, 0, everyone.near)
        assert found == 1
        assert next_in_way(standing.way, standing.rank, standing.may_move, 0, pose, 2 * RADIUS, 2, everyone.near) == -1
        ask = asking(standing)
        count = step_aside(GRAPH, room(4.0), everyone, 0, 1, NOW, Chain.empty(20), ask)
        # The toy graph walks ahead only.
        assert (count == 1) == leaves
        assert (abs(everyone.timeline[1, -1, 1]) >= 2 * RADIUS) == leaves


def test_reserving_by_asking_clears_what_reserving_alone_does_not() -> None:
    everyone, standing, origin = standing_crowd(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.0, np.pi / 2]))
    chain = Chain.empty(20)
    chain.origins[0] = origin[0]
    lay_move(GRAPH, MOVES, int(MOVES.begin[0]), 0, origin[0], chain)
    ask, timeline = asking(standing), np.zeros((SLOTS, SAMPLE))
    frame = int(GRAPH.node_frames[0])
    found = reserve_by_asking(
        GRAPH, room(5.0), everyone, 0, frame, NOW, chain, Chain.empty(20), 1, 1, False, timeline, ask
    )
    assert found == (1, FOREVER, 1)
    np.testing.assert_array_equal(everyone.timeline[0], timeline)
    assert nobody_meets(everyone)


@given(st.integers(0, 10_000))
def test_who_is_met_is_told_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    everyone, _, _ = standing_crowd(rng.uniform(-3, 3, (8, 2)), np.zeros(8))
    want = through(-2.0, 2.0)
    met = [
        row
        for row in range(1, 8)
        if pair_meets(want, 0, FOREVER, everyone.timeline[row], 0, FOREVER, 0, 2 * RADIUS, True)
    ]
    found, row = [], -1
    while (row := next_met(0, want, 0, FOREVER, 0, RADIUS, everyone, row + 1)) >= 0:
        found.append(row)
    assert found == met


@given(st.integers(0, 10_000))
@settings(deadline=None)
def test_stops_in_ways_and_passages_are_told_by_their_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways = np.cumsum(rng.normal(0, 0.6, (3, 8, 2)), axis=1)
    timeline = np.linspace(rng.uniform(-2, 2, 2), rng.uniform(-2, 2, 2), SLOTS)
    width = 0.7
    expected = False
    for way in ways:
        behind = (timeline[-1] - way[0]) @ (way[1] - way[0]) < 0
        off, along = off_way(way, timeline[-1])
        in_before = off_way(way, timeline[0])[0] < width
        against = (timeline[-1] - timeline[0]) @ along < 0
        expected |= bool(not behind and off < width and (not in_before or against))
    assert stops_in_way(timeline, ways, width) == expected
    passages = ways[:, :2].reshape(-1, 4)
    near = [any(off_way(way[:2], at)[0] < width for way in ways) for at in timeline[[0, -1]]]
    assert stops_in_passage(timeline, passages, width) == (near[1] and not near[0])
    assert not stops_in_way(timeline, ways[:0], width)
    assert not stops_in_passage(timeline, passages[:0], width)


def test_the_way_ahead_ends_where_it_is_far_enough_or_where_the_plan_does() -> None:
    origins = np.column_stack([0.5 * np.arange(20), np.zeros(20), np.zeros(20)])
    way = np.full((8, 2), np.nan)
    farthest = lay_way(origins, 3, np.array([1.0, 0.0]), 4.0, way)
    assert way[0] == pytest.approx([1.0, 0.0])
    assert (np.diff(way[:, 0]) >= 0).all()
    assert 4.0 <= way[-1, 0] - 1.0 == farthest <= 5.0
    assert lay_way(origins, 20, np.array([9.5, 0.0]), 4.0, way) == 0.0
    assert (way == [9.5, 0.0]).all()


def test_ranks_and_ways_of_those_before() -> None:
    ways = np.full((4, 8, 2), np.nan)
    for row, x in enumerate((0.0, 1.0, -1.0)):
        ways[row] = np.column_stack([x + np.linspace(0, 4, 8), np.zeros(8)])
    ranks = np.array([640, 64, 128, 1], np.int64)
    places = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 3.0]])
    circles = np.column_stack([places, np.full(4, 5.0)])
    near = Neighbors.of(places, circles, np.full(4, RADIUS), ways)
    assert rank_behind(0, ways, ranks, 0.6, 2.0, near) == 65, "who is ahead goes the same way"
    assert rank_behind(1, ways, ranks, 0.6, 2.0, near) == FOREVER, "nobody is ahead"
    ways[1] = ways[1, ::-1]
    near = Neighbors.of(places, circles, np.full(4, RADIUS), ways)
    assert rank_behind(0, ways, ranks, 0.6, 9.0, near) == FOREVER, "it comes the other way"
    out = np.empty((8, 8, 2))
    assert ways_before(0, ways, ranks, 9.0, near, out) == 2, "who has no way is left out"
    np.testing.assert_array_equal(out[:2], ways[[1, 2]])
    assert ways_before(0, ways, ranks, 9.0, near, out[:1]) == 1


def test_a_door_is_a_narrow_passage_and_a_corner_is_none() -> None:
    rooms = shapely.box(0, 0, 10, 4).difference(shapely.box(4.9, 0, 5.1, 1.5)).difference(shapely.box(4.9, 2.5, 5.1, 4))
    found = narrow_passages(NavMesh(rooms), 0.3, 1.2)
    assert len(found)
    assert np.abs(found[:, [0, 2]] - 5.0).max() < 0.11
    assert len(narrow_passages(NavMesh(shapely.box(0, 0, 10, 4)), 0.3, 1.2)) == 0
    assert len(narrow_passages(NavMesh(rooms), 0.3, 0.9)) == 0


@settings(deadline=None)
@given(st.floats(0.4, 2.0), st.floats(0.3, 8.0), st.floats(0.0, 0.4), st.floats(0.0, 6.3))
def test_a_narrow_passage_is_one_all_along(gap: float, length: float, slant: float, turn: float) -> None:
    halls = shapely.box(-14, -4, -length / 2, 4) | shapely.box(length / 2, -4, 14, 4)
    walls = [
        (-length / 2, -gap / 2),
        (length / 2, slant - gap / 2),
        (length / 2, slant + gap / 2),
        (-length / 2, gap / 2),
    ]
    rooms = shapely.affinity.rotate(shapely.union(halls, shapely.Polygon(walls)), turn, origin=(0, 0), use_radians=True)
    mesh = NavMesh(rooms)
    found = narrow_passages(mesh, 0.1, 1.2)
    for x, y, to_x, to_y in found:
        along = np.linspace([x, y], [to_x, to_y], 60)
        assert mesh.clearances(along).max() < 0.6 + 0.3 / 2, "measured every 0.3 m"
    # Slanted walls are a little closer to each other than the width of the opening.
    if gap < 1.2:
        middle = np.linspace([-length / 2, 0.0], [length / 2, slant], 20) @ [
            [np.cos(turn), np.sin(turn)],
            [-np.sin(turn), np.cos(turn)],
        ]
        lines = shapely.linestrings(found.reshape(-1, 2, 2))
        assert shapely.distance(shapely.points(middle)[:, None], lines).min(axis=1).max() < gap
    if gap * length / np.hypot(length, slant) > 1.25:
        assert len(found) == 0


def test_those_who_come_to_rest_in_a_passage_rank_before_all_outside_but_not_those_who_go_nowhere() -> None:
    passages = np.array([[0.0, -0.5, 0.0, 0.5]])
    assert rank_at(640, FOREVER, 2.0, 0.0, passages, 0.9) == 640
    assert rank_at(640, 65, 2.0, 0.0, passages, 0.9) == 65, "it follows another one"
    inside = [rank_at(turn, FOREVER, 0.5, 0.0, passages, 0.9) for turn in (0, 64, 640, 10**15)]
    assert inside == sorted(inside)
    assert inside[-1] < 0
    assert rank_at(640, inside[0] + 1, 0.5, 0.0, passages, 0.9) == inside[0] + 1, "taken over once"
    assert rank_at(640, inside[1] + 1, 2.0, 0.0, passages, 0.9) == 65, "outside, behind one who is in it"
    assert rank_at(inside[2], inside[2], 2.0, 0.0, passages, 0.9) == 640, "it has come out"
    assert rank_at(FOREVER, FOREVER, 0.5, 0.0, passages, 0.9) == FOREVER


@pytest.mark.parametrize("towards", [True, False])
@pytest.mark.parametrize("begins", [-2.0, -0.6, 0.9])
def test_nobody_enters_a_passage_against_one_who_comes_out_of_it(towards: bool, begins: float) -> None:
    passages = np.array([[0.0, -0.4, 3.0, 0.4]])
    way = np.column_stack([np.linspace(2.0, -2.0, 8), np.zeros(8)])
    ways = way[None] if towards else way[None, ::-1]
    chain = Chain.empty(12)
    chain.origins[:, 0] = begins + 0.5 * np.arange(12)
    tracks = np.column_stack([np.linspace(begins, 1.0, SLOTS), np.zeros(SLOTS)])
    enters = _enters_against(discs_along(tracks, RADIUS), chain, 11, ways, passages, 0.9, RADIUS)
    assert enters == (towards and begins < -0.3), "one that is in it already goes on"
    assert not _enters_against(discs_along(tracks - [3.0, 0.0], RADIUS), chain, 11, ways, passages, 0.9, RADIUS)


@kernel
def _enters_against(timeline, chain, available, ways, passages, distance, radius):
    """Call the helper of the kernels."""
    return meets_oncoming(timeline, chain, available, ways, passages, distance, radius)
