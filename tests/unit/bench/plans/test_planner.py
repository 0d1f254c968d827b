"""The benchmark of planners, with few goals."""

import json

import pytest

from crowdsim.bench.plans import planner, planner_comparison

pytest.importorskip("fcl")


def test_every_planner_has_a_row_for_each_place_and_distance(monkeypatch, tmp_path):
    monkeypatch.setattr(planner, "STEPS", (5,))
    monkeypatch.setattr(planner, "DENSITIES", ("normal",))
    monkeypatch.setattr(planner_comparison, "PLACES", ("normal", "small_house"))
    measured = planner.measure(goals=3, picture=tmp_path / "times.png", worlds=tmp_path, queries=4)
    assert [row["planner"] for row in measured.rows] == [*planner.PLANNERS, "layered", "layered"]
    assert measured.rows[-2]["note"].startswith("4 queries")
    assert measured.rows[-1]["place"] == "small_house"
    assert "--worlds" in measured.rows[-1]["note"]
    assert 0.0 < measured.figures["layered_over_literal_mean_normal"] <= 1.0 + 1e-6
    assert "layered_over_literal_mean_small_house" not in measured.figures
    assert {tuple(row) for row in measured.rows} == {tuple(measured.rows[0])}
    assert {"layered_ms_normal_5", "greedy_literal_ms_normal_5", "layered_over_greedy_cost_max", "gap_mean"} <= set(
        measured.figures
    )
    assert measured.figures["layered_over_greedy_cost_max"] <= 1.0 + 1e-6
    assert measured.figures["ratio_3d_over_layered_normal_5"] > 1.0
    assert (tmp_path / "times.png").stat().st_size > 1000
    json.dumps(measured.rows)
