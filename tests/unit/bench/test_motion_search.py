"""The benchmark of searching motion graphs, on one small environment."""

import json

import numpy as np
import pytest

from crowdsim.bench import motion_search


@pytest.fixture(scope="module")
def measured():
    return motion_search.measure(densities=(0.04,), queries=4, budget=1_500)


def test_channels_need_no_collision_test_and_bent_branches_arrive(measured):
    rows = {row["search"]: row for row in measured.rows}
    assert len(rows) == 5
    assert rows["channel"]["collision_tests"] == rows["channel, bent"]["collision_tests"] == 0
    assert measured.figures["compared"] >= 1
    assert measured.figures["collision_tests_ratio"] >= 10.0
    assert measured.figures["bent"] >= 2
    assert measured.figures["bent_most_off_mm"] <= 1.0
    for where in ("channel", "collision tests"):
        assert rows[where]["bent"] == 0
        assert rows[f"{where}, bent"]["found"] >= rows[where]["found"]
        assert rows[f"{where}, bent"]["expansions"] <= rows[where]["expansions"]


def test_figures_are_plain_numbers(measured):
    assert json.loads(json.dumps(measured.figures)) == measured.figures
    assert np.isfinite(list(measured.figures.values())).all()
    assert {tuple(row) for row in measured.rows} == {tuple(measured.rows[0])}
