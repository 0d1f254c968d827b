"""The benchmark of steered crowds, on a few agents."""

import json

import numpy as np
import pytest

from crowdsim.bench.crowds import crowd, shown_bodies, step_times, whole_runs


@pytest.fixture(scope="module")
def measured():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(step_times, "AGENT_STEPS", 100)
        patch.setattr(whole_runs, "STEPS", 6)
        patch.setattr(shown_bodies, "STEPS", 4)
        patch.setattr(crowd, "SIMULATED", 60)
        patch.setattr(crowd, "POSED", 12)
        yield crowd.measure(crowds=((30, 0.25), (60, 3.0)))


def test_a_row_for_each_crowd(measured):
    assert [row["agents"] for row in measured.rows] == [30, 60]
    stages = ("sort", "look", "decide", "commit", "advance", "record", "statistics")
    assert all(row[f"{stage}_us"] > 0.0 for row in measured.rows for stage in stages)
    assert "30_at_0.25_rvo2_us" not in measured.figures


def test_a_whole_step_is_the_sum_of_its_parts(measured):
    for row in measured.rows:
        parts = row["advance_us"] + row["record_us"] + row["statistics_us"]
        assert row["whole_us"] == pytest.approx(parts, abs=0.02)
        assert row["core_at_10_hz"] == pytest.approx(row["whole_us"] * row["agents"] * 1e-5, abs=0.01)


def test_an_agent_is_small(measured):
    for row in measured.rows:
        assert 200 < row["state_bytes"] < 2000
        assert row["place_mb"] > 0.0


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert not np.isnan(list(measured.figures.values())).any()
    assert measured.figures["frames_a_second"] > 0.0
