"""All agents of a recording as one mesh whose vertices move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.playback.bodies.builds import builds_of
from crowdsim.playback.bodies.sculptor import build_body
from crowdsim.playback.body_mesh import BodyMesh, Tissue
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording

Colors = NDArray[np.uint8]

_TROUSERS = np.array([[74, 84, 108], [112, 100, 86], [66, 76, 88], [134, 128, 118], [86, 94, 80]], np.uint8)
_SKIN = np.array([[246, 208, 182], [226, 182, 148], [188, 136, 100], [142, 98, 72], [236, 194, 164]], np.uint8)
_HAIR = np.array([[48, 36, 28], [86, 60, 38], [28, 26, 26], [142, 108, 66], [104, 98, 94]], np.uint8)
_SHOES = np.array([[52, 50, 50], [92, 68, 52], [84, 86, 92]], np.uint8)

_SHADES = np.array([0.0, -0.18, 0.16, -0.09, 0.26, 0.08, -0.26])
"""Shares of black (below 0) or white (above 0) mixed into the shirts of agents, which share the hue of a behavior."""

LEVEL_COLORS = {Level.CAPTURED: "#2f8f6b", Level.STEERED: "#d2882b"}
"""Colors of shirts that show the level of an agent."""
_LEVELS = Level.STEERED, Level.CAPTURED
"""In the order of ``np.where``: color if an agent is steered, color if not."""

_SCALE = np.array([[38, 70, 120], [42, 140, 140], [120, 190, 90], [250, 220, 60]], np.float64)
"""Colors from the smallest value of a numeric attribute to the greatest."""
_NO_ATTRIBUTE = np.array([150, 150, 150], np.uint8)

_SHADOW_SIDES = 20
_SHADOW_HEIGHT = 0.008
"""Height of shadows of people above the floor [m]: above the shadows of solids and below planned paths."""
_FOOT = (0.21, 0.11)
"""Half length and half breadth of a foot's shadow [m]."""
_SOLE = 0.03
"""Height of the ball of a planted foot [m]."""
_NO_SHADOW = 0.25
"""Height above _SOLE at which the shadow of a foot has vanished [m]."""

# Pairs of a number of agents and the corners of a body's cross-sections in pictures of up to that many: with more
# agents, fewer corners suffice.
_SIDES = ((40, 16), (300, 10), (1500, 6), (10**9, 5))
_SMALL, _SMALL_SIDES = 240.0, 10
"""Height in pixels below which a body has no more corners than these: more of them are not seen."""
_MANY, _NEAR = 300, 150
"""Number of agents beyond which those nearest to the eye are drawn with finer bodies, and how many of these."""
_FLESH = 0.13
"""How far the wide shadow of a body reaches beyond its joints [m]."""


def hex_color(text: str) -> Colors:
    """Return (3,) RGB of ``#rrggbb``."""
    return np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)], np.uint8)


def distinct_colors(count: int) -> Colors:
    """Return (count, 3) RGB colors whose hues are a golden angle apart, so that neighbors in the list differ most."""
    # 0.58 is a blue. `channel` is the usual conversion of hues to RGB; 0.28 to 0.82 of full light make soft colors.
    hue = np.mod(np.arange(count) * 0.61803398875 + 0.58, 1.0)[:, None]
    channel = np.clip(np.abs(np.mod(hue * 6.0 + np.array([0.0, 4.0, 2.0]), 6.0) - 3.0) - 1.0, 0.0, 1.0)
    colors: NDArray[np.uint8] = (255.0 * (0.28 + 0.54 * channel)).astype(np.uint8)
    return colors


def attribute_colors(values: NDArray[Any]) -> tuple[Colors, list[tuple[str, str]]]:
    """Return colors (n, 3) of an attribute, and a legend of words or numbers with ``#rrggbb``; gray for no value.

    ``values`` (n,) are numbers, with nan for no value, or texts, with "" for none. The legend of numbers holds the
    least and the greatest, one entry if they are equal, and 0 if no agent has a value.
    """
    if np.issubdtype(values.dtype, np.number):
        given = values[~np.isnan(values)]
        low, high = (float(given.min()), float(given.max())) if len(given) else (0.0, 0.0)
        at = (np.nan_to_num(values, nan=low) - low) / (high - low if high > low else 1.0)
        colors = np.stack([np.interp(at, np.linspace(0.0, 1.0, len(_SCALE)), channel) for channel in _SCALE.T], axis=1)
        colors[np.isnan(values)] = _NO_ATTRIBUTE
        ends = [(low, _SCALE[0])] if low == high else [(low, _SCALE[0]), (high, _SCALE[-1])]
        return colors.astype(np.uint8), [(f"{value:g}", _hex(color)) for value, color in ends]
    words = np.unique(values[values != ""])
    palette = np.concatenate([distinct_colors(len(words)), _NO_ATTRIBUTE[None]])
    which = np.where(values == "", len(words), np.searchsorted(words, values))
    return palette[which], [(str(word), _hex(color)) for word, color in zip(words, palette, strict=False)]


