"""Keys of a scenario file about the place: its floor, what stands on it, and the layers made of it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator
from shapely import Polygon
from shapely import box as rectangle_polygon

from crowdsim.environment.layers import Band
from crowdsim.environment.solids import MIN_EXTENT, Solid, box, centered_box, cylinder, extrusion, polygon_from_points
from crowdsim.environment.walls import wall
from crowdsim.errors import GeometryError
from crowdsim.scenario.values import (
    Circle,
    Degrees,
    Extent,
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


class Floor(Part):
    """The walkable floor before anything stands on it."""

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("polygon",)))
    rectangle: Rectangle | None = None
    polygon: Ring | None = None

    @model_validator(mode="after")
    def _check(self) -> Floor:
        self.only("rectangle", "polygon")
        return self

    def shape(self) -> Polygon:
        """The floor as a polygon."""
        if self.rectangle is not None:
            return rectangle_polygon(*self.rectangle)
        return polygon_from_points(self.polygon or (), "floor")


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
    top: Length = 2.1

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


class Clutter(Part):
    """Random obstacles, drawn by the scenario's seed, that leave a way between the starts and goals of each group."""

    region: Region | None = None
    density: Literal["normal", "dense"] | Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=MAX_DENSITY)]
    sizes: SizePair = (0.3, 1.2)

    @model_validator(mode="after")
    def _check(self) -> Clutter:
        if self.sizes[0] > self.sizes[1]:
            raise ValueError("'sizes' are the least and the greatest extent of an obstacle, in this order")
        return self

    def share(self) -> float:
        """Share of the region to cover."""
        return DENSITIES[self.density] if isinstance(self.density, str) else self.density


class Obstacle(Part):
    """What stands on the floor: a solid, or several, from height ``bottom`` to ``top``."""

    model_config = ConfigDict(json_schema_extra=one_of(("box",), ("cylinder",), ("polygon",), ("wall",)))
    name: Name
    box: Box | None = None
    cylinder: Cylinder | None = None
    polygon: Ring | None = None
    wall: Wall | None = None
    bottom: Length = 0.0
    top: Length

    @model_validator(mode="after")
    def _check(self) -> Obstacle:
        self.only("box", "cylinder", "polygon", "wall")
        if self.top <= self.bottom:
            raise ValueError(f"'top' ({self.top}) must lie above 'bottom' ({self.bottom})")
        if self.wall is not None:
            try:
                self.solids()
            except GeometryError as error:
                raise ValueError(str(error)) from None
        return self

    def solids(self) -> tuple[Solid, ...]:
        """The obstacle as solids; a wall with openings is several."""
        name, bottom, top = self.name, self.bottom, self.top
        if self.cylinder is not None:
            return (cylinder(name, self.cylinder.center, self.cylinder.radius, bottom, top),)
        if self.polygon is not None:
            return (extrusion(name, self.polygon, bottom, top),)
        if self.wall is not None:
            line = self.wall
            openings = [(gap.at, gap.width, gap.bottom, gap.top) for gap in line.openings]
            return wall(name, line.points, line.thickness, bottom, top, openings)
        given = self.box
        assert given is not None
        if given.min is not None and given.max is not None:
            return (box(name, given.min, given.max, bottom, top, given.rotation),)
        assert given.center is not None
        assert given.size is not None
        return (centered_box(name, given.center, given.size, bottom, top, given.rotation),)


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
