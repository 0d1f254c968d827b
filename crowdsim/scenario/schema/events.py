"""Keys of a scenario file about what changes while it runs: doors, and events that move, add and remove things."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from crowdsim.scenario.schema.environment import Obstacle
from crowdsim.scenario.schema.values import Degrees, Name, Pair, Part, Seconds, one_of

ACTIONS = ("open", "close", "insert", "move", "remove")


def _require_shape(obstacle: Obstacle, what: str) -> None:
    if obstacle.mesh is not None or obstacle.plan is not None:
        raise ValueError(f"{what} is a box, cylinder, polygon or wall; files are read before the run")


class Door(Obstacle):
    """The leaf of a door, in the place it has while closed; an open door is not there at all."""

    initially: Literal["open", "closed"] = "open"

    @model_validator(mode="after")
    def _check_kind(self) -> Door:
        _require_shape(self, "a door")
        return self


class Move(Part):
    """Another place for an obstacle: ``by`` so much, or its center ``to`` a spot; then turned about its center."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": [key]} for key in ("by", "to", "rotation")]})
    name: Name
    by: Pair | None = None
    to: Pair | None = None
    rotation: Degrees = 0.0

    @model_validator(mode="after")
    def _check(self) -> Move:
        if self.by is not None and self.to is not None:
            raise ValueError("give one of 'by' and 'to'")
        if self.by is None and self.to is None and not self.rotation:
            raise ValueError("a move needs 'by', 'to' or 'rotation'")
        return self


class Event(Part):
    """What changes at one time of the run."""

    model_config = ConfigDict(json_schema_extra=one_of(*((action,) for action in ACTIONS)))
    at: Annotated[Seconds, Field(description="seconds from the start of the run")]
    open: Name | None = None
    close: Name | None = None
    insert: Obstacle | None = None
    move: Move | None = None
    remove: Name | None = None

    @model_validator(mode="after")
    def _check(self) -> Event:
        self.only(*ACTIONS)
        if self.insert is not None:
            _require_shape(self.insert, "what is inserted")
        return self

    @property
    def action(self) -> str:
        """Which of :data:`ACTIONS` it is."""
        return self.only(*ACTIONS)

    @property
    def subject(self) -> str:
        """Name of the door or obstacle."""
        what: str | Obstacle | Move = getattr(self, self.action)
        return what if isinstance(what, str) else what.name
