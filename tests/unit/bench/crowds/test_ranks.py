"""The benchmark of runs on several processes, on a small crowd."""

import pytest

from crowdsim.bench.crowds import ranks
from crowdsim.bench.crowds.ranks import PREDICTED, measure


def test_two_processes_give_the_states_of_one_and_the_model_goes_on_from_both(monkeypatch) -> None:
    monkeypatch.setattr(ranks, "MOST_RANKS", 2)  # the tests of ranks have more
    found = measure(200, 1.5, rounds=1)
    measured, predicted = found.rows[:2], found.rows[2:]
    assert [row["ranks"] for row in measured] == [1, 2]
    assert measured[0]["sent_kb_a_step"] == 0.0
    assert measured[1]["sent_kb_a_step"] > 0.0
    assert [row["ranks"] for row in predicted] == list(PREDICTED)
    assert found.figures["runs_with_equal_states"] == 4
    one, whole = found.figures["1_ranks_run_ms"], found.figures["whole_ms"]
    assert whole == pytest.approx(max(2.0 * found.figures["2_ranks_run_ms"] - one, 0.0), abs=0.011)
    for row in predicted:
        assert row["characters"] == 200 * row["ranks"]
        assert row["run_ms"] == pytest.approx(one + (row["ranks"] - 1) * whole, abs=0.01 * row["ranks"])
