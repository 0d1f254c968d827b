"""Places from drawings seen from above: WKT polygons and floor plans in DXF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.dxf_drawing import Drawing, read_dxf
from crowdsim.environment.layers import polygons_only
from crowdsim.environment.sections import snapped_union
from crowdsim.environment.solids import MIN_EXTENT, Solid
from crowdsim.environment.units import meters_per_unit
from crowdsim.errors import GeometryError, PlaceError, one_line
from crowdsim.geometry.polygons import LARGE_EXTENT, buffered, clean_polygon
from crowdsim.whole_files import require_regular

WALL_THICKNESS = 0.10
"""Thickness of walls that a plan draws as lines [m]."""
WALL_HEIGHT = 2.5
"""Height of walls of a plan [m]."""

_MOST_TEXT = 100_000_000
"""Largest size of a .wkt file [bytes]."""

_JOINT = 1e-3
"""How far the ends of lines may be apart that are meant to meet [m]."""


@dataclass(frozen=True)
class FloorPlan:
    """Content of a floor plan.

    Attributes
    ----------
    floor
        The walkable area [m], or None if the plan draws none.
    solids
        Hatches in the order of the drawing, then closed curves, then open lines. Curves are ordered by the names of
        their layers; so are lines.
    report
        What was assumed or left out, one line each.
    """

    floor: Polygon | MultiPolygon | None
    solids: tuple[Solid, ...]
    report: tuple[str, ...]


def read_floor_plan(
    path: str | Path,
    *,
    content: bytes | None = None,
    layers: Sequence[str] | None = None,
    floor_layer: str | None = None,
    units: str | None = None,
    thickness: float = WALL_THICKNESS,
    bottom: float = 0.0,
    top: float = WALL_HEIGHT,
) -> FloorPlan:
    """Read a floor plan from a .wkt or .dxf file.

    WKT: a POLYGON or MULTIPOLYGON is the walkable floor with obstacles as holes. Of a GEOMETRYCOLLECTION, as JuPedSim
    writes it, the floor is the union.

    DXF: lines, arcs and other open curves are walls of ``thickness``; lines that meet at their ends form one wall.
    Closed curves and hatches are filled: they are obstacles from ``bottom`` to ``top``. But a closed curve with
    something else drawn inside is a wall along the curve, and one around the whole drawing is the floor, unless
    ``floor_layer`` names the floor. Blocks are resolved.

    Parameters
    ----------
    path
        The file.
    content
        The bytes of the file if it is not on disk (WKT).
    layers
        Names of the drawing's layers to read (DXF), even if they are switched off or frozen; by default all that are
        neither.
    floor_layer
        Name of the layer whose closed curves and hatches are the walkable floor (DXF); it is always read.
    units
        Unit of the file; by default the one that the file names (DXF, ``$INSUNITS``), else meters.
    thickness
        Thickness of walls [m].
    bottom, top
        Heights of walls and obstacles above the floor [m].

    Raises
    ------
    PlaceError
        If the file cannot be read, holds no polygon (WKT) or nothing to build with (DXF), nothing is on a layer that an
        argument names, or ezdxf is not installed.
    GeometryError
        If an argument is not valid.
    """
    file = Path(path)
    if not (math.isfinite(thickness) and thickness >= MIN_EXTENT):
        raise GeometryError(f"thickness: {thickness} m is not valid for a wall; give at least {MIN_EXTENT:g} m")
    if not (math.isfinite(bottom) and math.isfinite(top) and bottom < top):
        raise GeometryError(f"top: {top} m must lie above the bottom, {bottom} m")
    if file.suffix.lower() == ".wkt":
        return _read_wkt(file, content, 1.0 if units is None else meters_per_unit(units))
    if file.suffix.lower() == ".dxf":
        require_regular(file, PlaceError)
        drawing = read_dxf(file, layers, floor_layer, units)
        return _built(file, drawing, floor_layer, thickness, bottom, top)
    raise PlaceError(f"{file}: files ending in '{file.suffix}' cannot be read as floor plans; known are .wkt, .dxf")


def _read_wkt(file: Path, content: bytes | None, meters: float) -> FloorPlan:
    """Read the floor from a .wkt file, or from its ``content``; a unit of it is ``meters`` long."""
    if content is None:
        require_regular(file, PlaceError, _MOST_TEXT)
    try:
        text = (file.read_bytes() if content is None else content).decode("utf-8-sig").strip()
    except OSError as error:
        raise PlaceError(f"{file}: cannot be read ({error.strerror or error}); check the path") from None
    except UnicodeDecodeError:
        raise PlaceError(f"{file}: is not a text file; a .wkt file holds one polygon as well-known text") from None
    if not text:
        raise PlaceError(f"{file}: the file is empty; write a POLYGON into it")
    try:
        geometry = shapely.from_wkt(text)
    # NotImplementedError is raised for curves.
    except (shapely.errors.ShapelyError, NotImplementedError) as error:
        raise PlaceError(f"{file}: is not well-known text ({one_line(error)}); write one POLYGON") from None
    if meters != 1.0:
        geometry = shapely.transform(geometry, lambda places: meters * places)
    try:
        parts = _polygons_of(geometry, file)
        for polygon in shapely.get_parts(parts):
            _require_holes_inside(polygon, file)
        floor = shapely.union_all([clean_polygon(part, str(file)) for part in parts])
    except GeometryError as error:
        raise PlaceError(str(error)) from None
    report = [f"{file.name}: floor of {floor.area:.1f} m2, obstacles are its holes"]
    if not geometry.is_valid:
        why = shapely.is_valid_reason(geometry)
        report.append(f"{file.name}: warning: the outline crosses or touches itself ({why}) and was repaired")
    floor = polygons_only(floor)
    floor = floor.geoms[0] if len(floor.geoms) == 1 else floor
    return FloorPlan(floor, (), tuple(report + _doubts(file, floor)))


def _require_holes_inside(polygon: shapely.Polygon, file: Path) -> None:
    """Raise PlaceError if a hole lies outside of its polygon: it would cut nothing out. ``file`` is for messages."""
    outside = shapely.disjoint(shapely.Polygon(polygon.exterior), shapely.get_rings(polygon)[1:])
    if not polygon.is_valid and outside.any():
        x, y = polygon.interiors[int(np.argmax(outside))].coords[0]
        raise PlaceError(f"{file}: the hole at ({x:g}, {y:g}) is outside of its polygon; move or remove it")


def _polygons_of(geometry: BaseGeometry, file: Path) -> list[BaseGeometry]:
    """Return the polygons and multipolygons of a geometry; raise PlaceError for others or an empty collection.

    ``file`` is for messages only.
    """
    parts = [geometry]
    while any(part.geom_type == "GeometryCollection" for part in parts):
        parts = [
            inner for part in parts for inner in (part.geoms if part.geom_type == "GeometryCollection" else [part])
        ]
    wrong = sorted({part.geom_type.upper() for part in parts if not isinstance(part, Polygon | MultiPolygon)})
    if wrong or not parts:
        found = f"a {', '.join(wrong)}" if wrong else "an empty collection"
        raise PlaceError(
            f"{file}: holds {found}; a floor is a POLYGON, a MULTIPOLYGON or a GEOMETRYCOLLECTION of these"
        )
    return parts


def _doubts(file: Path, shape: BaseGeometry) -> list[str]:
    """Return a warning if the longer side of the place is below 1 m or above LARGE_EXTENT; else an empty list.

    ``shape`` is the area of the place [m]; ``file`` is for messages only.
    """
    x0, y0, x1, y1 = shape.bounds
    extent = max(x1 - x0, y1 - y0)
    if 1.0 <= extent <= LARGE_EXTENT:
        return []
    return [f"{file.name}: warning: the place is {extent:.3g} m wide; is it drawn in meters? give 'units' if not"]


def _built(
    file: Path, drawing: Drawing, floor_layer: str | None, thickness: float, bottom: float, top: float
) -> FloorPlan:
    """Build solids and a floor from a drawing, as :func:`read_floor_plan` says, whose arguments the others are.

    Raise PlaceError if the drawing gives neither.
    """
    report = list(drawing.report)
    filled: list[tuple[str, BaseGeometry]] = [(layer, area) for layer, area in drawing.areas if layer != floor_layer]
    outlines: list[tuple[str, Polygon]] = []
    open_lines: list[tuple[str, BaseGeometry]] = []
    floors = [area for layer, area in drawing.areas if layer == floor_layer]
    for layer in drawing.layers:
        drawn = [part for name, line in drawing.lines if name == layer for part in line.geoms]
        # Closed curves are taken one by one: merged with others that they touch they would no longer be closed.
        loose = [part for part in drawn if not part.is_closed]
        chains = shapely.get_parts(shapely.line_merge(snapped_union(loose, _JOINT)))
        for chain in [part for part in drawn if part.is_closed] + list(chains):
            outline = polygons_only(shapely.make_valid(Polygon(chain))) if chain.is_closed else MultiPolygon()
            if outline.area > MIN_EXTENT * MIN_EXTENT:
                outlines += [(layer, part) for part in outline.geoms]
            # The rest is open, or encloses no area: walls, but not on the floor's layer.
            elif layer != floor_layer:
                open_lines.append((layer, chain))
    floors += [outline for layer, outline in outlines if layer == floor_layer]
    outlines = [(layer, outline) for layer, outline in outlines if layer != floor_layer]
    things = [area for _, area in filled] + [outline for _, outline in outlines] + [line for _, line in open_lines]
    # Without a floor layer, the largest outline around everything else is the floor.
    if floor_layer is None and len(things) > 1:
        around = [pair for pair in outlines if all(pair[1].covers(thing) for thing in things)]
        if around:
            layer, outline = max(around, key=lambda pair: pair[1].area)
            outlines.remove((layer, outline))
            things = [thing for thing in things if thing is not outline]
            floors.append(outline)
            report.append(f"{file.name}: the closed curve around all others (layer '{layer}') is the floor")
    solids = []
    counts: dict[str, int] = {}

    def build(layer: str, shape: BaseGeometry) -> None:
        """Add a solid for each polygon of ``shape`` that is no sliver, numbered within its layer."""
        for part in polygons_only(shape).geoms:
            if part.area > MIN_EXTENT * MIN_EXTENT:
                counts[layer] = counts.get(layer, 0) + 1
                solids.append(Solid(f"{layer} {counts[layer]}", part, bottom, top))

    for layer, area in filled:
        build(layer, area)
    # An outline with something inside is a wall along its line, otherwise an obstacle.
    rooms = 0
    for layer, outline in outlines:
        within = [thing for thing in things if thing is not outline and outline.contains(thing)]
        rooms += bool(within)
        ring = buffered(outline.exterior, 0.5 * thickness, join_style="mitre")
        build(layer, ring if within else outline)
    for layer, line in open_lines:
        build(layer, buffered(line, 0.5 * thickness, cap_style="flat", join_style="mitre"))
    if rooms:
        report.append(f"{file.name}: {rooms} closed curves with something drawn inside are walls around it")
    if len(outlines) + len(filled) > rooms:
        report.append(f"{file.name}: {len(outlines) + len(filled) - rooms} closed curves and hatches are filled")
    floor = shapely.union_all(floors) if floors else None
    if not solids and floor is None:
        raise PlaceError(
            f"{file}: there is nothing to build with in the layers {', '.join(drawing.layers) or '(none)'}:\n"
            + "\n".join(report)
        )
    whole = shapely.union_all([*floors, *(solid.footprint for solid in solids)])
    return FloorPlan(floor, tuple(solids), tuple(report + _doubts(file, whole)))
