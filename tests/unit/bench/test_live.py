"""Benchmark of live simulations on few agents."""

from crowdsim.bench.live import hall, measure
from crowdsim.scenario.cast import place_crowd


def test_an_odd_number_of_agents_all_come():
    assert place_crowd(hall("steered", 10, 5)).head_count == 5


def test_a_row_for_each_level():
    measured = measure(seconds=4.0, agents=4)
    assert [row["locomotion"] for row in measured.rows] == ["captured", "auto", "steered"]
    for row in measured.rows:
        assert row["steps"] > 10
        assert row["clicks"] > 0
        assert row["click_steps_most"] >= 1
        assert row["pictures_lost"] >= 0
        assert 0.0 <= row["late_percent"] <= 100.0
