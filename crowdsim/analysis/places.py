"""Areas and lines at which a run is measured: those of its scenario, and those of the command line."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import shapely
from shapely import LineString, Polygon

from crowdsim.analysis.results import Place, Places
from crowdsim.errors import CrowdSimError
from crowdsim.recording.header import RecordingHeader, ShapeRecord

_LEAST = 1e-3
"""Least distance of two successive points of a line [m], and least size of an area [m2]."""


def places_of(header: RecordingHeader, lines: Sequence[str] = (), areas: Sequence[str] = ()) -> Places:
    """Return the areas and lines of a recording's scenario, and further ones.

    Parameters
    ----------
    header : RecordingHeader
        Its header, with the ``areas`` and ``lines`` of the scenario.
    lines, areas : sequence of str
        Further ones, as ``name=x0,y0,x1,y1`` [m]: two corners or more; an area of two is a rectangle.

    Raises
    ------
    CrowdSimError
        If a text is not of that form, names a place that is there, or draws no line or no area.
    """
    places = Places(
        {record.name: _of_scenario(record) for record in header.areas},
        {record.name: _of_scenario(record) for record in header.lines},
    )
    for text in areas:
        name, points = _read(text, "--area", places.areas)
        places.areas[name] = Place(_area(text, points))
    for text in lines:
        name, points = _read(text, "--line", places.lines)
        line = LineString(points)
        if any(math.dist(*ends) < _LEAST for ends in itertools.pairwise(points)):
            raise CrowdSimError(f"--line {text}: two points lie on each other; give points that differ")
        places.lines[name] = Place(line)
    return places


def _of_scenario(record: ShapeRecord) -> Place:
    """Return the area or line that a record of the recording's header holds as WKT, with its times [s]."""
    return Place(shapely.from_wkt(record.shape), record.start, record.end)


def _read(text: str, option: str, known: dict[str, Place]) -> tuple[str, list[tuple[float, float]]]:
    """Return name and corners [m] of a place given on the command line as ``name=x0,y0,x1,y1,...``.

    ``option`` is that of the command line, for messages; names of ``known`` places are refused.
    """
    name, equals, numbers = text.partition("=")
    name = name.strip()
    try:
        values = [float(number) for number in numbers.split(",")]
    except ValueError:
        values = []
    if not (name and equals and len(values) >= 4 and len(values) % 2 == 0 and all(map(math.isfinite, values))):
        raise CrowdSimError(f"{option} {text}: expected name=x0,y0,x1,y1 in meters, as in door=10,4.5,10,5.5")
    if name in known:
        raise CrowdSimError(f"{option} {text}: there is a place '{name}' already; choose another name")
    return name, list(zip(values[::2], values[1::2], strict=True))


def _area(text: str, points: list[tuple[float, float]]) -> Polygon:
    """Return the polygon of corners [m]; two are opposite ones of a rectangle. ``text`` is for messages."""
    if len(points) == 2:
        (x0, y0), (x1, y1) = points
        shape = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    else:
        shape = Polygon(points)
    if not shape.is_valid or shape.area < _LEAST:
        raise CrowdSimError(f"--area {text}: its corners enclose no area, or its sides cross; give them in order")
    return shape
