"""What docs/scenarios.md says of the file is what the reader knows."""

import re
from pathlib import Path

from crowdsim.scenario.agent_keys import AgentGroup
from crowdsim.scenario.check import check_scenario
from crowdsim.scenario.event_keys import ACTIONS
from crowdsim.scenario.loader import parse_scenario

TEXT = (Path(__file__).parents[3] / "docs" / "scenarios.md").read_text(encoding="utf-8")


def test_the_whole_scenario_is_valid_and_shows_every_action():
    (body,) = re.findall(r"^```yaml\n(.*?)^```", TEXT, re.M | re.S)
    scenario = parse_scenario(body)
    assert check_scenario(scenario) == []
    assert {event.action for event in scenario.events} == set(ACTIONS)


def test_every_key_of_a_group_is_described():
    table = TEXT[TEXT.index("## Characters") : TEXT.index("## Doors")]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.M)) == set(AgentGroup.model_fields)
