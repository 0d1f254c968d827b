"""Drift of planted feet: of feet that are known to slide, of the default set, and across its transitions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crowdsim.library import library_folder
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.analysis.standard_graph import build_standard_graph
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.graph.foot_contacts import Feet, foot_points, stances
from crowdsim.motion.graph.motion_graph import CAPTURED_DRIFT, MotionSource, build_motion_graph
from crowdsim.motion.graph.transition_drift import clip_stances, skating_edges, transition_drifts
from tests.reference.transition_play import drift_of_edge
from tests.unit.motion.graph.test_default_graph import default_sources
from tests.unit.motion.walker import walk

CLIPS = sorted(library_folder("behaviors").glob("*/clips/*.bvh"))


def one_point(places: np.ndarray) -> Feet:
    """Feet of one point each: the left one at ``places`` (F, 3), the right one in the air."""
    points = np.stack([places, np.full_like(places, 0.5)], axis=1)[:, :, None]
    return Feet(points, np.zeros((2, 1)), np.zeros(2))


def test_a_foot_that_stands_does_not_drift() -> None:
    (found,) = stances(one_point(np.zeros((40, 3))))
    assert (found.foot, found.first, found.last, found.drift) == (0, 0, 39, 0.0)


def test_a_foot_that_slides_drifts_as_far_as_it_slides() -> None:
    places = np.zeros((41, 3))
    places[:, 0] = 0.02 * np.sin(np.linspace(0.0, 2.0 * np.pi, 41))
    (found,) = stances(one_point(places))
    assert found.drift == pytest.approx(0.04, abs=1e-4)


@pytest.mark.parametrize("way", [np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.0, 0.01])])
def test_a_foot_that_swings_or_lands_is_not_planted(way: np.ndarray) -> None:
    still = np.zeros((30, 3))
    moving = np.cumsum(np.tile(way, (30, 1)), axis=0)
    found = stances(one_point(np.concatenate([still, moving])))
    assert len(found) == 1
    assert found[0].last <= 30
    assert found[0].drift < 1e-9


def test_what_touches_the_floor_for_a_moment_is_no_stance() -> None:
    places = np.full((60, 3), 0.3)
    places[20:25] = 0.0
    assert stances(one_point(places)) == []


def test_a_foot_rolls_over_its_points() -> None:
    """Heel and ball take turns: each moves while the other stands."""
    heel, ball = np.zeros((40, 3)), np.zeros((40, 3))
    ball[:20, 0] = 0.002 * np.arange(20) - 0.04
    heel[20:, 0] = 0.002 * np.arange(20)
    points = np.stack([np.stack([heel, ball], axis=1), np.full((40, 2, 3), 0.5)], axis=1)
    (found,) = stances(Feet(points, np.zeros((2, 2)), np.zeros(2)))
    assert found.drift < 0.003


def test_a_foot_that_points_straight_down_at_rest_has_its_heel_behind_the_ankle() -> None:
    skeleton = walk(steps=2).skeleton
    offsets = skeleton.offsets.copy()
    offsets[skeleton.joint("left_toe"), :2] = 0.0
    _, places = foot_points(replace(skeleton, offsets=offsets), np.array([0.08, 0.08]))
    assert places[0, 0].tolist() == [-HEEL_BACK, 0.0, -0.08]
    assert np.isfinite(places).all()


@pytest.mark.parametrize("path", CLIPS, ids=lambda path: f"{path.parent.parent.name}/{path.stem}")
def test_planted_feet_of_the_default_set_drift_at_most_a_centimeter(path: Path) -> None:
    found = clip_stances(read_clip(path))
    assert {stance.foot for stance in found} == {0, 1}
    assert max(stance.drift for stance in found) <= 0.01


def test_transitions_of_the_default_set_drift_at_most_a_centimeter() -> None:
    sources = default_sources()
    renamed = [replace(s, clip=replace(s.clip, name=str(i))) for i, s in enumerate(sources)]
    drift = transition_drifts(build_motion_graph(renamed), [s.clip for s in renamed])
    assert len(drift.edge) > 1000
    assert drift.played.max() <= 0.01


def test_drift_across_transitions_is_that_of_the_slow_twin() -> None:
    clips = [walk(steps=9, name="straight"), walk(steps=10, step_length=0.64, turn=1.2, name="left")]
    graph = build_motion_graph([MotionSource(clip, 0, ("crossing", "standing")) for clip in clips])
    drift = transition_drifts(graph, clips)
    assert drift.added.max() > 0.001
    for edge, played, added in zip(drift.edge.tolist(), drift.played, drift.added, strict=True):
        expected = drift_of_edge(graph, edge, {clip.name: clip for clip in clips})
        assert (played, added) == pytest.approx(expected, abs=1e-5)


def test_no_transition_between_captures_adds_more_than_half_a_centimeter(shared: Path) -> None:
    """All 44 of them. Those that would add more are left out, and they are few."""
    clips = read_clips(sorted((shared / "mocap").glob("*.bvh")))
    sources = as_sources(clips)
    graph = build_motion_graph(sources, most_drift=CAPTURED_DRIFT)
    drift = transition_drifts(graph, clips)
    assert drift.added.max() <= CAPTURED_DRIFT == 0.005
    assert np.median(drift.added) < 0.001
    assert len(drift.edge) == graph.report.transitions > 800
    assert 0 < graph.report.skating < 0.03 * len(drift.edge)
    every = build_motion_graph(sources)
    assert every.report.skating == 0
    assert int((transition_drifts(every, clips).added > CAPTURED_DRIFT).sum()) == graph.report.skating


def test_a_standard_graph_leaves_out_what_skates_as_well(shared: Path) -> None:
    clips = read_clips(sorted((shared / "mocap").glob("16_[12][13579]*.bvh")))
    sources = as_sources(clips)
    every, rest = (build_standard_graph(sources, most_drift=most) for most in (None, 0.002))
    added = transition_drifts(every, clips).added
    assert transition_drifts(rest, clips).added.max() <= 0.002 < added.max()
    assert rest.report.skating == int((added > 0.002).sum())
    assert rest.report.transitions >= 0.8 * every.report.transitions


def test_what_skates_is_named_by_the_nodes_it_joins() -> None:
    clips = [walk(steps=9, name="straight"), walk(steps=10, step_length=0.64, turn=1.2, name="left")]
    graph = build_motion_graph([MotionSource(clip, 0, ("crossing", "standing")) for clip in clips])
    drift = transition_drifts(graph, clips)
    most = float(np.median(drift.added))
    pairs = {(int(a), int(b)) for a, b in skating_edges(graph, clips, most).T}
    source = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    edges = drift.edge[drift.added > most]
    assert len(edges) > 0
    assert pairs == {(int(source[e]), int(graph.arrays.edge_target[e])) for e in edges}
