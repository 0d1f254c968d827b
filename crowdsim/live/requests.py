"""Requests of a page to a running simulation: messages that are checked before anything is done."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from crowdsim.errors import CrowdSimError

MOST_BYTES = 16_384
"""Largest message that a page may send [bytes]."""
SLOWEST, FASTEST = 0.25, 8.0
"""Least and greatest speed of the simulation, as a multiple of real time."""

_SHORTEST_WALL, _LONGEST_WALL = 0.2, 200.0
"""Least and greatest length of a wall that is drawn [m]."""

Meters = Annotated[float, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
Point = Annotated[tuple[Meters, Meters], Field(strict=False)]
Name = Annotated[str, Field(min_length=1, max_length=80)]
AgentNumber = Annotated[int, Field(ge=0, lt=2**31)]
Characters = Annotated[tuple[AgentNumber, ...], Field(strict=False, min_length=1, max_length=1000)]


class RequestRefused(CrowdSimError):
    """A message is no request, or its request cannot be met; the page shows the text of this error."""


class Request(BaseModel):
    """A request; ``id`` comes back with the answer."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    id: Annotated[int, Field(ge=0, lt=2**53)]


class SetGoal(Request):
    """Send agents to a point, where they leave the world or stay."""

    do: Literal["set_goal"]
    agents: Characters
    goal: Point
    on_arrival: Literal["leave", "stay"] = "leave"


class RemoveAgents(Request):
    """Take agents out of the world."""

    do: Literal["remove_agents"]
    agents: Characters


class Add(Request):
    """Add agents of a group on call, at a point or, without one, where the group starts."""

    do: Literal["add"]
    group: Name
    count: Annotated[int, Field(ge=1, le=1000)]
    start: Point | None = None


class Move(Request):
    """Move an obstacle by an offset [m]."""

    do: Literal["move"]
    name: Name
    by: Point


class DrawWall(Request):
    """Insert a wall between two points."""

    do: Literal["draw_wall"]
    points: Annotated[tuple[Point, Point], Field(strict=False)]

    def require_length(self) -> None:
        """Raise RequestRefused if the wall is shorter or longer than walls may be."""
        (ax, ay), (bx, by) = self.points
        length = math.hypot(bx - ax, by - ay)
        if not _SHORTEST_WALL <= length <= _LONGEST_WALL:
            raise RequestRefused(
                f"a wall is {_SHORTEST_WALL:g} to {_LONGEST_WALL:g} m long, not {length:.2f} m; draw it again"
            )


class RemoveObstacle(Request):
    """Remove an obstacle."""

    do: Literal["remove_obstacle"]
    name: Name


class SetDoor(Request):
    """Open or close a door."""

    do: Literal["set_door"]
    name: Name
    open: bool


class Pause(Request):
    """Stop the simulation, or let it go on."""

    do: Literal["pause"]
    paused: bool


class Step(Request):
    """Take one step, and stop."""

    do: Literal["step"]


class SetSpeed(Request):
    """Let the simulation run at ``speed`` times real time."""

    do: Literal["set_speed"]
    speed: Annotated[float, Field(allow_inf_nan=False, ge=SLOWEST, le=FASTEST, strict=False)]


AnyRequest = Annotated[
    SetGoal | RemoveAgents | Add | Move | DrawWall | RemoveObstacle | SetDoor | Pause | Step | SetSpeed,
    Field(discriminator="do"),
]

_READER: TypeAdapter[Any] = TypeAdapter(AnyRequest)


def read_request(message: str | bytes) -> Request:
    """Return the request in a message; raise RequestRefused with the reason if there is none."""
    if isinstance(message, bytes):
        raise RequestRefused("a request is a text, not bytes")
    try:
        request: Request = _READER.validate_json(message)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise RequestRefused(f"no request: {place + ': ' if place else ''}{first['msg']}") from None
    return request


def number_of(message: str | bytes) -> int | None:
    """Return the ``id`` of a message, which may otherwise be malformed; None if it has no valid one."""
    try:
        return _Numbered.model_validate_json(message).id
    except ValidationError:
        return None


class _Numbered(BaseModel):
    """Any message with a number."""

    id: Annotated[int, Field(ge=0, lt=2**53, strict=True)]
