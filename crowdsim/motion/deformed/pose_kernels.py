"""Pose the bodies of deformed clips, many in one call.

Arguments of all helpers: ``model`` (ClipModel); ``steps`` (H, STEP_COLUMNS), footsteps of the :class:`StepPlan
<crowdsim.motion.deformed.step_plan.StepPlan>`, with the columns of :mod:`crowdsim.motion.deformed.plan_kernels`;
``foot``, 0 for the left and 1 for the right; ``track``, the columns X to TWIST of
:mod:`crowdsim.motion.deformed.body_kernels` at the time of the pose; ``place`` and ``turn``, position [m] and rotation
of the root; ``out`` (P, J, 4), rotations of the joints of P bodies, each relative to its parent, of which row ``body``
is written. Quaternions are (w, x, y, z). ``q`` is a rotation, ``phase`` the phase of the gait [cycles].
"""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper, kernel
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.deformed.body_kernels import (
    AHEAD,
    ANKLE_HEIGHT,
    FOOT_LENGTH,
    PHASE,
    REACH,
    SHANK,
    SHARE,
    THIGH,
    TWIST,
    conjugate,
    ease,
    hip_of,
    lacking,
    multiply,
    pelvis_of,
    quaternion,
    rotate,
    sampled,
    track_at,
    turned_by,
)
from crowdsim.motion.deformed.phase_kernels import STANCE
from crowdsim.motion.deformed.plan_kernels import ASIDE, LAND, LIFT, PAD, PRINT, planned_pitch, stand_ankle

_LEAST_LIFT = 0.045
"""Height that is added to the way of a foot in a step on the spot [m]; 0.6 of it if the stride is 0."""
_CLEAR = 0.015
"""Least distance between sole and floor in the middle of a swing [m]."""


@helper
def _cubic(u, start, start_speed, end, end_speed):
    """Interpolate between ``start`` and ``end``, u in [0, 1], with given speeds there (cubic Hermite).

    start_speed, end_speed: change per unit of u.
    """
    rest = 1.0 - u
    return (
        (1.0 + 2.0 * u) * rest * rest * start
        + u * u * (1.0 + 2.0 * rest) * end
        + u * rest * (rest * start_speed - u * end_speed)
    )


@helper
def _swing_ankle(model, foot, old, new, u, track):
    """Return ankle, pitch, heading and toe bend of a foot that swings from one print to its next.

    old, new: (STEP_COLUMNS,) rows of steps: the columns LIFT and ASIDE of the print that it leaves, and LAND of the
    next one, are read. u: share of the foot's cycle, from STANCE to 1. The ankle is (x, y, z) [m]; the others are
    angles [rad], the pitch positive if the toes point up, the toe bend never negative.
    """
    # v: share of the swing; speeds per cycle become speeds per swing. A bump over the swing, from 0 over 1 in its
    # middle back to 0, is 16 v^2 (1 - v)^2 if it begins and ends without speed, else 4 v (1 - v).
    length = 1.0 - STANCE
    v = (u - STANCE) / length
    rest = 1.0 - v
    x = _cubic(v, old[LIFT], length * old[LIFT + 5], new[LAND], length * new[LAND + 5])
    y = _cubic(v, old[LIFT + 1], length * old[LIFT + 6], new[LAND + 1], length * new[LAND + 6])
    z = _cubic(v, old[LIFT + 2], length * old[LIFT + 7], new[LAND + 2], length * new[LAND + 7])
    yaw = old[LIFT + 4] + ease(v) * (new[LAND + 4] - old[LIFT + 4])
    # Pass the other foot at a distance, ASIDE meters in the middle; outward is left for the left foot.
    c, s = cos_sin(yaw)
    aside = (1.0 - 2.0 * foot) * old[ASIDE] * 16.0 * v * v * rest * rest
    x -= aside * s
    y += aside * c
    # Lift as the clip does, times AHEAD, the stride ahead as a multiple of the clip's. Add the lift of a step on the
    # spot, which fades as AHEAD grows (to half at 0.2). It has its full height if SHARE, the whole stride as such a
    # multiple, turning included, is 1 or more; 0.6 of it for a body that hardly moves.
    ahead = track[AHEAD]
    share = min(track[SHARE], 1.0)
    z += ahead * sampled(model.lift, foot, u)
    z += (1.0 - ahead / (ahead + 0.2)) * _LEAST_LIFT * 16.0 * v * v * rest * rest * (0.6 + 0.4 * share)
    # Pitch as in the clip, blended from the pitch at which the foot lifted.
    least = 1.0 - ease(v)
    pitch = planned_pitch(model, foot, u, ahead)
    pitch += least * (old[LIFT + 3] - planned_pitch(model, foot, STANCE, ahead))
    # Keep ball and heel off the floor.
    pc, ps = cos_sin(pitch)
    high = model.bones[foot, ANKLE_HEIGHT]
    ball = model.bones[foot, FOOT_LENGTH] * ps - high * pc
    heel = -HEEL_BACK * ps - high * pc
    z = max(z, _CLEAR * 4.0 * v * rest - min(ball, heel))
    # Toes bend up by as much as the foot points down, else their tips would go through the floor.
    return (x, y, z), pitch, yaw, max(-pitch, 0.0)


