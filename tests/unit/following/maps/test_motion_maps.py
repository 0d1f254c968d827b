import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose
from tests.reference.follow_maps import pose_after, slow_map
from tests.unit.following.walking_graph import graph_of, pieces

GRAPH = graph_of(pieces())


@pytest.fixture(scope="module")
def maps() -> MotionMaps:
    return MotionMaps.build(GRAPH, depth=2, reach=2.2, max_entries=100_000)


def entries(maps: MotionMaps, node: int) -> slice:
    return slice(int(maps.arrays.first[node]), int(maps.arrays.first[node + 1]))


@pytest.mark.parametrize("root", [0, 17, 30, 66])
def test_maps_equal_a_search_with_single_nodes(maps: MotionMaps, root: int) -> None:
    rows = entries(maps, root)
    a = maps.arrays
    place = np.empty(rows.stop - rows.start, np.int64)
    place[a.order[rows]] = a.key[rows]
    cells = [((k >> 24) - 2**19, (k >> 4 & (2**20 - 1)) - 2**19, k & 15) for k in place.tolist()]
    ours = list(zip(cells, a.node[rows].tolist(), a.level[rows].tolist(), strict=True))
    slow = slow_map(GRAPH, root, depth=2, reach=2.2)
    assert ours == [(cell, node, level) for cell, node, level, _ in slow]
    branches: list[tuple[int, ...]] = []
    for parent, edge in zip(a.parent[rows].tolist(), a.edge[rows].tolist(), strict=True):
        branches.append(() if parent < 0 else (*branches[parent], edge))
    assert branches == [edges for *_, edges in slow]


def test_every_entry_ends_where_its_branch_leads(maps: MotionMaps) -> None:
    a = maps.arrays
    for root in range(0, len(GRAPH.node_frames), 7):
        rows = entries(maps, root)
        starts, walked = [np.zeros(3)], [0.0]
        for row in range(rows.start + 1, rows.stop):
            above = rows.start + a.parent[row]
            assert a.parent[row] < row - rows.start
            assert a.level[row] == a.level[above] + 1
            assert GRAPH.edge_target[a.edge[row]] == a.node[row]
            assert GRAPH.edge_start[a.node[above]] <= a.edge[row] < GRAPH.edge_start[a.node[above] + 1]
            end = compose(starts[a.parent[row]], GRAPH.node_motion[a.node[above]])
            starts.append(pose_after(GRAPH, int(a.edge[row]), 0.0, end))
            blend_offset = np.hypot(*(starts[-1] - end)[:2])
            walked.append(walked[a.parent[row]] + GRAPH.node_length[a.node[above]] + 2.0 * blend_offset)
        assert a.average[root] == pytest.approx(np.mean(walked), abs=1e-5)
        for row in range(rows.start, rows.stop):
            entry = a.order[row]
            node = a.node[rows.start + entry]
            x, y, meters, level, behavior = a.ahead[row].tolist()
            assert (x, y) == pytest.approx(compose(starts[entry], GRAPH.node_motion[node])[:2], abs=5e-6)
            beyond = walked[entry] + GRAPH.node_length[node] - GRAPH.node_length[root]
            assert meters == pytest.approx(beyond, abs=1e-5)
            assert (level, behavior) == (a.level[rows.start + entry], GRAPH.node_behavior[node])


def test_any_number_of_workers_and_batches_grows_the_same_maps(
    maps: MotionMaps, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[int, int]] = []
    many = MotionMaps.build(
        GRAPH, depth=2, reach=2.2, max_entries=100_000, progress=lambda *done: told.append(done), workers=3
    )
    assert all(np.array_equal(one, other) for one, other in zip(maps.arrays, many.arrays, strict=True))
    nodes = len(GRAPH.node_frames)
    assert len(told) >= 10
    assert told[-1] == (nodes, nodes)
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    monkeypatch.setattr("crowdsim.following.maps.motion_maps._ROWS_AT_ONCE", 1)
    single = MotionMaps.build(GRAPH, depth=2, reach=2.2, max_entries=100_000)
    assert all(np.array_equal(one, other) for one, other in zip(maps.arrays, single.arrays, strict=True))


