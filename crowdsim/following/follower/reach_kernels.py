"""Test that every joint of a body stays within its section: the clearance that the path was planned with.

``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`); ``guide``, ``rules``, ``search`` and
``laid`` are those of :mod:`crowdsim.following.follower.follow_workspace`; ``reach``
(:class:`crowdsim.following.follower.body_reach.BodyReach`) holds the joints of each frame, of which ``row`` is one;
``edge`` is the edge into a node, -1 for none; ``heading`` is that of the track [rad].
"""

import math

import numpy as np

from crowdsim.following.follower.path_kernels import path_gap, sample_index
from crowdsim.following.maps.map_kernels import CELL
from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, track_pose

WINDOW = 6
"""Number of frames that ``reach.far`` covers, this one included."""

_BESIDE = 0.15
"""Arc length around the expected place of a track or joint in which its nearest path point is searched [m]."""


@helper
def _first_and_most(reach, node, edge):
    """Return a node's first row, its first row while a blend offset fades, and its farthest joint [m].

    Rows are those of ``reach.joint``. The distance is the largest in any row of both kinds.
    """
    rows = reach.node_first[node]
    # Without an edge nothing fades.
    if edge < 0:
        return rows, rows, reach.node_most[node]
    return rows, reach.edge_first[edge], max(reach.node_most[node], reach.edge_most[edge])


@helper
def _joints_keep_in(guide, reach, row, gap, at, x, y, heading):
    """Return True if all joints in one frame lie within the room of the section nearest to each.

    Joints are sorted from the farthest from the track to the nearest, so the loop ends at the first that cannot leave.
    gap: distance of the track from the path [m]. at: arc length of the path beside the track [m]. x, y, heading: pose
    of the track in the world [m, rad].
    """
    c, s = cos_sin(heading)
    for j in range(reach.joint.shape[1]):
        u, v = reach.joint[row, j, 0], reach.joint[row, j, 1]
        far = math.sqrt(u * u + v * v)
        # This joint and all nearer ones are within the smallest room of any section.
        if gap + far <= reach.least:
            return True
        # Search the joint's nearest path point within this arc length of the track's.
        far += _BESIDE
        arc, off = path_gap(guide, x + c * u - s * v, y + s * u + c * v, at - far, at + far)
        if off > reach.room[guide.behavior[sample_index(guide, arc)]]:
            return False
    return True


@helper
def _frame_of_passing(graph, guide, node, frames, x, y, heading, dx, dy, dh):
    """Return the first frame of ``node``, from 0 to ``frames``, in which its track is nearest to the end of the path.

    x, y, heading: origin of the node [m, rad]. dx, dy, dh: blend offset at its begin, which fades [m, rad].
    """
    last = guide.pose.shape[0] - 1
    nearest = math.inf
    best = frames
    for frame in range(frames + 1):
        px, py, _ = track_pose(graph, node, frame, x, y, heading, dx, dy, dh)
        gap = (px - guide.pose[last, 0]) ** 2 + (py - guide.pose[last, 1]) ** 2
        if gap < nearest:
            nearest, best = gap, frame
    return best


@helper
def branch_keeps_in(graph, guide, rules, reach, search, laid, depth, stage_end, stage_arc, joined):
    """Return True if every joint in every frame of a laid branch, with blend offsets faded, stays in its section.

    Else mark the first node in which a joint leaves its section as unfit for this stage. ``depth`` is the number of
    nodes; ``stage_end`` (3,) and ``stage_arc`` are pose and arc length at the end of the stage [m, rad]; ``joined`` is
    that of :func:`crowdsim.following.follower.branch_kernels.branch_is_free`. Nodes that pass are marked in the last
    column of ``laid.free``, as branches share nodes. If neither a stand nor a heading is required at the goal, a node
    that reaches it is tested only up to the frame in which it passes the goal.
    """
    column = laid.free.shape[1] - 1
    x, y, heading = stage_end[0], stage_end[1], stage_end[2]
    arc = stage_arc
    for d in range(depth):
        entry = search.branch[d]
        if not laid.free[entry, column]:
            node, edge = laid.node[entry], laid.edge[entry]
            ox, oy, oh = laid.origin[entry, 0], laid.origin[entry, 1], laid.origin[entry, 2]
            dx, dy, dh = 0.0, 0.0, 0.0
            if joined or d > 0:
                dx, dy, dh = x - ox, y - oy, wrap_angle(heading - oh)
            rows, fading, most = _first_and_most(reach, node, edge)
            # Quick test of the whole node: farthest joint plus largest stray of the track plus the blend offset. The
            # track is at most half a cell from a point of its outline.
            blend_offset = math.sqrt(dx * dx + dy * dy)
            if laid.strayed[entry] + 0.5 * CELL + blend_offset + most > reach.least:
                frames = np.int64(graph.node_frames[node])
                if laid.reached[entry] and not rules.end_standing and math.isnan(rules.goal_heading):
                    frames = _frame_of_passing(graph, guide, node, frames, ox, oy, oh, dx, dy, dh)
                # pace: largest step of the track between frames, above 0 as a divisor. The smoothstep fade is fastest
                # half way, at 1.5 times its mean.
                pace = reach.node_pace[node] + 1.5 * blend_offset / BLEND_FRAMES + 1e-9
                at, moved = arc, 0.0
                frame = np.int64(0)
                while frame <= frames:
                    row = frame + (fading if frame < BLEND_FRAMES else rows)
                    px, py, ph = track_pose(graph, node, frame, ox, oy, oh, dx, dy, dh)
                    at, gap = path_gap(guide, px, py, at - _BESIDE, at + moved + _BESIDE)
                    # far covers WINDOW frames: if no joint can leave in them, however the track moves, skip them all.
                    leap = np.int64(1)
                    if gap + reach.far[row] + (WINDOW - 1) * pace <= reach.least:
                        leap = np.int64(WINDOW)
                    elif not _joints_keep_in(guide, reach, row, gap, at, px, py, ph):
                        laid.fit[entry] = False
                        return False
                    # The track needs at least this many frames to get so far off that the farthest joint of any frame
                    # could leave.
                    leap = max(leap, np.int64((reach.least - gap - most) / pace))
                    moved = leap * pace
                    frame += leap
            laid.free[entry, column] = True
        x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
        arc = laid.arc[entry]
    return True