@helper
def _foot_at(model, steps, row, foot, u, track, place, turn):
    """Return ankle (x, y, z) [m], pitch, heading and toe bend [rad] of a foot at the share ``u`` of its cycle.

    row: row of the print that it stands on or comes from; the foot's next print is two rows on.
    """
    if u < STANCE:
        prints = (steps[row, PRINT], steps[row, PRINT + 1], steps[row, PRINT + 2])
        ankle, pitch, yaw = stand_ankle(model, foot, prints, u, track, place, turn, -1.0)
        # While the heel is raised, the toes bend up by as much, so that they lie flat on the floor.
        return ankle, pitch, yaw, max(-pitch, 0.0)
    return _swing_ankle(model, foot, steps[row], steps[row + 2], u, track)


@helper
def _frame_rotation(x0, x1, x2, y0, y1, y2, z0, z1, z2):
    """Return the rotation of the frame with the axes x = (x0, x1, x2), y = (y0, y1, y2), z = (z0, z1, z2).

    They are unit vectors, the columns of a rotation matrix, which is turned into a quaternion.
    """
    # At least one of the four components is 1/2 or more in size. The axes give the products of all four with four
    # times that one; scaling them to length one then divides by no small number.
    trace = x0 + y1 + z2
    if trace > 0.0:
        w = 1.0 + trace
        i, j, k = y2 - z1, z0 - x2, x1 - y0
    elif x0 >= y1 and x0 >= z2:
        w = y2 - z1
        i, j, k = 1.0 + x0 - y1 - z2, y0 + x1, z0 + x2
    elif y1 >= z2:
        w = z0 - x2
        i, j, k = y0 + x1, 1.0 + y1 - x0 - z2, z1 + y2
    else:
        w = x1 - y0
        i, j, k = z0 + x2, z1 + y2, 1.0 + z2 - x0 - y1
    n = 1.0 / math.sqrt(w * w + i * i + j * j + k * k)
    return w * n, i * n, j * n, k * n


@helper
def _put(out, body, joint, q):
    """Write the rotation ``q`` of a joint to its row of ``out``."""
    out[body, joint, 0] = q[0]
    out[body, joint, 1] = q[1]
    out[body, joint, 2] = q[2]
    out[body, joint, 3] = q[3]


