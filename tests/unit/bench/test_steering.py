"""Benchmarks of steered crowds on few agents."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.bench.crowds import drill_table, drills, steering
from crowdsim.bench.crowds.rvo2 import Rvo2
from crowdsim.errors import CrowdSimError


def test_a_row_for_each_crowd(monkeypatch):
    monkeypatch.setattr(steering, "CROWDS", ((30, 0.25), (40, 3.0)))
    monkeypatch.setattr(steering, "AGENT_STEPS", 100)
    measured = steering.measure()
    assert [row["agents"] for row in measured.rows] == [30, 40]
    assert all(row[f"{stage}_us"] > 0.0 for row in measured.rows for stage in ("sort", "look", "decide", "commit"))
    assert measured.figures["40_at_3_one_thread_us"] > 0.0
    assert "30_at_0.25_rvo2_us" not in measured.figures


def test_a_folder_without_rvo2_is_refused(tmp_path):
    with pytest.raises(CrowdSimError, match=r"src/RVO\.h"):
        Rvo2(tmp_path, tmp_path)


def test_drills_say_who_arrived(monkeypatch):
    monkeypatch.setattr(drill_table, "SEEDS", (1,))
    monkeypatch.setattr(drill_table, "DRILLS", ((drills.door(2, 1.2), 1.2),))
    row = drill_table.measure().rows[0]
    assert row["missing"] == 0
    assert 4.0 < row["last_s"] < 40.0


def test_agents_of_a_drill_do_not_touch():
    state = drills.draw_agents(drills.crossing(10), 1)
    places = np.column_stack((state["x"], state["y"]))
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 9.0 * np.eye(len(state))
    assert apart.min() > 0.52
    with pytest.raises(ValueError, match="find no room"):
        drills.draw_agents(drills.door(200, 1.0), 1)
