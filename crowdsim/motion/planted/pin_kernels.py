"""Put the feet of captured bodies where they stand, and bend the legs to them.

A foot that stands keeps its place from touch-down until it lifts, through all nodes that it stands in; only what it
rolls and turns in the clip that is played moves it. While it swings, its displacement from the clip fades out.

Arguments of all helpers: ``table`` (PoseTable) and ``feet`` (FootTable); ``foot``, 0 for the left and 1 for the right;
``positions`` (A, J, 3) and ``rotations`` (A, J, 4), the joints of all bodies, which are changed in place, and ``a``,
the row of one body; hip, knee, ankle and other points are triples [m], rotations are quaternions (w, x, y, z). ``a``
and ``b`` are vectors in products; ``turn`` is a rotation, ``target`` the ankle's place to be reached [m], ``most`` the
share of its length to which the leg may stretch; ``spans`` are the lengths of the floor along x and y [m], 0 if it is
not periodic there; ``place`` is where a foot is in the pose of the clip: x, y of its ball [m], heading [rad];
``moved`` is how far it is moved x, y [m] and turned [rad].
"""

import math

from crowdsim.geometry.elementary_kernels import acos, atan2, cos_sin
from crowdsim.geometry.planar_kernels import compose, shorter_way, to_local, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.deformed.body_kernels import REACH, ease, multiply, quaternion, rotate

# Columns of the state of a foot. MODE: how it is corrected (FREE: not at all, STANDS, FADES). NODE: the node in which
# the correction holds; in others there is none. SINCE: frame of that node from which on it holds. UNTIL: frame at which
# a fade ends (not read otherwise). X, Y [m] and YAW [rad]: place and heading of a standing foot in frame SINCE, or the
# displacement that fades, as it is in frame SINCE.
MODE, NODE, SINCE, UNTIL, X, Y, YAW = 0, 1, 2, 3, 4, 5, 6
COLUMNS = 7
FREE, STANDS, FADES = 0.0, 1.0, 2.0

FARTHEST = 0.2
"""Largest distance by which a foot is moved from its place in the clip [m]; beyond, the body drags the foot along."""
_LOWEST = 0.1
"""Largest height by which the pelvis comes down for a foot that is out of reach [m]."""
_BENT = 0.05
"""Sine of a bend below which the bones alone do not give the hinge of the knee."""
_NOTHING = 1e-9


@helper
def place_in_clip(feet, first, last, foot, frame):
    """Return ball x, y [m] and heading [rad] of a foot in a frame of the node with rows ``first`` to ``last``.

    They are relative to the track pose in row ``first``, and interpolated between frames; the last frame has no next.
    """
    row = first + int(frame)
    after = min(row + 1, last)
    part = frame - int(frame)
    a, b = feet.places[row, foot], feet.places[after, foot]
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * wrap_angle(b[2] - a[2])


@helper
def place_of_foot(feet, foot, positions, rotations, a):
    """Return ball x, y [m] and heading [rad] of a foot of posed body ``a``."""
    ankle, ball = feet.legs[foot, 2], feet.legs[foot, 3]
    # The axis across a foot gives its heading, as a foot on its toes has none along its length. Turned back by a right
    # angle, (x, y) points ahead as (y, -x).
    left = feet.across[foot]
    x, y, _ = rotate(quaternion(rotations[a], ankle), left[0], left[1], left[2])
    return float(positions[a, ball, 0]), float(positions[a, ball, 1]), atan2(-x, y)


@helper
def correction(table, feet, state, node, frame, foot, place, spans):
    """Return how far a foot at ``place`` is moved (x, y [m]) and turned [rad] in a frame of ``node``.

    state: (COLUMNS,) of the foot. A foot that is FREE, or whose NODE is another one, is not moved. One that STANDS is
    moved by FARTHEST at most.
    """
    if state[MODE] == FREE or state[NODE] != node:
        return 0.0, 0.0, 0.0
    # A fade takes one frame at least.
    if state[MODE] == FADES:
        w = 1.0 - ease((frame - state[SINCE]) / max(state[UNTIL] - state[SINCE], 1.0))
        return w * state[X], w * state[Y], w * state[YAW]
    # A standing foot: from its place in frame SINCE, go on by as much as the foot moves in the clip since then.
    first = table.node_first[node]
    last = first + table.node_frames[node]
    ax, ay, ah = place_in_clip(feet, first, last, foot, state[SINCE])
    bx, by, bh = place_in_clip(feet, first, last, foot, frame)
    x, y, h = to_local(ax, ay, ah, bx, by, bh)
    x, y, h = compose(state[X], state[Y], state[YAW], x, y, h)
    dx, dy = shorter_way(x - place[0], spans[0]), shorter_way(y - place[1], spans[1])
    # A foot that would have to stay behind by more than FARTHEST is dragged along.
    far = math.sqrt(dx * dx + dy * dy)
    share = FARTHEST / far if far > FARTHEST else 1.0
    return share * dx, share * dy, wrap_angle(h - place[2])


