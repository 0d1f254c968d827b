"""Transition between two motions: the new motion plays, and its difference to the old motion fades out.

After D. Bollo, "Inertialization: high-performance animation transitions in Gears of War", GDC 2018: position and
velocity of the difference fade together, so that no joint jumps or stops suddenly. Planted feet are not dragged along:
each keeps its place until it lifts, and reaches its place in the new motion during that swing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2, cos, sin
from crowdsim.motion.clips.kinematics import (
    Floats,
    conjugate,
    forward_kinematics,
    multiply,
    rotate,
    rotation_vectors,
    turns_of,
)
from crowdsim.motion.clips.leg_solver import Leg, bend_legs, missing_height, raised_heels, stretch
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.deformed.body_kernels import REACH

FADE = 0.4
"""Time over which the difference fades [s]. A longer one shows more of the old motion's style."""

_FASTEST = 1.5
"""Largest velocity of a difference [m/s]; higher ones are cut."""
_FASTEST_TURN = 8.0
"""Largest angular velocity of a difference [rad/s]; higher ones are cut."""
_OWN_STEP = 1.5
"""Height of the small step of a standing body, as a multiple of the distance that the foot moves."""
_HIGHEST = 0.05
"""Largest height of such a step [m]."""


class Body(NamedTuple):
    """Poses of n bodies: root positions (n, 3) [m]; rotations (n, J, 4) relative to the parent, the root's global."""

    roots: Floats
    rotations: Floats

    def chosen(self, some: NDArray[np.int64] | NDArray[np.bool_]) -> Body:
        """Return the selected bodies."""
        return Body(self.roots[some], self.rotations[some])


class Feet(NamedTuple):
    """Both feet of n bodies, left first: balls (n, 2, 3) [m], world rotations of the ankle joints (n, 2, 4)."""

    balls: Floats
    turns: Floats


class Offsets(NamedTuple):
    """Differences of old motions to new ones at n switches.

    Attributes
    ----------
    times : (n,) float64
        Times of the switches [s].
    roots, root_speeds : (n, 3) float64
        Root position [m] and velocity [m/s].
    turns, turn_speeds : (n, J, 3) float64
        Rotation vectors [rad] and angular velocities [rad/s] of all joints.
    balls, ball_speeds : (n, 2, 3) float64
        Position [m] and velocity [m/s] of the balls of the feet; the velocity of a planted foot is 0.
    yaws : (n, 2) float64
        Rotation of the feet about the vertical [rad].
    tilts : (n, 2, 3) float64
        Rotation vectors of the rest of their rotation [rad].
    hold, end : (n, 2) float64
        Times until which each foot keeps its offset, and at which it has vanished [s].
    rise : (n, 2) float64
        Height that the foot is lifted meanwhile [m].
    """

    times: Floats
    roots: Floats
    root_speeds: Floats
    turns: Floats
    turn_speeds: Floats
    balls: Floats
    ball_speeds: Floats
    yaws: Floats
    tilts: Floats
    hold: Floats
    end: Floats
    rise: Floats

    def chosen(self, some: NDArray[np.int64]) -> Offsets:
        """Return the selected offsets."""
        return Offsets(*(values[some] for values in self))

    @property
    def until(self) -> Floats:
        """Return the times (n,) at which each offset has vanished [s]."""
        until: Floats = np.maximum(self.times + FADE, self.end.max(axis=1))
        return until


def offsets_between(
    skeleton: Skeleton, times: Floats, old: tuple[Body, Body], new: tuple[Body, Body], lapse: tuple[Floats, Floats]
) -> Offsets:
    """Return the differences of old motions to new ones, without times and lifts of feet, which :func:`with_feet` adds.

    Parameters
    ----------
    skeleton : Skeleton
        Skeleton of all bodies.
    times : (n,) float64
        Times of the switches [s].
    old, new : tuple of Body
        Poses at these times, and ``lapse`` later, of the old and the new motion.
    lapse : tuple of (n,) float64
        Times between both poses, of the old and the new motion; may be negative [s].
    """
    # Velocities of roots, joints and balls in the old and the new motion, from the two poses of each.
    speeds = []
    for (body, later), seconds in zip((old, new), lapse, strict=True):
        balls, later_balls = feet_of_body(skeleton, body).balls, feet_of_body(skeleton, later).balls
        turned = rotation_vectors(multiply(later.rotations, conjugate(body.rotations)))
        scale = 1.0 / seconds
        speeds.append(
            (
                (later.roots - body.roots) * scale[:, None],
                turned * scale[:, None, None],
                (later_balls - balls) * scale[:, None, None],
            )
        )
    root_speeds, turn_speeds, ball_speeds = (before - after for before, after in zip(*speeds, strict=True))
    # Turn of each foot, split into a turn about the vertical and the tilt that is left.
    old_feet, new_feet = feet_of_body(skeleton, old[0]), feet_of_body(skeleton, new[0])
    apart = multiply(old_feet.turns, conjugate(new_feet.turns))
    # A quaternion and its negative are the same rotation: take the one with w >= 0, whose turn is within half a turn.
    yaws = 2.0 * atan2(np.where(apart[..., 0] < 0.0, -1.0, 1.0) * apart[..., 3], np.abs(apart[..., 0]))
    none = np.zeros((len(times), 2))
    return Offsets(
        times=times,
        roots=old[0].roots - new[0].roots,
        root_speeds=_bounded(root_speeds, _FASTEST),
        turns=rotation_vectors(multiply(old[0].rotations, conjugate(new[0].rotations))),
        turn_speeds=_bounded(turn_speeds, _FASTEST_TURN),
        balls=old_feet.balls - new_feet.balls,
        ball_speeds=_bounded(ball_speeds, _FASTEST),
        yaws=yaws,
        tilts=rotation_vectors(multiply(apart, conjugate(_yaw_turns(yaws)))),
        hold=none,
        end=none,
        rise=none,
    )


