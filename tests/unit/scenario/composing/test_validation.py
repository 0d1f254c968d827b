"""Validation: a problem of an exit or a route that several groups share is reported once."""

from typing import Any

import pytest

from crowdsim.errors import ScenarioError
from crowdsim.scenario.scenario import Scenario


@pytest.mark.parametrize(
    ("shared", "way", "key"),
    [
        ({"exits": [{"name": "west", "rectangle": [20, 0, 21, 1]}]}, {"exits": "all"}, "exits.0"),
        (
            {"routes": [{"name": "loop", "through": [{"point": [20, 20]}]}]},
            {"route": "loop", "goal": {"point": [8, 5]}},
            "routes.0.through.0",
        ),
    ],
)
def test_a_problem_that_groups_share_is_reported_once(shared: dict[str, Any], way: dict[str, Any], key: str) -> None:
    starts = {"first": [1, 1], "second": [3, 1]}
    agents = [{"name": name, "count": 1, "start": {"point": point}, **way} for name, point in starts.items()]
    with pytest.raises(ScenarioError) as caught:
        Scenario(floor={"rectangle": [0, 0, 10, 6]}, agents=agents, **shared)
    assert [problem.key for problem in caught.value.problems] == [key]
