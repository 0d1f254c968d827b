import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.following.motion_maps import MotionMaps
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


def test_every_entry_starts_where_its_branch_leads(maps: MotionMaps) -> None:
    a = maps.arrays
    for root in range(0, len(GRAPH.node_frames), 7):
        rows = entries(maps, root)
        for row in range(rows.start + 1, rows.stop):
            above = rows.start + a.parent[row]
            assert a.parent[row] < row - rows.start
            assert a.level[row] == a.level[above] + 1
            assert GRAPH.edge_target[a.edge[row]] == a.node[row]
            assert GRAPH.edge_start[a.node[above]] <= a.edge[row] < GRAPH.edge_start[a.node[above] + 1]
            end = compose(a.pose[above], GRAPH.node_motion[a.node[above]])
            np.testing.assert_allclose(a.pose[row], pose_after(GRAPH, int(a.edge[row]), 0.0, end), atol=2e-6)
            assert a.length[row] == pytest.approx(a.length[above] + GRAPH.node_length[a.node[above]], abs=1e-5)


def test_keys_ascend_and_orders_are_permutations(maps: MotionMaps) -> None:
    a = maps.arrays
    for root in range(len(GRAPH.node_frames)):
        rows = entries(maps, root)
        assert np.all(np.diff(a.key[rows]) >= 0)
        assert np.array_equal(np.sort(a.order[rows]), np.arange(rows.stop - rows.start))
        assert a.average[root] == pytest.approx(a.length[rows].mean(dtype=np.float64))
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


def test_outlines_follow_the_tracks(maps: MotionMaps) -> None:
    a = maps.arrays
    for n in range(len(GRAPH.node_frames)):
        outline = a.outline[a.outline_first[n] : a.outline_first[n + 1]]
        np.testing.assert_allclose(outline[-1, :2], GRAPH.node_motion[n, :2], atol=1e-9)
        assert outline[-1, 2] == pytest.approx(GRAPH.node_length[n])
        assert np.all(np.diff(outline[:, 2]) <= 0.1 + 1e-9)


@pytest.mark.parametrize("wrong", [{"depth": 0}, {"reach": 0.0}, {"max_entries": 0}])
def test_wrong_numbers_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(MotionError, match="motion maps need"):
        MotionMaps.build(GRAPH, **wrong)
