"""Camera positions for the views of a recording."""

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
"""Angle from the lower to the upper edge of the picture [degrees]."""

_MARGIN = 1.04
"""How much larger a picture is than what has to be in it."""
_PERSON_HEIGHT = 1.85
"""Height up to which a picture shows what is on the floor [m]: that of a tall person."""
_FOLLOW_DISTANCE = 6.5
"""Distance of the camera from the agent that it follows [m]."""
_FOLLOW_SECONDS = 0.8
"""Time before and after a moment over which the position of a followed agent is smoothed [s]."""


@dataclass(frozen=True)
class Camera:
    """A camera: eye and target [m], and the direction that is up in the picture.

    ``half_height`` is the distance from the middle to the upper edge of a parallel projection [m]; None for
    perspective.
    """

    eye: Floats
    target: Floats
    up: Floats
    half_height: float | None = None


def place_camera(recording: Recording, view: str, aspect: float, time: float, agent: int | None) -> Camera:
    """Return the camera of a view.

    Parameters
    ----------
    recording : Recording
        Recording to look at.
    view : str
        One of :data:`VIEWS`.
    aspect : float
        Width of the picture divided by its height.
    time : float
        Time at which ``follow`` looks at its agent [s]; the other views are the same at all times.
    agent : int or None
        Agent that the view ``follow`` follows.

    Raises
    ------
    CrowdSimError
        If there is no such view; if the view is ``follow``, also if there is no such agent, or it never appears.
    """
    if view not in VIEWS:
        raise CrowdSimError(f"there is no view '{view}'; choose one of {', '.join(VIEWS)}")
    if view == "follow":
        return _follow(recording, time, agent)
    low_x, low_y, high_x, high_y = shapely.from_wkt(recording.header.floor).bounds
    corners = np.array(
        [[x, y, z] for x in (low_x, high_x) for y in (low_y, high_y) for z in (0.0, _PERSON_HEIGHT)], np.float64
    )
    wide = high_x - low_x >= high_y - low_y
    # In all views of the whole floor, its long side runs across the picture.
    if view == "top":
        return _plan(corners, np.array([0.0, 1.0, 0.0]) if wide else np.array([-1.0, 0.0, 0.0]), aspect)
    # The more slender the hall, the more the camera looks from its side. `turn` and `lift` are azimuth and elevation of
    # the eye as seen from the floor: at an azimuth of -90 degrees the camera would look along y.
    slender = max(high_x - low_x, high_y - low_y) / max(min(high_x - low_x, high_y - low_y), 1e-9)
    turn = np.radians(-62.0 if slender < 2.5 else -80.0) + (0.0 if wide else np.pi / 2)
    lift = np.radians(38.0)
    direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return _fit(corners, direction, np.array([0.0, 0.0, 1.0]), aspect)


def tallest_person(recording: Recording, camera: Camera, height: int) -> float:
    """Return how tall a person on the floor is at most in a picture of ``height`` pixels [pixels]."""
    if camera.half_height is not None:
        return float(_PERSON_HEIGHT / (2.0 * camera.half_height) * height)
    # In perspective, nobody is nearer to the eye than the nearest point of the box around the floor.
    low_x, low_y, high_x, high_y = shapely.from_wkt(recording.header.floor).bounds
    nearest = np.clip(camera.eye, [low_x, low_y, 0.0], [high_x, high_y, _PERSON_HEIGHT])
    distance = max(float(np.linalg.norm(camera.eye - nearest)), 0.1)  # the eye may be within the box
    return float(_PERSON_HEIGHT / (2.0 * distance * np.tan(np.radians(FIELD_OF_VIEW) / 2.0)) * height)


def _plan(corners: Floats, up: Floats, aspect: float) -> Camera:
    """Return a camera straight above with parallel projection, as in an architect's plan, that sees all ``corners``.

    ``corners`` (n, 3) [m]; ``up`` (3,) is the direction that is up in the picture; ``aspect`` is width over height.
    """
    to_eye = np.array([0.0, 0.0, 1.0])  # from the floor to the eye
    right = np.cross(up, to_eye)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    half_wide = np.max(np.abs((corners - middle) @ right))
    half_tall = np.max(np.abs((corners - middle) @ up))
    # The height of the eye [m] does not change a parallel projection; 1.12 leaves a margin around the floor.
    return Camera(middle + 50.0 * to_eye, middle, up, float(1.12 * max(half_tall, half_wide / aspect)))


