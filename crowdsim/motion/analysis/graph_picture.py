"""Draw the error image with the transitions of both graphs (2011 paper, figure 2), and the feature-based graph."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from crowdsim.motion.analysis.error_image import ErrorImage, error_image, valleys
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.assembly import MotionGraph, clip_frames
from crowdsim.motion.graph.nodes import MotionSource, feature_segments, prepare_sources

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CLIP_COLORS = "tab20"
_PIXELS = 2000
"""Largest number of rows of the image that are drawn."""
_LABEL = 25
"""Largest number of letters of a clip's name beside its node."""


def draw_motion_graph(sources: Sequence[MotionSource], graph: MotionGraph) -> Figure:
    """Draw the error image of ``sources`` with both graphs' transitions, and their feature-based ``graph``."""
    from matplotlib.figure import Figure

    image = error_image([source.clip for source in sources])
    figure = Figure(figsize=(19.0, 9.2), dpi=110)
    margins = {"left": 0.04, "right": 0.99, "bottom": 0.09, "top": 0.9, "wspace": 0.02}
    left, right = figure.subplots(1, 2, gridspec_kw=margins)
    _draw_image(left, image, sources, graph)
    _draw_graph(right, sources, graph)
    return figure


def _draw_image(axes: Axes, image: ErrorImage, sources: Sequence[MotionSource], graph: MotionGraph) -> None:
    """Draw the error image, its local minima, and the graph's transitions and cuts."""
    count = int(image.clip_first[-1])
    step = max(1, -(-count // _PIXELS))
    shown = axes.imshow(
        image.distance[::step, ::step],
        cmap="jet",
        vmin=0.0,
        extent=(0, count, count, 0),
        interpolation="nearest",
    )
    axes.figure.colorbar(shown, ax=axes, label="distance, m", fraction=0.04, pad=0.02)
    first = {s.clip.name: int(row) for s, row in zip(sources, image.clip_first, strict=False)}
    size = max(2.0, 900.0 / np.sqrt(count))
    minima = valleys(image, graph.report.threshold)
    places = [clip_frames(name) for name in graph.node_names]
    row_of = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    ends = np.array([first[clip] + last for clip, _, last in places])[row_of]
    starts = np.array([first[clip] + begin for clip, begin, _ in places])[graph.arrays.edge_target]
    # Edges that go on with their clip leave and enter the same frame, and are no transitions.
    joins = ends != starts
    axes.scatter(
        minima[1], minima[0], s=size, c="red", linewidths=0, label=f"{len(minima[0]):,} local minima (standard graph)"
    )
    # A white cross below each black one, so that it is seen on dark colors.
    axes.scatter(starts[joins], ends[joins], s=3.0 * size, c="white", marker="x", linewidths=2.4)
    axes.scatter(
        starts[joins],
        ends[joins],
        s=2.4 * size,
        c="black",
        marker="x",
        linewidths=1.1,
        label=f"{int(joins.sum()):,} transitions between cuts (feature-based graph)",
    )
    cuts = np.array(_cut_frames(sources, image))
    bar = 0.012 * count
    axes.vlines(cuts, -2.0 * bar, -0.5 * bar, color="black", lw=0.7, clip_on=False)
    axes.hlines(cuts, -2.0 * bar, -0.5 * bar, color="black", lw=0.7, clip_on=False)
    for row in image.clip_first[1:-1]:
        axes.axvline(row, color="white", lw=0.3)
        axes.axhline(row, color="white", lw=0.3)
    axes.set(xlim=(-2.0 * bar, count), ylim=(count, -2.0 * bar))
    axes.set(xlabel="frame that is entered", ylabel="frame that is left")
    clips = len(image.clip_first) - 1
    axes.set_title(
        f"How far each frame is from each other: {count:,} frames of {clips} clips (white lines)\n"
        f"marks: where they may be joined, within {graph.report.threshold * 100:.1f} cm; ticks: the feature cuts",
        pad=14,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2, frameon=False, markerscale=1.5)


def _cut_frames(sources: Sequence[MotionSource], image: ErrorImage) -> list[int]:
    """Return the rows of the image at which features cut."""
    rows: set[int] = set()
    for prepared, first in zip(prepare_sources(sources), image.clip_first.tolist(), strict=False):
        for segment in feature_segments(prepared):
            rows |= {first + segment.first, first + segment.last}
    return sorted(rows)


def _draw_graph(axes: Axes, sources: Sequence[MotionSource], graph: MotionGraph) -> None:
    """Draw the nodes on a circle in the order of their clips, with their edges; gray ones continue the capture."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    count = graph.report.nodes
    angle = 2.0 * np.pi * np.arange(count) / count
    place = np.column_stack([np.cos(angle), np.sin(angle)])
    names = [clip_frames(name) for name in graph.node_names]
    clips = [source.clip.name for source in sources]
    color = colormaps[_CLIP_COLORS](np.array([clips.index(name[0]) for name in names]) % 20)
    row_of = np.repeat(np.arange(count), np.diff(graph.arrays.edge_start))
    lines, colors, widths = [], [], []
    for a, b in zip(row_of.tolist(), graph.arrays.edge_target.tolist(), strict=True):
        natural = names[a][0] == names[b][0] and names[a][2] == names[b][1]
        lines.append(_curve(place[a], place[b]))
        colors.append((0.3, 0.3, 0.3, 1.0) if natural else (*color[a][:3], 0.5))
        widths.append(2.2 if natural else max(0.3, min(1.2, 200.0 / graph.report.edges)))
    axes.add_collection(LineCollection(lines, colors=colors, linewidths=widths))
    axes.scatter(
        place[:, 0],
        place[:, 1],
        s=np.clip(4000.0 / count, 8.0, 90.0),
        c=color,
        edgecolors="black",
        linewidths=0.6,
        zorder=3,
    )
    # Names only if there is room for them; on the left half of the circle turned around, so that none is upside down.
    for i in range(count) if count <= 60 else ():
        turn = np.degrees(angle[i])
        flip = 90.0 < turn < 270.0
        axes.text(
            1.05 * place[i, 0],
            1.05 * place[i, 1],
            _label(graph.node_names[i]),
            fontsize=6.5,
            rotation=turn + 180.0 * flip,
            rotation_mode="anchor",
            ha="right" if flip else "left",
            va="center",
        )
    report = graph.report
    axes.set_title(
        f"Feature-based graph: {report.nodes} segments, {report.transitions:,} transitions, "
        f"branching {report.branching:.2f}, {report.out_degree:.1f} ways on from each"
    )
    handles = [
        Line2D([], [], color=(0.3, 0.3, 0.3), lw=2.2, label="goes on in its capture"),
        Line2D([], [], color=color[0], lw=1.2, label="transition, in the color of the capture that is left"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, frameon=False)
    axes.set(xlim=(-1.72, 1.72), ylim=(-1.72, 1.72), aspect="equal")
    axes.axis("off")


def _label(node: str) -> str:
    """Return a node's name, shortened in the middle if it is long: trials differ at both ends."""
    clip, first, last = clip_frames(node)
    if len(clip) > _LABEL:
        # Its first five letters, and its last ones from behind an underscore on, if there is one.
        _, _, tail = clip[6 - _LABEL :].partition("_")
        clip = f"{clip[:5]}\N{HORIZONTAL ELLIPSIS}{tail or clip[6 - _LABEL :]}"
    return f"{clip} {first}\N{EN DASH}{last}"


def _curve(a: Floats, b: Floats) -> Floats:
    """Return points (n, 2) from a to b (2,) on the unit circle, bent inward; an outward loop if both are the same."""
    if np.allclose(a, b):
        turn = np.linspace(0.0, 2.0 * np.pi, 13)[:, None]
        side = np.array([-a[1], a[0]])
        loop: Floats = a * (1.0 + 0.03 * (1.0 - np.cos(turn))) + 0.02 * np.sin(turn) * side
        return loop
    u = np.linspace(0.0, 1.0, 17)[:, None]
    middle = 0.25 * (a + b) + 0.08 * np.array([a[1] - b[1], b[0] - a[0]])
    curve: Floats = (1.0 - u) ** 2 * a + 2.0 * u * (1.0 - u) * middle + u**2 * b
    return curve
