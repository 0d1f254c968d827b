"""The benchmark of motion maps, on a few trials."""

import json

import numpy as np
import pytest

from crowdsim.bench import motion_maps


@pytest.fixture(scope="module")
def measured():
    return motion_maps.measure(trials=12, entries=(2_000, 20_000), beside=2, astar_budget=1_500)


def test_maps_lead_along_every_path_and_no_shorter_than_it(measured):
    rows = [row for row in measured.rows if row["table"] == "maps"]
    assert [row["search"] for row in rows] == ["maps", "maps", "maps of runs", "maps, discs alone"]
    for row in rows:
        assert row["success_percent"] >= 90.0
        assert 0.95 < row["length_ratio"] < 1.05
        assert 0 < row["cells"] < row["entries"]
    assert rows[0]["entries"] < rows[1]["entries"] < rows[2]["entries"]


def test_bodies_keep_near_the_path_and_exact_arrivals_are_exact(measured):
    figures = measured.figures
    assert figures["joints_excess_m_most_default"] <= 0.02
    assert figures["joints_within_2_cm_percent_default"] == 100.0
    assert figures["joints_excess_m_most_default"] <= figures["joints_excess_m_most_discs_alone_default"]
    assert 0.0 <= figures["standing_off_m_most_default"] <= 0.1
    assert figures["exact_share_percent_default"] >= 50.0
    assert figures["heading_share_percent_default"] >= 50.0
    assert 0.0 <= figures["heading_off_degrees_most_default"] <= 15.0


def test_astar_stands_beside_maps(measured):
    rows = {(row["table"], row["search"]): row for row in measured.rows if row["table"] != "maps"}
    assert set(rows) == {(f"beside {name}", search) for name in ("A*", "A*-Ch") for search in (name, "maps")}
    assert all(row["trials"] == 2 for row in rows.values())


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert not np.isnan(list(measured.figures.values())).any()
    assert {tuple(row) for row in measured.rows} == {tuple(measured.rows[0])}
    assert {"success_default", "search_ms_median", "length_ratio_mean", "maps_mb", "maps_s", "load_ms"} <= set(
        measured.figures
    )
