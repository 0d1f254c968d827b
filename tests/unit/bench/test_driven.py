"""Benchmark of driven simulations on few agents, and its bar."""

import numpy as np
import pytest

from crowdsim.bench import driven
from crowdsim.crowd.simulation import Simulation


def test_a_row_for_each_level():
    measured = driven.measure(agents=20, steps=5, rounds=1)
    assert [row["locomotion"] for row in measured.rows] == ["steered", "auto", "captured"]
    for row in measured.rows:
        assert 0.0 < row["read_ms"] < row["driven_ms"]
        assert row["run_ms"] > 0.0
        assert row["more_percent"] == row["more_most_percent"]


def test_all_columns_are_read():
    with Simulation(driven.hall("steered", 10, 20)) as simulation:
        simulation.step()
        columns = {name for name, values in vars(simulation.agents).items() if isinstance(values, np.ndarray)}
        assert columns == set(driven.COLUMNS)
        assert driven.read_columns(simulation) > 0.0


@pytest.mark.parametrize("level", ["steered", "auto", "captured"])
def test_driving_a_thousand_agents_costs_at_most_five_percent_more_than_a_run(level):
    # Of three tries the best: how CPU time is counted varies with the load of the machine.
    tries = (driven.compare(level, agents=1000, steps=60) for _ in range(3))
    assert any(cost.more <= driven.MOST_MORE for cost in tries)
