"""The benchmark of motion maps, on a few trials."""

import json

import numpy as np
import pytest

from crowdsim.bench.motions import motion_maps


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


def test_arrivals_hold_what_was_asked_for(measured):
    rows = {row["search"]: row for row in measured.rows if row["table"] == "arrivals"}
    assert set(rows) == {"to a stand", "to a stand, bent", "with a heading", "to a stand with a heading, bent"}
    for row in rows.values():
        assert row["success_percent"] >= 50.0
        assert row["held_percent"] == 100.0
        assert 0.0 <= row["off_degrees"] <= 15.0
    assert 0.01 < rows["to a stand"]["off_m"] <= 0.1
    assert max(row["off_m"] for row in rows.values() if "bent" in row["search"]) <= 0.01


def test_astar_stands_beside_maps(measured):
    rows = {(row["table"], row["search"]): row for row in measured.rows if row["table"].startswith("beside")}
    assert set(rows) == {(f"beside {name}", search) for name in ("A*", "A*-Ch") for search in (name, "maps")}
    assert all(row["trials"] == 2 for row in rows.values())


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert not np.isnan(list(measured.figures.values())).any()
    assert {tuple(row) for row in measured.rows} == {tuple(measured.rows[0])}
    assert {"success_default", "search_ms_median", "length_ratio_mean", "maps_mb", "maps_s"} <= set(measured.figures)
    assert set(measured.headline) <= set(measured.figures)


def test_maps_are_as_deep_as_is_asked():
    asked = {"depth": 2, "reach": 1e3, "max_entries": 100_000}
    measured = motion_maps.measure(trials=3, beside=0, depth=asked)
    rows = [row for row in measured.rows if row["table"] == "maps"]
    assert [(row["search"], row["depth"]) for row in rows] == [("maps", 2), ("maps, discs alone", 2)]
