"""The scenario file as data: every key, its type and its range.

Coordinates and lengths are meters, times seconds, angles degrees counter-clockwise. Models are frozen and strict:
text is never taken for a number, nor a yes for a one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator
from shapely import Point, Polygon
from shapely import box as rectangle_polygon

from crowdsim.constants import CAPTURE_RATE
from crowdsim.environment.layers import LEGS, TORSO, Band
from crowdsim.environment.solids import (
    MIN_EXTENT,
    Solid,
    box,
    centered_box,
    circle_around,
    cylinder,
    extrusion,
    polygon_from_points,
)
from crowdsim.errors import GeometryError

FORMAT_VERSION = 1
DEFAULT_BEHAVIORS = ("lateral", "arm_constrained", "frontal")

Length = Annotated[float, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
Extent = Annotated[float, Field(allow_inf_nan=False, ge=MIN_EXTENT, le=1e5)]
Seconds = Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e6)]
Degrees = Annotated[float, Field(allow_inf_nan=False, ge=-360.0, le=360.0)]
Name = Annotated[
    str, Field(min_length=1, max_length=80, pattern=r"^[^\s\x00-\x1f\x7f]([^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$")
]
FileText = Annotated[str, Field(min_length=1, pattern=r"^[^\x00-\x1f\x7f]+$")]
# YAML has lists only; strictness for the tuple itself would refuse them.
Pair = Annotated[tuple[Length, Length], Field(strict=False)]
SizePair = Annotated[tuple[Extent, Extent], Field(strict=False)]


def _checked_rectangle(rectangle: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = rectangle
    if xmax - xmin < MIN_EXTENT or ymax - ymin < MIN_EXTENT:
        raise ValueError("a rectangle is [xmin, ymin, xmax, ymax] with xmin below xmax and ymin below ymax")
    return rectangle


def _checked_ring(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    try:
        polygon_from_points(points, "polygon")
    except GeometryError as error:
        raise ValueError(str(error).removeprefix("polygon: ")) from None
    return points


Rectangle = Annotated[tuple[Length, Length, Length, Length], Field(strict=False), AfterValidator(_checked_rectangle)]
Ring = Annotated[tuple[Pair, ...], Field(strict=False, min_length=3, max_length=10_000), AfterValidator(_checked_ring)]


def _one_of(*groups: tuple[str, ...]) -> Any:
    """JSON schema that asks for exactly one of several groups of keys."""

    def extend(schema: dict[str, Any]) -> None:
        schema["oneOf"] = [{"required": list(group)} for group in groups]

    return extend


class Part(BaseModel):
    """Base of every mapping in the file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def _only(self, *names: str) -> str:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            found = f"'{given[0]}' and '{given[1]}'" if given else "none"
            raise ValueError(f"give exactly one of {', '.join(names)}; found {found}")
        return given[0]


class Floor(Part):
    """The walkable floor before anything stands on it."""

    model_config = ConfigDict(json_schema_extra=_one_of(("rectangle",), ("polygon",)))
    rectangle: Rectangle | None = None
    polygon: Ring | None = None

    @model_validator(mode="after")
    def _check(self) -> Floor:
        self._only("rectangle", "polygon")
        return self

    def shape(self) -> Polygon:
        """The floor as a polygon."""
        if self.rectangle is not None:
            return rectangle_polygon(*self.rectangle)
        return polygon_from_points(self.polygon or (), "floor")


class Circle(Part):
    """Disc on the floor."""

    center: Pair
    radius: Extent


class Region(Part):
    """A spot or an area of the floor."""

    model_config = ConfigDict(json_schema_extra=_one_of(("rectangle",), ("point",), ("circle",), ("polygon",)))
    rectangle: Rectangle | None = None
    point: Pair | None = None
    circle: Circle | None = None
    polygon: Ring | None = None

    @model_validator(mode="after")
    def _check(self) -> Region:
        self._only("rectangle", "point", "circle", "polygon")
        return self

    def shape(self) -> Polygon | Point:
        """The region as a polygon, or as a point."""
        if self.rectangle is not None:
            return rectangle_polygon(*self.rectangle)
        if self.circle is not None:
            return circle_around(self.circle.center, self.circle.radius)
        if self.point is not None:
            return Point(self.point)
        return polygon_from_points(self.polygon or (), "region")


class Box(Part):
    """Box by two corners, or by center and size; turned about its center."""

    model_config = ConfigDict(json_schema_extra=_one_of(("min", "max"), ("center", "size")))
    min: Pair | None = None
    max: Pair | None = None
    center: Pair | None = None
    size: SizePair | None = None
    rotation: Degrees = 0.0

    @model_validator(mode="after")
    def _check(self) -> Box:
        corners, centered = (self.min, self.max), (self.center, self.size)
        given = sum(value is not None for value in (*corners, *centered))
        if given != 2 or not (None not in corners or None not in centered):
            raise ValueError("a box is given by 'min' and 'max', or by 'center' and 'size'")
        if self.min and self.max and any(b - a < MIN_EXTENT for a, b in zip(self.min, self.max, strict=True)):
            raise ValueError("'min' must lie below 'max' in x and in y")
        return self


