"""The benchmark of crowds, on a few agents."""

import json

import numpy as np
import pytest

from crowdsim.bench.crowds import crowd, levels, shown_bodies, step_times, whole_runs
from crowdsim.crowd.captured_crowd import CapturedCrowd


@pytest.fixture(scope="module")
def measured():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(step_times, "AGENT_STEPS", 100)
        patch.setattr(whole_runs, "STEPS", 6)
        patch.setattr(shown_bodies, "STEPS", 4)
        patch.setattr(crowd, "SIMULATED", 60)
        patch.setattr(crowd, "POSED", 12)
        patch.setattr(levels, "STEPS", 8)
        patch.setattr(levels, "SETTLING", 40)
        yield crowd.measure(crowds=((30, 0.25), (60, 3.0)), levels=(12, 40), mixed=30)


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


def test_levels_of_captured_characters_are_told_by_stage(measured):
    figures = measured.figures
    for agents in (12, 40):
        stages = sum(figures[f"captured_{agents}_{name}_ms"] for name in levels.STAGES)
        assert figures[f"captured_{agents}_whole_ms"] == pytest.approx(stages, abs=0.02)
        assert figures[f"captured_{agents}_choose_ms"] > 0.0
        assert 0.5 * agents < figures[f"captured_{agents}_admitted_in_second"] <= figures[f"captured_{agents}_present"]
        assert figures[f"captured_{agents}_present"] <= agents
    assert figures["captured_12_to_40_times_a_tenfold"] > 0.0
    assert 0.0 < figures["mixed_30_captured_share"] <= 1.0
    assert set(measured.headline) <= set(figures)


def test_a_step_by_stage_is_the_step_of_the_crowd():
    hashes = []
    for step in (levels.staged_step, lambda crowd: (crowd.advance(), crowd.begin_work(), crowd.end_step())):
        scenario, cast = levels.captured_square(20)
        run = CapturedCrowd(scenario, 1, None, cast)
        for _ in range(60):
            step(run)
        hashes.append(run.hash)
        run.close()
    assert hashes[0] == hashes[1]