def _fit(corners: Floats, direction: Floats, up: Floats, aspect: float) -> Camera:
    """Return the nearest camera along ``direction`` that sees all ``corners``; shift the target to center them.

    ``corners`` (n, 3) [m]; ``direction`` (3,) is the unit vector from the target to the eye, ``up`` (3,) points up from
    the floor; ``aspect`` is width over height.
    """
    right = unit(np.cross(up, direction))
    above = np.cross(direction, right)
    # Half width and half height of what is seen at distance 1.
    tall = np.tan(np.radians(FIELD_OF_VIEW) / 2.0) / _MARGIN
    slopes = ((right, tall * aspect), (above, tall))
    target = corners.mean(axis=0)
    distance = 0.0
    # A corner is in the picture if its offset along each axis is at most slope * (distance - depth), where depth is its
    # place along the direction to the eye. From this follows the least distance; then the target moves to the middle.
    # A shift of the target changes the distance, and the reverse: eight rounds settle both within millimeters.
    for _ in range(8):
        depth = (corners - target) @ direction
        needs = [(corners - target) @ axis / slope for axis, slope in slopes]
        distance = max(float(np.max(np.abs(need) + depth)) for need in needs)
        for axis, _ in slopes:
            across = (corners - target) @ axis / (distance - depth)
            target = target + axis * 0.5 * (across.min() + across.max()) * distance
    return Camera(target + distance * direction, target, up)


def _follow(recording: Recording, time: float, agent: int | None) -> Camera:
    """Return a camera at a fixed distance and direction from an agent at ``time`` [s], aimed at 0.95 m above the floor.

    Raise CrowdSimError if there is no such agent, or it never appears.
    """
    if agent is None:
        raise CrowdSimError("the view 'follow' needs the number of an agent to follow")
    if not 0 <= agent < recording.agent_count:
        raise CrowdSimError(f"there is no agent {agent}; the recording has agents 0 to {recording.agent_count - 1}")
    place = np.array([*_mean_place(recording, time, agent), 0.95], np.float64)
    turn, lift = np.radians(-58.0), np.radians(24.0)  # azimuth and elevation of the eye as seen from the agent
    direction = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    return Camera(place + _FOLLOW_DISTANCE * direction, place, np.array([0.0, 0.0, 1.0]))


def _mean_place(recording: Recording, time: float, agent: int) -> Floats:
    """Return the smoothed position (2,) of an agent: the value at ``time`` of a weighted linear fit around it [m].

    Weights decrease linearly with the time difference. The result is calm and moves smoothly at any rate of steps.
    Before the agent first appears, and after it leaves for good, the result is that of its first or last step. If it is
    absent for longer in between, it is where it disappeared. Raise CrowdSimError if it never appears.
    """
    stay = recording.stay(agent)
    if stay is None:
        raise CrowdSimError(f"agent {agent} never enters the recording; follow another one")
    rate = recording.steps_per_second
    middle = float(np.clip(time * rate, stay[0], stay[1]))
    reach = max(_FOLLOW_SECONDS * rate, 1.5)  # [steps]: at any rate, at least one step beside the middle
    rows = slice(max(int(middle - reach), stay[0]), min(int(middle + reach) + 1, stay[1]) + 1)
    here = recording.state[rows, agent] != AgentState.ABSENT
    if not here.any():
        # Absent in all these steps: stay at its last step before them.
        left = np.flatnonzero(recording.state[: rows.start, agent] != AgentState.ABSENT)
        rows, here = slice(int(left[-1]), int(left[-1]) + 1), np.ones(1, bool)
    off = np.arange(rows.start, rows.stop) - middle
    # The least weight is not 0, so that the sum is not either.
    weights = here * np.clip(1.0 - np.abs(off) / reach, 1e-9, 1.0)
    # Moments of the offsets; these weights give the fitted line's value at offset 0, a plain mean if all coincide.
    first, second = float(weights @ off) / weights.sum(), float(weights @ (off * off)) / weights.sum()
    if second - first * first > 1e-6:
        weights = weights * (second - first * off)
    # Positions are nan while the agent is absent, which has no weight.
    places = np.where(here, np.stack([recording.x[rows, agent], recording.y[rows, agent]]), 0.0).astype(np.float64)
    mean: Floats = places @ weights / weights.sum()
    return mean
