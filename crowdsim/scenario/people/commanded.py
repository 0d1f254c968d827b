"""Commands about agents: what is wrong with them."""

from __future__ import annotations

import numpy as np

from crowdsim.scenario.environment import Environment
from crowdsim.scenario.people.arrivals import start_times
from crowdsim.scenario.people.new_goals import new_goal_complaint, region_complaint
from crowdsim.scenario.schema.commands import Added, Command, NewGoal, Removed
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.yamlfile.document import Complaint


class Called:
    """The agents on call of a scenario, and which of them commands have added, or removed for good, so far.

    Attributes
    ----------
    head_count : int
        Number of all agents.
    on_call : dict of str to range
        Numbers of the agents of each group on call, by its name.
    """

    def __init__(self, keys: ScenarioFields) -> None:
        counts = [len(start_times(keys, number)) for number in range(len(keys.agents))]
        firsts = np.concatenate([[0], np.cumsum(counts)]).tolist()
        self.head_count = firsts[-1]
        self.on_call = {
            group.name: range(firsts[number], firsts[number + 1])
            for number, group in enumerate(keys.agents)
            if group.on_call
        }
        self._spent: set[int] = set()

    def awaits(self, agent: int) -> bool:
        """Return whether an agent is on call, and no command has added or removed it."""
        return agent not in self._spent and any(agent in numbers for numbers in self.on_call.values())

    def next_of(self, group: str, count: int) -> list[int]:
        """Return the first ``count`` agents of a group that are still on call, or fewer if there are no more."""
        return [agent for agent in self.on_call.get(group, ()) if agent not in self._spent][:count]

    def take(self, command: Command) -> None:
        """Take in a command, which may add or remove agents."""
        if isinstance(command.commanded, Added | Removed):
            self._spent.update(command.commanded.agents)


def command_complaint(
    keys: ScenarioFields, environment: Environment, command: Command, called: Called
) -> Complaint | None:
    """Return what is wrong with a command about agents, with the key in the command; None if nothing is.

    Also return None for a command that is not about agents. ``called`` has taken in the commands before this one.
    """
    asked = command.commanded
    # A command about a door or an obstacle: the timetable checks it.
    if asked is None:
        return None
    agents = (command.action, "agents")
    unknown = [agent for agent in asked.agents if agent >= called.head_count]
    if unknown:
        return agents, f"there is no agent {unknown[0]}; they are numbered from 0 to {called.head_count - 1}"
    if isinstance(asked, NewGoal):
        wrong = new_goal_complaint(keys, environment, asked)
        return None if wrong is None else (("set_goal", "goal"), wrong)
    # Any agent can be removed, or get another speed, at any time.
    if not isinstance(asked, Added):
        return None
    busy = [agent for agent in asked.agents if not called.awaits(agent)]
    if busy:
        return agents, f"agent {busy[0]} is not on call, or no longer; give its group 'on_call: true'"
    if asked.start is None:
        return None
    start = ("add", "start")
    if keys.floor.periodic is not None:
        return start, "on a periodic floor agents start where their group does; drop it"
    wrong = region_complaint(environment, asked.start)
    return None if wrong is None else (start, wrong)
