"""Types of the keys of a scenario file: lengths, regions, names, and the base of every mapping.

Coordinates and lengths are in meters, times in seconds, angles in degrees counter-clockwise. Models are frozen and
strict: text is not accepted as a number, nor true as 1.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from shapely import Point, Polygon
from shapely import box as rectangle_polygon

from crowdsim.environment.solids import MIN_EXTENT, circle_around, polygon_from_points
from crowdsim.errors import GeometryError

Length = Annotated[float, Field(allow_inf_nan=False, ge=-1e5, le=1e5)]
Extent = Annotated[float, Field(allow_inf_nan=False, ge=MIN_EXTENT, le=1e5)]
Seconds = Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e6)]
Degrees = Annotated[float, Field(allow_inf_nan=False, ge=-360.0, le=360.0)]
Name = Annotated[
    str, Field(min_length=1, max_length=80, pattern=r"^[^\s\x00-\x1f\x7f]([^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$")
]
FileText = Annotated[str, Field(min_length=1, pattern=r"^[^\x00-\x1f\x7f]+$")]
# YAML has lists only, and a strict tuple would refuse a list.
Pair = Annotated[tuple[Length, Length], Field(strict=False)]
SizePair = Annotated[tuple[Extent, Extent], Field(strict=False)]


def _checked_rectangle(rectangle: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return the rectangle if it has an extent along both axes; else raise ValueError."""
    xmin, ymin, xmax, ymax = rectangle
    if xmax - xmin < MIN_EXTENT or ymax - ymin < MIN_EXTENT:
        raise ValueError("a rectangle is [xmin, ymin, xmax, ymax] with xmin below xmax and ymin below ymax")
    return rectangle


def _checked_ring(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the corners [m] if they go around a valid polygon; else raise ValueError."""
    try:
        polygon_from_points(points, "polygon")
    except GeometryError as error:
        raise ValueError(str(error).removeprefix("polygon: ")) from None
    return points


Rectangle = Annotated[tuple[Length, Length, Length, Length], Field(strict=False), AfterValidator(_checked_rectangle)]
Ring = Annotated[tuple[Pair, ...], Field(strict=False, min_length=3, max_length=10_000), AfterValidator(_checked_ring)]


def one_of(*groups: tuple[str, ...]) -> Any:
    """Return a JSON schema extension that requires exactly one of several groups of keys."""

    def extend(schema: dict[str, Any]) -> None:
        """Add the requirement to the JSON schema of a mapping."""
        schema["oneOf"] = [{"required": list(group)} for group in groups]

    return extend


class Part(BaseModel):
    """Base of all mappings in the file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def only(self, *names: str) -> str:
        """Return which of the keys ``names`` is given.

        Parameters
        ----------
        *names : str
            Keys.

        Returns
        -------
        str
            The one that is given.

        Raises
        ------
        ValueError
            Unless exactly one is given.
        """
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            found = f"'{given[0]}' and '{given[1]}'" if given else "none"
            raise ValueError(f"give exactly one of {', '.join(names)}; found {found}")
        return given[0]


class Circle(Part):
    """A disc on the floor."""

    center: Annotated[Pair, Field(description="x, y [m]")]
    radius: Annotated[Extent, Field(description="meters")]


class Region(Part):
    """A point or an area of the floor."""

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("point",), ("circle",), ("polygon",)))
    rectangle: Annotated[Rectangle | None, Field(description="xmin, ymin, xmax, ymax [m]")] = None
    point: Annotated[Pair | None, Field(description="x, y [m]")] = None
    circle: Annotated[Circle | None, Field(description="a disc")] = None
    polygon: Annotated[Ring | None, Field(description="three points x, y or more [m]")] = None

    @model_validator(mode="after")
    def _check(self) -> Region:
        """Refuse several shapes, and none."""
        self.only(*self._kinds())
        return self

    def _kinds(self) -> tuple[str, ...]:
        """Return the keys of which exactly one gives the shape; models with more kinds add theirs."""
        return ("rectangle", "point", "circle", "polygon")

    def shape(self) -> Polygon | Point:
        """Return the region as a polygon, or as a point [m]; a circle as a polygon around it."""
        if self.rectangle is not None:
            return rectangle_polygon(*self.rectangle)
        if self.circle is not None:
            return circle_around(self.circle.center, self.circle.radius)
        if self.point is not None:
            return Point(self.point)
        return polygon_from_points(self.polygon or (), "region")
