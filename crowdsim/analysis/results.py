"""One result of an analysis: sentences, values, a table, and a picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import shapely
from shapely import LineString, Polygon

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Places(NamedTuple):
    """Areas and lines at which a run is measured, by name."""

    areas: dict[str, Polygon]
    lines: dict[str, LineString]


@dataclass(frozen=True)
class Result:
    """What one kind of measurement found.

    Attributes
    ----------
    name, title : str
        Name, also of its files, and heading.
    values : dict
        Figures for programs; None where there is none.
    sentences : tuple of str
        The same for readers, and why something is missing.
    table : pandas.DataFrame or None
        What the picture shows.
    draw : callable or None
        Draws into an empty matplotlib figure; None if there is nothing to draw.
    """

    name: str
    title: str
    values: dict[str, Any] = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    table: pandas.DataFrame | None = None
    draw: Callable[[Figure], None] | None = None


def polygons_of(shape: shapely.Geometry) -> list[Polygon]:
    """Return the polygons of a shape."""
    return [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > 0.0]