def _hex(color: NDArray[Any]) -> str:
    """Return ``#rrggbb`` of a color (3,), 0 to 255."""
    return "#" + "".join(f"{int(channel):02x}" for channel in color)


def crowd_meshes(recording: Recording, color_by: str, tallest: float = np.inf) -> list[CrowdMesh]:
    """Return one mesh for all agents, or two: a finer one for the _NEAR nearest agents, and one for the others.

    There are two if more than _MANY agents are present at once. ``tallest`` is how tall a body is in the picture at
    most [pixels]; below _SMALL, bodies have fewer corners. ``color_by`` is as of :class:`CrowdMesh`.
    """
    counts = [max(recording.most_present, 1)]  # if nobody ever appears, one mesh that draws nothing
    if counts[0] > _MANY:
        counts.insert(0, _NEAR)
    meshes = []
    for count in counts:
        sides = next(sides for limit, sides in _SIDES if count <= limit)
        if tallest < _SMALL:
            sides = min(sides, _SMALL_SIDES)
        meshes.append(CrowdMesh(recording, color_by, sides, count))
    return meshes


def shown_by(
    meshes: Sequence[CrowdMesh], recording: Recording, time: float, eye: ArrayLike, target: ArrayLike
) -> list[NDArray[np.int64]]:
    """Return the numbers of the agents that each of ``meshes`` shows at ``time`` [s] to a camera, in ascending order.

    ``meshes`` are those of :func:`crowd_meshes`. Of two, the first shows the _NEAR nearest agents, with those behind
    the camera last, and the second all others. ``eye`` is (x, y, z) of the camera [m], ``target`` that of a point in
    the middle of the picture.
    """
    frame = recording.at_time(time)
    here = shown_agents(frame)
    if len(meshes) == 1:
        return [here]
    x, y = frame.x[here] - np.asarray(eye)[0], frame.y[here] - np.asarray(eye)[1]
    ahead = np.subtract(target, eye)
    # First those before the camera, from near to far, then those behind it.
    order = np.lexsort((x * x + y * y, x * ahead[0] + y * ahead[1] < 0.0))
    return [np.sort(here[order[:_NEAR]]), np.sort(here[order[_NEAR:]])]


def shown_agents(frame: RecordedFrame) -> NDArray[np.int64]:
    """Return the agents that have a body in a frame: present, and posed from a node of the motion graph or steered."""
    return np.flatnonzero((frame.state != AgentState.ABSENT) & ((frame.node >= 0) | frame.steered))


