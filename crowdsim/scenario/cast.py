"""Place the agents of a checked scenario."""

from __future__ import annotations

from crowdsim.errors import ScenarioError
from crowdsim.scenario.people.crowd_placement import CrowdPlacement, try_crowd_placement
from crowdsim.scenario.people.placement import Placement, try_placement
from crowdsim.scenario.scenario import Scenario


def place_agents(scenario: Scenario, radius: float) -> Placement:
    """Place the agents of a scenario that has captured ones only; see :func:`try_placement`.

    Parameters
    ----------
    scenario : Scenario
        Checked scenario.
    radius : float
        Free floor around the center of each agent [m].

    Raises
    ------
    ScenarioError
        With every region that is off the floor, blocked, or too full.
    """
    placement, complaints = try_placement(scenario, scenario.environment, radius)
    if complaints:
        raise ScenarioError(scenario.problem(*complaint) for complaint in complaints)
    return placement


def place_crowd(scenario: Scenario) -> CrowdPlacement:
    """Place the agents of a scenario in which some may be steered; see :func:`try_crowd_placement`.

    Raises
    ------
    ScenarioError
        With every region that is off the floor, blocked, or too full.
    """
    placement, complaints = try_crowd_placement(scenario, scenario.environment)
    if complaints:
        raise ScenarioError(scenario.problem(*complaint) for complaint in complaints)
    return placement
