"""Going over to captured motion: only to motion that leads on, and not away from it because of a wait."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.mixed.switches import leads_on
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.scenario.loader import parse_scenario

ROOM = "crowdsim: 1\nname: room\nduration: 60\nseed: 1\nfloor: {rectangle: [0, 0, 10, 6]}\nagents:\n"
WAITS = "  - {name: waits, count: 1, start: {point: [1, 3]}, goals: [{point: [8, 3]}, {point: [1, 3]}], wait: 4}\n"


def plan_of(x: list[float]) -> MotionPlan:
    """Nodes of a second each, which begin at these places along the x axis."""
    count = len(x)
    origins = np.column_stack([x, np.zeros(count), np.zeros(count)])
    route: Any = None  # not read
    return MotionPlan(route, 0, np.zeros(3), np.zeros(count, np.int32), origins, np.zeros((count, 3)), arrives=False)


@pytest.mark.parametrize(
    ("x", "leads"),
    [
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], True),
        ([0.0, 0.1, 0.2, 0.1, 0.0, 0.2, 1.0], False),
        ([0.0, 1.0, 2.0, 2.1, 2.2, 2.1, 2.0, 3.0], False),
        ([0.0, 0.2, 0.1, 0.3, 1.5, 3.0], True),
        ([0.0, 0.1, 0.2, 0.1], True),  # not known for four seconds
        ([], True),
    ],
)
def test_motion_that_stays_in_one_place_does_not_lead_on(x: list[float], leads: bool) -> None:
    assert leads_on(plan_of(x), np.array([60], np.int32)) is leads


def test_who_waits_at_a_place_does_not_count_as_held_up() -> None:
    with Simulation(parse_scenario(ROOM + WAITS)) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, MixedCrowd)
        waited = 0
        while simulation.step_count < 300 and waited < 35:
            simulation.step()
            view = crowd.captured.world.view()
            waited += len(view.agent) and not crowd._walks(view)[0]
        # As soon as it is to go on, it has a second to find captured motion.
        assert waited == 35
        while not crowd._walks(crowd.captured.world.view())[0]:
            simulation.step()
        view = crowd.captured.world.view()
        assert crowd._refused(view, crowd._walks(view))[0] <= 0.1
