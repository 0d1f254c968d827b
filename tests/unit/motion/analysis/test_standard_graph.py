"""Standard graphs, the threshold that gives a wanted branching, and one graph on every run."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.analysis.error_image import error_image, valleys
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.captures.retargeting import on_one_skeleton, retarget
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from tests.unit.motion.walker import walk

DETECTORS = ("crossing", "standing")


def walks() -> list[MotionSource]:
    clips = [
        walk(steps=9, name="straight"),
        walk(steps=10, turn=1.0, name="left"),
        walk(steps=10, turn=-1.0, name="right"),
    ]
    return [MotionSource(clip, 0, DETECTORS) for clip in clips]


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return build_standard_graph(walks())


def ends(name: str) -> tuple[str, int, int]:
    clip, _, frames = name.partition(":")
    first, _, last = frames.partition("-")
    return clip, int(first), int(last)


def test_edges_are_the_valleys_and_what_goes_on(graph: MotionGraph) -> None:
    sources = walks()
    image = error_image([s.clip for s in sources])
    first = {s.clip.name: int(row) for s, row in zip(sources, image.clip_first, strict=False)}
    allowed = set(zip(*(part.tolist() for part in valleys(image, 0.06)), strict=True))
    order = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    transitions = 0
    for source, target in zip(order, graph.arrays.edge_target, strict=True):
        a, b = ends(graph.node_names[source]), ends(graph.node_names[target])
        if (a[0], a[2]) != (b[0], b[1]):
            transitions += 1
            assert (first[a[0]] + a[2], first[b[0]] + b[1]) in allowed
    assert transitions == graph.report.transitions > 0
    assert graph.report.edges - transitions > 0


def test_all_nodes_reach_each_other(graph: MotionGraph) -> None:
    reach = np.eye(graph.report.nodes, dtype=bool)
    reach[np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start)), graph.arrays.edge_target] = True
    for _ in range(int(np.ceil(np.log2(graph.report.nodes))) + 1):
        reach = reach @ reach
    assert reach.all()


def test_the_feature_graph_is_better_connected(graph: MotionGraph) -> None:
    features = build_motion_graph(walks())
    assert features.report.nodes < graph.report.nodes
    assert features.report.branching > graph.report.branching


def test_best_transitions_only(graph: MotionGraph) -> None:
    capped = build_standard_graph(walks(), max_out_edges=1)
    assert 0 < capped.report.transitions < graph.report.transitions
    assert np.diff(capped.arrays.edge_start).max() <= 2


def test_too_small_a_threshold_is_refused_with_a_remedy() -> None:
    with pytest.raises(MotionError, match="raise"):
        build_standard_graph([MotionSource(walk(steps=2), 0, DETECTORS)], 1e-9)


def test_threshold_for_a_wanted_branching() -> None:
    whole = build_motion_graph(walks(), 0.3)
    wanted = whole.report.branching - 0.1
    found = build_motion_graph(walks(), branching=wanted)
    assert found.report.threshold <= 0.3
    assert 2 * found.report.nodes >= whole.report.nodes
    again = build_motion_graph(walks(), found.report.threshold)
    assert again.report.transitions == found.report.transitions
    for threshold in np.linspace(0.02, 0.3, 40):
        other = build_motion_graph(walks(), float(threshold))
        if 2 * other.report.nodes >= whole.report.nodes:
            assert abs(other.report.branching - wanted) >= abs(found.report.branching - wanted) - 1e-12


def digest(graph: MotionGraph) -> str:
    whole = hashlib.sha256(repr((graph.node_names, graph.report)).encode())
    for array in (*graph.arrays, *graph.poses):
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()


@pytest.mark.parametrize("build", [build_motion_graph, build_standard_graph])
def test_graphs_are_equal_on_every_run(build, shared: Path) -> None:
    names = ("16_15_walk_straight_slow_a", "16_11_walk_veer_left_slow_a", "16_31_walk_straight_from_standstill")

    def built() -> MotionGraph:
        clips = [read_clip(shared / "mocap" / f"{name}.bvh") for name in names]
        return build([MotionSource(clip, 0, DETECTORS) for clip in clips])

    assert digest(built()) == digest(built())


def test_another_person_walks_on_the_first_ones_legs(shared: Path) -> None:
    names = ("16_15_walk_straight_slow_a", "135_11_lateral_side_steps_with_side_kicks")
    one, other = (read_clip(shared / "mocap" / f"{name}.bvh") for name in names)
    moved = on_one_skeleton([one, other])[1]
    assert moved.skeleton is one.skeleton
    assert (moved.rotations == other.rotations).all()
    ratio = one.skeleton.leg_length() / other.skeleton.leg_length()
    span = np.ptp(moved.root_positions[:, :2], axis=0) / np.ptp(other.root_positions[:, :2], axis=0)
    assert span == pytest.approx(ratio)
    assert moved.joint_positions[..., 2].min() == pytest.approx(other.joint_positions[..., 2].min(), abs=1e-9)
    assert retarget(one, one.skeleton).root_positions is one.root_positions


def test_other_joints_are_refused(shared: Path) -> None:
    capture = read_clip(shared / "mocap" / "16_15_walk_straight_slow_a.bvh")
    with pytest.raises(MotionError, match="other joints"):
        retarget(walk(steps=2), capture.skeleton)
