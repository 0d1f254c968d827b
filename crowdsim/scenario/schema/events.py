"""Keys of a scenario file for changes during the run: doors, and events that move, add and remove things."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from crowdsim.scenario.schema.environment import Obstacle
from crowdsim.scenario.schema.values import Degrees, Name, Pair, Part, Seconds, one_of

ACTIONS = ("open", "close", "insert", "move", "remove")


def _require_shape(obstacle: Obstacle, what: str) -> None:
    """Raise ValueError if a door or an inserted obstacle is a file, or has ``movable``; messages name it ``what``."""
    if obstacle.mesh is not None or obstacle.plan is not None:
        raise ValueError(f"{what} is a box, cylinder, polygon or wall; files are read before the run")
    if "movable" in obstacle.model_fields_set:
        raise ValueError(f"'movable' is for obstacles that are there from the start; drop it: {what} is movable anyway")


class Door(Obstacle):
    """The leaf of a door in its closed position; an open door takes no space."""

    initially: Annotated[Literal["open", "closed"], Field(description="whether it is open at the start")] = "open"

    @model_validator(mode="after")
    def _check_kind(self) -> Door:
        """Refuse a door that is a file, or has ``movable``."""
        _require_shape(self, "a door")
        return self


class Move(Part):
    """A new position of an obstacle: shifted ``by`` an offset, or its center moved ``to`` a point; then rotated."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": [key]} for key in ("by", "to", "rotation")]})
    name: Annotated[Name, Field(description="of an obstacle")]
    by: Annotated[Pair | None, Field(description="x, y by which it is moved [m]")] = None
    to: Annotated[Pair | None, Field(description="x, y of its center from then on [m]")] = None
    rotation: Annotated[Degrees, Field(description="about its center, counter-clockwise [degrees]")] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Move:
        """Require that the move goes somewhere or turns, and in one way."""
        if self.by is not None and self.to is not None:
            raise ValueError("give one of 'by' and 'to'")
        if self.by is None and self.to is None and not self.rotation:
            raise ValueError("a move needs 'by', 'to' or 'rotation'")
        return self


class Event(Part):
    """A change at one time of the run."""

    model_config = ConfigDict(json_schema_extra=one_of(*((action,) for action in ACTIONS)))
    at: Annotated[Seconds, Field(description="seconds from the start of the run")]
    open: Annotated[Name | None, Field(description="name of a door to open")] = None
    close: Annotated[Name | None, Field(description="name of a door to close")] = None
    insert: Annotated[Obstacle | None, Field(description="an obstacle that comes")] = None
    move: Annotated[Move | None, Field(description="an obstacle that is moved")] = None
    remove: Annotated[Name | None, Field(description="name of an obstacle that goes")] = None

    @model_validator(mode="after")
    def _check(self) -> Event:
        """Refuse several actions or none, and an inserted obstacle that is a file, or has ``movable``."""
        self.only(*self.actions())
        if self.insert is not None:
            _require_shape(self.insert, "what is inserted")
        return self

    @classmethod
    def actions(cls) -> tuple[str, ...]:
        """Return the names of the keys of which exactly one says what happens."""
        return ACTIONS

    @property
    def action(self) -> str:
        """Return which of :meth:`actions` the event has."""
        return self.only(*self.actions())

    @property
    def subject(self) -> str:
        """Return the name of the door or obstacle."""
        what: str | Obstacle | Move = getattr(self, self.action)
        return what if isinstance(what, str) else what.name
