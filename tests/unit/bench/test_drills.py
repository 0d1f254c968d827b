"""Benchmarks of steered crowds on few agents."""

from __future__ import annotations

import numpy as np
import pytest

from crowdsim.bench.crowds import drill_table, drills
from crowdsim.bench.crowds.rvo2 import Rvo2
from crowdsim.errors import CrowdSimError


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
