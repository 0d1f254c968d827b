"""Runs and plans come out as ``tests/golden/golden.json`` says, to the bit; ``tools/update_golden.py`` writes it."""

import json

import pytest

from crowdsim.scenario.loader import builtin_scenarios
from tests.support import golden
from tests.support.recorded import Recorded

GOLDEN = json.loads(golden.FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", sorted(builtin_scenarios()))
def test_a_scenario_of_the_library_comes_out_as_it_did(recorded: Recorded, name: str) -> None:
    assert golden.figures_of(recorded(name)) == GOLDEN["scenarios"][name]


@pytest.mark.parametrize("place", golden.PLACES)
def test_plans_cost_what_they_did(place: str) -> None:
    assert golden.plan_costs(place) == GOLDEN["plans"][place]
