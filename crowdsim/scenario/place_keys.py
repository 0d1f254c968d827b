"""Keys of a scenario file about the place: its floor, what stands on it, and the layers made of it."""

from __future__ import annotations

from pydantic import ConfigDict, model_validator
from shapely import Polygon
from shapely import box as rectangle_polygon

from crowdsim.environment.layers import Band
from crowdsim.environment.solids import MIN_EXTENT, Solid, box, centered_box, cylinder, extrusion, polygon_from_points
from crowdsim.scenario.values import Circle, Degrees, Length, Name, Pair, Part, Rectangle, Ring, SizePair, one_of


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


class Obstacle(Part):
    """A solid from height ``bottom`` to ``top`` above the floor."""

    model_config = ConfigDict(json_schema_extra=one_of(("box",), ("cylinder",), ("polygon",)))
    name: Name
    box: Box | None = None
    cylinder: Cylinder | None = None
    polygon: Ring | None = None
    bottom: Length = 0.0
    top: Length

    @model_validator(mode="after")
    def _check(self) -> Obstacle:
        self.only("box", "cylinder", "polygon")
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
