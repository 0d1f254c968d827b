"""What cannot run on several processes is named, with what to change."""

import pytest

from crowdsim.crowd.ranked_run import require_ranks
from crowdsim.errors import RanksError
from crowdsim.scenario.loader import parse_scenario

SCENE = """\
crowdsim: 1
name: square
seed: 1
duration: 10
floor: {rectangle: [0, 0, 20, 10]}
agents:
  - {name: people, count: 4, locomotion: steered, start: {rectangle: [1, 1, 5, 9]}, goal: {rectangle: [17, 1, 19, 9]}}
"""


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("locomotion: steered, ", "", "group 'people' is auto; give it 'locomotion: steered'"),
        ("count: 4,", "count: 4, together: 2,", "group 'people' walks in parties; drop 'together'"),
        ("[0, 0, 20, 10]}", "[0, 0, 20, 10], periodic: x}", "the floor is periodic; drop 'periodic'"),
        ("agents:", "commands: [{at: 1, remove_agents: {agents: [0]}}]\nagents:", "it has commands; drop 'commands'"),
    ],
)
def test_each_reason_is_told(old, new, told):
    text = SCENE.replace(old, new)
    if "periodic" in new:
        text = text.replace("goal: {rectangle: [17, 1, 19, 9]}", "goal: {along: +x}")
    with pytest.raises(RanksError, match="or run it without mpiexec") as refused:
        require_ranks(parse_scenario(text))
    assert told in str(refused.value)


def test_steered_groups_are_not_refused():
    require_ranks(parse_scenario(SCENE))
