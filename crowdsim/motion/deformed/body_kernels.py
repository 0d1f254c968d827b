"""Parts of a deformed body: the pelvis on a track, standing feet, and the reach of their legs.

Rotations are unit quaternions (w, x, y, z) in tuples. World axes are x, y on the floor and z up. ``model`` is a
:class:`crowdsim.motion.deformed.deformed_clip.ClipModel`; foot 0 is the left one, 1 the right one.

``q`` is a rotation, ``rows`` an array of rotations or samples; ``bones`` (2, 5) are the model's, of both legs: thigh,
shank, ankle to ball along the foot, heights of ankle and ball [m]; ``pitch`` is the pitch of a foot, positive if its
toes point up [rad]; ``print_yaw`` is the heading of a print [rad]; ``hip``, ``ankle`` and ``ball`` are points [m];
``track`` is a result of :func:`track_at`; ``u`` is the phase since a foot landed, the share of its cycle.
"""

import math

from crowdsim.geometry.elementary_kernels import acos, atan2, cos_sin
from crowdsim.jit import helper
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.deformed.spline_kernels import span_of, value_at, weights_of

# Columns of the samples of a track: place [m], heading of the hips [rad], phase [cycles], stride as a multiple of the
# clip's (SHARE), the same of the movement ahead alone (AHEAD), how far the pelvis comes down for legs to reach [m], and
# angle from the chest to the hips [rad].
X, Y, HEADING, PHASE, SHARE, AHEAD, DROP, TWIST = 0, 1, 2, 3, 4, 5, 6, 7
COLUMNS = 8

THIGH, SHANK, FOOT_LENGTH, ANKLE_HEIGHT, BALL_HEIGHT = range(5)
"""Columns of the bones of a model; the length of a foot is that from ankle to ball."""

REACH = 0.9965
"""Largest share of its length to which a leg stretches. Below 1, so that knees do not lock and snap."""
SOLE_DOWN = 0.125
"""Phase after landing at which the whole sole is on the floor, and from which a heel rises if its leg needs it."""
_FREE = 0.15
"""Phase over which a foot on the floor becomes free to pivot."""
_STEEPEST = 1.25
"""Largest pitch of a foot whose heel rises [rad]."""
_TWIST, _EASE = 0.5, 0.2
"""Twist of a leg from which its foot pivots on the ball, and range over which pivoting sets in [rad]."""


