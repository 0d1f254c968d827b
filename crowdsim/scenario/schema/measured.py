"""Keys of a scenario file for measurements: areas and lines on the floor."""

from __future__ import annotations

import itertools
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field, model_validator
from shapely import LineString

from crowdsim.environment.solids import MIN_EXTENT
from crowdsim.scenario.schema.values import Name, Pair, Part, Region, Seconds, one_of


def _check_times(start_time: float, until: float | None) -> None:
    """Raise ValueError if a measurement ends before or when it starts [s]; ``until`` is None for the end of the run."""
    if until is not None and until <= start_time:
        raise ValueError(f"'until' ({until:g} s) must lie after 'start_time' ({start_time:g} s)")


class Area(Region):
    """A named part of the floor in which density, speed and the share of each behavior are measured.

    Density and speed are means over the time from ``start_time`` to ``until``.
    """

    model_config = ConfigDict(json_schema_extra=one_of(("rectangle",), ("circle",), ("polygon",)))
    name: Annotated[Name, Field(description="unique among areas")]
    start_time: Annotated[Seconds, Field(description="seconds from which on means are taken")] = 0.0
    until: Annotated[Seconds | None, Field(description="seconds until which means are taken; the end if absent")] = None

    @model_validator(mode="after")
    def _check_extent(self) -> Area:
        """Refuse an area that is a point, and times out of order."""
        if self.point is not None:
            raise ValueError("an area needs an extent; give rectangle, circle or polygon")
        _check_times(self.start_time, self.until)
        return self


def _checked_points(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the points of a line [m]; raise ValueError if two successive ones are less than MIN_EXTENT apart."""
    for first, second in itertools.pairwise(points):
        if max(abs(first[0] - second[0]), abs(first[1] - second[1])) < MIN_EXTENT:
            raise ValueError(f"two points of a line lie on each other: [{first[0]:g}, {first[1]:g}]")
    return points


class Line(Part):
    """A named line through ``points``; agents that cross it between ``start_time`` and ``until`` are counted."""

    name: Annotated[Name, Field(description="unique among lines")]
    points: Annotated[
        tuple[Pair, ...],
        Field(strict=False, min_length=2, max_length=1000, description="two points x, y or more [m]"),
        AfterValidator(_checked_points),
    ]
    start_time: Annotated[Seconds, Field(description="seconds from which on passages count")] = 0.0
    until: Annotated[Seconds | None, Field(description="seconds until which passages count; the end if absent")] = None

    @model_validator(mode="after")
    def _check(self) -> Line:
        """Refuse times out of order."""
        _check_times(self.start_time, self.until)
        return self

    def shape(self) -> LineString:
        """Return the line on the floor [m]."""
        return LineString(self.points)
