"""What only a simulation can refuse: it still names the place in the file and the remedy."""

import pytest

import crowdsim


def test_steps_longer_than_the_shortest_movement() -> None:
    with pytest.raises(
        crowdsim.ScenarioError,
        match=r"corridor\.yaml:\d+:\d+: steps_per_second: .*take more steps|--set.*take more steps",
    ):
        crowdsim.Simulation(crowdsim.load_scenario("corridor", ["steps_per_second=1", "agents.0.locomotion=captured"]))
