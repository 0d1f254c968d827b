"""Keys of a scenario file about commands given while it ran, which have no effect before their time."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from crowdsim.scenario.schema.events import ACTIONS, Event
from crowdsim.scenario.schema.spreads import LEAST_SPEED, MOST_SPEED
from crowdsim.scenario.schema.values import Part, Region, one_of

AGENT_ACTIONS = ("set_goal", "add", "remove_agents", "set_speed")
"""Commands that are about agents."""

AgentNumber = Annotated[int, Field(ge=0, lt=2**31)]


class Commanded(Part):
    """A command to some agents: ``agents`` are their numbers, counted through all groups from 0 on."""

    agents: Annotated[
        tuple[AgentNumber, ...],
        Field(
            strict=False,
            min_length=1,
            max_length=100_000,
            description="numbers of agents, counted through all groups from 0",
        ),
    ]


class NewGoal(Commanded):
    """Send agents elsewhere, instead of all places that they were to go to; there they leave, or stay."""

    goal: Annotated[Region, Field(description="region to go to")]
    on_arrival: Annotated[Literal["leave", "stay"], Field(description="leave the world at the goal, or stay there")] = (
        "leave"
    )


class Added(Commanded):
    """Let agents on call come, at ``start`` or where their group starts."""

    start: Annotated[Region | None, Field(description="region to come in; where their group starts if absent")] = None


class Removed(Commanded):
    """Take agents out of the world; those who are yet to come never come."""


class NewSpeed(Commanded):
    """Let agents walk at ``speed`` [m/s] if nothing is in their way."""

    speed: Annotated[float, Field(allow_inf_nan=False, ge=LEAST_SPEED, le=MOST_SPEED, description="meters a second")]


class Command(Event):
    """A command given at one time of the run."""

    model_config = ConfigDict(json_schema_extra=one_of(*((action,) for action in (*ACTIONS, *AGENT_ACTIONS))))
    set_goal: Annotated[NewGoal | None, Field(description="another goal for some agents")] = None
    add: Annotated[Added | None, Field(description="agents on call that come")] = None
    remove_agents: Annotated[Removed | None, Field(description="agents that are taken out")] = None
    set_speed: Annotated[NewSpeed | None, Field(description="another speed for some agents")] = None

    @classmethod
    def actions(cls) -> tuple[str, ...]:
        """Return the names of the keys of which exactly one is given."""
        return (*ACTIONS, *AGENT_ACTIONS)

    @property
    def changes_place(self) -> bool:
        """Return whether the command is about a door or an obstacle."""
        return self.commanded is None

    @property
    def commanded(self) -> Commanded | None:
        """Return the part of the command that is about agents, or None."""
        return self.set_goal or self.add or self.remove_agents or self.set_speed
