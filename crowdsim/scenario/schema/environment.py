"""Keys of a scenario file for the environment: its floor, its obstacles, and the layers made of them."""

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
"""Share of the floor that obstacles cover in the 2018 paper's two environments, measured from its figure 6."""

MAX_DENSITY = 0.4
"""Largest share of the floor that clutter may cover. Beyond it, hardly any way remains between the obstacles."""


def _as_share(value: Any) -> Any:
    """Return the share of the floor that the name of a density stands for; any other value as it is.

    Raise ValueError for a name that is unknown.
    """
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
"""Least length of a periodic floor [m], so that no agent sees itself ahead."""


class Floor(Part):
    """The whole floor, without obstacles: drawn, read from a file, or derived from the obstacles.

    ``periodic``: an agent that leaves the floor at one end of this axis comes in at the other end.
    """

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("polygon",), ("file",), ("derive",)))
    rectangle: Annotated[Rectangle | None, Field(description="xmin, ymin, xmax, ymax [m]")] = None
    polygon: Annotated[Ring | None, Field(description="outline of three points x, y or more [m]")] = None
    file: Annotated[FileText | None, Field(description="WKT or DXF file of the floor, beside the scenario file")] = None
    drawing_layer: Annotated[Name | None, Field(description="layer of the DXF drawing that is the floor")] = None
    units: Annotated[Name | None, Field(description="units of the file, instead of those it names")] = None
    derive: Annotated[Literal[True] | None, Field(description="true: find the floor in the files of the obstacles")] = (
        None
    )
    height: Annotated[Length | None, Field(description="height of the floor in these files [m]")] = None
    periodic: Annotated[
        Literal["x", "y"] | None, Field(description="axis along which the floor begins again at its end")
    ] = None

    @model_validator(mode="after")
    def _check(self) -> Floor:
        """Refuse a period on a floor that is short or not drawn, and keys about a file without ``file``."""
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
        """Return the period along x and y [m]; 0 along an axis on which the floor ends."""
        if self.periodic is None:
            return 0.0, 0.0
        xmin, ymin, xmax, ymax = self.bounds
        return (xmax - xmin, 0.0) if self.periodic == "x" else (0.0, ymax - ymin)

    @property
    def bounds(self) -> Rectangle:
        """Return least x, least y, greatest x and greatest y of a floor given by ``rectangle`` or ``polygon`` [m]."""
        if self.rectangle is not None:
            return self.rectangle
        xs, ys = zip(*(self.polygon or ()), strict=True)
        return min(xs), min(ys), max(xs), max(ys)


class Box(Part):
    """A box, given by two corners or by center and size, and rotated about its center."""

    model_config = ConfigDict(json_schema_extra=one_of(("min", "max"), ("center", "size")))
    min: Annotated[Pair | None, Field(description="corner with the least x, y [m]")] = None
    max: Annotated[Pair | None, Field(description="corner with the greatest x, y [m]")] = None
    center: Annotated[Pair | None, Field(description="x, y [m]")] = None
    size: Annotated[SizePair | None, Field(description="extent along x and y [m]")] = None
    rotation: Annotated[Degrees, Field(description="about the center, counter-clockwise [degrees]")] = 0.0

    @model_validator(mode="after")
    def _check(self) -> Box:
        """Refuse a box that is not given by two corners, or by center and size; and corners out of order."""
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
    """A door or window: its middle is ``at`` meters along the wall's line; it is open from ``bottom`` to ``top``."""

    at: Annotated[
        float,
        Field(
            allow_inf_nan=False, ge=0.0, le=1e5, description="meters along the wall's line to the middle of the opening"
        ),
    ]
    width: Annotated[Extent, Field(description="meters")]
    bottom: Annotated[Length, Field(description="height from which it is open [m]")] = 0.0
    top: Annotated[Length, Field(description="height up to which it is open [m]")] = walls.DOOR_HEIGHT

    @model_validator(mode="after")
    def _check(self) -> Opening:
        """Refuse heights out of order."""
        if self.top <= self.bottom:
            raise ValueError(f"'top' ({self.top}) must lie above 'bottom' ({self.bottom})")
        return self


class Wall(Part):
    """A wall along the line through ``points``, with half of its ``thickness`` on either side."""

    points: Annotated[
        tuple[Pair, ...],
        Field(strict=False, min_length=2, max_length=10_000, description="line of two points x, y or more [m]"),
    ]
    thickness: Annotated[Extent, Field(description="meters")] = 0.12
    openings: Annotated[tuple[Opening, ...], Field(strict=False, description="doors and windows in the wall")] = ()


