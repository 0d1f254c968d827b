"""Draw shapely areas in matplotlib figures, and write figures to files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import shapely

from crowdsim.whole_files import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SUFFIXES = (".png", ".svg", ".pdf")


def fill(axes: Axes, area: Any, **style: Any) -> None:
    """Draw a shapely area with its holes into ``axes``; ``style`` goes to matplotlib's ``PathPatch``."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(area))]
    if rings:
        axes.add_patch(PathPatch(Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings]), **style))


def write_figure(figure: Figure, file: str | os.PathLike[str]) -> None:
    """Write a figure as .png, .svg or .pdf; the file appears under its name only when it is complete."""
    with whole_file(file, _SUFFIXES, "pictures") as written:
        figure.savefig(written)