def test_keys_ascend_and_orders_are_permutations(maps: MotionMaps) -> None:
    a = maps.arrays
    for root in range(len(GRAPH.node_frames)):
        rows = entries(maps, root)
        assert np.all(np.diff(a.key[rows]) >= 0)
        assert np.array_equal(np.sort(a.order[rows]), np.arange(rows.stop - rows.start))
    assert maps.cell_count < maps.entry_count == len(a.key)


def test_idle_nodes_are_roots_only(maps: MotionMaps) -> None:
    below = maps.arrays.level > 0
    assert not GRAPH.node_idle[maps.arrays.node[below]].any()
    idle = int(np.flatnonzero(GRAPH.node_idle)[0])
    rows = entries(maps, idle)
    assert rows.stop - rows.start > 10


def test_all_successors_fit_under_the_smallest_cap() -> None:
    maps = MotionMaps.build(GRAPH, max_entries=1)
    for root in range(len(GRAPH.node_frames)):
        rows = entries(maps, root)
        targets = GRAPH.edge_target[GRAPH.edge_start[root] : GRAPH.edge_start[root + 1]]
        singles = maps.arrays.node[rows][maps.arrays.level[rows] == 1]
        assert sorted(singles.tolist()) == sorted(targets[~GRAPH.node_idle[targets]].tolist())


def test_families_join_nodes_with_the_same_successors(maps: MotionMaps) -> None:
    parts = pieces()
    ends = [p.end for p in parts]
    family = maps.arrays.family
    for i in range(len(parts)):
        for j in range(i):
            assert (family[i] == family[j]) == (ends[i] == ends[j])


def test_nodes_are_late_by_what_they_take_beyond_the_mean_speed_of_their_behavior(maps: MotionMaps) -> None:
    """Nodes that move less than 15 cm are late as a whole; no node is early."""
    for behavior in range(3):
        nodes = [n for n in range(len(GRAPH.node_frames)) if GRAPH.node_behavior[n] == behavior]
        seconds = {n: GRAPH.node_frames[n] / 60.0 for n in nodes}
        moved = {n: float(np.linalg.norm(GRAPH.node_motion[n, :2])) for n in nodes}
        walking = [n for n in nodes if moved[n] >= 0.15]
        speed = sum(moved[n] for n in walking) / sum(seconds[n] for n in walking)
        for n in nodes:
            assert maps.arrays.late[n] == pytest.approx(max(seconds[n] - moved[n] / speed, 0.0), abs=1e-12)


def test_three_quarters_of_the_nodes_that_move_are_slower_than_the_speed_of_their_behavior(maps: MotionMaps) -> None:
    """Nodes that move less than 15 cm do not count."""
    for behavior in range(3):
        speeds = sorted(
            float(np.linalg.norm(GRAPH.node_motion[n, :2])) * 60.0 / float(GRAPH.node_frames[n])
            for n in range(len(GRAPH.node_frames))
            if GRAPH.node_behavior[n] == behavior and np.linalg.norm(GRAPH.node_motion[n, :2]) >= 0.15
        )
        assert maps.arrays.speeds[behavior] == pytest.approx(speeds[3 * len(speeds) // 4])


def test_outlines_follow_the_tracks(maps: MotionMaps) -> None:
    a = maps.arrays
    for n in range(len(GRAPH.node_frames)):
        outline = a.outline[a.outline_first[n] : a.outline_first[n + 1]]
        np.testing.assert_allclose(outline[-1, :2], GRAPH.node_motion[n, :2], atol=1e-9)
        assert outline[-1, 2] == pytest.approx(GRAPH.node_length[n])
        assert np.all(np.diff(outline[:, 2]) <= 0.1 + 1e-9)


@pytest.mark.parametrize("wrong", [{"depth": 0}, {"reach": 0.0}, {"max_entries": 0}, {"workers": 0}])
def test_wrong_numbers_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(MotionError, match="motion maps need"):
        MotionMaps.build(GRAPH, **wrong)