@helper
def _pose_leg(model, foot, hip, turn, target, forward, out, body):
    """Write rotations of hip, knee, ankle and toe so that the leg ends at ``target``: ankle, pitch, heading, toe bend.

    hip: place of the hip joint [m]. turn: rotation of the root. target: as of :func:`_foot_at`. forward: unit vector x,
    y in which the knee points. The knee bends by the law of cosines. A leg that is too short is stretched to REACH of
    its length toward the ankle.
    """
    ankle, pitch, yaw, bend = target
    thigh = model.bones[foot, THIGH]
    shank = model.bones[foot, SHANK]
    x, y, z = ankle[0] - hip[0], ankle[1] - hip[1], ankle[2] - hip[2]
    far = math.sqrt(x * x + y * y + z * z)
    reach = min(far, REACH * (thigh + shank))
    x, y, z = x / far, y / far, z / far
    # Knee hinge: perpendicular to forward and to the line from hip to ankle; it points to the left. 1e-12: a leg along
    # ``forward`` has no hinge, and must not divide by 0.
    hx, hy, hz = forward[1] * z, -forward[0] * z, forward[0] * y - forward[1] * x
    n = 1.0 / math.sqrt(max(hx * hx + hy * hy + hz * hz, 1e-12))
    hx, hy, hz = hx * n, hy * n, hz * n
    # Front of the leg: perpendicular to that line, on the knee's side.
    fx, fy, fz = hy * -z - hz * -y, hz * -x - hx * -z, hx * -y - hy * -x
    # Law of cosines: angle between the thigh and the line from hip to ankle. t is the thigh, k the shank. If the ankle
    # is too near to the hip for any bend of the knee, the sine is 0.
    cosine = (thigh * thigh + reach * reach - shank * shank) / (2.0 * thigh * reach)
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    tx, ty, tz = cosine * x + sine * fx, cosine * y + sine * fy, cosine * z + sine * fz
    kx, ky, kz = (reach * x - thigh * tx) / shank, (reach * y - thigh * ty) / shank, (reach * z - thigh * tz) / shank
    n = 1.0 / math.sqrt(kx * kx + ky * ky + kz * kz)
    kx, ky, kz = kx * n, ky * n, kz * n
    # Frame of each bone: z up the bone, y the hinge, x perpendicular to both. ``turns`` lead from it to the joint.
    upper = _frame_rotation(hz * ty - hy * tz, hx * tz - hz * tx, hy * tx - hx * ty, hx, hy, hz, -tx, -ty, -tz)
    lower = _frame_rotation(hz * ky - hy * kz, hx * kz - hz * kx, hy * kx - hx * ky, hx, hy, hz, -kx, -ky, -kz)
    turns = model.turns[foot]
    thigh_world = multiply(upper, quaternion(turns, 1))
    shank_world = multiply(lower, quaternion(turns, 2))
    # The foot pitches about its own y axis; the toes bend up from it.
    yc, ys = cos_sin(0.5 * yaw)
    pc, ps = cos_sin(0.5 * pitch)
    level = multiply((yc, 0.0, 0.0, ys), (pc, 0.0, -ps, 0.0))
    foot_world = multiply(level, quaternion(turns, 3))
    legs = model.legs
    _put(out, body, legs[foot, 0], multiply(conjugate(multiply(turn, quaternion(turns, 0))), thigh_world))
    _put(out, body, legs[foot, 1], multiply(conjugate(thigh_world), shank_world))
    _put(out, body, legs[foot, 2], multiply(conjugate(shank_world), foot_world))
    # A skeleton may have no toe joint.
    if legs[foot, 3] >= 0:
        bc, bs = cos_sin(0.5 * bend)
        toe_world = multiply(multiply(level, (bc, 0.0, -bs, 0.0)), quaternion(turns, 4))
        _put(out, body, legs[foot, 3], multiply(conjugate(foot_world), toe_world))


