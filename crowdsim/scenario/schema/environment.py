"""Keys of a scenario file about the place: its floor, what stands on it, and the layers made of it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from crowdsim.environment import walls
from crowdsim.environment.floor_plans import WALL_THICKNESS
from crowdsim.environment.layers import AnyLayer, Band, Plane
from crowdsim.environment.solids import MIN_EXTENT, Solid, box, centered_box, cylinder, extrusion
from crowdsim.errors import GeometryError
from crowdsim.scenario.schema.values import (
    Circle,
    Degrees,
    Extent,
    FileText,
    Length,
    Name,
    Pair,
    Part,
    Rectangle,
    Region,
    Ring,
    SizePair,
    one_of,
)

DENSITIES = {"normal": 0.12, "dense": 0.24}
"""Share of the floor that obstacles cover in the paper's two environments, as far as its figure 6 shows."""

MAX_DENSITY = 0.4
"""With more, obstacles that do not overlap leave hardly a way between them."""


def _as_share(value: Any) -> Any:
    if isinstance(value, str):
        if value not in DENSITIES:
            raise ValueError(f"expected {' or '.join(DENSITIES)}, or the share of the floor to cover, got '{value}'")
        return DENSITIES[value]
    return value


Density = Annotated[
    float,
    Field(allow_inf_nan=False, gt=0.0, le=MAX_DENSITY),
    BeforeValidator(_as_share),
    WithJsonSchema(
        {"anyOf": [{"enum": list(DENSITIES)}, {"type": "number", "exclusiveMinimum": 0.0, "maximum": MAX_DENSITY}]}
    ),
]


LEAST_SPAN = 10.0
"""Length of a periodic floor at least [m]: nobody is to see oneself ahead."""


class Floor(Part):
    """The walkable floor before anything stands on it: drawn, read from a file, or found in the obstacles.

    ``periodic``: who leaves it at its end along that axis comes in at the other one.
    """

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("polygon",), ("file",), ("derive",)))
    rectangle: Rectangle | None = None
    polygon: Ring | None = None
    file: FileText | None = None
    drawing_layer: Name | None = None
    units: Name | None = None
    derive: Literal[True] | None = None
    height: Length | None = None
    periodic: Literal["x", "y"] | None = None

    @model_validator(mode="after")
    def _check(self) -> Floor:
        if self.periodic is not None and self.rectangle is None and self.polygon is None:
            raise ValueError(
                "'periodic' is of a floor that the scenario draws; give 'rectangle' or 'polygon', or drop it"
            )
        if max(self.span) > 0.0 and max(self.span) < LEAST_SPAN:
            raise ValueError(f"a periodic floor is {LEAST_SPAN:g} m long at least, this one {max(self.span):g} m")
        if self.only("rectangle", "polygon", "file", "derive") != "file":
            if self.drawing_layer is not None:
                raise ValueError("'drawing_layer' is the layer of a drawing; give its 'file' with it, or drop it")
            if self.units is not None:
                raise ValueError("'units' are those of a file; give the 'file' with them, or drop them")
        return self

    @property
    def span(self) -> tuple[float, float]:
        """Way along x and y after which the floor begins again [m]; 0 where it ends."""
        if self.periodic is None:
            return 0.0, 0.0
        xmin, ymin, xmax, ymax = self.bounds
        return (xmax - xmin, 0.0) if self.periodic == "x" else (0.0, ymax - ymin)

    @property
    def bounds(self) -> Rectangle:
        """Least x and y, greatest x and y of a floor that is drawn [m]."""
        if self.rectangle is not None:
            return self.rectangle
        xs, ys = zip(*(self.polygon or ()), strict=True)
        return min(xs), min(ys), max(xs), max(ys)


class Box(Part):
    """Box by two corners, or by center and size; turned about its center."""

    model_config = ConfigDict(json_schema_extra=one_of(("min", "max"), ("center", "size")))
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


class Cylinder(Circle):
    """Upright cylinder."""


class Opening(Part):
    """A door or window, ``at`` meters along the wall's line to its middle, open from ``bottom`` to ``top``."""

    at: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e5)]
    width: Extent
    bottom: Length = 0.0
    top: Length = walls.DOOR_HEIGHT

    @model_validator(mode="after")
    def _check(self) -> Opening:
        if self.top <= self.bottom:
            raise ValueError(f"'top' ({self.top}) must lie above 'bottom' ({self.bottom})")
        return self


class Wall(Part):
    """A wall along the line through ``points``, half of its ``thickness`` on either side."""

    points: Annotated[tuple[Pair, ...], Field(strict=False, min_length=2, max_length=10_000)]
    thickness: Extent = 0.12
    openings: Annotated[tuple[Opening, ...], Field(strict=False)] = ()