class CrowdMesh:
    """Points, normals and colors of ``count`` bodies, and soft shadows on the floor.

    ``count`` is by default the largest number of agents present at once. The agents shown get the first bodies, in
    order. Unused bodies shrink to a point, which draws nothing. ``sides`` is the number of corners of a body's
    cross-sections. ``color_by`` says what the color of shirts shows: "behavior", "group", "agent" or "level", or the
    name of an attribute of the agents.

    Of bodies with V vertices each, ``points`` [m] and unit ``normals`` are (count, V, 3) float32 in the world, and
    ``colors`` are (count, V, 3) uint8. ``shadow_points`` are (count, S, 3) [m] of S points in three discs. Of all
    bodies together, ``triangles`` and ``shadow_triangles`` are (F, 3), and ``shadow_colors`` (count * S, 4) uint8 with
    opacity. Triangles and colors of shadows never change; :meth:`update` rewrites the rest. ``legend`` pairs words with
    ``#rrggbb``; it is empty if shirts show behaviors, levels or single agents.
    """

    def __init__(self, recording: Recording, color_by: str, sides: int = 16, count: int | None = None) -> None:
        count = recording.most_present if count is None else count
        self._recording = recording
        self._body: BodyMesh = build_body(recording.header.motion.skeleton, sides)
        size = self._body.vertex_count
        self.points = np.zeros((count, size, 3), np.float32)
        self.normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (count, size, 1))
        self.triangles = _repeat(self._body.triangles, size, count)
        self.colors = np.zeros((count, size, 3), np.uint8)
        self._color_by = color_by
        self._looks = looks_of(recording.agent_count)
        self._shades = shades_of(recording.agent_count)
        self._builds = builds_of(recording.agent_count, recording.header.motion.skeleton)
        self.legend: list[tuple[str, str]] = []
        agents = recording.header.agents
        # For "agent", the shirts of `looks_of` stay; those for "behavior" and "level" are colored in `update`.
        if color_by in agents.attributes:
            shirts, self.legend = attribute_colors(agents.attributes[color_by])
            self._looks[:, Tissue.SHIRT] = shirts
        elif color_by == "group":
            names = sorted(set(agents.groups))
            colors = np.array(group_colors(len(names)), np.uint8)
            self._looks[:, Tissue.SHIRT] = shaded(colors[np.searchsorted(names, agents.groups)], self._shades)
            self.legend = [(name, _hex(color)) for name, color in zip(names, colors, strict=True)]
        self._behaviors = np.array([hex_color(behavior.color) for behavior in recording.header.behaviors])
        angle = 2.0 * np.pi * np.arange(_SHADOW_SIDES) / _SHADOW_SIDES
        rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        # A disc of radius 1: its middle, a ring at half the radius, and the rim.
        self._shadow = np.concatenate([np.zeros((1, 2)), 0.5 * rim, rim])
        # Three discs per agent: a wide, faint one below the body, and one below each foot.
        self.shadow_points = np.zeros((count, 3 * len(self._shadow), 3), np.float32)
        self.shadow_triangles = _repeat(_disc_triangles(), len(self._shadow), 3 * count)
        # Nearly black (gray 20), most opaque in the middle and clear at the rim; opacities are out of 255.
        fading = np.concatenate([[1.0], np.full(_SHADOW_SIDES, 0.7), np.zeros(_SHADOW_SIDES)])
        opacity = np.concatenate([darkness * fading for darkness in (70.0, 130.0, 130.0)])
        shade = np.column_stack([np.full((len(opacity), 3), 20), opacity]).astype(np.uint8)
        self.shadow_colors = np.tile(shade, (count, 1))
        skeleton = recording.header.motion.skeleton
        self._feet = [(skeleton.joint(f"{side}_ankle"), skeleton.joint(f"{side}_toe")) for side in ("left", "right")]

    def update(self, time: float, some: NDArray[np.int64] | None = None) -> None:
        """Move and color the bodies as agents are at ``time`` [s]: all of :func:`shown_agents`, or ``some`` (n,).

        There must be a body for each.
        """
        frame = self._recording.at_time(time)
        here = shown_agents(frame) if some is None else some
        count = len(here)
        self.points[count:] = 0.0
        self.shadow_points[count:] = 0.0
        if not count:
            return
        positions, rotations = self._recording.poses_at(time, here)
        self.points[:count], self.normals[:count] = self._body.place(positions, rotations, self._builds[here])
        self._cast_shadows(count, positions)
        # Other colorings than these two do not change with time.
        looks = self._looks[here]
        if self._color_by == "behavior":
            # An agent without a behavior (-1) looks as one of behavior 0, as in USD.
            colors = self._behaviors[np.maximum(frame.behavior[here], 0)]
            looks[:, Tissue.SHIRT] = shaded(colors, self._shades[here])
        elif self._color_by == "level":
            steered = frame.steered[here, None]
            looks[:, Tissue.SHIRT] = np.where(steered, *(hex_color(LEVEL_COLORS[level]) for level in _LEVELS))
        self.colors[:count] = looks[:, self._body.tissue]

    def _cast_shadows(self, count: int, joints: NDArray[np.float32]) -> None:
        """Place the shadows of the first ``count`` bodies: an ellipse around all joints, and one along each foot.

        ``joints`` (count, J, 3) are positions in the world [m].
        """
        flat, size = joints[..., :2].transpose(1, 0, 2).copy(), len(self._shadow)
        low, high = flat.min(axis=0), flat.max(axis=0)
        half = 0.5 * (high - low) + _FLESH
        shadows = self.shadow_points[:count]
        shadows[:, :size, :2] = 0.5 * (low + high)[:, None] + self._shadow * half[:, None]
        shadows[..., 2] = _SHADOW_HEIGHT
        for number, (ankle, toe) in enumerate(self._feet, start=1):
            heel, ball = joints[:, ankle, :2], joints[:, toe, :2]
            way = ball - heel
            # A foot that points straight down has no direction: its shadow shrinks to a point.
            along = way / np.maximum(np.sqrt(np.sum(way * way, axis=1)), 1e-6)[:, None]
            across = np.stack([-along[:, 1], along[:, 0]], axis=1)
            # The shadow of a lifted foot shrinks with its height.
            height = np.minimum(joints[:, ankle, 2], joints[:, toe, 2]) - _SOLE
            size_of = np.clip(1.0 - height / _NO_SHADOW, 0.0, 1.0)[:, None, None]
            disc = _FOOT[0] * self._shadow[None, :, :1] * along[:, None]
            disc = disc + _FOOT[1] * self._shadow[None, :, 1:] * across[:, None]
            middle = 0.5 * (heel + ball) + 0.03 * along  # further ahead, as the foot reaches beyond its ball
            shadows[:, number * size : (number + 1) * size, :2] = middle[:, None] + size_of * disc


