"""Where the eye stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from crowdsim.errors import CrowdSimError
from crowdsim.playback.surfaces import Floats, unit
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording

VIEWS = ("overview", "top", "follow")
FIELD_OF_VIEW = 28.0
"""Degrees from the lower to the upper edge of the picture."""

_MARGIN = 1.04
_PERSON_HEIGHT = 1.85
_FOLLOW_DISTANCE = 6.5
_FOLLOW_SECONDS = 0.8


@dataclass(frozen=True)
class Camera:
    """Eye and target in meters, and the direction that is up in the picture.

    half_height: meters from the middle to the upper edge of a picture without perspective; None for one with it.
    """

    eye: Floats
    target: Floats
    up: Floats
    half_height: float | None = None


def place_camera(recording: Recording, view: str, aspect: float, time: float, agent: int | None) -> Camera:
    """The camera of ``view`` (one of :data:`VIEWS`) for a picture of width / height ``aspect``; CrowdSimError."""
    if view not in VIEWS:
        raise CrowdSimError(f"there is no view '{view}'; choose one of {', '.join(VIEWS)}")
    if view == "follow":
        return _follow(recording, time, agent)
    low_x, low_y, high_x, high_y = shapely.from_wkt(recording.header.floor).bounds
    corners = np.array(
        [[x, y, z] for x in (low_x, high_x) for y in (low_y, high_y) for z in (0.0, _PERSON_HEIGHT)], np.float64
    )
    wide = high_x - low_x >= high_y - low_y
    if view == "top":
        return _plan(corners, np.array([0.0, 1.0, 0.0]) if wide else np.array([-1.0, 0.0, 0.0]), aspect)
    # The long side of the floor runs across the picture; a long hall is seen more from the side.
    slender = max(high_x - low_x, high_y - low_y) / max(min(high_x - low_x, high_y - low_y), 1e-9)
    turn = np.radians(-62.0 if slender < 2.5 else -80.0) + (0.0 if wide else np.pi / 2)
    lift = np.radians(38.0)
    direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return _fit(corners, direction, np.array([0.0, 0.0, 1.0]), aspect)


def _plan(corners: Floats, up: Floats, aspect: float) -> Camera:
    """From straight above without perspective, as an architect draws."""
    down = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, down)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    half_wide = np.max(np.abs((corners - middle) @ right))
    half_tall = np.max(np.abs((corners - middle) @ up))
    return Camera(middle + 50.0 * down, middle, up, float(1.12 * max(half_tall, half_wide / aspect)))


def _fit(corners: Floats, direction: Floats, up: Floats, aspect: float) -> Camera:
    """The nearest camera along ``direction`` that sees all ``corners``, its target shifted to center them."""
    right = unit(np.cross(up, direction))
    above = np.cross(direction, right)
    tall = np.tan(np.radians(FIELD_OF_VIEW) / 2.0) / _MARGIN
    slopes = ((right, tall * aspect), (above, tall))
    target = corners.mean(axis=0)
    distance = 0.0
    for _ in range(8):
        depth = (corners - target) @ direction
        needs = [(corners - target) @ axis / slope for axis, slope in slopes]
        distance = max(float(np.max(np.abs(need) + depth)) for need in needs)
        for axis, _ in slopes:
            across = (corners - target) @ axis / (distance - depth)
            target = target + axis * 0.5 * (across.min() + across.max()) * distance
    return Camera(target + distance * direction, target, up)


def _follow(recording: Recording, time: float, agent: int | None) -> Camera:
    if agent is None:
        raise CrowdSimError("the view 'follow' needs the number of an agent to follow")
    if not 0 <= agent < recording.agent_count:
        raise CrowdSimError(f"there is no agent {agent}; the recording has agents 0 to {recording.agent_count - 1}")
    place = np.array([*_mean_place(recording, time, agent), 0.95], np.float64)
    turn, lift = np.radians(-58.0), np.radians(24.0)
    direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return Camera(place + _FOLLOW_DISTANCE * direction, place, np.array([0.0, 0.0, 1.0]))


def _mean_place(recording: Recording, time: float, agent: int) -> Floats:
    """(2,) x, y of an agent on the line that fits its places about a time best, the nearer the more.

    That keeps the picture calm, and moves smoothly whatever the rate of steps. Before the agent comes and after it
    leaves it is where it came or left.
    """
    stay = recording.stay(agent)
    if stay is None:
        raise CrowdSimError(f"agent {agent} never enters the recording; follow another one")
    rate = recording.steps_per_second
    middle = float(np.clip(time * rate, stay[0], stay[1]))
    reach = max(_FOLLOW_SECONDS * rate, 1.5)
    rows = slice(max(int(middle - reach), stay[0]), min(int(middle + reach) + 1, stay[1]) + 1)
    here = recording.state[rows, agent] != AgentState.ABSENT
    if not here.any():
        # Away for a while: wait where it left.
        left = np.flatnonzero(recording.state[: rows.start, agent] != AgentState.ABSENT)
        rows, here = slice(int(left[-1]), int(left[-1]) + 1), np.ones(1, bool)
    off = np.arange(rows.start, rows.stop) - middle
    weights = here * np.clip(1.0 - np.abs(off) / reach, 1e-9, 1.0)
    first, second = float(weights @ off) / weights.sum(), float(weights @ (off * off)) / weights.sum()
    if second - first * first > 1e-6:
        weights = weights * (second - first * off)
    places = np.stack([recording.x[rows, agent], recording.y[rows, agent]]).astype(np.float64)
    mean: Floats = places @ weights / weights.sum()
    return mean
