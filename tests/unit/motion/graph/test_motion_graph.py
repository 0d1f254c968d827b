"""Motion graphs of the procedural walker and of captures."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.geometry.planar import transform_points
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.graph.segmentation import segment_clip
from tests.reference.motion_distance import shortest_stop
from tests.unit.motion.walker import walk

DETECTORS = ("crossing", "standing")


def idle_clip() -> Clip:
    clip = walk(stand=50)
    return Clip("idle", clip.skeleton, clip.root_positions[:40], clip.rotations[:40])


def sources() -> list[MotionSource]:
    return [
        MotionSource(walk(steps=9, name="straight"), 1, DETECTORS),
        MotionSource(walk(steps=10, turn=1.0, name="left"), 1, DETECTORS),
        MotionSource(walk(steps=10, turn=-1.0, name="right"), 1, DETECTORS),
        MotionSource(walk(steps=2, step_length=0.3, facing=np.pi / 2, name="side"), 0, ("standing",)),
        MotionSource(idle_clip(), 1, (), idle=True),
    ]


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_motion_graph(sources())


def edge_sources(graph: MotionGraph) -> np.ndarray:
    return np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))


def test_all_behaviors_and_the_idle_are_in_one_component(graph: MotionGraph) -> None:
    arrays = graph.arrays
    assert set(arrays.node_behavior) == {0, 1}
    assert arrays.node_idle.sum() == 1
    reach = np.eye(graph.report.nodes, dtype=bool)
    reach[edge_sources(graph), arrays.edge_target] = True
    for _ in range(graph.report.nodes):
        reach = reach @ reach
    assert reach.all()


def test_shapes_and_types_are_those_of_graph_arrays(graph: MotionGraph) -> None:
    arrays, n, e = graph.arrays, graph.report.nodes, graph.report.edges
    for name in ("node_frames", "node_track", "node_behavior", "stop_edge"):
        assert getattr(arrays, name).dtype == np.int32
        assert getattr(arrays, name).shape == (n,)
    assert arrays.edge_start.dtype == arrays.edge_target.dtype == np.int32
    assert arrays.edge_start[-1] == e == len(arrays.edge_target)
    assert arrays.tracks.shape == (int((arrays.node_frames + 1).sum()), 3)
    assert np.allclose(arrays.tracks[arrays.node_track], 0.0)
    assert np.allclose(arrays.tracks[arrays.node_track + arrays.node_frames], arrays.node_motion)
    assert all(array.flags.c_contiguous for array in arrays)
    assert (arrays.edge_low <= 0).all()
    assert (arrays.edge_high >= 0).all()
    t = graph.report.transitions
    assert 0 < t < e
    assert graph.report.branching == pytest.approx((n + 2 * t) / (n + t))
    assert graph.poses.node_frames.tolist() == arrays.node_frames.tolist()


def test_natural_successors_join_without_a_seam(graph: MotionGraph) -> None:
    place = {name: i for i, name in enumerate(graph.node_names)}
    natural = 0
    for edge, (source, target) in enumerate(zip(edge_sources(graph), graph.arrays.edge_target, strict=True)):
        a, b = graph.node_names[source].split(":"), graph.node_names[target].split(":")
        if a[0] == b[0] and a[1].split("-")[1] == b[1].split("-")[0]:
            natural += 1
            assert np.allclose(graph.arrays.edge_transform[edge], 0.0, atol=1e-9)
    assert natural >= 8
    assert len(place) == len(graph.node_names)


def test_the_planted_foot_stays(graph: MotionGraph) -> None:
    """The pivot of every edge, moved by its transform, is one point for source and target."""
    arrays = graph.arrays
    order = edge_sources(graph)
    pivots_of_target: dict[int, np.ndarray] = {}
    for edge, target in enumerate(arrays.edge_target):
        back = arrays.edge_transform[edge]
        c, s = np.cos(back[2]), np.sin(back[2])
        local = np.array([[c, s], [-s, c]]) @ (arrays.edge_pivot[edge] - back[:2])
        known = pivots_of_target.setdefault(int(target), local)
        assert np.allclose(local, known, atol=1e-9)
        assert np.allclose(transform_points(back, local), arrays.edge_pivot[edge])
    assert len(order) == len(arrays.edge_target)


def test_standing_ends_meet_only_standing_starts(graph: MotionGraph) -> None:
    starts_standing = {"idle:0-39": True}
    for source in sources()[:-1]:
        for s in segment_clip(source.clip, source.detectors):
            starts_standing[f"{source.clip.name}:{s.first}-{s.last}"] = s.starts_standing
    for node, target in zip(edge_sources(graph), graph.arrays.edge_target, strict=True):
        assert graph.arrays.node_ends_standing[node] == starts_standing[graph.node_names[target]]


def test_stop_edges_are_the_shortest_ways_to_stand(graph: MotionGraph) -> None:
    arrays = graph.arrays
    for node in range(graph.report.nodes):
        if arrays.node_ends_standing[node]:
            assert arrays.stop_edge[node] == -1
            continue
        meters, at = 0.0, node
        while not arrays.node_ends_standing[at]:
            edge = arrays.stop_edge[at]
            assert arrays.edge_start[at] <= edge < arrays.edge_start[at + 1]
            at = arrays.edge_target[edge]
            meters += arrays.node_length[at] + abs(arrays.node_motion[at, 2])
        assert meters == pytest.approx(shortest_stop(arrays, node, narrowing=True))


def test_stopping_never_widens_the_behavior_where_it_need_not() -> None:
    clips = sources()
    clips[1] = MotionSource(clips[1].clip, 2, DETECTORS)
    arrays = build_motion_graph(clips).arrays
    taken = arrays.stop_edge[arrays.stop_edge >= 0]
    source = np.repeat(np.arange(len(arrays.node_frames)), np.diff(arrays.edge_start))
    assert len(taken) > 0
    assert (arrays.node_behavior[arrays.edge_target[taken]] <= arrays.node_behavior[source[taken]]).all()


def test_an_edge_cap_keeps_the_nearest_and_the_natural(graph: MotionGraph) -> None:
    capped = build_motion_graph(sources(), max_out_edges=2)
    assert capped.report.out_degree <= 3.0
    assert capped.report.edges < graph.report.edges


def test_an_edge_cap_lets_an_idle_clip_repeat() -> None:
    """It ends as other clips start, and starts 1 cm lower itself."""
    clip = idle_clip()
    low = clip.root_positions - np.linspace(0.01, 0.0, 40)[:, None] * [0, 0, 1]
    rising = MotionSource(Clip("idle", clip.skeleton, low, clip.rotations), 1, (), idle=True)
    graph = build_motion_graph([*sources()[:-1], rising], max_out_edges=2)
    (idle,) = np.flatnonzero(graph.arrays.node_idle)
    assert idle in graph.arrays.edge_target[edge_sources(graph) == idle]


def test_building_twice_gives_the_same_bits(graph: MotionGraph) -> None:
    again = build_motion_graph(sources())
    assert all(np.array_equal(a, b) for a, b in zip(graph.arrays, again.arrays, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(graph.poses, again.poses, strict=True))


def test_what_cannot_be_joined_is_reported() -> None:
    squat = walk(steps=6, name="squat")
    low = Clip("squat", squat.skeleton, squat.root_positions - [0, 0, 0.3], squat.rotations)
    graph = build_motion_graph([*sources(), MotionSource(low, 1, DETECTORS)])
    assert any(name.startswith("squat") and "connected" in why for name, why in graph.report.dropped)
    assert not any(name.startswith("squat") for name in graph.node_names)


def test_bad_sets_are_refused_with_a_reason() -> None:
    with pytest.raises(MotionError, match="at least one clip"):
        build_motion_graph([])
    with pytest.raises(MotionError, match="no segment"):
        build_motion_graph([MotionSource(walk(steps=2), 0, ())])
    with pytest.raises(MotionError, match="raise the threshold"):
        build_motion_graph([MotionSource(walk(steps=4), 0, DETECTORS)], threshold=1e-6)
    down = walk(steps=2)
    count = down.frame_count
    drop = np.interp(np.arange(count), [25, count - 25], [0.0, 0.6])[:, None] * [0, 0, 1]
    down = Clip("down", down.skeleton, down.root_positions - drop, down.rotations)
    with pytest.raises(MotionError, match=r"no segments join within 0\.3 m"):
        build_motion_graph([MotionSource(down, 0, ("standing",))], branching=1.5)
    clip = walk()
    s = clip.skeleton
    renamed = Skeleton(("Pelvis", *s.names[1:]), s.parents, s.offsets, s.end_parents, s.end_offsets, s.roles)
    other = Clip("renamed", renamed, clip.root_positions, clip.rotations)
    with pytest.raises(MotionError, match="different skeletons"):
        build_motion_graph([MotionSource(clip, 0, DETECTORS), MotionSource(other, 0, DETECTORS)])
    longer = Skeleton(s.names, s.parents, s.offsets * 1.1, s.end_parents, s.end_offsets, s.roles)
    other = Clip("longer", longer, clip.root_positions, clip.rotations)
    with pytest.raises(MotionError, match="differ by"):
        build_motion_graph([MotionSource(clip, 0, DETECTORS), MotionSource(other, 0, DETECTORS)])


def test_idle_clips_must_last_and_loop() -> None:
    clip = idle_clip()
    single = Clip("blink", clip.skeleton, clip.root_positions[:1], clip.rotations[:1])
    with pytest.raises(MotionError, match="single frame"):
        build_motion_graph([*sources()[:-1], MotionSource(single, 1, (), idle=True)])
    sinking = Clip(
        "sink", clip.skeleton, clip.root_positions - np.linspace(0, 0.3, 40)[:, None] * [0, 0, 1], clip.rotations
    )
    with pytest.raises(MotionError, match="cannot repeat"):
        build_motion_graph([*sources()[:-1], MotionSource(sinking, 1, (), idle=True)])


def test_a_skeleton_without_toes_stands_on_its_ankles() -> None:
    clip = walk(steps=9)
    s = clip.skeleton
    roles = {role: joint for role, joint in s.roles.items() if not role.endswith("toe")}
    bare = Skeleton(s.names, s.parents, s.offsets, s.end_parents, s.end_offsets, roles)
    graph = build_motion_graph([MotionSource(Clip("bare", bare, clip.root_positions, clip.rotations), 0, DETECTORS)])
    assert graph.report.nodes >= 3


def test_slow_walks_of_subject_16_join_as_measured(shared: Path) -> None:
    """FACTS: 24 segments of ten slow walks give 549 transitions at 6 cm under a like metric."""
    files = sorted((shared / "mocap").glob("16_1[1-9]*.bvh")) + sorted((shared / "mocap").glob("16_20*.bvh"))
    graph = build_motion_graph([MotionSource(read_clip(path), 0, ("crossing",)) for path in files])
    assert graph.report.nodes == 24
    assert graph.report.edges == pytest.approx(549, rel=0.1)
    assert (graph.arrays.stop_edge == -1).all()
