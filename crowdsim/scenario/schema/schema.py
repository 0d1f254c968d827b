"""The scenario file as data: every key, its type and its range."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from shapely import MultiPolygon, Point, Polygon, union_all

from crowdsim.constants import CAPTURE_RATE, STEERING_RATE
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.scenario.schema.agents import AgentGroup, Goal, Motion
from crowdsim.scenario.schema.environment import Clutter, Floor, Layer, Obstacle
from crowdsim.scenario.schema.events import Door, Event
from crowdsim.scenario.schema.exits import Exit
from crowdsim.scenario.schema.measured import Area, Line
from crowdsim.scenario.schema.routes import Route
from crowdsim.scenario.schema.values import Extent, Name, Pair, Part

FORMAT_VERSION = 1

CAPTURED_RATE = 30
"""Steps a second where all characters are captured and nothing else is asked for."""

DEFAULT_BEHAVIORS = ("lateral", "arm_constrained", "frontal")


class Neighborhood(Part):
    """What lies near a point, as what a camera sees: there ``auto`` characters stay captured as long as they can."""

    point: Pair
    radius: Extent


class ScenarioFields(Part):
    """The keys of a scenario file."""

    crowdsim: Annotated[int, Field(json_schema_extra={"const": FORMAT_VERSION})]
    name: Name
    description: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    duration: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)]
    steps_per_second: Annotated[
        int, Field(ge=1, le=CAPTURE_RATE, description=f"{CAPTURED_RATE} where all characters are captured")
    ] = STEERING_RATE
    floor: Floor
    obstacles: Annotated[tuple[Obstacle, ...], Field(strict=False)] = ()
    clutter: Clutter | None = None
    doors: Annotated[tuple[Door, ...], Field(strict=False)] = ()
    events: Annotated[tuple[Event, ...], Field(strict=False)] = ()
    # The attribute gives way to the method that builds the layers themselves.
    bands: Annotated[tuple[Layer, ...], Field(strict=False, min_length=1, alias="layers")] = tuple(
        Layer(name=band.name, low=band.low, high=band.high) for band in (LEGS, TORSO)
    )
    behaviors: Annotated[tuple[Name, ...], Field(strict=False, min_length=1)] = DEFAULT_BEHAVIORS
    planner: Literal["layered", "greedy_literal", "collision3d"] = "layered"
    motion: Motion = Motion(set="default")
    agents: Annotated[tuple[AgentGroup, ...], Field(strict=False, min_length=1)]
    exits: Annotated[tuple[Exit, ...], Field(strict=False)] = ()
    routes: Annotated[tuple[Route, ...], Field(strict=False)] = ()
    areas: Annotated[tuple[Area, ...], Field(strict=False)] = ()
    lines: Annotated[tuple[Line, ...], Field(strict=False)] = ()
    captured_near: Neighborhood | None = None

    @model_validator(mode="before")
    @classmethod
    def _take_their_rate(cls, keys: Any) -> Any:
        """Captured characters alone take other steps than those of steering, where the file does not say."""
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
        if value != FORMAT_VERSION:
            raise ValueError(f"format version {value} is unknown here; this crowdsim reads version {FORMAT_VERSION}")
        return value

    @field_validator("steps_per_second")
    @classmethod
    def _check_rate(cls, value: int) -> int:
        if CAPTURE_RATE % value:
            rates = [rate for rate in range(1, CAPTURE_RATE + 1) if CAPTURE_RATE % rate == 0]
            nearest = min(rates, key=lambda rate: abs(rate - value))
            raise ValueError(f"{value} does not divide {CAPTURE_RATE}; did you mean {nearest}?")
        return value

    def locomotions(self) -> set[str]:
        """How the groups move."""
        periodic = self.floor.periodic is not None
        return {"steered" if periodic and group.level == "auto" else group.level for group in self.agents}

    @property
    def span(self) -> tuple[float, float]:
        """Way along x and y after which the floor begins again [m]; 0 where it ends."""
        return self.floor.span

    def exits_of(self, group: AgentGroup) -> list[int]:
        """Numbers of the exits of a group, in the order of the file."""
        named = group.exits or ()
        return [number for number, each in enumerate(self.exits) if named == "all" or each.name in named]

    def waypoints(self, group: AgentGroup) -> list[tuple[tuple[str | int, ...], Goal]]:
        """The places of a group's route in order, each with its place in the file."""
        return [
            (("routes", number, "through", k), Goal.model_validate(place.model_dump(exclude_none=True)))
            for number, route in enumerate(self.routes)
            if route.name == group.route
            for k, place in enumerate(route.through)
        ]

    def regions(self, number: int) -> list[tuple[tuple[str | int, ...], Goal]]:
        """Where group ``number`` goes to in turn, by way of its route, each with its place in the file; no exits."""
        group = self.agents[number]
        return [
            *self.waypoints(group),
            *((("agents", number, *key), goal) for key, goal in group.regions()),
        ]

    def destinations(self, number: int) -> list[tuple[tuple[str | int, ...], Polygon | MultiPolygon | Point]]:
        """Shapes of what group ``number`` goes to in turn, each with its place in the file.

        Exits count as one place, and ways without end as none.
        """
        group = self.agents[number]
        shapes = [(path, goal.shape()) for path, goal in self.regions(number) if goal.along is None]
        if group.exits is None:
            return shapes
        exits = union_all([self.exits[each].shape() for each in self.exits_of(group)])
        return [*shapes, (("agents", number, "exits"), exits)]

    @property
    def steers(self) -> bool:
        """Whether any character may be steered."""
        return self.locomotions() != {"captured"}


def json_schema() -> dict[str, Any]:
    """JSON schema of a scenario file, for editors that complete and check YAML."""
    schema = ScenarioFields.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "crowdsim scenario"}


def write_json_schema(path: Path) -> None:
    """Write :func:`json_schema` to ``path``."""
    path.write_text(json.dumps(json_schema(), indent=1) + "\n", encoding="utf-8")
