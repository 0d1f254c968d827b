"""Curves and areas of a DXF drawing, in meters; needs the extra package ezdxf."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.units import METERS, meters_per_unit
from crowdsim.errors import GeometryError, PlaceError, one_line

SAGITTA = 2e-3
"""How far the chords of a curve may leave it [m]. A smaller value makes more corners."""

_INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 10: "yd", 14: "dm"}
"""Codes of the drawing's unit that are plausible for a building."""

_AREAS = ("HATCH", "MPOLYGON", "SOLID", "TRACE")
"""Entities that draw a filled area."""

_DEPTH = 20
"""Greatest depth of nested blocks."""

_MANY = 500_000
"""Number of entities above which a drawing is refused, as nested blocks multiply."""


@dataclass(frozen=True)
class Drawing:
    """Content of a drawing: lines and areas (shapely, [m]), each with the name of its layer.

    layers: names of all layers that hold any. report: what was assumed or left out, one line each.
    """

    lines: list[tuple[str, BaseGeometry]]
    areas: list[tuple[str, BaseGeometry]]
    layers: list[str]
    report: list[str]


def read_dxf(file: Path, layers: Sequence[str] | None, floor_layer: str | None, units: str | None) -> Drawing:
    """Read the lines and areas of a drawing's model space, in meters.

    Arguments are those of :func:`crowdsim.environment.floor_plans.read_floor_plan`. Entities that draw no curve or are
    damaged are left out and reported. Raise PlaceError if ezdxf is not installed, the file cannot be read, its unit is
    not one of buildings, it has more than :data:`_MANY` entities, or nothing is drawn on a layer that is named by
    ``layers`` or ``floor_layer``.
    """
    document = _document(file)
    report: list[str] = []
    meters = _meters(file, document, units, report)
    known = {layer.dxf.name: layer for layer in document.layers}
    wanted = None if layers is None else {*layers, *([floor_layer] if floor_layer is not None else [])}
    lines: list[tuple[str, BaseGeometry]] = []
    areas: list[tuple[str, BaseGeometry]] = []
    others: dict[str, int] = {}
    seen: set[str] = set()
    for count, entity in enumerate(_resolved(document.modelspace(), 0)):
        if count >= _MANY:
            raise PlaceError(f"{file}: has more than {_MANY} entities; remove those that are not part of the building")
        name = str(entity.dxf.layer)
        seen.add(name)
        hidden = name in known and (known[name].is_off() or known[name].is_frozen())
        # Named layers are read even if they are hidden. Without names, all layers that are shown are read, and the
        # floor's in any case.
        if name not in wanted if wanted is not None else hidden and name != floor_layer:
            continue
        try:
            kind, shape = _shape(entity, meters)
        # A damaged entity can raise anything.
        except Exception as error:
            report.append(
                f"{file.name}: left out a {entity.dxftype()} on layer '{name}' ({type(error).__name__}: {error})"
            )
            continue
        if shape is None:
            others[entity.dxftype()] = others.get(entity.dxftype(), 0) + 1
        else:
            (areas if kind == "area" else lines).append((name, shape))
    # A named layer with nothing on it is a mistake in the name.
    missing = sorted((wanted or ({floor_layer} if floor_layer is not None else set())) - seen)
    if missing:
        raise PlaceError(
            f"{file}: nothing is drawn on layer {', '.join(missing)}; there are: {', '.join(sorted(seen))}"
        )
    if others:
        listed = ", ".join(f"{count} {kind}" for kind, count in sorted(others.items()))
        report.append(f"{file.name}: left out entities that draw no curve: {listed}")
    return Drawing(lines, areas, sorted({name for name, _ in lines + areas}), report)


