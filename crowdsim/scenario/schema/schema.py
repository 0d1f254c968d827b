"""The scenario file as a data model: every key with its type and range."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from shapely import MultiPolygon, Point, Polygon, union_all

from crowdsim.constants import CAPTURE_RATE, STEERING_RATE
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.scenario.schema.agents import AgentGroup, Goal, Motion
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.schema.environment import Clutter, Floor, Layer, Obstacle
from crowdsim.scenario.schema.events import Door, Event
from crowdsim.scenario.schema.exits import Exit
from crowdsim.scenario.schema.measured import Area, Line
from crowdsim.scenario.schema.routes import Route
from crowdsim.scenario.schema.values import Extent, Name, Pair, Part

FORMAT_VERSION = 1

SCHEMA_ID = f"urn:crowdsim:scenario:{FORMAT_VERSION}"
"""Name of the JSON schema: a name only, nothing is fetched from it."""

CAPTURED_RATE = 30
"""Default steps per second if all agents are captured [1/s]."""

DEFAULT_BEHAVIORS = ("lateral", "arm_constrained", "frontal")


class Neighborhood(Part):
    """A disc, such as the view of a camera, in which ``auto`` agents stay captured as long as they can."""

    point: Annotated[Pair, Field(description="x, y [m]")]
    radius: Annotated[Extent, Field(description="meters")]


class ScenarioFields(Part):
    """The keys of a scenario file."""

    crowdsim: Annotated[int, Field(json_schema_extra={"const": FORMAT_VERSION}, description="version of this format")]
    name: Annotated[Name, Field(description="of the scenario, and of its recording's file")]
    description: Annotated[str, Field(description="what it shows, for listings")] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63, description="all random draws follow from it")]
    duration: Annotated[
        float, Field(allow_inf_nan=False, gt=0.0, le=1e6, description="seconds until the run ends at the latest")
    ]
    steps_per_second: Annotated[
        int,
        Field(
            ge=1,
            le=CAPTURE_RATE,
            description=f"divides {CAPTURE_RATE}; if absent {STEERING_RATE}, or {CAPTURED_RATE} if all are captured",
        ),
    ] = STEERING_RATE
    floor: Annotated[Floor, Field(description="the walkable floor")]
    obstacles: Annotated[tuple[Obstacle, ...], Field(strict=False, description="what stands on the floor")] = ()
    clutter: Annotated[Clutter | None, Field(description="random obstacles")] = None
    doors: Annotated[tuple[Door, ...], Field(strict=False, description="obstacles that open and close")] = ()
    events: Annotated[tuple[Event, ...], Field(strict=False, description="what changes while the scenario runs")] = ()
    # The key is called ``layers``; in Python that is the name of the built ones, in the scenario's environment.
    bands: Annotated[
        tuple[Layer, ...],
        Field(
            strict=False, min_length=1, alias="layers", description="heights at which clearance counts, the legs' first"
        ),
    ] = tuple(Layer(name=band.name, low=band.low, high=band.high) for band in (LEGS, TORSO))
    behaviors: Annotated[
        tuple[Name, ...], Field(strict=False, min_length=1, description="ways to move: names, or folders as ./stroll")
    ] = DEFAULT_BEHAVIORS
    planner: Annotated[
        Literal["layered", "greedy_literal", "collision3d"],
        Field(description="layered: the usual one; greedy_literal: the published one; collision3d: the same in 3D"),
    ] = "layered"
    motion: Annotated[Motion, Field(description="where movement comes from")] = Motion(set="default")
    agents: Annotated[tuple[AgentGroup, ...], Field(strict=False, min_length=1, description="groups of agents")]
    exits: Annotated[
        tuple[Exit, ...],
        Field(strict=False, description="regions through which agents leave, by choice or as assigned"),
    ] = ()
    routes: Annotated[tuple[Route, ...], Field(strict=False, description="places to come by on the way to a goal")] = ()
    areas: Annotated[tuple[Area, ...], Field(strict=False, description="where density and speed are measured")] = ()
    lines: Annotated[tuple[Line, ...], Field(strict=False, description="where passages are counted")] = ()
    captured_near: Annotated[
        Neighborhood | None, Field(description="where auto agents stay captured as long as they can")
    ] = None
    commands: Annotated[
        tuple[Command, ...], Field(strict=False, description="what was commanded while the scenario ran in Python")
    ] = ()

    @model_validator(mode="before")
    @classmethod
    def _take_their_rate(cls, keys: Any) -> Any:
        """Default to CAPTURED_RATE steps per second if all agents are captured.

        The keys are not validated yet: those of wrong types are left to validation.
        """
        if not isinstance(keys, dict) or "steps_per_second" in keys:
            return keys
        groups = keys.get("agents")
        if not isinstance(groups, list | tuple):
            return keys
        captured = all(isinstance(group, dict) and group.get("locomotion") == "captured" for group in groups)
        return {**keys, "steps_per_second": CAPTURED_RATE} if captured else keys

    @field_validator("crowdsim")
    @classmethod
    def _check_version(cls, value: int) -> int:
        """Refuse versions of the format other than FORMAT_VERSION."""
        if value != FORMAT_VERSION:
            raise ValueError(f"format version {value} is unknown here; this crowdsim reads version {FORMAT_VERSION}")
        return value

    @field_validator("steps_per_second")
    @classmethod
    def _check_rate(cls, value: int) -> int:
        """Require a rate that divides the frame rate of captures."""
        if CAPTURE_RATE % value:
            rates = [rate for rate in range(1, CAPTURE_RATE + 1) if CAPTURE_RATE % rate == 0]
            nearest = min(rates, key=lambda rate: abs(rate - value))
            raise ValueError(f"{value} does not divide {CAPTURE_RATE}; did you mean {nearest}?")
        return value

    def locomotions(self) -> set[str]:
        """Return the levels of the groups.

        Returns
        -------
        set of str
            Some of captured, steered, auto.
        """
        # Captured agents need a floor with ends, so ``auto`` ones are steered on a periodic one.
        periodic = self.floor.periodic is not None
        return {"steered" if periodic and group.level == "auto" else group.level for group in self.agents}

    @property
    def span(self) -> tuple[float, float]:
        """Return the period of the floor along x and y [m]; 0 along an axis on which it ends."""
        return self.floor.span

    def exits_of(self, group: AgentGroup) -> list[int]:
        """Return the exits of a group.

        Parameters
        ----------
        group : AgentGroup
            A group of the scenario.

        Returns
        -------
        list of int
            Indices of the exits, in the order of the file.
        """
        named = group.exits or ()
        return [number for number, each in enumerate(self.exits) if named == "all" or each.name in named]

    def waypoints(self, group: AgentGroup) -> list[tuple[tuple[str | int, ...], Goal]]:
        """Return the places of a group's route in order.

        Parameters
        ----------
        group : AgentGroup
            A group of the scenario.

        Returns
        -------
        list of (tuple, Goal)
            The places, each with its key in the file.
        """
        return [
            (("routes", number, "through", k), Goal.model_validate(place.model_dump(exclude_none=True)))
            for number, route in enumerate(self.routes)
            if route.name == group.route
            for k, place in enumerate(route.through)
        ]

    def regions(self, number: int) -> list[tuple[tuple[str | int, ...], Goal]]:
        """Return the places that a group visits in turn, its route first; no exits.

        Parameters
        ----------
        number : int
            Index of the group.

        Returns
        -------
        list of (tuple, Goal)
            The places, each with its key in the file.
        """
        group = self.agents[number]
        return [
            *self.waypoints(group),
            *((("agents", number, *key), goal) for key, goal in group.regions()),
        ]

    def destinations(self, number: int) -> list[tuple[tuple[str | int, ...], Polygon | MultiPolygon | Point]]:
        """Return the shapes that a group goes to in turn.

        The union of the group's exits is one shape, the last. Endless ways are left out.

        Parameters
        ----------
        number : int
            Index of the group.

        Returns
        -------
        list of (tuple, geometry)
            The shapes [m], each with its key in the file.
        """
        group = self.agents[number]
        shapes = [(path, goal.shape()) for path, goal in self.regions(number) if goal.along is None]
        if group.exits is None:
            return shapes
        exits = union_all([self.exits[each].shape() for each in self.exits_of(group)])
        return [*shapes, (("agents", number, "exits"), exits)]

    @property
    def steers(self) -> bool:
        """Return whether some agent may be steered."""
        return self.locomotions() != {"captured"}


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario file, for editors that complete and check YAML."""
    schema = ScenarioFields.model_json_schema()
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": SCHEMA_ID}
    return {**head, **schema, "title": "crowdsim scenario"}


def json_schema_text() -> str:
    """Return :func:`json_schema` as the text of a file."""
    return json.dumps(json_schema(), indent=1) + "\n"


def write_json_schema(path: Path) -> None:
    """Write :func:`json_schema` to ``path``."""
    path.write_text(json_schema_text(), encoding="utf-8")
