"""The model of a clip for deforming it: one cycle about its mean pose, and the geometry of its legs and feet.

2018 paper, section 3.1: one deformable clip for each behavior.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import atan2, cos, hypot, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, about_axis, conjugate, forward_kinematics, multiply, rotate
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.deformed.body_kernels import ANKLE_HEIGHT, FOOT_LENGTH, SHANK, SOLE_DOWN, THIGH
from crowdsim.motion.deformed.clip_cycle import SAMPLES, Cycle, find_cycle
from crowdsim.motion.deformed.leg_frames import foot_shape, leg_turns, mean_rotation

WAVES = 4
"""Harmonics of a cycle that the pelvis keeps; the fifth would be faster than 5 Hz."""

_STAND_REACH = 0.993
"""Share of its length that a leg has at rest; the knee is then bent by 13 degrees."""
_RISE = 0.06
"""Largest height by which a body stands taller than it walks [m]: ducked walkers wait ducked."""
_STAND_HALF_WIDTH = 0.07
"""Distance from the middle to each foot of a body that stands or side-steps [m]."""
_FOOT_LENGTH = 0.18
"""Distance from heel to ball [m]."""
_NARROWEST = 0.03
"""Least half width of steps [m]."""
_MOST_IN, _MOST_OUT = 0.1, 0.3
"""Largest angles at which feet point inward and outward [rad]."""
_STRAIGHT = 0.03
"""Pitch below which a foot on the floor counts as flat [rad]."""
_HEEL_UNTIL, _BALL_FROM = 0.2, 0.25
"""Phase after landing until which a foot may stand on its heel, and from which it may stand on its ball."""
_QUICKEST = 1.3
"""Cadence at which the pelvis must still move gently [cycles/s]."""
_GENTLE = 6.0
"""Largest acceleration of the pelvis along one axis at that cadence [m/s2]."""
_TILTED = 0.12
"""Half of the largest angle by which the pelvis turns about one axis [rad]."""
_HIGHEST = 0.12
"""Largest lift of a foot that is kept of a clip [m]: kicks are no steps."""
_Z = np.array([0.0, 0.0, 1.0])


class ClipModel(NamedTuple):
    """A cycle of one clip in arrays; S + 1 samples at equal phases, J joints, U of them neither root nor leg.

    mean: (J, 4) float64, mean rotation of each joint relative to its parent; the root's relative to the heading.
    upper: (U,) int32 joints. swings: (S + 1, U, 3) float64, half rotation vectors by which each leaves its mean.
    waves: (6, 2 * WAVES) float64, cosine and sine coefficients of the root: ahead, left, up [m], half rotation vector.
    root: (3,) float64, mean place of the root: ahead and left of the track, and height when walking [m].
    legs: (2, 4) int32, joints of hip, knee, ankle, toe, left leg first; the toe is -1 if none hangs on the ankle.
    hips: (2, 3) float64, hip joints in the frame of the root [m]. turns: (2, 5, 4) float64, rotations of the joint that
    carries the hip, of hip and knee (:func:`~crowdsim.motion.deformed.leg_frames.leg_turns`), and of ankle and toe of
    the flat foot.
    bones: (2, 5) float64, thigh, shank, ankle to ball along the foot, heights of ankle and ball [m].
    pitch: (2, S + 1) float64, toes up, from each foot's landing on [rad]. lift: (2, S + 1) float64, height of the ankle
    above a smooth curve from lift-off to landing, in the swing [m].
    prints: (2, 3) float64, ball relative to the track while the body is over it: ahead, left [m], heading [rad].
    spine: how many of ``upper``, the first ones, lead from the root to the chest.
    stride: length of the cycle, at least 0.3 [m]. stand: height of the root at rest [m]. width: half of the step width
    at rest [m].
    """

    mean: Floats
    upper: NDArray[np.int32]
    swings: Floats
    waves: Floats
    root: Floats
    legs: NDArray[np.int32]
    hips: Floats
    turns: Floats
    bones: Floats
    pitch: Floats
    lift: Floats
    prints: Floats
    stride: float
    stand: float
    width: float
    spine: int


@dataclass(frozen=True)
class DeformedClip:
    """A clip from which bodies of ``skeleton`` are posed on any tracks."""

    name: str
    skeleton: Skeleton
    model: ClipModel


def deform_clip(clip: Clip, speed: float | None = None) -> DeformedClip:
    """Prepare ``clip`` for being deformed to tracks.

    Parameters
    ----------
    clip : Clip
        Walking or side-stepping, with a whole cycle of steps.
    speed : float, optional
        Preferred speed [m/s], if the clip has cycles of several speeds.

    Returns
    -------
    DeformedClip
        Input of step plans and poses, for any number of tracks.

    Raises
    ------
    MotionError
        If the skeleton lacks joints of the legs, if other joints lie between them, or if the clip has no cycle.
    """
    legs = _leg_joints(clip.skeleton)
    cycle = find_cycle(clip, speed)
    root, rotations = _sampled(clip, cycle)
    # Joints: mean rotations, and what each swings away from its mean, relative to the heading of the track.
    turned = rotations.copy()
    turned[:, 0] = multiply(about_axis(_Z, -cycle.track[:, 2]), rotations[:, 0])
    mean = np.stack([mean_rotation(turned[:-1, joint]) for joint in range(turned.shape[1])])
    swings = _closed(_half_vectors(multiply(conjugate(mean), turned)))
    placed = _closed(_beside(root, cycle.track))
    # Legs: sizes of foot and bones, rotations of the hip, and where the feet are printed.
    positions, world = forward_kinematics(clip.skeleton, root, rotations)
    shapes = [foot_shape(clip.skeleton, legs[foot], *_from_landing(foot, positions, world)) for foot in (0, 1)]
    chain = [_hip_in_root(clip.skeleton, mean, int(joint)) for joint in legs[:, 0]]
    turns = [
        np.concatenate(
            [chain[foot][1][None], leg_turns(legs[foot], clip.skeleton, positions, world), shapes[foot].turns]
        )
        for foot in (0, 1)
    ]
    bones = np.array([_bones(clip.skeleton, legs[foot], shapes[foot].sizes) for foot in (0, 1)])
    # The ball is the toe joint, which has a higher number than its ankle, or the ankle if the toe is -1 (none).
    prints = [_print(cycle, positions[:, max(int(legs[f, 3]), int(legs[f, 2]))], shapes[f].yaw, f) for f in (0, 1)]
    # Joints above the legs, those of the spine first.
    spine = _spine(clip.skeleton)
    others = [j for j in range(1, clip.skeleton.joint_count) if j not in legs and j not in spine]
    upper = np.array([*spine, *others], np.int32)
    even = _even_prints(cycle, np.array(prints))
    hips = np.array([place for place, _ in chain])
    # A clip that steps almost on the spot gets a stride of 0.3 m, as strides of tracks are divided by it.
    model = ClipModel(
        mean=mean,
        upper=upper,
        swings=np.ascontiguousarray(swings[:, upper]),
        waves=_gentle(_waves(np.concatenate([placed, swings[:, 0]], axis=1))),
        root=placed[:-1].mean(axis=0),
        legs=legs,
        hips=hips,
        turns=np.array(turns),
        bones=bones,
        pitch=_alike([_settled(shape.pitch) for shape in shapes]),
        lift=_alike([_lift(shape.height) for shape in shapes]),
        prints=even,
        stride=max(cycle.stride, 0.3),
        stand=min(_standing_height(mean[0], hips, bones), float(placed[:-1, 2].mean()) + _RISE),
        width=_half_width(float(even[0, 2])),
        spine=len(spine),
    )
    return DeformedClip(clip.name, clip.skeleton, model)


def on_legs_of(clip: DeformedClip, walk: DeformedClip) -> DeformedClip:
    """Return a body with the legs and pelvis of ``walk`` and the upper body of ``clip``, on the same skeleton.

    Footsteps planned for one of several clips on the same legs are valid for all, so no foot moves if a body changes
    from one clip to another.
    """
    mean = walk.model.mean.copy()
    mean[clip.model.upper] = clip.model.mean[clip.model.upper]
    return DeformedClip(clip.name, walk.skeleton, walk.model._replace(mean=mean, swings=clip.model.swings))


def _leg_joints(skeleton: Skeleton) -> NDArray[np.int32]:
    """Return the joints (2, 4) of hip, knee, ankle and toe (-1 for none on the ankle) of the left and the right leg."""
    legs = []
    for side in ("left", "right"):
        hip, knee, ankle = (skeleton.joint(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        if skeleton.parents[knee] != hip or skeleton.parents[ankle] != knee:
            raise MotionError(
                f"joints lie between {side} hip, knee and ankle ({skeleton.names[hip]}, {skeleton.names[knee]}, "
                f"{skeleton.names[ankle]}); a leg can be deformed if it has two bones"
            )
        toe = skeleton.roles.get(f"{side}_toe", -1)
        # A foot is posed as one bone from ankle to ball: a toe joint counts only if it hangs on the ankle (-1: none).
        legs.append([hip, knee, ankle, toe if skeleton.parents[toe] == ankle else -1])
    return np.array(legs, np.int32)


def _sampled(clip: Clip, cycle: Cycle) -> tuple[Floats, Floats]:
    """Return root places (S + 1, 3) [m] and joint rotations (S + 1, J, 4) of ``clip``, interpolated at cycle.times."""
    before = np.minimum(cycle.times.astype(np.int64), clip.frame_count - 2)
    share = (cycle.times - before)[:, None]
    root = (1.0 - share) * clip.root_positions[before] + share * clip.root_positions[before + 1]
    a, b = clip.rotations[before], clip.rotations[before + 1]
    b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0.0, -b, b)
    mixed = (1.0 - share[..., None]) * a + share[..., None] * b
    return root, mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)


def _half_vectors(q: Floats) -> Floats:
    """Return the half rotation vectors (..., 3), axes times half angles [rad], of unit quaternions (..., 4)."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    scale = np.where(sine < 1e-9, 1.0, atan2(sine, q[..., 0]) / np.maximum(sine, 1e-9))
    return scale[..., None] * q[..., 1:]