def _document(file: Path) -> Any:
    """Open the drawing with ezdxf, repaired if necessary, or raise PlaceError."""
    try:
        import ezdxf
        from ezdxf import recover
    except ImportError:
        raise PlaceError(f"{file}: DXF files need ezdxf; install it with: pip install 'crowdsim[dxf]'") from None
    try:
        if file.stat().st_size == 0:
            raise PlaceError(f"{file}: the file is empty; export it again")
        try:
            return ezdxf.readfile(str(file))
        # The strict reader refuses damaged files; this one repairs what it can.
        except ezdxf.DXFError:
            return recover.readfile(str(file))[0]
    except PlaceError:
        raise
    # The parser can raise anything on damaged files.
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:
            raise PlaceError(f"{file}: cannot be read ({error.strerror}); check the path") from None
        said = f"{type(error).__name__}: {one_line(error)}"
        raise PlaceError(f"{file}: cannot be read as DXF ({said}); export it again") from None


def _meters(file: Path, document: Any, units: str | None, report: list[str]) -> float:
    """Return the length of the drawing's unit [m], and report where it comes from unless ``units`` gives it.

    A file that names no unit is in meters. Raise PlaceError if it names one that buildings are not drawn in.
    """
    if units is not None:
        return meters_per_unit(units)
    code = document.header.get("$INSUNITS", 0)
    if code in _INSUNITS:
        report.append(f"{file.name}: drawn in {_INSUNITS[code]}, as the file says")
        return METERS[_INSUNITS[code]]
    if code == 0:
        report.append(f"{file.name}: warning: the file names no unit; meters are assumed, or give 'units'")
        return 1.0
    raise PlaceError(f"{file}: its unit (code {code}) is not one of buildings; give 'units'")


def _resolved(entities: Any, depth: int) -> Iterator[Any]:
    """Yield the entities, with blocks replaced by their content; blocks nested deeper than _DEPTH are left out.

    ``depth`` is the number of blocks that the entities are nested in.
    """
    for entity in entities:
        if entity.dxftype() != "INSERT":
            yield entity
        elif depth < _DEPTH:
            # One reference can stand for rows and columns of copies.
            for insert in entity.multi_insert() if entity.mcount > 1 else [entity]:
                parts = list(insert.virtual_entities())
                for part in parts:
                    # By the rules of the format, layer 0 of a block stands for the layer of its reference.
                    if part.dxf.layer == "0":
                        part.dxf.layer = entity.dxf.layer
                yield from _resolved(parts, depth + 1)


def _shape(entity: Any, meters: float) -> tuple[str, BaseGeometry | None]:
    """Return an entity as ("area" or "line", shape [m]); the shape is None if the entity draws neither.

    ``meters`` is the length of the drawing's unit [m].
    """
    from ezdxf import path

    kind = entity.dxftype()
    if kind in ("HATCH", "MPOLYGON"):
        # Outlines inside of others are holes, in turn: even-odd filling.
        area = shapely.Polygon()
        for outline in path.from_hatch(entity):
            area = area.symmetric_difference(shapely.make_valid(shapely.Polygon(_points(outline, meters))))
        return "area", None if area.is_empty else area
    # ezdxf raises TypeError for what is no curve, such as text.
    try:
        curve = path.make_path(entity)
    except TypeError:
        return "line", None
    parts = [_points(part, meters) for part in curve.sub_paths()] if len(curve) else []
    if kind in _AREAS:
        return "area", shapely.make_valid(shapely.Polygon(parts[0])) if parts else None
    lines = [points for points in parts if len(points) > 1]
    return "line", shapely.multilinestrings([shapely.linestrings(points) for points in lines]) if lines else None


def _points(curve: Any, meters: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the points (n, 2) of a curve [m], without those that repeat the one before.

    ``meters`` is the length of the drawing's unit [m]. Raise GeometryError if a coordinate is not finite.
    """
    points = np.array([(point.x, point.y) for point in curve.flattening(SAGITTA / meters)], np.float64) * meters
    # To a micrometer, as ezdxf uses sines of the C library, whose last bits differ between processors.
    points = np.round(points, 6)
    if not np.isfinite(points).all():
        raise GeometryError("a coordinate is not a finite number")
    return np.asarray(points[np.concatenate([[True], (points[1:] != points[:-1]).any(axis=1)])])
