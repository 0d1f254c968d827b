"""Files that a scenario names: a key that is present and null names none."""

from pathlib import Path
from typing import Any

import pytest

from crowdsim.scenario.loader import load_scenario
from crowdsim.scenario.scenario import Scenario

BOX = {"name": "desk", "box": {"min": [3, 3], "max": [4, 3.5]}, "top": 1.0}
WALKERS = {"name": "walkers", "count": 1, "start": {"point": [1, 2]}, "goal": {"point": [7, 2]}}


@pytest.mark.parametrize(
    "keys",
    [
        {"floor": {"rectangle": [0, 0, 8, 4], "file": None}},
        {"motion": {"set": "default", "captures": None}},
        {"obstacles": [{**BOX, "mesh": None}]},
        {"obstacles": [{**BOX, "plan": None}]},
    ],
)
def test_keys_that_are_null_name_no_file(keys: dict[str, Any], tmp_path: Path) -> None:
    scenario = Scenario(**{"floor": {"rectangle": [0, 0, 8, 4]}, "agents": [WALKERS], **keys})
    assert scenario.to_yaml(tmp_path) == scenario.to_yaml()
    scenario.save(tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml").model_dump() == scenario.model_dump()