class Mesh(Part):
    """A file of triangles: enlarged by ``scale``, turned about the vertical by ``rotation``, moved by ``position``."""

    file: FileText
    up: Literal["y", "z"] | None = None
    units: Name | None = None
    scale: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)] = 1.0
    rotation: Degrees = 0.0
    position: Annotated[tuple[Length, Length, Length], Field(strict=False)] = (0.0, 0.0, 0.0)


class Plan(Part):
    """A floor plan in DXF: its lines are walls, its closed curves obstacles."""

    file: FileText
    drawing_layers: Annotated[tuple[Name, ...], Field(strict=False, min_length=1)] | None = None
    units: Name | None = None
    thickness: Extent = WALL_THICKNESS


class Clutter(Part):
    """Random obstacles, drawn by the scenario's seed, that leave a way between the starts and goals of each group."""

    region: Region | None = None
    density: Density
    sizes: SizePair = (0.3, 1.2)

    @model_validator(mode="after")
    def _check(self) -> Clutter:
        if self.sizes[0] > self.sizes[1]:
            raise ValueError("'sizes' are the least and the greatest extent of an obstacle, in this order")
        return self


class Obstacle(Part):
    """What stands on the floor: a solid, or several; a shape needs a ``top``, a file has its own heights."""

    model_config = ConfigDict(
        json_schema_extra=one_of(
            ("box", "top"), ("cylinder", "top"), ("polygon", "top"), ("wall", "top"), ("plan", "top"), ("mesh",)
        )
    )
    name: Name
    box: Box | None = None
    cylinder: Cylinder | None = None
    polygon: Ring | None = None
    wall: Wall | None = None
    plan: Plan | None = None
    mesh: Mesh | None = None
    bottom: Length = 0.0
    top: Length | None = None

    @model_validator(mode="after")
    def _check(self) -> Obstacle:
        kind = self.only("box", "cylinder", "polygon", "wall", "plan", "mesh")
        if kind == "mesh":
            if self.top is not None or "bottom" in self.model_fields_set:
                raise ValueError("a mesh has its own heights; drop 'bottom' and 'top', or move it with 'position'")
            return self
        if self.top is None:
            raise ValueError(f"a {kind} needs a 'top', meters above the floor")
        if self.top <= self.bottom:
            raise ValueError(f"'top' ({self.top}) must lie above 'bottom' ({self.bottom})")
        try:
            self.solids()
        except GeometryError as error:
            raise ValueError(str(error)) from None
        return self

    def solids(self) -> tuple[Solid, ...]:
        """The obstacle as solids, several for a wall with openings; none for a file, which others read."""
        if self.top is None or self.plan is not None:
            return ()
        name, bottom, top = self.name, self.bottom, self.top
        if self.cylinder is not None:
            return (cylinder(name, self.cylinder.center, self.cylinder.radius, bottom, top),)
        if self.polygon is not None:
            return (extrusion(name, self.polygon, bottom, top),)
        if self.wall is not None:
            line = self.wall
            openings = [walls.Opening(gap.at, gap.width, gap.bottom, gap.top) for gap in line.openings]
            return walls.wall(name, line.points, line.thickness, bottom, top, openings)
        given = self.box
        assert given is not None
        if given.min is not None and given.max is not None:
            return (box(name, given.min, given.max, bottom, top, given.rotation),)
        assert given.center is not None
        assert given.size is not None
        return (centered_box(name, given.center, given.size, bottom, top, given.rotation),)


class Layer(Part):
    """A band of heights above the floor, or a plane at one height, for which one clearance of a body counts."""

    model_config = ConfigDict(json_schema_extra=one_of(("low", "high"), ("height",)))
    name: Name
    low: Length | None = None
    high: Length | None = None
    height: Length | None = None

    @model_validator(mode="after")
    def _check(self) -> Layer:
        if (self.low is None, self.high is None, self.height is None) not in (
            (False, False, True),
            (True, True, False),
        ):
            raise ValueError("a layer is given by 'low' and 'high', or by one 'height'")
        if self.low is not None and self.high is not None and self.high <= self.low:
            raise ValueError(f"'high' ({self.high}) must lie above 'low' ({self.low})")
        return self

    def band(self) -> AnyLayer:
        """The same as the environment's band or plane."""
        if self.height is not None:
            return Plane(self.name, self.height)
        assert self.low is not None
        assert self.high is not None
        return Band(self.name, self.low, self.high)