def _closed(values: Floats) -> Floats:
    """Return samples (S + 1, ...) with the difference between the last and the first removed evenly."""
    share = (np.arange(len(values)) / (len(values) - 1) - 0.5).reshape(-1, *[1] * (values.ndim - 1))
    closed: Floats = values - share * (values[-1] - values[0])
    return closed


def _beside(points: Floats, track: Floats) -> Floats:
    """Return points (S + 1, 3) relative to track poses (S + 1, 3): ahead, left, up [m]."""
    c, s = cos(track[:, 2]), sin(track[:, 2])
    x, y = points[:, 0] - track[:, 0], points[:, 1] - track[:, 1]
    return np.stack([c * x + s * y, c * y - s * x, points[:, 2]], axis=1)


def _from_landing(foot: int, positions: Floats, world: Floats) -> tuple[Floats, Floats]:
    """Return joints' places (S + 1, J, 3) and rotations (S + 1, J, 4) from the landing of ``foot`` to its next one.

    ``positions`` and ``world`` begin with the left foot's landing; the right foot lands half a cycle later.
    """
    rows = np.append((np.arange(SAMPLES) + foot * SAMPLES // 2) % SAMPLES, foot * SAMPLES // 2)
    return positions[rows], world[rows]


def _hip_in_root(skeleton: Skeleton, mean: Floats, hip: int) -> tuple[Floats, Floats]:
    """Return the place (3,) [m] of a hip joint and the rotation (4,) of its parent joint, both in the root's frame.

    Joints between them, such as a pelvis, are in their mean rotations ``mean`` (J, 4).
    """
    chain = [int(skeleton.parents[hip])]
    while chain[-1] > 0:
        chain.append(int(skeleton.parents[chain[-1]]))
    place, turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    # From the joint below the root down to the parent of the hip.
    for joint in chain[-2::-1]:
        place = place + rotate(turn, skeleton.offsets[joint])
        turn = multiply(turn, mean[joint])
    return place + rotate(turn, skeleton.offsets[hip]), turn


def _spine(skeleton: Skeleton) -> list[int]:
    """Return the joints from the root (excluded) to the chest, which carries the arms; none if there is no chest."""
    joint, spine = skeleton.roles.get("chest", 0), []
    while joint > 0:
        spine.append(joint)
        joint = int(skeleton.parents[joint])
    return spine[::-1]


def _bones(skeleton: Skeleton, leg: NDArray[np.int32], foot: Floats) -> Floats:
    """Return (5,): the lengths of thigh and shank, then ``foot`` (3,), as ``FootShape.sizes`` [m]."""
    lengths = np.linalg.norm(skeleton.offsets[leg[1:3]], axis=1)
    return np.concatenate([lengths, foot])


def _print(cycle: Cycle, ball: Floats, yaw: Floats, foot: int) -> Floats:
    """Return the ball's place ahead and left of the track [m] and the foot's heading from the track's [rad], (3,).

    All are means over the time in which the body passes over the foot.

    ball: (S + 1, 3) places over the cycle [m]. yaw: (S + 1,) headings of the foot from its own landing on [rad].
    """
    # Means over phases around REFERENCE, at which the foot lies flat.
    rows = (np.arange(round(0.2 * SAMPLES), round(0.34 * SAMPLES)) + foot * SAMPLES // 2) % SAMPLES
    seen = _beside(ball, cycle.track)[rows]
    own = np.arange(round(0.2 * SAMPLES), round(0.34 * SAMPLES))
    turn = np.mod(yaw[own] - cycle.track[rows, 2] + np.pi, 2.0 * np.pi) - np.pi
    return np.array([seen[:, 0].mean(), seen[:, 1].mean(), turn.mean()])


def _half_width(out: float) -> float:
    """Return the distance from the middle to each foot at rest [m]; heels need more if toes point ``out`` > 0 [rad]."""
    return _STAND_HALF_WIDTH + 0.5 * _FOOT_LENGTH * max(out, 0.0)


def _even_prints(cycle: Cycle, prints: Floats) -> Floats:
    """Return the prints (2, 3) made symmetric and kept within bounds; as wide as at rest if the cycle is not ahead."""
    heading = cycle.track[:, 2].mean()
    way = cycle.track[-1, :2] - cycle.track[0, :2]
    ahead = float(cos(heading) * way[0] + sin(heading) * way[1])
    half = max(0.5 * float(prints[0, 1] - prints[1, 1]), _NARROWEST)
    out = min(max(0.5 * float(prints[0, 2] - prints[1, 2]), -_MOST_IN), _MOST_OUT)
    # Sideways or back: more than 45 degrees from where the body faces.
    if ahead < 0.7 * cycle.stride:
        half = _half_width(out)
    place = float(prints[:, 0].mean())
    return np.array([[place, half, out], [place, -half, -out]])


def _settled(pitch: Floats) -> Floats:
    """Return the pitch (S + 1,) of a foot that is on its heel, then flat, then on its ball, and nothing in between."""
    phase = np.arange(SAMPLES + 1) / SAMPLES
    smooth = pitch.copy()
    smooth[1:-1] = 0.25 * pitch[:-2] + 0.5 * pitch[1:-1] + 0.25 * pitch[2:]
    # Smooth, and take small pitches for flat. On its heel a foot only points up, on its ball (up to about where it
    # lifts) only down.
    flat = np.sign(smooth) * np.maximum(np.abs(smooth) - _STRAIGHT, 0.0)
    early, late = phase <= _BALL_FROM, (phase >= _HEEL_UNTIL) & (phase < 0.62)
    flat = np.where(early, np.maximum(flat, 0.0), flat)
    flat = np.where(late, np.minimum(flat, 0.0), flat)
    # Monotone in both parts: a foot on its ball does not sink back to its heel, nor does it rise on its heel.
    rows = np.flatnonzero(late)
    flat[rows] = np.minimum.accumulate(flat[rows])
    rows = np.flatnonzero(phase <= _HEEL_UNTIL)
    flat[rows] = np.minimum.accumulate(flat[rows])
    # The pitch on the heel fades out until SOLE_DOWN, from which the sole is exactly flat.
    flat *= np.where(early, np.clip((SOLE_DOWN - phase) / (0.5 * SOLE_DOWN), 0.0, 1.0), 1.0)
    flat[-1] = flat[0]
    return flat


def _alike(feet: list[Floats]) -> Floats:
    """Return the mean of both feet for each of them (2, S + 1): bodies on tracks step alike with both."""
    return np.stack([0.5 * (feet[0] + feet[1])] * 2)


def _lift(height: Floats) -> Floats:
    """Return the height (S + 1,) of an ankle above a cubic from lift-off to landing, 0 in the stance [m].

    height: (S + 1,) from the landing on [m]. The cubic begins and ends with the ankle's height and speed (Hermite), as
    that of a planned swing does.
    """
    first = round(0.6 * SAMPLES)
    swing = height[first:]
    u = np.arange(len(swing)) / (len(swing) - 1)
    up = (swing[2] - swing[0]) * (len(swing) - 1) / 2.0
    down = (swing[-1] - swing[-3]) * (len(swing) - 1) / 2.0
    rest = 1.0 - u
    cubic = (1.0 + 2.0 * u) * rest * rest * swing[0] + u * u * (3.0 - 2.0 * u) * swing[-1]
    cubic += u * rest * rest * up - u * u * rest * down
    lift = np.zeros(SAMPLES + 1)
    lift[first:] = np.clip(swing - cubic, -_HIGHEST, _HIGHEST)
    return lift


def _waves(samples: Floats) -> Floats:
    """Return Fourier coefficients (D, 2 * WAVES), cosine and sine of each harmonic, of closed samples (S + 1, D)."""
    angle = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    waves = [
        2.0 * np.mean(samples[:-1] * wave(harmonic * angle)[:, None], axis=0)
        for harmonic in range(1, WAVES + 1)
        for wave in (cos, sin)
    ]
    return np.ascontiguousarray(np.stack(waves, axis=1))


def _gentle(waves: Floats) -> Floats:
    """Return the waves of :func:`_waves` without those that would shake a body whose steps are quicker than the clip's.

    The highest harmonics are dropped first; the rest is scaled down if it is still too much.

    waves: (6, 2 * WAVES) float64, cosine and sine coefficients by turns, of harmonic 1 on. Rows 0 to 2 are places [m],
    whose second derivative at the cadence _QUICKEST is the acceleration that _GENTLE bounds; rows 3 to 5 are the half
    rotation vector [rad], which _TILTED bounds itself.
    """
    angle = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    gentle = waves.copy()
    for row, wave in enumerate(gentle):
        for kept in range(WAVES, 0, -1):
            wave[2 * kept :] = 0.0
            most = 0.0
            for harmonic in range(1, kept + 1):
                part = wave[2 * harmonic - 2] * cos(harmonic * angle) + wave[2 * harmonic - 1] * sin(harmonic * angle)
                speed = 2.0 * np.pi * harmonic * _QUICKEST if row < 3 else 1.0
                most = most + speed * speed * part
            share = (_GENTLE if row < 3 else _TILTED) / max(float(np.max(np.abs(most))), 1e-9)
            if share >= 1.0:
                break
        wave *= min(1.0, share)
    return gentle


def _standing_height(turn: Floats, hips: Floats, bones: Floats) -> float:
    """Return the root's height at which both legs are nearly straight over feet side by side [m].

    turn: (4,) mean rotation of the root; hips, bones: as of :class:`ClipModel`.
    """
    heights = []
    for foot, side in ((0, 1.0), (1, -1.0)):
        hip = rotate(turn, hips[foot])
        reach = _STAND_REACH * (bones[foot, THIGH] + bones[foot, SHANK])
        # Horizontal distance from hip to ankle: ankles are half a foot behind the middle, balls half a foot ahead.
        apart = hypot(0.5 * bones[foot, FOOT_LENGTH] + hip[0], side * _STAND_HALF_WIDTH - hip[1])
        heights.append(bones[foot, ANKLE_HEIGHT] + np.sqrt(reach * reach - apart * apart) - hip[2])
    return float(min(heights))
