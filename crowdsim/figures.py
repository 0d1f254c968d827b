"""Areas in matplotlib figures, and figures in files."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shapely

from crowdsim.errors import CrowdSimError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SUFFIXES = (".png", ".svg", ".pdf")


def fill(axes: Axes, area: Any, **style: Any) -> None:
    """Draw an area (shapely) with its holes."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(area))]
    if rings:
        axes.add_patch(PathPatch(Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings]), **style))


def write_figure(figure: Figure, file: str | os.PathLike[str]) -> None:
    """Write a figure as .png, .svg or .pdf; the file appears under its name when it is complete."""
    path = Path(file)
    if path.suffix.lower() not in _SUFFIXES:
        raise CrowdSimError(f"{path}: pictures are written as .png, .svg or .pdf; choose such a name")
    if not path.parent.is_dir():
        raise CrowdSimError(f"the folder {path.parent} does not exist; make it first")
    handle, written = tempfile.mkstemp(suffix=path.suffix, prefix=f".{path.stem}-", dir=path.parent)
    os.close(handle)
    try:
        figure.savefig(written)
        os.chmod(written, 0o644)
        os.replace(written, path)
    except BaseException:
        Path(written).unlink(missing_ok=True)
        raise