@helper
def multiply(a, b):
    """Return the Hamilton product of two rotations: ``b``, then ``a``."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@helper
def conjugate(a):
    """Return the inverse of a rotation."""
    return a[0], -a[1], -a[2], -a[3]


@helper
def quaternion(rows, row):
    """Return a row of an array (n, 4) as a tuple."""
    return rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3]


@helper
def rotate(q, x, y, z):
    """Return the vector (x, y, z) turned by a rotation."""
    tx = 2.0 * (q[2] * z - q[3] * y)
    ty = 2.0 * (q[3] * x - q[1] * z)
    tz = 2.0 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * tx + q[2] * tz - q[3] * ty,
        y + q[0] * ty + q[3] * tx - q[1] * tz,
        z + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@helper
def turned_by(x, y, z):
    """Return the rotation of a half rotation vector, which is the axis times half the angle [rad].

    By the series of cosine and sine, to 1e-4 for angles up to half a turn.
    """
    square = x * x + y * y + z * z
    c = square / 40320.0 - 1.0 / 720.0
    c = ((c * square + 1.0 / 24.0) * square - 0.5) * square + 1.0
    s = square / 362880.0 - 1.0 / 5040.0
    s = ((s * square + 1.0 / 120.0) * square - 1.0 / 6.0) * square + 1.0
    norm = 1.0 / math.sqrt(c * c + s * s * square)
    return c * norm, s * x * norm, s * y * norm, s * z * norm


@helper
def ease(u):
    """Return 0 for u <= 0, 1 for u >= 1, and a curve between without speed or acceleration at the ends.

    ``u`` is a share of any range here, not a phase.
    """
    u = min(max(u, 0.0), 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


@helper
def track_at(samples, first, count, step, time):
    """Return all eight columns of a track ``time`` seconds after its first sample, row ``first`` of ``samples``.

    ``samples`` (n, COLUMNS) have x, y [m], heading [rad], phase [cycles] and so on, as the constants X to TWIST number
    them. The track has ``count`` samples, ``step`` seconds apart; a smooth curve runs near them.
    """
    span, share = span_of(time, step, first, count)
    weights = weights_of(share)
    return (
        value_at(samples, 0, span, weights),
        value_at(samples, 1, span, weights),
        value_at(samples, 2, span, weights),
        value_at(samples, 3, span, weights),
        value_at(samples, 4, span, weights),
        value_at(samples, 5, span, weights),
        value_at(samples, 6, span, weights),
        value_at(samples, 7, span, weights),
    )


@helper
def pelvis_of(model, track):
    """Return place (x, y, z) [m] and rotation of the root on a track.

    Sway, surge and turns are the clip's times SHARE, the bob is the clip's times its square. The mean height goes from
    that of a standing body to that of the clip as SHARE grows to 1. DROP is taken off.
    """
    share = track[SHARE]
    c1, s1 = cos_sin(2.0 * math.pi * (track[PHASE] - math.floor(track[PHASE])))
    # Sum the harmonics (Fourier series over the phase). The cosine and sine of each follow from those of the one before
    # by angle addition.
    ahead, left, up, tx, ty, tz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    c, s = c1, s1
    waves = model.waves
    for k in range(0, waves.shape[1], 2):
        ahead += waves[0, k] * c + waves[0, k + 1] * s
        left += waves[1, k] * c + waves[1, k + 1] * s
        up += waves[2, k] * c + waves[2, k + 1] * s
        tx += waves[3, k] * c + waves[3, k + 1] * s
        ty += waves[4, k] * c + waves[4, k + 1] * s
        tz += waves[5, k] * c + waves[5, k + 1] * s
        c, s = c * c1 - s * s1, s * c1 + c * s1
    # A body at rest stands taller than one that walks; strides longer than the clip's (share > 1) lower it no further.
    # The bob grows with the square of the stride (inverted pendulum).
    walking = min(share, 1.0)
    ahead = model.root[0] + share * ahead
    left = model.root[1] + share * left
    height = (1.0 - walking) * model.stand + walking * model.root[2] + share * share * up - track[DROP]
    # Turn to the heading: half angles for the quaternion, whole ones for the place.
    hc, hs = cos_sin(0.5 * track[HEADING])
    c, s = hc * hc - hs * hs, 2.0 * hc * hs
    swung = multiply(quaternion(model.mean, 0), turned_by(share * tx, share * ty, share * tz))
    place = (track[X] + c * ahead - s * left, track[Y] + s * ahead + c * left, height)
    return place, multiply((hc, 0.0, 0.0, hs), swung)


@helper
def hip_of(model, foot, place, turn):
    """Return the place of the hip joint of a leg [m], for a root at ``place`` [m] with rotation ``turn``."""
    x, y, z = rotate(turn, model.hips[foot, 0], model.hips[foot, 1], model.hips[foot, 2])
    return place[0] + x, place[1] + y, place[2] + z


@helper
def sampled(rows, foot, u):
    """Return row ``foot`` of samples (2, S + 1) over a cycle, interpolated at its share ``u``."""
    last = rows.shape[1] - 1
    place = min(max(u, 0.0), 1.0) * last
    k = min(int(place), last - 1)
    return rows[foot, k] + (place - k) * (rows[foot, k + 1] - rows[foot, k])


@helper
def standing_yaw(print_yaw, out, heading, u):
    """Return the heading of a standing foot: its print's, but turned on its ball if the leg would twist too much [rad].

    out: heading of the foot relative to a body whose leg is not twisted [rad]. heading: of the body [rad]. A foot on
    its heel does not turn.
    """
    # Headings of a track are unwrapped, and the print's comes from them, so their difference is not wrapped.
    twist = heading + out - print_yaw
    # Beyond _TWIST the foot follows; b * b / (b + _EASE) starts without a kink.
    beyond = abs(twist) - _TWIST
    if beyond <= 0.0:
        return print_yaw
    pivoting = ease((u - SOLE_DOWN) / _FREE)
    return print_yaw + math.copysign(pivoting * beyond * beyond / (beyond + _EASE), twist)


@helper
def ankle_over(bones, foot, pitch):
    """Return the ankle of a standing foot relative to where its ball is on the floor: distance ahead and height [m].

    The foot turns about its heel if the toes point up (pitch > 0), else about the ball joint.
    """
    length = bones[foot, FOOT_LENGTH]
    high = bones[foot, ANKLE_HEIGHT]
    c, s = cos_sin(pitch)
    if pitch > 0.0:
        return HEEL_BACK * (c - 1.0) - high * s - length, HEEL_BACK * s + high * c
    # The ankle circles the ball joint, which is bones[foot, BALL_HEIGHT] above the floor.
    rise = high - bones[foot, BALL_HEIGHT]
    return -length * c - rise * s, -length * s + rise * c + bones[foot, BALL_HEIGHT]


@helper
def reaching_pitch(bones, foot, pitch, hip, ball, c, s):
    """Return ``pitch`` of a foot on its ball, or as much lower (heel up) as its leg needs to reach the ankle [rad].

    The result is no lower than -_STEEPEST; the leg may not reach even then. hip: place of the hip joint. ball: place of
    the ball on the floor. c, s: cosine and sine of the foot's heading.
    """
    most = REACH * (bones[foot, THIGH] + bones[foot, SHANK])
    # The hip seen from the ball in the foot's frame; done if the leg reaches the ankle as it is.
    x = c * (hip[0] - ball[0]) + s * (hip[1] - ball[1])
    y = c * (hip[1] - ball[1]) - s * (hip[0] - ball[0])
    ahead, up = ankle_over(bones, foot, pitch)
    dz = hip[2] - up
    if (x - ahead) * (x - ahead) + y * y + dz * dz <= most * most:
        return pitch
    # Else raise the heel. The ankle moves on a circle about the ball joint; by the law of cosines in the triangle ball,
    # ankle, hip the leg has its full length at one angle above the direction to the hip. Less the ankle's angle in a
    # flat foot, it is the pitch. A hip too far for every angle (share > 1) gets the angle that is nearest to it.
    z = hip[2] - bones[foot, BALL_HEIGHT]
    length = bones[foot, FOOT_LENGTH]
    rise = bones[foot, ANKLE_HEIGHT] - bones[foot, BALL_HEIGHT]
    radius = math.sqrt(length * length + rise * rise)
    flat = math.sqrt(x * x + z * z)
    share = (x * x + y * y + z * z + radius * radius - most * most) / (2.0 * radius * flat)
    angle = atan2(z, x) + acos(min(max(share, -1.0), 1.0))
    return max(min(pitch, angle - atan2(rise, -length)), -_STEEPEST)


@helper
def lacking(bones, foot, hip, ankle):
    """Return how far the pelvis must come down for a leg to reach its ankle [m].

    If the leg reaches already, the result is negative: the pelvis could be higher by as much.
    """
    # Pythagoras: the hip's largest height above the ankle at this horizontal distance. It is taken as 0.1 m if it is
    # less, or if the ankle is out of reach at any height: the pelvis must not come down to the floor for it.
    most = REACH * (bones[foot, THIGH] + bones[foot, SHANK])
    x = hip[0] - ankle[0]
    y = hip[1] - ankle[1]
    return hip[2] - ankle[2] - math.sqrt(max(most * most - x * x - y * y, 0.01))
