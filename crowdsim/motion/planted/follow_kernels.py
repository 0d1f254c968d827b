"""Follow the feet of captured bodies from step to step: where each stands, and what fades after it lifts.

Arguments of all helpers: ``work`` (:class:`~crowdsim.motion.planted.follow_feet.Step`); ``a``, the row of the body;
``node`` and ``previous``, what it plays and what it played before, -1 for none; ``frame``, of the node; ``share``,
``early`` and ``late``, moments of the step, 0 to 1; ``count``, the number of events noted so far (helpers that take it
return the new one). ``mode``, ``since``, ``until`` and ``pose`` (x, y [m], heading [rad]) are the columns of a foot's
state that :mod:`crowdsim.motion.planted.pin_kernels` names.
"""

from crowdsim.geometry.planar_kernels import shorter_way, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.pose_kernels import pose_body
from crowdsim.motion.planted.between_kernels import split_step, track_between
from crowdsim.motion.planted.pin_kernels import (
    COLUMNS,
    FADES,
    FREE,
    MODE,
    NODE,
    SINCE,
    STANDS,
    UNTIL,
    YAW,
    X,
    Y,
    correction,
    place_of_foot,
)

LONGEST_FADE = 24.0
"""Frames over which the correction of a lifted foot fades at most: a usual swing."""


@helper
def _track_at(work, a, share):
    """Return the track pose of body ``a`` (x, y [m], heading [rad]) at a share of the step."""
    return track_between(
        work.feet.tracks,
        work.natural,
        work.spans,
        work.old_node[a],
        work.old_frame[a],
        work.old_track[a],
        work.new_node[a],
        work.new_frame[a],
        work.new_track[a],
        share,
    )


@helper
def _pose(work, a, node, previous, frame, share):
    """Pose body ``a`` in a frame of a node at a share of the step; writes ``work.positions`` and ``work.rotations``."""
    x, y, heading = _track_at(work, a, share)
    pose_body(work.table, node, previous, frame, x, y, heading, work.positions, work.rotations, 0)


@helper
def _place(work, foot):
    """Return ball x, y [m] and heading [rad] of a foot of the body posed last."""
    return place_of_foot(work.feet, foot, work.positions, work.rotations, 0)


@helper
def _set(work, a, foot, mode, node, since, until, pose, share, count):
    """Change the state of a foot at a share of the step, note it as event ``count``, and return the next number.

    The state holds from frame ``since`` of the node on. A fade ends in its frame ``until``, which does not matter in
    other modes (pass 0.0).
    """
    state = work.states[a, foot]
    state[MODE] = mode
    state[NODE] = node
    state[SINCE] = since
    state[UNTIL] = until
    state[X], state[Y], state[YAW] = pose
    # Without room the event is only counted; the caller then makes room and takes the step again.
    if count < len(work.rows):
        work.rows[count] = 2 * a + foot
        work.shares[count] = share
        for k in range(COLUMNS):
            work.events[count, k] = state[k]
    return count + 1


@helper
def _release(work, a, foot, node, frame, moved, share, count):
    """Let the displacement ``moved`` of a foot (x, y [m], turn [rad]) fade from ``frame`` of a node until it lands.

    It fades over LONGEST_FADE frames at most. A foot that is not displaced is FREE at once. The change is noted; return
    the next number of an event.
    """
    row = work.table.node_first[node] + int(frame)
    until = min(float(work.feet.landings[row, foot]), frame + LONGEST_FADE)
    mode = FREE if abs(moved[0]) + abs(moved[1]) + abs(moved[2]) < 1e-9 else FADES
    return _set(work, a, foot, mode, node, frame, until, moved, share, count)


