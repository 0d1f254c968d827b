"""How figures of docs look, and how they are written: small SVG files, the same bytes from the same code."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch
from matplotlib.quiver import Quiver
from matplotlib.text import Text

# Okabe and Ito (2008): people with any kind of color vision tell these apart.
BLACK, ORANGE, SKY, GREEN = "#000000", "#e69f00", "#56b4e9", "#009e73"
BLUE, VERMILION, PURPLE, GRAY = "#0072b2", "#d55e00", "#cc79a7", "#8a8f96"
SOLID, FLOOR, EDGE = "#5b6068", "#f4f4f1", "#c9ccd0"

BEHAVIOR_COLORS = {"frontal": BLUE, "arm_constrained": ORANGE, "lateral": VERMILION}
BEHAVIOR_STYLES = {"frontal": "-", "arm_constrained": "--", "lateral": "-."}

WIDTH = 7.2
"""Inches: 691 pixels where a page is shown without scaling."""

DESCRIBED = "dc:description"

_SETTINGS = {
    "svg.hashsalt": "crowdsim",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#6b7078",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def new_figure(height: float, rows: int = 1, columns: int = 1, **grid: Any) -> tuple[Figure, list[Axes]]:
    """Return an empty figure of ``height`` inches, and its axes row by row."""
    figure = Figure(figsize=(WIDTH, height), dpi=96, layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False, **grid).flat)


def plan_view(axes: Axes, bounds: tuple[float, float, float, float], margin: float = 0.15) -> None:
    """Show ``bounds`` (left, bottom, right, top) [m] seen from above, the same scale both ways."""
    left, bottom, right, top = bounds
    axes.set(xlim=(left - margin, right + margin), ylim=(bottom - margin, top + margin), aspect="equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")


def styled() -> Any:
    """Return the settings that all figures are drawn and written with, as a context."""
    return mpl.rc_context(_SETTINGS)


def write_svg(figure: Figure, file: Path) -> None:
    """Write a figure with what is drawn in it (:func:`drawn`) as its description."""
    described = json.dumps(drawn(figure), separators=(",", ":"))
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Description": described})
    text = file.read_text(encoding="utf-8")
    head, end, body = text.partition("</metadata>")
    # A hundredth of a point is finer than any screen; matplotlib writes six digits.
    body = re.sub(r"-?\d+\.\d{3,}", lambda number: _short(float(number.group())), body)
    file.write_text(head + end + body, encoding="utf-8", newline="\n")


def _short(number: float) -> str:
    text = f"{number:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def read_drawn(file: Path) -> list[Any]:
    """Return what :func:`write_svg` kept in a file of what it drew."""
    found = re.search(rf"<{DESCRIBED}>(.*?)</{DESCRIBED}>", file.read_text(encoding="utf-8"), re.S)
    if found is None:
        raise ValueError(f"{file} does not say what is drawn in it; draw it anew with tools/draw_figures.py")
    text = found.group(1)
    for entity, sign in (("&quot;", '"'), ("&lt;", "<"), ("&gt;", ">"), ("&amp;", "&")):
        text = text.replace(entity, sign)
    return list(json.loads(text))


def drawn(figure: Figure) -> list[list[Any]]:
    """Return a row for each thing drawn: its kind, its text or the number of its points, and what sums them up.

    Points are summed up by the mean and the root mean square of x and y in the units of the axes, so that two figures
    can be compared to a tolerance, whatever drew them: neither fonts nor the layout of a version of matplotlib count.
    """
    rows: list[list[Any]] = []
    for axes in figure.axes:
        children: list[Artist] = [*axes.lines, *axes.collections, *axes.patches, *axes.images, *axes.texts]
        rows += [["title", axes.get_title()], ["labels", axes.get_xlabel(), axes.get_ylabel()]]
        rows += [row for child in children for row in _rows_of(child)]
    return rows


def _rows_of(child: Artist) -> list[list[Any]]:
    if isinstance(child, Text):
        return [["text", child.get_text(), *_summed(np.array([child.get_position()], float))]]
    if isinstance(child, Line2D):
        return [["line", *_summed(np.column_stack(child.get_data()).astype(float))]]
    if isinstance(child, AxesImage):
        values = np.ma.filled(np.ma.asarray(child.get_array(), float), 0.0).reshape(-1, 1)
        return [["image", *_summed(np.hstack([values, values]))]]
    if isinstance(child, Quiver):
        return [
            ["arrows", *_summed(np.asarray(child.get_offsets(), float)), *_summed(np.column_stack([child.U, child.V]))]
        ]
    if isinstance(child, Collection):
        paths = [path.vertices for path in child.get_paths()]
        offsets = np.asarray(child.get_offsets(), float)
        return [["collection", *_summed(np.concatenate([*paths, offsets]) if paths else offsets)]]
    if isinstance(child, FancyArrowPatch):
        return [["arrow", child.get_gid()]]  # its outline is known when it is drawn; figures name what it joins
    if isinstance(child, Patch):
        return [["patch", *_summed(child.get_patch_transform().transform(child.get_path().vertices))]]
    return []


def _summed(points: Any) -> list[float | int]:
    """Return how many points (n, 2) there are, and mean and root mean square of both coordinates."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return [0]
    mean, square = points.mean(axis=0), np.sqrt((points * points).mean(axis=0))
    return [len(points), *(float(f"{value:.6g}") for value in (*mean, *square))]


def alike(one: list[Any], other: list[Any], tolerance: float = 1e-4) -> bool:
    """Return whether two descriptions of :func:`drawn` say the same, numbers to a ``tolerance``."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(alike(a, b, tolerance) for a, b in zip(one, other, strict=True))
    if isinstance(one, float | int) and isinstance(other, float | int):
        return bool(abs(one - other) <= tolerance * max(1.0, abs(one), abs(other)))
    return bool(one == other)