def with_feet(offsets: Offsets, hold: Floats, end: Floats, forced: NDArray[np.bool_]) -> Offsets:
    """Return the offsets with the times ``hold`` and ``end`` (n, 2) of the feet [s], and what follows from them.

    ``forced`` (n, 2) marks feet that take a small step of their own while the body stands; these are lifted. Feet that
    still stand after the switch have no velocity.
    """
    aside = np.sqrt(np.sum(offsets.balls[..., :2] * offsets.balls[..., :2], axis=-1))
    stands = hold > offsets.times[:, None]
    return offsets._replace(
        hold=hold,
        end=end,
        rise=np.where(forced, np.minimum(_OWN_STEP * aside, _HIGHEST), 0.0),
        ball_speeds=np.where(stands[..., None], 0.0, offsets.ball_speeds),
    )


def feet_of_body(skeleton: Skeleton, body: Body) -> Feet:
    """Return balls and world rotations of the feet; the ankle stands for the ball if the skeleton has no toe joint."""
    places, world = forward_kinematics(skeleton, body.roots, body.rotations)
    ankles = [skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
    toes = [skeleton.roles.get(f"{side}_toe", ankle) for side, ankle in zip(("left", "right"), ankles, strict=True)]
    return Feet(places[:, toes], world[:, ankles])


def faded(skeleton: Skeleton, new: Body, offsets: Offsets, time: float | Floats) -> Body:
    """Return the bodies ``new`` of n new motions at ``time`` [s], with what is left of their ``offsets`` added.

    ``time`` is one for all, or (n,). Before its switch, a body has the whole offset.
    """
    since = np.maximum(time - offsets.times, 0.0)
    keep, drift = _weights(since, np.full(len(since), FADE))
    roots = new.roots + keep[:, None] * offsets.roots + drift[:, None] * offsets.root_speeds
    left = keep[:, None, None] * offsets.turns + drift[:, None, None] * offsets.turn_speeds
    rotations = multiply(turns_of(left), new.rotations)
    feet, targets = _foot_targets(skeleton, new, offsets, time, keep)
    return _on_feet(skeleton, new, Body(roots, rotations), feet, targets)


def _foot_targets(
    skeleton: Skeleton, new: Body, offsets: Offsets, time: float | Floats, keep: Floats
) -> tuple[Feet, Floats]:
    """Return the feet of ``new`` with their offsets at ``time`` [s] added, and their ankles (n, 2, 3) [m].

    ``time`` is one for all n bodies, or (n,). ``keep`` (n,) is the share of the offsets of whole bodies that is left.
    """
    places, _ = forward_kinematics(skeleton, new.roots, new.rotations)
    ankles = [skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
    feet = feet_of_body(skeleton, new)
    # Offsets of feet last longer than those of bodies: they are kept until ``hold``, and have vanished at ``end``.
    now = np.broadcast_to(np.asarray(time, np.float64), offsets.times.shape)[:, None]
    share, drift = _weights(np.maximum(now - offsets.hold, 0.0), offsets.end - offsets.hold)
    u = np.clip((now - offsets.hold) / (offsets.end - offsets.hold), 0.0, 1.0)
    moved = share[..., None] * offsets.balls + drift[..., None] * offsets.ball_speeds
    # Heights and tilts fade from the switch on, even of planted feet, so that no foot hovers.
    moved[..., 2] = np.minimum(share, keep[:, None]) * offsets.balls[..., 2]
    # A small step: up to ``rise`` halfway through, 0 at both ends and without a jump in speed there.
    moved[..., 2] += offsets.rise * 16.0 * u * u * (1.0 - u) * (1.0 - u)
    tilt = np.minimum(share, keep[:, None])[..., None] * offsets.tilts
    turns = multiply(multiply(turns_of(tilt), _yaw_turns(share * offsets.yaws)), feet.turns)
    # The ankle moves so that the foot turns about its ball.
    back = rotate(multiply(turns, conjugate(feet.turns)), places[:, ankles] - feet.balls)
    balls = feet.balls + moved
    return Feet(balls, turns), balls + back


def _on_feet(skeleton: Skeleton, new: Body, body: Body, feet: Feet, targets: Floats) -> Body:
    """Return ``body`` with legs that bring the ankles to ``targets`` (n, 2, 3) [m] and the feet to ``feet``.

    If a leg is too short, its heel is raised; if that is not enough, the pelvis is lowered. ``new`` is the body of the
    new motion alone.
    """
    places, world = forward_kinematics(skeleton, body.roots, body.rotations)
    new_places, _ = forward_kinematics(skeleton, new.roots, new.rotations)
    # Left of the pelvis: knees bend about this axis if a leg is so straight that it has no plane of its own.
    left = rotate(world[:, 0], np.array([0.0, 1.0, 0.0]))
    joints = [[skeleton.joint(f"{side}_{part}") for part in ("hip", "knee", "ankle")] for side in ("left", "right")]
    legs, most = [], []
    for hip, knee, ankle in joints:
        legs.append(Leg(places[:, hip], places[:, knee], places[:, ankle], world[:, hip], world[:, knee], left))
        # A leg may be as straight as in the blended or the new motion.
        alone = legs[-1]._replace(hips=new_places[:, hip], knees=new_places[:, knee], ankles=new_places[:, ankle])
        most.append(np.maximum(np.maximum(stretch(alone), stretch(legs[-1])), REACH))
    # Raise the heel of a leg that does not reach its target; lower the pelvis if that is not enough.
    rises = [raised_heels(leg, feet.balls[:, k], targets[:, k], most[k]) for k, leg in enumerate(legs)]
    targets = feet.balls + np.stack([rotate(rise, targets[:, k] - feet.balls[:, k]) for k, rise in enumerate(rises)], 1)
    lack = np.maximum(*(missing_height(leg, targets[:, k], most[k]) for k, leg in enumerate(legs)))
    down = np.zeros_like(body.roots)
    down[:, 2] = np.maximum(lack, 0.0)
    rotations = body.rotations.copy()
    for k, (hip, knee, ankle) in enumerate(joints):
        leg = legs[k]._replace(hips=legs[k].hips - down, knees=legs[k].knees - down, ankles=legs[k].ankles - down)
        thigh, shank = bend_legs(leg, targets[:, k], most[k])
        rotations[:, hip] = multiply(conjugate(world[:, skeleton.parents[hip]]), thigh)
        rotations[:, knee] = multiply(conjugate(thigh), shank)
        turn = multiply(rises[k], feet.turns[:, k])
        rotations[:, ankle] = multiply(conjugate(shank), turn)
        toe = skeleton.roles.get(f"{('left', 'right')[k]}_toe")
        if toe is not None and int(skeleton.parents[toe]) == ankle:
            # Toes keep their direction in the world as the heel rises.
            rotations[:, toe] = multiply(multiply(conjugate(turn), feet.turns[:, k]), rotations[:, toe])
    return Body(body.roots - down, rotations)


def _weights(since: Floats, whole: Floats) -> tuple[Floats, Floats]:
    """Return the weights ``keep`` and ``drift`` of a difference and its velocity after ``since`` of ``whole`` seconds.

    What is left of the difference is keep * difference + drift * velocity: ``keep`` is a share, 1 at first, ``drift`` a
    time [s], 0 at first. Both are quintic polynomials: their sum begins with the difference, its velocity and no
    acceleration, and ends at 0 and at rest.
    """
    u = np.clip(since / whole, 0.0, 1.0)
    keep = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0))
    drift = whole * u * (1.0 + u * u * (-6.0 + u * (8.0 - 3.0 * u)))
    return keep, drift


def _bounded(vectors: Floats, most: float) -> Floats:
    """Return vectors (..., 3); those that are longer than ``most`` are shortened to it."""
    length = np.sqrt(np.sum(vectors * vectors, axis=-1, keepdims=True))
    bounded: Floats = vectors * np.minimum(1.0, most / np.maximum(length, 1e-12))
    return bounded


def _yaw_turns(yaws: Floats) -> Floats:
    """Return quaternions (..., 4) of rotations by ``yaws`` (...) about the vertical [rad]."""
    zero = np.zeros_like(yaws)
    return np.stack([cos(0.5 * yaws), zero, zero, sin(0.5 * yaws)], axis=-1)