def shades_of(count: int) -> NDArray[np.float64]:
    """Return (count,) the share of black (below 0) or white (above 0) that is mixed into the shirt of each agent."""
    return _SHADES[np.arange(count) % len(_SHADES)]


def shaded(colors: Colors, shades: NDArray[np.float64]) -> Colors:
    """Return colors (n, 3) mixed with black or white by ``shades`` (n,), as those of :func:`shades_of`."""
    share = shades[:, None]
    mixed: Colors = np.rint(colors + share * np.where(share > 0.0, 255.0 - colors, 1.0 * colors)).astype(np.uint8)
    return mixed


def group_colors(count: int) -> list[tuple[int, int, int]]:
    """Return the colors of ``count`` groups: red, green and blue, 0 to 255.

    The first eight are colors that color-blind people tell apart (after Okabe and Ito). Group number 8 and those after
    it get the color of the shirt of the agent with the same number, see :func:`looks_of`.
    """
    known = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#8c6bb1", "#b8a500")
    colors = [hex_color(text) for text in known[:count]]
    colors += list(looks_of(max(count, 8))[8:count, Tissue.SHIRT])
    return [(int(red), int(green), int(blue)) for red, green, blue in colors]


def looks_of(count: int) -> Colors:
    """Return (count, tissues, 3) the color of each tissue of each agent; shirts tell agents apart."""
    agent = np.arange(count)
    looks = np.zeros((count, len(Tissue), 3), np.uint8)
    looks[:, Tissue.SHIRT] = distinct_colors(count)
    # Different strides, so that the same combination returns only after many agents.
    for kind, choices, stride in (
        (Tissue.TROUSERS, _TROUSERS, 1),
        (Tissue.SKIN, _SKIN, 2),
        (Tissue.HAIR, _HAIR, 3),
        (Tissue.SHOES, _SHOES, 1),
    ):
        looks[:, kind] = choices[(agent * stride + agent // len(choices)) % len(choices)]
    return looks


def _repeat(triangles: NDArray[np.int64], size: int, count: int) -> NDArray[np.int64]:
    """Return the triangles (count * F, 3) of ``count`` copies of a mesh with triangles (F, 3) over ``size`` points.

    The points of one copy follow those of another.
    """
    return (triangles[None] + size * np.arange(count)[:, None, None]).reshape(-1, 3)


def _disc_triangles() -> NDArray[np.int64]:
    """Return the triangles (3 n, 3) of a shadow of n sides: a fan around the middle, and a band around the fan."""
    i = np.arange(_SHADOW_SIDES)
    j = (i + 1) % _SHADOW_SIDES
    inner, outer = 1 + i, 1 + _SHADOW_SIDES + i
    inner_next, outer_next = 1 + j, 1 + _SHADOW_SIDES + j
    fan = np.stack([np.zeros_like(i), inner, inner_next], axis=1)
    band = [np.stack([inner, outer, outer_next], axis=1), np.stack([inner, outer_next, inner_next], axis=1)]
    return np.concatenate([fan, *band])