class Cylinder(Part):
    """Upright cylinder."""

    center: Pair
    radius: Extent


class Obstacle(Part):
    """A solid from height ``bottom`` to ``top`` above the floor."""

    model_config = ConfigDict(json_schema_extra=_one_of(("box",), ("cylinder",), ("polygon",)))
    name: Name
    box: Box | None = None
    cylinder: Cylinder | None = None
    polygon: Ring | None = None
    bottom: Length = 0.0
    top: Length

    @model_validator(mode="after")
    def _check(self) -> Obstacle:
        self._only("box", "cylinder", "polygon")
        if self.top <= self.bottom:
            raise ValueError(f"'top' ({self.top}) must lie above 'bottom' ({self.bottom})")
        return self

    def solid(self) -> Solid:
        """The obstacle as a solid."""
        if self.cylinder is not None:
            return cylinder(self.name, self.cylinder.center, self.cylinder.radius, self.bottom, self.top)
        if self.polygon is not None:
            return extrusion(self.name, self.polygon, self.bottom, self.top)
        given = self.box
        assert given is not None
        if given.min is not None and given.max is not None:
            return box(self.name, given.min, given.max, self.bottom, self.top, given.rotation)
        assert given.center is not None
        assert given.size is not None
        return centered_box(self.name, given.center, given.size, self.bottom, self.top, given.rotation)


class Layer(Part):
    """A height band; the lowest is the ground layer, on which paths are found."""

    name: Name
    low: Length
    high: Length

    @model_validator(mode="after")
    def _check(self) -> Layer:
        if self.high <= self.low:
            raise ValueError(f"'high' ({self.high}) must lie above 'low' ({self.low})")
        return self

    def band(self) -> Band:
        """The same as the environment's band."""
        return Band(self.name, self.low, self.high)


class Motion(Part):
    """Where movement comes from: a built-in set, or captures in a folder beside the scenario file."""

    model_config = ConfigDict(json_schema_extra=_one_of(("set",), ("captures",)))
    set: Literal["default"] | None = None
    captures: FileText | None = None
    clips: Annotated[tuple[FileText, ...], Field(strict=False, min_length=1)] = ("*.bvh",)

    @model_validator(mode="after")
    def _check(self) -> Motion:
        if self._only("set", "captures") == "set" and "clips" in self.model_fields_set:
            raise ValueError("'clips' chooses among captures; give 'captures' with it, or drop it")
        return self


class AgentGroup(Part):
    """Characters with one start and one goal; ``interval`` seconds pass between the starts of one and the next."""

    name: Name
    count: Annotated[int, Field(ge=1, le=100_000)]
    start: Region
    goal: Region
    start_time: Seconds = 0.0
    interval: Seconds = 0.0
    on_arrival: Literal["leave", "stay"] = "leave"


class Area(Region):
    """A named part of the floor for which shares of behaviors are reported."""

    model_config = ConfigDict(json_schema_extra=_one_of(("rectangle",), ("circle",), ("polygon",)))
    name: Name

    @model_validator(mode="after")
    def _check_extent(self) -> Area:
        if self.point is not None:
            raise ValueError("an area needs an extent; give rectangle, circle or polygon")
        return self


class ScenarioFields(Part):
    """The keys of a scenario file."""

    crowdsim: Annotated[int, Field(json_schema_extra={"const": FORMAT_VERSION})]
    name: Name
    description: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    duration: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)]
    steps_per_second: Annotated[int, Field(ge=1, le=CAPTURE_RATE)] = 30
    floor: Floor
    obstacles: Annotated[tuple[Obstacle, ...], Field(strict=False)] = ()
    # The attribute gives way to the method that builds the layers themselves.
    bands: Annotated[tuple[Layer, ...], Field(strict=False, min_length=1, alias="layers")] = tuple(
        Layer(name=band.name, low=band.low, high=band.high) for band in (LEGS, TORSO)
    )
    behaviors: Annotated[tuple[Name, ...], Field(strict=False, min_length=1)] = DEFAULT_BEHAVIORS
    motion: Motion = Motion(set="default")
    agents: Annotated[tuple[AgentGroup, ...], Field(strict=False, min_length=1)]
    areas: Annotated[tuple[Area, ...], Field(strict=False)] = ()

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


def json_schema() -> dict[str, Any]:
    """JSON schema of a scenario file, for editors that complete and check YAML."""
    schema = ScenarioFields.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "crowdsim scenario"}


def write_json_schema(path: Path) -> None:
    """Write :func:`json_schema` to ``path``."""
    path.write_text(json.dumps(json_schema(), indent=1) + "\n", encoding="utf-8")
