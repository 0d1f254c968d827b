"""Walls along a line, with doors and windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LinearRing, LineString
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from crowdsim.environment.layers import polygons_only
from crowdsim.environment.solids import MIN_EXTENT, Solid
from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import buffered

DOOR_HEIGHT = 2.05
"""Height above the floor up to which a door is open [m]."""

_CUT_EXCESS = 1.0 + 1e-6
"""Thickness of the cut of an opening, in thicknesses of the wall, so that rounding leaves no film across it."""


@dataclass(frozen=True)
class Opening:
    """A door or window in a wall.

    Attributes
    ----------
    at
        Distance along the wall's line to the middle of the opening [m].
    width
        Width along the line [m].
    bottom, top
        Heights above the floor [m]; a door begins at the floor, a window at its sill.
    """

    at: float
    width: float
    bottom: float = 0.0
    top: float = DOOR_HEIGHT

    def __post_init__(self) -> None:
        if not all(map(np.isfinite, (self.at, self.width, self.bottom, self.top))):
            raise GeometryError(f"opening: expected finite numbers, got {self}")
        if self.width < MIN_EXTENT:
            raise GeometryError(f"opening at {self.at:g} m: its width {self.width:g} m is too small")
        if self.top <= self.bottom:
            raise GeometryError(f"opening at {self.at:g} m: its top {self.top:g} m must lie above {self.bottom:g} m")


def wall(
    name: str,
    points: Sequence[tuple[float, float]],
    thickness: float,
    bottom: float,
    top: float,
    openings: Sequence[Opening] = (),
) -> tuple[Solid, ...]:
    """Build the prisms of a wall along a line, mitered at corners and flat at its ends.

    A line that ends where it began has no ends. Below an opening a sill remains, above it a lintel, if the wall reaches
    that far.

    Parameters
    ----------
    name
        Name of the wall.
    points
        (n, 2) line through the middle of the wall [m].
    thickness
        Thickness [m].
    bottom, top
        Heights above the floor [m].
    openings
        Doors and windows.

    Returns
    -------
    tuple of Solid
        The stretches between the openings, then what remains of each opening, named after the wall.

    Raises
    ------
    GeometryError
        If the line has fewer than two points or is not finite, if the thickness or the heights make no wall, or if an
        opening reaches past an end or into another.
    """
    what = f"wall '{name}'"
    line = _line(points, what)
    if not (np.isfinite(thickness) and thickness >= MIN_EXTENT):
        raise GeometryError(f"{what}: its thickness {thickness} m is too small")
    if not (np.isfinite(bottom) and np.isfinite(top) and bottom < top):
        raise GeometryError(f"{what}: its top {top} m must lie above its bottom {bottom} m")
    ordered = sorted(openings, key=lambda opening: opening.at)
    _check_openings(ordered, line.length, what)
    whole = _along(line, thickness)
    cuts = [_cut(line, opening, thickness) for opening in ordered]
    body = whole.difference(shapely.union_all(cuts)) if cuts else whole
    stretches = [part for part in polygons_only(body).geoms if part.area >= MIN_EXTENT * MIN_EXTENT]
    solids = [Solid(_numbered(name, k, len(stretches)), part, bottom, top) for k, part in enumerate(stretches)]
    for number, (opening, cut) in enumerate(zip(ordered, cuts, strict=True)):
        where = [part for part in polygons_only(whole.intersection(cut)).geoms if part.area >= MIN_EXTENT * MIN_EXTENT]
        for part_name, low, high in (
            ("sill", bottom, min(opening.bottom, top)),
            ("lintel", max(opening.top, bottom), top),
        ):
            if high - low >= MIN_EXTENT:
                what_remains = f"{name}, {_numbered(part_name, number, len(ordered))}"
                solids += [Solid(what_remains, part, low, high) for part in where]
    return tuple(solids)


def _line(points: Sequence[tuple[float, float]], what: str) -> LineString:
    """Return the line without repeated points; a LinearRing if it ends where it began, after three corners or more.

    Raise GeometryError, naming ``what``, if it has a coordinate that is not finite, or fewer than two distinct points.
    """
    array = np.asarray(points, np.float64).reshape(-1, 2)
    if not np.isfinite(array).all():
        raise GeometryError(f"{what}: its line has a coordinate that is not a finite number")
    array = array[np.concatenate([[True], (array[1:] != array[:-1]).any(axis=1)])] if len(array) else array
    if len(array) < 2:
        raise GeometryError(f"{what}: its line has {len(array)} distinct points; give at least two")
    closed = len(array) > 3 and (array[0] == array[-1]).all()
    return LinearRing(array) if closed else LineString(array)


def _along(line: LineString, thickness: float) -> BaseGeometry:
    """Return the area of a wall of some ``thickness`` [m] along a line, mitered at corners and flat at its ends."""
    return buffered(line, 0.5 * thickness, cap_style="flat", join_style="mitre")


def _cut(line: LineString, opening: Opening, thickness: float) -> BaseGeometry:
    """Return the area of an opening, slightly thicker than the wall of some ``thickness`` [m] along ``line``."""
    # A ring counts as the line from its first point around. Rounding may put the opening's begin below 0, which
    # substring would take as a place before the end of the wall.
    first = max(opening.at - 0.5 * opening.width, 0.0)
    piece = substring(LineString(line.coords), first, opening.at + 0.5 * opening.width)
    return _along(piece, _CUT_EXCESS * thickness)


def _check_openings(ordered: Sequence[Opening], length: float, what: str) -> None:
    """Raise GeometryError if an opening reaches past an end of the wall, ``length`` [m] long, or into another.

    ``ordered`` openings come in their order along the wall, which ``what`` names. A nanometer is left for rounding.
    """
    end = 0.0
    for opening in ordered:
        first, last = opening.at - 0.5 * opening.width, opening.at + 0.5 * opening.width
        if first < -1e-9 or last > length + 1e-9:
            raise GeometryError(
                f"{what}: the opening from {first:g} to {last:g} m reaches past the wall, which is {length:g} m long"
            )
        if first < end - 1e-9:
            raise GeometryError(f"{what}: the opening from {first:g} to {last:g} m begins inside of another")
        end = last


def _numbered(name: str, number: int, count: int) -> str:
    """Return the name; if there are ``count`` > 1 of it, with the index ``number``, counted from 1, behind it."""
    return name if count == 1 else f"{name} {number + 1}"
