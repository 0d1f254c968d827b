"""The benchmark of searching motion graphs, on one small environment."""

import json

import numpy as np
import pytest

from crowdsim.bench.motions import motion_search
from crowdsim.bench.motions.thinned_graph import thinned
from crowdsim.motion.analysis.capture_sets import as_sources, read_clips
from crowdsim.motion.captures.bvh_writer import write_bvh
from crowdsim.motion.graph.motion_graph import build_motion_graph
from crowdsim.motion.synthesis.library import motion_database
from crowdsim.motion.synthesis.styles import HAPPY
from tests.unit.following.walking_graph import graph_of, pieces


@pytest.fixture(scope="module")
def measured():
    return motion_search.measure(densities=(0.04,), queries=4, budget=1_500)


def test_channels_need_no_collision_test_and_bent_branches_arrive(measured):
    rows = {row["search"]: row for row in measured.rows if row["edges"] == "all"}
    assert len(rows) == 5
    assert len(measured.rows) == 10
    assert rows["channel"]["collision_tests"] == rows["channel, bent"]["collision_tests"] == 0
    assert measured.figures["all_compared"] >= 1
    assert measured.figures["all_collision_tests_ratio"] >= 10.0
    assert measured.figures["all_bent"] >= 2
    assert measured.figures["all_bent_most_off_mm"] <= 1.0
    assert measured.figures["few_bent_most_off_mm"] <= 1.0
    for where in ("channel", "collision tests"):
        assert rows[where]["bent"] == 0
        assert rows[f"{where}, bent"]["found"] >= rows[where]["found"]
        assert rows[f"{where}, bent"]["expansions"] <= rows[where]["expansions"]


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert np.isfinite(list(measured.figures.values())).all()
    assert {tuple(row) for row in measured.rows} == {tuple(measured.rows[0])}


def test_a_thinned_graph_keeps_the_edges_that_turn_farthest_and_stays_connected():
    graph = graph_of(pieces())
    graph = graph._replace(edge_high=graph.edge_high + 1e-3 * np.arange(len(graph.edge_high)))
    thin = thinned(graph, 4)
    count = len(thin.node_frames)
    assert 4 <= count < len(graph.node_frames)
    assert np.diff(thin.edge_start).max() <= 4
    reached = {0}
    for _ in range(count):
        reached |= {int(t) for n in reached for t in thin.edge_target[thin.edge_start[n] : thin.edge_start[n + 1]]}
    assert len(reached) == count
    for node in range(count):
        old = int(np.flatnonzero(graph.node_track == thin.node_track[node])[0])
        edges = np.arange(graph.edge_start[old], graph.edge_start[old + 1])
        widest = np.sort(graph.edge_high[edges])[-4:]
        kept = thin.edge_high[thin.edge_start[node] : thin.edge_start[node + 1]]
        assert set(kept.tolist()) <= set(widest.tolist())


def test_the_standard_graph_of_captures_takes_far_more_segments(tmp_path):
    for clip in motion_database(HAPPY):
        if clip.name in ("walk", "walk_left_45", "walk_right_45"):
            write_bvh(clip, tmp_path / f"{clip.name}.bvh")
    radii, graphs = motion_search._graphs(tmp_path)
    # The set that is walked with has nodes that are made of the captures, too; these are the captured ones.
    captured = build_motion_graph(as_sources(read_clips(sorted(tmp_path.glob("*.bvh")))))
    assert len(graphs["standard"].node_frames) > 5 * captured.report.nodes
    assert len(graphs["standard"].node_frames) > len(graphs["all"].node_frames)
    place = motion_search._environment(0.02, 2, 0)
    probes = motion_search.body_probes(graphs["all"], radii)
    features = {
        search: motion_search._search_all(search, graphs["all"], probes, place, 1_000, passes=1)
        for search in ("collision tests", "channel")
    }
    rows, figures = motion_search._standard(graphs["standard"], radii, [place], features, 1_000)
    assert [row["search"] for row in rows] == ["collision tests", "channel"]
    assert rows[1]["collision_tests"] == 0
    assert np.isfinite(list(figures.values())).all()
    assert figures["standard_nodes"] == len(graphs["standard"].node_frames)
