"""One result of an analysis: sentences, values, a table, and a picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Place(NamedTuple):
    """A shape, and the times from and until which a run is measured there [s]."""

    shape: Polygon | LineString
    start: float = 0.0
    end: float = math.inf

    def during(self, times: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether each of the times (n,) [s] counts: from ``start`` until before ``end``."""
        return np.asarray((times >= self.start) & (times < self.end))

    @property
    def times_in_words(self) -> str:
        """Return the times as the end of a sentence; an empty text if the whole run is measured."""
        if self.start <= 0.0 and self.end == math.inf:
            return ""
        return f" from {self.start:g} s on" if self.end == math.inf else f" from {self.start:g} to {self.end:g} s"


class Places(NamedTuple):
    """Areas and lines at which a run is measured, by name."""

    areas: dict[str, Place]
    lines: dict[str, Place]


@dataclass(frozen=True)
class Result:
    """What one kind of measurement found.

    Attributes
    ----------
    name, title : str
        Name, also of its files, and heading.
    values : dict
        Figures for programs; None stands for a figure that is unknown.
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
    """Return the polygons of a shape, without lines, points and polygons of no area."""
    return [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > 0.0]
