"""Figures of what bodies do: clearances by height, a small motion graph, and the footsteps of a deformed clip."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import read_behavior
from crowdsim.behaviors.clearance_profiles import measure_profile
from crowdsim.constants import CAPTURE_RATE
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.deformed.phase_kernels import advance_phases
from crowdsim.motion.deformed.step_plan import plan_steps
from crowdsim.motion.graph.assembly import clip_frames
from crowdsim.motion.graph.motion_graph import build_motion_graph
from crowdsim.motion.graph.nodes import MotionSource
from crowdsim.motion.graph.segmentation import segment_clip
from tools.figures.style import (
    BEHAVIOR_COLORS,
    BLACK,
    BLUE,
    GRAY,
    GREEN,
    ORANGE,
    VERMILION,
    new_figure,
)

LABEL = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 0.8}

LIBRARY = library_folder("behaviors")
NAMES = ("frontal", "arm_constrained", "lateral")
BEST = 3
"""Edges out of a node that are kept in the figure of a graph: with all of them, few could be told apart."""

POSED = {"frontal": ("walk", 0.0, 128), "arm_constrained": ("walk", 0.0, 128), "lateral": ("side_left", 90.0, 120)}
"""A clip, the side its body faces [degrees], and a frame of it to show."""


def clip_of(behavior: str, name: str) -> Clip:
    """Read a clip of the library."""
    return read_clip(LIBRARY / behavior / "clips" / f"{name}.bvh")


def draw_clearance() -> Figure:
    """How wide the body is at each height in each behavior, seen along its way."""
    figure, panels = new_figure(4.3, columns=3, sharey=True)
    for axes, name in zip(panels, NAMES, strict=True):
        color, profile = BEHAVIOR_COLORS[name], measure_profile(name, LIBRARY)
        for band, look in ((LEGS, "#00000010"), (TORSO, "#00000014")):
            axes.axhspan(band.low, band.high, color=look, linewidth=0)
        half = 0.5 * profile.diameters
        axes.fill_betweenx(profile.heights, -half, half, color=color, alpha=0.25, linewidth=0)
        for side in (-half, half):
            axes.plot(side, profile.heights, color=color, linewidth=1.8)
        _draw_body(axes, name)
        inside = (profile.heights >= TORSO.low) & (profile.heights <= TORSO.high)
        row = int(np.argmax(np.where(inside, profile.diameters, 0.0)))
        width, height = float(profile.diameters[row]), float(profile.heights[row])
        arrow = {"arrowstyle": "<->", "color": BLACK, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (-0.5 * width, height), (0.5 * width, height), arrowprops=arrow)
        axes.annotate(f"{width:.2f} m", (0.0, height + 0.035), ha="center", va="bottom", weight="bold", bbox=LABEL)
        axes.set(xlim=(-0.5, 0.5), ylim=(0.0, 2.15), aspect="equal", title=name.replace("_", " "))
        axes.set_xlabel("across the motion [m]")
    panels[0].set_ylabel("height above the floor [m]")
    panels[0].annotate("layer\n'legs'", (-0.48, 1.98), va="top", fontsize=7.5, color="#3c4147")
    panels[0].annotate("layer\n'torso'", (-0.48, 1.48), va="top", fontsize=7.5, color="#3c4147")
    return figure


def _draw_body(axes: Axes, behavior: str) -> None:
    """Draw the bones of one frame, seen along the way of the body."""
    name, side, frame = POSED[behavior]
    clip = clip_of(behavior, name)
    track, joints = track_of(clip)[frame], clip.joint_positions[frame]
    way = track[2] - np.radians(side)
    offset = (joints[:, :2] - track[:2]) @ np.array([np.sin(way), -np.cos(way)])
    # The middle of the diameters, which do not ask where the track is.
    offset = offset - 0.5 * (offset.min() + offset.max())
    bones = [
        [(offset[parent], joints[parent, 2]), (offset[joint], joints[joint, 2])]
        for joint, parent in enumerate(clip.skeleton.parents)
        if parent >= 0
    ]
    axes.add_collection(LineCollection(bones, colors="#3c4147", linewidths=2.2, capstyle="round"))


def draw_graph() -> Figure:
    """Draw a clip cut where one ankle passes the other leg, and the motion graph of three clips."""
    names = ("walk", "walk_left_45", "stand")
    detectors = tuple(read_behavior("frontal", LIBRARY).detectors)
    sources = [MotionSource(clip_of("frontal", name), 0, detectors, idle=name == "stand") for name in names]
    graph = build_motion_graph(sources, max_out_edges=BEST)
    figure, (above, below) = new_figure(6.6, rows=2, height_ratios=[1.0, 2.1])
    _draw_cuts(above, sources[0].clip, detectors)
    _draw_nodes(below, graph.node_names, graph.arrays.edge_start, graph.arrays.edge_target)
    return figure


def _draw_cuts(axes: Axes, clip: Clip, detectors: tuple[str, ...]) -> None:
    """Draw how far ahead of the body each ankle is, and where the clip is cut."""
    track, joints = track_of(clip), clip.joint_positions
    seconds = np.arange(clip.frame_count) / CAPTURE_RATE
    ahead = np.stack([np.cos(track[:, 2]), np.sin(track[:, 2])], axis=-1)
    for side, color, style in (("left", BLUE, "-"), ("right", VERMILION, "--")):
        ankle = joints[:, clip.skeleton.joint(f"{side}_ankle"), :2] - track[:, :2]
        axes.plot(seconds, (ankle * ahead).sum(axis=1), color=color, linestyle=style, label=f"{side} ankle")
    for segment in segment_clip(clip, detectors):
        middle = 0.5 * (seconds[segment.first] + seconds[segment.last])
        axes.axvline(seconds[segment.first], color=GRAY, linewidth=1.0)
        axes.axvline(seconds[segment.last], color=GRAY, linewidth=1.0)
        axes.annotate(f"{segment.first}-{segment.last}", (middle, 0.52), ha="center", fontsize=7.5, color="#3c4147")
    axes.set(xlabel="time [s]", ylabel="ahead of the body [m]", xlim=(0.0, seconds[-1]), ylim=(-0.72, 0.62))
    axes.set_title("clip 'walk': cut where it stands and where the right ankle passes the left leg", loc="left", pad=8)
    axes.legend(loc="lower right", ncols=2, frameon=False)


def _draw_nodes(axes: Axes, names: tuple[str, ...], starts: NDArray[np.int32], targets: NDArray[np.int32]) -> None:
    """Draw nodes around a circle, in the order of their clips, and what may follow what."""
    count = len(names)
    angles = 0.5 * np.pi - 2.0 * np.pi * np.arange(count) / count
    places = np.column_stack([1.55 * np.cos(angles), np.sin(angles)])
    frames = [clip_frames(name) for name in names]
    colors = {"walk": BLUE, "walk_left_45": ORANGE, "stand": GREEN}
    for node in range(count):
        for other in targets[starts[node] : starts[node + 1]].tolist():
            goes_on = frames[node][0] == frames[other][0] and frames[node][2] == frames[other][1]
            look: dict[str, Any] = {"color": BLACK if goes_on else "#aab0b7", "linewidth": 1.8 if goes_on else 0.8}
            look |= {"zorder": 3 if goes_on else 2, "gid": f"{names[node]} to {names[other]}"}
            if other != node:
                bend = "arc3,rad=0.12"
                shrink = {"shrinkA": 11, "shrinkB": 11, "mutation_scale": 8, "connectionstyle": bend}
                axes.add_patch(
                    FancyArrowPatch(tuple(places[node]), tuple(places[other]), arrowstyle="-|>", **shrink, **look)
                )
    for place, (clip, first, last) in zip(places, frames, strict=True):
        axes.plot(
            *place, "o", color="white", markeredgecolor=colors[clip], markersize=19, markeredgewidth=2.2, zorder=4
        )
        beside = {"ha": "left" if place[0] > 0.0 else "right", "va": "center"}
        above = {"ha": "center", "va": "bottom" if place[1] > 0.0 else "top"}
        shift = (15.0 * np.sign(place[0]), 0.0) if abs(place[0]) > 0.3 else (0.0, 14.0 * np.sign(place[1]))
        look = {"xytext": shift, "textcoords": "offset points", "fontsize": 7.5, "zorder": 5}
        axes.annotate(f"{clip}\n{first}-{last}", tuple(place), **look, **(beside if abs(place[0]) > 0.3 else above))
    axes.plot([], [], color=BLACK, linewidth=1.8, label="goes on as in its clip")
    axes.plot([], [], color="#aab0b7", linewidth=0.8, label="transition: both moments are alike")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, frameon=False)
    axes.set(xlim=(-2.15, 2.15), ylim=(-1.35, 1.3), aspect="equal")
    axes.axis("off")
    title = f"the graph of three clips: {count} nodes (clip, first to last frame), at most {BEST} edges out of each"
    axes.set_title(title, loc="left")


def body_track() -> NDArray[np.float64]:
    """Return a track (N, 4) at 10 Hz, x, y [m], heading [rad], phase [cycles].

    Walk, turn left, stop, stand, step to the left, stand.
    """
    at = np.arange(0.0, 10.0, 0.1)
    knots = np.array([0.0, 0.8, 2.0, 2.5, 3.9, 4.4, 5.2, 6.0, 6.8, 7.4, 9.0, 9.4, 10.0])
    ahead = np.interp(at, knots, [0.0, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    side = np.interp(at, knots, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.45, 0.45, 0.0, 0.0])
    turn = np.interp(at, knots, [0.0, 0.0, 0.0, 0.8, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    heading = np.cumsum(turn * 0.1)
    velocity = np.column_stack(
        [ahead * np.cos(heading) - side * np.sin(heading), ahead * np.sin(heading) + side * np.cos(heading)]
    )
    places = np.column_stack([np.cumsum(velocity * 0.1, axis=0), heading])
    phases, anchor, rows = np.array([0.06]), places[:1].copy(), []
    for place, speed, rate in zip(places, velocity, turn, strict=True):
        advance_phases(place[None].copy(), speed[None].copy(), np.array([rate]), 0.1, phases, anchor)
        rows.append([*place, phases[0]])
    return np.array(rows)


def draw_footprints() -> Figure:
    """Draw the track of a body, and where its feet stand."""
    clip = deform_clip(clip_of("frontal", "walk"))
    track = body_track()
    plan = plan_steps(clip, [track])
    figure, (axes,) = new_figure(4.9)
    axes.plot(*track[:, :2].T, color=GRAY, linewidth=1.5, label="track: a place and a heading every 0.1 s")
    axes.quiver(
        *track[::5, :2].T, np.cos(track[::5, 2]), np.sin(track[::5, 2]), color=GRAY, width=0.003, scale=28, zorder=3
    )
    half = plan.halves[0] + np.arange(len(plan.steps))
    shown = (half >= np.floor(2.0 * track[0, 3]) - 1.0) & (half <= np.floor(2.0 * track[-1, 3]))
    for number, step in zip(half[shown].tolist(), plan.steps[shown], strict=True):
        foot = int(number) % 2
        length = float(clip.model.bones[foot, 2]) + HEEL_BACK
        color = BLUE if foot == 0 else VERMILION
        axes.add_patch(Polygon(_sole(step[:3], length), facecolor=f"{color}66", edgecolor=color, linewidth=1.2))
    for name, color in (("left foot", BLUE), ("right foot", VERMILION)):
        axes.plot([], [], "s", color=f"{color}66", markeredgecolor=color, label=name)
    for second, text, shift in (
        (0.0, "sets off", (-4, 30)),
        (1.7, "walks 1.2 m/s", (0, 30)),
        (3.3, "turns", (34, -14)),
        (6.4, "stands", (34, 6)),
        (8.4, "steps aside", (0, 26)),
    ):
        place = track[round(10 * second)]
        axes.add_patch(Circle(tuple(place[:2]), 0.18, facecolor="none", edgecolor=GRAY, linestyle=":"))
        axes.annotate(text, tuple(place[:2]), xytext=shift, textcoords="offset points", ha="center")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.margins(0.08)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _sole(ball: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return the outline of a foot whose ball is at x, y, turned by a heading."""
    ahead = np.array([np.cos(ball[2]), np.sin(ball[2])])
    aside = np.array([-ahead[1], ahead[0]])
    around = np.linspace(0.0, np.pi, 9)
    toe = ball[:2] + 0.045 * (np.sin(around)[:, None] * ahead * 1.4 + np.cos(around)[:, None] * aside)
    heel = ball[:2] - (length - 0.03) * ahead
    back = heel + 0.03 * (-np.sin(around)[:, None] * ahead - np.cos(around)[:, None] * aside)
    return np.vstack([toe, back])
