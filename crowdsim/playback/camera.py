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
    """Eye and target in meters, and the direction that is up in the picture."""

    eye: Floats
    target: Floats
    up: Floats


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
        direction = np.array([0.0, 0.0, 1.0])
        up = np.array([0.0, 1.0, 0.0]) if wide else np.array([-1.0, 0.0, 0.0])
    else:
        # The long side of the floor runs across the picture; a long hall is seen more from the side.
        slender = max(high_x - low_x, high_y - low_y) / max(min(high_x - low_x, high_y - low_y), 1e-9)
        turn = np.radians(-62.0 if slender < 2.5 else -76.0) + (0.0 if wide else np.pi / 2)
        lift = np.radians(38.0)
        direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
        up = np.array([0.0, 0.0, 1.0])
    return _fit(corners, direction, up, aspect)


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
    rate = recording.steps_per_second
    reach = round(_FOLLOW_SECONDS * rate)
    step = round(time * rate)
    state = recording.state[:, agent]
    present = np.flatnonzero(state != AgentState.ABSENT)
    if not len(present):
        raise CrowdSimError(f"agent {agent} never enters the recording; follow another one")
    # A moving mean keeps the picture calm; before the agent comes and after it leaves the eye waits there.
    middle = int(np.clip(step, present[0], present[-1]))
    rows = slice(max(middle - reach, int(present[0])), min(middle + reach, int(present[-1])) + 1)
    place = np.array([recording.x[rows, agent].mean(), recording.y[rows, agent].mean(), 0.95], np.float64)
    turn, lift = np.radians(-58.0), np.radians(24.0)
    direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return Camera(place + _FOLLOW_DISTANCE * direction, place, np.array([0.0, 0.0, 1.0]))