@helper
def _play(work, a, node, previous, begin, end, early, late, count):
    """Note each foot that lands or lifts while a body plays the frames of a node after ``begin``, up to ``end``.

    They are played at an even pace between the shares ``early`` and ``late`` of the step.
    """
    table, feet = work.table, work.feet
    first = table.node_first[node]
    # Leave out the last row of the node: whether a foot stands from there on depends on the next node, see `_enter`.
    for frame in range(int(begin) + 1, min(int(end), table.node_frames[node] - 1) + 1):
        for foot in range(2):
            stood, stands = feet.stands[first + frame - 1, foot], feet.stands[first + frame, foot]
            # The foot neither lands nor lifts here.
            if stood == stands:
                continue
            share = early + (late - early) * (frame - begin) / max(end - begin, 1e-9)
            _pose(work, a, node, previous, float(frame), share)
            place = _place(work, foot)
            moved = correction(table, feet, work.states[a, foot], node, float(frame), foot, place, work.spans)
            # A foot that lands stands where it is shown. If it lifts, its displacement fades.
            if stands:
                pose = (place[0] + moved[0], place[1] + moved[1], place[2] + moved[2])
                count = _set(work, a, foot, STANDS, node, float(frame), 0.0, pose, share, count)
            else:
                count = _release(work, a, foot, node, float(frame), moved, share, count)
    return count


@helper
def _enter(work, a, node, previous, frame, share, shown, count):
    """Go on in ``frame`` of the next node ``node``, and note the new state of both feet.

    shown: where the left and the right foot were shown last, (x, y [m], heading [rad]) each. A foot that stands in the
    next node keeps this place. If it swings there, the difference of this place from its place in the next node fades.
    """
    row = work.table.node_first[node] + int(frame)
    _pose(work, a, node, previous, frame, share)
    for foot in range(2):
        if work.feet.stands[row, foot]:
            count = _set(work, a, foot, STANDS, node, frame, 0.0, shown[foot], share, count)
        else:
            place = _place(work, foot)
            x, y = (
                shorter_way(shown[foot][0] - place[0], work.spans[0]),
                shorter_way(shown[foot][1] - place[1], work.spans[1]),
            )
            count = _release(work, a, foot, node, frame, (x, y, wrap_angle(shown[foot][2] - place[2])), share, count)
    return count


@helper
def _shown(work, a, node, frame, foot):
    """Return where a foot of the body posed last is shown, corrected: x, y [m] and heading [rad]."""
    place = _place(work, foot)
    x, y, yaw = correction(work.table, work.feet, work.states[a, foot], node, frame, foot, place, work.spans)
    return place[0] + x, place[1] + y, place[2] + yaw


@helper
def _appear(work, a, node, previous, frame, count):
    """Note the feet of a body that was not captured before: in ``frame`` of ``node``, where its clip has them."""
    # At the end of the step (share 1), each foot stands from this frame on, or is free.
    row = work.table.node_first[node] + int(frame)
    _pose(work, a, node, previous, frame, 1.0)
    for foot in range(2):
        mode = STANDS if work.feet.stands[row, foot] else FREE
        count = _set(work, a, foot, mode, node, frame, 0.0, _place(work, foot), 1.0, count)
    return count


@kernel
def follow_feet(work):
    """Follow the feet of all bodies over one step, as :func:`crowdsim.recording.between.frame_between` shows it.

    work: :class:`crowdsim.motion.planted.follow_feet.Step`. Its states change, and each change of a captured body is
    noted in order. Return the number of changes; if it is larger than the arrays of events, the last ones are missing
    there.
    """
    count = 0
    table = work.table
    for a in range(len(work.new_node)):
        node, frame, previous = work.new_node[a], work.new_frame[a], work.new_previous[a]
        # Not captured, or no longer: nothing is corrected.
        if node < 0:
            for foot in range(2):
                work.states[a, foot, MODE] = FREE
            continue
        old, since, before = work.old_node[a], work.old_frame[a], work.old_previous[a]
        # Not captured before.
        if old < 0:
            count = _appear(work, a, node, previous, frame, count)
            continue
        # The same node goes on.
        if old == node and frame >= since:
            count = _play(work, a, node, previous, since, frame, 0.0, 1.0, count)
            continue
        # The last node ends within the step.
        share, end, begin = split_step(float(table.node_frames[old]), since, frame, work.natural)
        count = _play(work, a, old, before, since, end, 0.0, share, count)
        _pose(work, a, old, before, end, share)
        shown = (_shown(work, a, old, end, 0), _shown(work, a, old, end, 1))
        count = _enter(work, a, node, previous, begin, share, shown, count)
        count = _play(work, a, node, previous, begin, frame, share, 1.0, count)
    return count
