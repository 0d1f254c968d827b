"""Slow twins of pinned feet: legs bent with numpy, and feet carried frame by frame."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crowdsim.geometry.planar import compose, invert, wrap_angle
from crowdsim.motion.clips.leg_solver import Leg, bend_legs, missing_height, stretch
from crowdsim.motion.deformed.body_kernels import REACH
from crowdsim.motion.planted.planted_rows import FootTable

ALONG = np.array([0.0, 1.0, 0.0])


def place_of(feet: FootTable, foot: int, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Return ball and heading (3,) of a foot of one body."""
    ankle, ball = feet.legs[foot, 2:]
    left = _turn(rotations[ankle]).apply(feet.across[foot])
    return np.array([positions[ball, 0], positions[ball, 1], np.arctan2(-left[0], left[1])])


def clip_place(feet: FootTable, first: int, foot: int, frame: float) -> np.ndarray:
    """Return the place (3,) of a foot in a frame of the node that begins at row ``first``."""
    row, part = first + int(frame), frame % 1.0
    place = feet.places[row, foot]
    if part > 0.0:
        way = feet.places[row + 1, foot] - place
        way[2] = wrap_angle(way[2])
        place = place + part * way
    return place


def carried(place: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return where a foot at ``place`` comes if it moves as in its clip, from place ``before`` to ``after``."""
    return compose(place, compose(invert(before), after))


def pinned(
    feet: FootTable, moved: np.ndarray, positions: np.ndarray, rotations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return joints (J, 3), (J, 4) of a body whose feet are moved by ``moved`` (2, 3): x, y [m] and a turn [rad]."""
    positions, rotations = positions.astype(float), rotations.astype(float)
    hinge = _turn(rotations[0]).apply(ALONG)[None]
    legs, targets, most = [], [], []
    for foot, (hip, knee, ankle, _) in enumerate(feet.legs.tolist()):
        place, ankle_place = place_of(feet, foot, positions, rotations), positions[ankle]
        turn = Rotation.from_rotvec([0.0, 0.0, moved[foot, 2]])
        ball = np.array([place[0], place[1], ankle_place[2]])
        targets.append((ball + [*moved[foot, :2], 0.0] + turn.apply(ankle_place - ball))[None])
        legs.append(
            Leg(
                *(values[None] for values in (positions[hip], positions[knee], positions[ankle])),
                rotations[None, hip],
                rotations[None, knee],
                hinge,
            )
        )
        most.append(np.maximum(stretch(legs[-1]), REACH))
    down = max(0.0, *(missing_height(*each)[0] for each in zip(legs, targets, most, strict=True)))
    positions[:, 2] -= down
    new_positions, new_rotations = positions.copy(), rotations.copy()
    for foot, (hip, knee, ankle, _) in enumerate(feet.legs.tolist()):
        leg = legs[foot]._replace(hips=positions[None, hip], knees=positions[None, knee], ankles=positions[None, ankle])
        thigh, shank = (_turn(q[0]) for q in bend_legs(leg, targets[foot], most[foot]))
        turns = [thigh * _turn(rotations[hip]).inv(), shank * _turn(rotations[knee]).inv()]
        turns.append(Rotation.from_rotvec([0.0, 0.0, moved[foot, 2]]))
        old, new = positions[hip], positions[hip]
        for bone, base in enumerate((hip, knee, ankle)):
            if bone:
                new = new + turns[bone - 1].apply(positions[base] - old)
                old = positions[base]
            for joint in np.flatnonzero(feet.bones == 3 * foot + bone):
                new_positions[joint] = new + turns[bone].apply(positions[joint] - old)
                new_rotations[joint] = (turns[bone] * _turn(rotations[joint])).as_quat(scalar_first=True)
    return new_positions, new_rotations


def _turn(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)