@helper
def _minus(a, b):
    """Return a - b, the vector from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@helper
def _plus(a, b, s):
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@helper
def _dot(a, b):
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def _cross(a, b):
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@helper
def _unit(a):
    """Return a vector scaled to length one; zero stays zero."""
    n = 1.0 / max(math.sqrt(_dot(a, a)), 1e-12)
    return n * a[0], n * a[1], n * a[2]


@helper
def _shortest(a, b):
    """Return the rotation that turns unit vector a into b (not opposite) the shortest way."""
    c = _cross(a, b)
    w = 1.0 + _dot(a, b)
    n = 1.0 / math.sqrt(w * w + _dot(c, c))
    return n * w, n * c[0], n * c[1], n * c[2]


@helper
def _joint(positions, a, joint):
    """Return the place of a joint of body ``a`` [m], as float64."""
    return float(positions[a, joint, 0]), float(positions[a, joint, 1]), float(positions[a, joint, 2])


@helper
def bent_leg(hip, knee, ankle, left, target, most):
    """Return the rotations of thigh and shank, in the world, that bring the ankle to ``target`` or as near as it gets.

    The knee bends by the law of cosines in its plane, then the leg turns the shortest way, as in
    :func:`crowdsim.motion.clips.leg_solver.bend_legs`. left: unit vector, axis about which a knee bends that is nearly
    straight or bent backward. most: share of its length to which the leg may stretch.
    """
    thigh, shank, way = _minus(knee, hip), _minus(ankle, knee), _minus(target, hip)
    upper, lower = math.sqrt(_dot(thigh, thigh)), math.sqrt(_dot(shank, shank))
    # The distance from hip to ankle lies between a leg folded up (the difference of its bones) and a stretched one.
    far = min(max(math.sqrt(_dot(way, way)), abs(upper - lower) + 1e-3), most * (upper + lower))
    cosine = (far * far - upper * upper - lower * lower) / (2.0 * upper * lower)
    c, s = cos_sin(acos(min(max(cosine, -1.0), 1.0)))
    down, along = _unit(thigh), _unit(shank)
    # A straight leg does not show where its knee bends, and one bent backward is bent forward.
    across = _cross(down, along)
    hinge = _plus(across, left, max(_BENT - _dot(across, left), 0.0))
    hinge = _unit(_plus(hinge, down, -_dot(hinge, down)))
    # The direction of the bent shank, while the thigh stays (``ahead`` is the direction into which a shank bends, to
    # the back of the body). Then turn the whole leg to the target.
    ahead = _cross(hinge, down)
    wanted = (c * down[0] + s * ahead[0], c * down[1] + s * ahead[1], c * down[2] + s * ahead[2])
    turn = _shortest(_unit(_plus(thigh, wanted, lower)), _unit(way))
    return turn, multiply(turn, _shortest(along, wanted))


@helper
def _move(positions, rotations, a, joint, turn, old, new):
    """Turn a joint of body ``a`` by ``turn`` about the point ``old``, then move it as that point moves to ``new`` [m].

    Changes the joint's rows of ``positions`` and ``rotations``.
    """
    x, y, z = rotate(
        turn, positions[a, joint, 0] - old[0], positions[a, joint, 1] - old[1], positions[a, joint, 2] - old[2]
    )
    positions[a, joint, 0], positions[a, joint, 1], positions[a, joint, 2] = new[0] + x, new[1] + y, new[2] + z
    q = multiply(turn, quaternion(rotations[a], joint))
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for k in range(4):
        rotations[a, joint, k] = n * q[k]


@helper
def _reach(hip, knee, ankle, target):
    """Return the share of its length to which a leg may stretch, and how far the pelvis must come down for it [m].

    The leg may stretch to REACH, or as far as it is posed if that is more. The second value is negative if the ankle
    reaches ``target`` already: the hip could be higher by as much.
    """
    thigh, shank, whole = _minus(knee, hip), _minus(ankle, knee), _minus(ankle, hip)
    length = math.sqrt(_dot(thigh, thigh)) + math.sqrt(_dot(shank, shank))
    most = max(REACH, math.sqrt(_dot(whole, whole)) / length)
    # Pythagoras: the hip's largest height above the target at this horizontal distance, 0 if that is too far.
    x, y = hip[0] - target[0], hip[1] - target[1]
    square = most * most * length * length - x * x - y * y
    return most, hip[2] - target[2] - math.sqrt(max(square, 0.0))


@helper
def _put_leg(feet, foot, positions, rotations, a, target, yaw, most, left):
    """Bend a leg of body ``a`` to bring its ankle to ``target``, and turn its foot by ``yaw`` about the vertical [rad].

    ``left`` is the unit vector to the left of the body, about which the knee bends if it is nearly straight or bent
    backward.
    """
    hip, knee, ankle = (
        _joint(positions, a, feet.legs[foot, 0]),
        _joint(positions, a, feet.legs[foot, 1]),
        _joint(positions, a, feet.legs[foot, 2]),
    )
    thigh, shank = bent_leg(hip, knee, ankle, left, target, most)
    x, y, z = rotate(thigh, knee[0] - hip[0], knee[1] - hip[1], knee[2] - hip[2])
    new_knee = (hip[0] + x, hip[1] + y, hip[2] + z)
    x, y, z = rotate(shank, ankle[0] - knee[0], ankle[1] - knee[1], ankle[2] - knee[2])
    new_ankle = (new_knee[0] + x, new_knee[1] + y, new_knee[2] + z)
    c, s = cos_sin(0.5 * yaw)
    # Joints go with the thigh (0), the shank (1) or the foot (2) of this leg; all others stay.
    for joint in range(len(feet.bones)):
        bone = feet.bones[joint] - 3 * foot
        if bone == 0:
            _move(positions, rotations, a, joint, thigh, hip, hip)
        elif bone == 1:
            _move(positions, rotations, a, joint, shank, knee, new_knee)
        elif bone == 2:
            _move(positions, rotations, a, joint, (c, 0.0, 0.0, s), ankle, new_ankle)


@helper
def _target(feet, foot, positions, a, place, moved):
    """Return the place of the ankle [m] after its foot is moved, and turned about its ball; its height stays."""
    ankle = _joint(positions, a, feet.legs[foot, 2])
    c, s = cos_sin(moved[2])
    x, y = ankle[0] - place[0], ankle[1] - place[1]
    return place[0] + moved[0] + c * x - s * y, place[1] + moved[1] + s * x + c * y, ankle[2]


@helper
def pin_body(table, feet, states, node, frame, spans, positions, rotations, a):
    """Correct both feet of posed body ``a`` in a frame of its node, and its legs with them.

    states: (2, COLUMNS) of its feet. If a foot is out of reach, the whole body comes down, by _LOWEST at most.
    """
    left_place = place_of_foot(feet, 0, positions, rotations, a)
    right_place = place_of_foot(feet, 1, positions, rotations, a)
    left = correction(table, feet, states[0], node, frame, 0, left_place, spans)
    right = correction(table, feet, states[1], node, frame, 1, right_place, spans)
    # Both feet are where the clip has them.
    if abs(left[0]) + abs(left[1]) + abs(left[2]) + abs(right[0]) + abs(right[1]) + abs(right[2]) < _NOTHING:
        return
    left_target = _target(feet, 0, positions, a, left_place, left)
    right_target = _target(feet, 1, positions, a, right_place, right)
    # If a leg does not reach, the pelvis comes down, and all of the body with it.
    legs = feet.legs
    left_most, left_lack = _reach(
        _joint(positions, a, legs[0, 0]),
        _joint(positions, a, legs[0, 1]),
        _joint(positions, a, legs[0, 2]),
        left_target,
    )
    right_most, right_lack = _reach(
        _joint(positions, a, legs[1, 0]),
        _joint(positions, a, legs[1, 1]),
        _joint(positions, a, legs[1, 2]),
        right_target,
    )
    lack = min(max(left_lack, right_lack, 0.0), _LOWEST)
    if lack > 0.0:
        for joint in range(len(feet.bones)):
            positions[a, joint, 2] -= lack
    # The body's left: +y of the root (joint 0).
    hinge = rotate(quaternion(rotations[a], 0), 0.0, 1.0, 0.0)
    _put_leg(feet, 0, positions, rotations, a, left_target, left[2], left_most, hinge)
    _put_leg(feet, 1, positions, rotations, a, right_target, right[2], right_most, hinge)


@kernel
def pin_feet(table, feet, states, node, frame, spans, positions, rotations):
    """Correct the feet of A posed bodies in place.

    Parameters
    ----------
    table: :class:`crowdsim.motion.graph.pose_table.PoseTable`.
    feet: :class:`crowdsim.motion.planted.planted_rows.FootTable`.
    states: (A, 2, COLUMNS) float64, see the columns of this module (MODE to YAW).
    node, frame: (A,) int32 and float64, what each body plays.
    spans: (2,) float64, lengths of the floor along x and y [m], 0 if it is not periodic there.
    positions, rotations: (A, J, 3) [m] and (A, J, 4) float32, joints in the world.
    """
    for a in range(len(node)):
        pin_body(table, feet, states[a], node[a], frame[a], spans, positions, rotations, a)