@helper
def _pose_upper(model, phase, share, twist, out, body):
    """Write the rotations of the joints ``model.upper``: their means, and ``share`` times the clip's swings from them.

    share: the body's stride as a multiple of the clip's: 0 for the mean pose, 1 for the clip's, 1.25 at most (column
    SHARE). twist: angle from the chest to the hips [rad]; the joints of the spine turn back by it in equal parts, so
    that the chest keeps its heading.
    """
    # Interpolate half rotation vectors between two samples of the cycle; scaled vectors are a slerp from the mean.
    samples = model.swings.shape[0] - 1
    at = (phase - math.floor(phase)) * samples
    k = min(int(at), samples - 1)
    late = share * (at - k)
    early = share - late
    swings = model.swings
    # Half of each spine joint's part of the twist; without a spine (max) no joint is turned by it.
    back, aside = cos_sin(0.5 * twist / max(model.spine, 1))
    for u in range(len(model.upper)):
        swing = turned_by(
            early * swings[k, u, 0] + late * swings[k + 1, u, 0],
            early * swings[k, u, 1] + late * swings[k + 1, u, 1],
            early * swings[k, u, 2] + late * swings[k + 1, u, 2],
        )
        joint = model.upper[u]
        turn = multiply(quaternion(model.mean, joint), swing)
        if u < model.spine:
            turn = multiply((back, 0.0, 0.0, -aside), turn)
        _put(out, body, joint, turn)


@kernel
def pose_bodies(model, plan, bodies, times, roots, rotations):
    """Pose P bodies on the tracks of a plan; write the places of their roots and the rotations of their joints.

    Parameters
    ----------
    model: :class:`~crowdsim.motion.deformed.deformed_clip.ClipModel`.
    plan: :class:`~crowdsim.motion.deformed.step_plan.StepPlan`.
    bodies: (P,) int64, the track of each body in the plan.
    times: (P,) float64 [s] after the first sample of the body's track. For about a second before and after a track its
    movement goes on; beyond that the body keeps its pose.
    roots: (P, 3) float64 [m], filled.
    rotations: (P, J, 4) float64 of joints in their parents, filled.
    """
    samples = plan.samples
    steps = plan.steps
    for pose in range(len(bodies)):
        body = bodies[pose]
        # Place the pelvis.
        time = times[pose] + PAD * plan.step
        track = track_at(samples, plan.firsts[body], plan.counts[body], plan.step, time)
        place, turn = pelvis_of(model, track)
        # Find the feet, on their prints or between them. The row of a foot's last landing is the number of that half
        # cycle less the number of row 0; the left foot lands at whole cycles, the right one half a cycle later.
        half = plan.halves[body]
        phase = track[PHASE]
        whole = math.floor(phase)
        left = _foot_at(model, steps, plan.rows[body] + 2 * whole - half, 0, phase - whole, track, place, turn)
        late = phase - 0.5
        behind = math.floor(late)
        right = _foot_at(model, steps, plan.rows[body] + 2 * behind + 1 - half, 1, late - behind, track, place, turn)
        # The plan's drop is smoothed and bounded. If a standing leg still does not reach, lower the pelvis.
        lack = 0.0
        if phase - whole < STANCE:
            lack = max(lack, lacking(model.bones, 0, hip_of(model, 0, place, turn), left[0]))
        if late - behind < STANCE:
            lack = max(lack, lacking(model.bones, 1, hip_of(model, 1, place, turn), right[0]))
        place = (place[0], place[1], place[2] - lack)
        roots[pose, 0] = place[0]
        roots[pose, 1] = place[1]
        roots[pose, 2] = place[2]
        _put(rotations, pose, 0, turn)
        # Knees point halfway between foot and pelvis. 1e-12: a foot turned opposite to the pelvis gives no direction.
        front = rotate(turn, 1.0, 0.0, 0.0)
        across = 1.0 / math.sqrt(front[0] * front[0] + front[1] * front[1])
        for foot in range(2):
            target = left if foot == 0 else right
            c, s = cos_sin(target[2])
            x, y = c + front[0] * across, s + front[1] * across
            n = 1.0 / math.sqrt(max(x * x + y * y, 1e-12))
            _pose_leg(model, foot, hip_of(model, foot, place, turn), turn, target, (x * n, y * n), rotations, pose)
        _pose_upper(model, phase, track[SHARE], track[TWIST], rotations, pose)