class Mesh(Part):
    """A file of triangles: scaled by ``scale``, rotated about the vertical by ``rotation``, moved by ``position``."""

    file: Annotated[FileText, Field(description="GLB, OBJ, STL, PLY or DAE file, beside the scenario file")]
    up: Annotated[Literal["y", "z"] | None, Field(description="axis of the file that points up")] = None
    units: Annotated[Name | None, Field(description="units of the file, instead of those it names")] = None
    scale: Annotated[
        float, Field(allow_inf_nan=False, gt=0.0, le=1e6, description="factor by which it is enlarged")
    ] = 1.0
    rotation: Annotated[Degrees, Field(description="about the vertical axis, counter-clockwise [degrees]")] = 0.0
    position: Annotated[
        tuple[Length, Length, Length], Field(strict=False, description="x, y, z by which it is moved [m]")
    ] = (0.0, 0.0, 0.0)


class Plan(Part):
    """A floor plan in DXF: its lines become walls, its closed curves obstacles."""

    file: Annotated[FileText, Field(description="DXF file, beside the scenario file")]
    drawing_layers: Annotated[
        Annotated[tuple[Name, ...], Field(strict=False, min_length=1)] | None,
        Field(description="layers of the drawing to take; all if absent"),
    ] = None
    units: Annotated[Name | None, Field(description="units of the file, instead of those it names")] = None
    thickness: Annotated[Extent, Field(description="of the lines, which are walls [m]")] = WALL_THICKNESS


class Clutter(Part):
    """Random obstacles, drawn from the scenario's seed, that leave a way between the starts and goals of each group."""

    region: Annotated[Region | None, Field(description="part of the floor to cover; all of it if absent")] = None
    density: Annotated[Density, Field(description="normal, dense, or the share of the floor to cover")]
    sizes: Annotated[SizePair, Field(description="least and greatest extent of an obstacle [m]")] = (0.3, 1.2)

    @model_validator(mode="after")
    def _check(self) -> Clutter:
        """Refuse sizes out of order."""
        if self.sizes[0] > self.sizes[1]:
            raise ValueError("'sizes' are the least and the greatest extent of an obstacle, in this order")
        return self


class Obstacle(Part):
    """One or several solids on the floor; a mesh has its own heights, all others need a ``top``.

    ``movable``: commands may move and remove the obstacle while a simulation runs, even if no event names it.
    """

    model_config = ConfigDict(
        json_schema_extra=one_of(
            ("box", "top"), ("cylinder", "top"), ("polygon", "top"), ("wall", "top"), ("plan", "top"), ("mesh",)
        )
    )
    name: Annotated[Name, Field(description="unique among obstacles and doors")]
    box: Annotated[Box | None, Field(description="a box by two corners, or by center and size")] = None
    cylinder: Annotated[Cylinder | None, Field(description="an upright cylinder")] = None
    polygon: Annotated[Ring | None, Field(description="outline of three points x, y or more [m]")] = None
    wall: Annotated[Wall | None, Field(description="a wall along a line, with openings")] = None
    plan: Annotated[Plan | None, Field(description="a floor plan in DXF")] = None
    mesh: Annotated[Mesh | None, Field(description="a file of triangles")] = None
    bottom: Annotated[Length, Field(description="height above the floor from which it reaches up [m]")] = 0.0
    top: Annotated[Length | None, Field(description="height above the floor up to which it reaches [m]")] = None
    movable: Annotated[bool, Field(description="whether commands may move and remove it while a simulation runs")] = (
        False
    )

    @model_validator(mode="after")
    def _check(self) -> Obstacle:
        """Refuse heights that do not go with the kind of obstacle, and shapes that are no solids."""
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
        """Return the solids of a drawn obstacle, several for a wall with openings; none for a file (mesh or plan)."""
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
    """A band of heights above the floor, or a plane at one height, with its own clearance for each behavior."""

    model_config = ConfigDict(json_schema_extra=one_of(("low", "high"), ("height",)))
    name: Annotated[Name, Field(description="unique among layers")]
    low: Annotated[Length | None, Field(description="least height above the floor [m]")] = None
    high: Annotated[Length | None, Field(description="greatest height above the floor [m]")] = None
    height: Annotated[Length | None, Field(description="of a plane above the floor, instead of low and high [m]")] = (
        None
    )

    @model_validator(mode="after")
    def _check(self) -> Layer:
        """Refuse a layer that is neither a band, from ``low`` up to ``high``, nor a plane at one ``height``."""
        if (self.low is None, self.high is None, self.height is None) not in (
            (False, False, True),
            (True, True, False),
        ):
            raise ValueError("a layer is given by 'low' and 'high', or by one 'height'")
        if self.low is not None and self.high is not None and self.high <= self.low:
            raise ValueError(f"'high' ({self.high}) must lie above 'low' ({self.low})")
        return self

    def band(self) -> AnyLayer:
        """Return the layer as a band or plane of :mod:`crowdsim.environment`."""
        if self.height is not None:
            return Plane(self.name, self.height)
        assert self.low is not None
        assert self.high is not None
        return Band(self.name, self.low, self.high)
