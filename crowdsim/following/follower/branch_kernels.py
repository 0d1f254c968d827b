"""Branches of a motion map laid on the path: steered, scored and tested.

The entries of the present map are laid down one by one, each after its parent. ``laid`` keeps, in a row per entry, its
twist, origin, end pose and the arc length of the path beside its end. A row is valid for the stage whose serial number
it carries.

Arguments of all helpers: ``graph`` (GraphArrays), ``maps`` (MapArrays), ``guide``, ``rules``, ``search`` and ``laid``
as of :mod:`crowdsim.following.follower.follow_workspace`; ``root``, the stage's node, whose map is read, -1 without
one; ``entry``, counted within that map; ``arc``, the arc length of the path beside a pose [m]. ``stage_end`` (3,) and
``stage_arc`` are pose and arc length at the end of the stage [m, rad], ``mesh`` is the mesh of a layer (MeshArrays).
"""

import math

import numpy as np

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.following.follower.path_kernels import path_point, project, sample_before, sample_index
from crowdsim.following.maps.map_kernels import IN_PLACE
from crowdsim.geometry.elementary_kernels import atan2, cos_sin, hypot
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance

TEST_FRAMES = 4
"""Frames between two samples of the collision test. Fewer: safer and slower."""

_BEYOND = 1e-6
"""Clearance is measured up to this much beyond what is needed, so that rounding cannot make it look short [m]."""

_MOST_BACKWARD = 0.1
"""Arc length that a node may lose [m]: a sway, not a step back."""

_MOST_TURNS = 64
"""Largest number of full turns taken off an angle."""

_HEADING_LEVER = 0.2
"""Weight of a heading error against a position error when steering [m/rad]."""

_HEADING_WINDOW = 0.3
"""Arc length before and behind the end of a node in which the path's direction may match its heading [m]."""

NODE_COST = 0.01
"""Cost per node, in square meters between branch and path: prefers few long nodes to many short ones."""

_TIME_COST = 0.02
"""Cost of time [m2/s]."""

_DELAY_COST = 0.1
"""Cost of the time that a node takes longer than its behavior does on average, against turning on the spot [m2/s]."""

_SWITCH_COST = 0.05
"""Cost of ending in a behavior other than the planned one [m2]."""

MISFIT_COST = 0.15
"""Cost of moving in a behavior one step off the planned one [m2/m]."""

END_COST = 0.25
"""Weight of the error at a branch's end [m]: its distance from the path [m] plus half its heading error [rad]."""


@helper
def _fit_heading(maps, guide, rules, node, heading, arc, window):
    """Return the smallest turn [rad] that makes a body's heading at the end of ``node`` fit the path at ``arc``.

    The heading fits if it is the path's direction plus a facing of the node's behavior, or of a behavior of one of its
    successors; only behaviors that are allowed at ``arc`` count. Directions of the path up to ``window`` meters before
    and behind ``arc`` count, as a body may round a corner sooner or later than its path. ``heading`` [rad] is that of
    the body in the world. The turn is positive to the left; it is pi if no behavior is allowed.
    """
    best = math.pi
    here = sample_index(guide, arc)
    begin = sample_index(guide, arc - window)
    end = sample_index(guide, arc + window)
    for b in range(maps.ends_as.shape[1]):
        if not (maps.ends_as[node, b] and guide.allowed[b, here]):
            continue
        for f in range(rules.facings.shape[1]):
            facing = rules.facings[b, f]
            # Behaviors with fewer facings than others have nan in their place.
            if math.isnan(facing):
                continue
            for i in range(begin, end + 1):
                turn = guide.pose[i, 2] + facing - heading
                # Wrap to (-pi, pi], by full turns.
                for _ in range(_MOST_TURNS):
                    if turn > math.pi:
                        turn -= 2.0 * math.pi
                    elif turn <= -math.pi:
                        turn += 2.0 * math.pi
                    else:
                        break
                if abs(turn) < abs(best):
                    best = turn
    return best


@helper
def _steer(graph, maps, guide, rules, edge, x, y, heading, arc):
    """Return the extra rotation [rad] about the planted foot of ``edge`` that fits its target's end best to the path.

    Place and heading count, the heading by _HEADING_LEVER. This is one joint of the 2011 paper's planar chain (inverse
    branch kinematics). (x, y, heading) is the end of the node before, and ``arc`` the path's arc length beside it. The
    rotation is clamped to the edge's range.
    """
    low, high = graph.edge_low[edge], graph.edge_high[edge]
    # This edge allows no extra rotation.
    if high - low <= 0.0:
        return 0.0
    node = np.int64(graph.edge_target[edge])
    c, s = cos_sin(heading)
    tx, ty = graph.edge_transform[edge, 0], graph.edge_transform[edge, 1]
    # The target's origin and end without extra rotation, and the pivot (jx, jy).
    ox, oy, oh = x + c * tx - s * ty, y + s * tx + c * ty, heading + graph.edge_transform[edge, 2]
    px, py = graph.edge_pivot[edge, 0], graph.edge_pivot[edge, 1]
    jx, jy = x + c * px - s * py, y + s * px + c * py
    ex, ey, eh = node_end(graph, np.int64(node), ox, oy, oh)
    # toward: angle at the pivot from the end to the path's nearest point, searched a little back and one node's length
    # ahead. mend: turn that corrects the heading.
    aim, _ = project(guide, ex, ey, arc - 0.2, arc + graph.node_length[node] + 0.3)
    gx, gy = path_point(guide, aim)
    lever = (ex - jx) ** 2 + (ey - jy) ** 2
    ax, ay, bx, by = ex - jx, ey - jy, gx - jx, gy - jy
    toward = atan2(ax * by - ay * bx, ax * bx + ay * by)
    # Near the goal the required heading counts, if there is one, not that of the path.
    if math.isnan(rules.goal_heading) or aim < guide.length - _HEADING_WINDOW:
        mend = _fit_heading(maps, guide, rules, node, eh, aim, 0.0)
    else:
        mend = wrap_angle(rules.goal_heading - eh)
    # Least squares: minimize lever * (t - toward)^2 + weight * (t - mend)^2 over the rotation t.
    weight = _HEADING_LEVER * _HEADING_LEVER
    return min(max((lever * toward + weight * mend) / (lever + weight), low), high)


@helper
def _place_entry(graph, maps, guide, rules, laid, root, entry, x, y, heading, arc):
    """Lay an entry after the pose (x, y, heading) at ``arc``, steered to the path.

    The pose is the end of the parent [m, rad]. Write node, edge, twist, origin and end to row ``entry`` of ``laid``.
    Without a root (-1), ``entry`` is a node of the motion graph that begins at the pose itself, with no edge and no
    twist. Return False, and write nothing, if its behavior is not allowed at ``arc``.
    """
    node = entry
    edge = np.int64(NONE)
    twist = 0.0
    ox, oy, oh = x, y, heading
    if root >= 0:
        node = np.int64(maps.node[maps.first[root] + entry])
        edge = np.int64(maps.edge[maps.first[root] + entry])
    if not guide.allowed[graph.node_behavior[node], sample_index(guide, arc)]:
        return False
    if root >= 0:
        twist = _steer(graph, maps, guide, rules, edge, x, y, heading, arc)
        ox, oy, oh = next_origin(graph, np.int64(edge), twist, x, y, heading)
    x, y, heading = node_end(graph, node, ox, oy, oh)
    laid.node[entry] = node
    laid.edge[entry] = edge
    laid.twist[entry] = twist
    laid.origin[entry, 0], laid.origin[entry, 1], laid.origin[entry, 2] = ox, oy, oh
    laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2] = x, y, heading
    return True


@helper
def _stray(graph, maps, guide, laid, entry, arc, arc_after, area):
    """Integrate the gap between an entry's track and the path from ``arc`` to ``arc_after``.

    Return ``area`` plus that integral [m2], and the least squared distance from the track to the goal [m2]. The gap
    counts as larger by MISFIT_COST times the difference between the numbers of the node's and the planned behavior. Set
    ``laid.wide`` (wider than planned anywhere) and ``laid.strayed`` (largest gap [m], without this addition).
    """
    node = laid.node[entry]
    behavior = graph.node_behavior[node]
    travel = graph.node_length[node]
    ox, oy = laid.origin[entry, 0], laid.origin[entry, 1]
    c, s = cos_sin(laid.origin[entry, 2])
    goal_x, goal_y = path_point(guide, guide.length)
    nearest = math.inf
    # The outline omits the node's first point, but the body is there: compare its behavior with the plan, too.
    wide = behavior > guide.behavior[sample_before(guide, arc)]
    begin, end = maps.outline_first[node], maps.outline_first[node + 1]
    step = travel / (end - begin)
    # Outline points are matched to the path by their share of the length walked; a node may turn without walking.
    pace = (arc_after - arc) / max(travel, 1e-9)
    qx, qy = path_point(guide, arc)
    strayed = math.sqrt((ox - qx) * (ox - qx) + (oy - qy) * (oy - qy))
    for row in range(begin, end):
        u, v = maps.outline[row, 0], maps.outline[row, 1]
        px, py = ox + c * u - s * v, oy + s * u + c * v
        along = min(arc + pace * maps.outline[row, 2], guide.length)
        qx, qy = path_point(guide, along)
        gap = math.sqrt((px - qx) * (px - qx) + (py - qy) * (py - qy))
        area += step * gap
        strayed = max(strayed, gap)
        misfit = behavior - guide.behavior[sample_index(guide, along)]
        area += step * MISFIT_COST * abs(misfit)
        wide = wide or misfit > 0
        nearest = min(nearest, (px - goal_x) * (px - goal_x) + (py - goal_y) * (py - goal_y))
    laid.wide[entry] = wide
    laid.strayed[entry] = strayed
    return area, nearest


@helper
def _reaches(graph, guide, rules, laid, entry, nearest):
    """Return True if an entry ends at the goal as the rules require, or passes it if that suffices.

    nearest: least squared distance of its track from the goal [m2].
    """
    # Neither a stand nor a heading is required: passing the goal is enough.
    if not rules.end_standing and math.isnan(rules.goal_heading):
        return nearest <= rules.goal_tolerance * rules.goal_tolerance
    goal_x, goal_y = path_point(guide, guide.length)
    stands = graph.node_ends_standing[laid.node[entry]] or not rules.end_standing
    reached = hypot(laid.end[entry, 0] - goal_x, laid.end[entry, 1] - goal_y) <= rules.goal_tolerance and stands
    if not math.isnan(rules.goal_heading):
        turned = abs(wrap_angle(rules.goal_heading - laid.end[entry, 2]))
        reached = reached and turned <= rules.goal_heading_tolerance
    return reached


@helper
def _judge_entry(graph, maps, guide, rules, laid, entry, arc, area, time):
    """Decide if an entry placed after ``arc`` may be taken, and if it reaches the goal.

    ``area`` is the cost of the branch before it [m2], ``time`` what that takes [s]. Write fit, reached, wide, strayed,
    arc, area, time and off of its row of ``laid``, and set free to False, as nothing is tested yet.
    """
    node = laid.node[entry]
    x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
    moved = hypot(graph.node_motion[node, 0], graph.node_motion[node, 1])
    seconds = graph.node_frames[node] / CAPTURE_RATE
    # The path beside the end of the node: searched a little back, and one node's length ahead.
    arc_after, end_gap = project(guide, x, y, arc - 0.2, arc + graph.node_length[node] + 0.3)
    backward = arc - arc_after
    # A sway back that is small enough to fit counts as no movement along the path.
    arc_after = max(arc_after, arc)
    error = abs(_fit_heading(maps, guide, rules, node, heading, arc_after, _HEADING_WINDOW))
    here = sample_index(guide, arc_after)
    # Fit: near the path, no step back, facing as a behavior allows (unless it turns in place), and of a behavior that
    # is allowed here.
    fit = (
        end_gap <= rules.deviation
        and backward <= _MOST_BACKWARD
        and (moved < IN_PLACE or error <= rules.heading_tolerance)
        and guide.allowed[graph.node_behavior[node], here]
    )
    nearest = math.inf
    laid.wide[entry] = False
    laid.strayed[entry] = math.inf
    if fit:
        area, nearest = _stray(graph, maps, guide, laid, entry, arc, arc_after, area)
        area += NODE_COST + _TIME_COST * seconds + _DELAY_COST * maps.late[node]
        if maps.leads_to[node] != guide.behavior[here]:
            area += _SWITCH_COST
    reached = _reaches(graph, guide, rules, laid, entry, nearest)
    # Near the goal the required heading counts, not that of the path.
    if not math.isnan(rules.goal_heading) and arc_after > guide.length - _HEADING_WINDOW:
        error = abs(wrap_angle(rules.goal_heading - heading))
    # A node that ends standing past the goal is useless, as there are no steps back; others may overshoot a little.
    stuck = rules.end_standing and graph.node_ends_standing[node]
    last = guide.length if stuck else guide.length + rules.goal_tolerance
    laid.fit[entry] = fit and (reached or arc_after <= last)
    laid.reached[entry] = reached
    for k in range(laid.free.shape[1]):
        laid.free[entry, k] = False
    laid.arc[entry] = arc_after
    laid.area[entry] = area
    laid.time[entry] = time + seconds
    laid.off[entry] = 0.0 if reached else END_COST * (end_gap + 0.5 * error)


@helper
def lay_branch(graph, maps, guide, rules, search, laid, root, depth, stage_end, stage_arc, serial):
    """Lay the first ``depth`` entries of ``search.branch`` after the end pose of a stage; return how many to take.

    The number is less than ``depth`` if an entry reaches the goal before, and 0 if one up to there is unfit: it ends
    far off the path or beyond the goal, goes back, or faces a wrong way; its behavior is not allowed here; or a test of
    this stage has found it blocked. Without a root (-1) an entry is a node, laid at the stage's end pose itself.

    ``laid.area`` sums the area between branch and path (equation 5 of the 2012 paper, with equal shares of each node's
    length), plus costs in the same unit: of nodes, of time, of delay, and of behaviors other than planned.
    """
    x, y, heading = stage_end[0], stage_end[1], stage_end[2]
    arc = stage_arc
    area, time = 0.0, 0.0
    for d in range(depth):
        entry = search.branch[d]
        # Branches share their first entries: skip those that this stage has already laid.
        if laid.serial[entry] != serial:
            laid.serial[entry] = serial
            laid.fit[entry] = False
            if _place_entry(graph, maps, guide, rules, laid, root, entry, x, y, heading, arc):
                _judge_entry(graph, maps, guide, rules, laid, entry, arc, area, time)
        if not laid.fit[entry]:
            return 0
        if laid.reached[entry]:
            return d + 1
        x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
        arc = laid.arc[entry]
        area, time = laid.area[entry], laid.time[entry]
    return depth


@helper
def branch_is_free(graph, rules, mesh, layer, search, laid, depth, stage_end, joined, hints):
    """Return True if the body's disc is free on one layer along a laid branch; else mark the first blocked node unfit.

    A node of a wider behavior than planned needs the whole planned clearance (radius + margin), as the plan is narrow
    for lack of that space; others need radius + sampling margin. ``depth`` is the number of nodes; ``hints`` (layers,)
    are the triangles found last on each layer, -1 for none, and are updated. ``stage_end`` (3,) is the pose before the
    branch. ``joined``: the branch follows the stage's end with a blend offset, which fades out over a node's first
    frames. ``laid.free`` keeps which nodes are free on this layer, as branches share nodes.
    """
    x, y, heading = stage_end[0], stage_end[1], stage_end[2]
    for d in range(depth):
        entry = search.branch[d]
        if not laid.free[entry, layer]:
            node = laid.node[entry]
            ox, oy, oh = laid.origin[entry, 0], laid.origin[entry, 1], laid.origin[entry, 2]
            # The blend offset: the end of the node before less the origin of this one.
            dx, dy, dh = 0.0, 0.0, 0.0
            if joined or d > 0:
                dx, dy, dh = x - ox, y - oy, wrap_angle(heading - oh)
            margin = rules.margin if laid.wide[entry] else rules.sampling_margin
            need = rules.radii[graph.node_behavior[node], layer] + margin
            frames = np.int64(graph.node_frames[node])
            # Test every TEST_FRAMES-th frame and the last one.
            frame = np.int64(-TEST_FRAMES)
            while frame < frames:
                frame = min(frame + TEST_FRAMES, frames)
                px, py, _ = track_pose(graph, node, frame, ox, oy, oh, dx, dy, dh)
                gap, hints[layer] = disc_clearance(mesh, px, py, need + _BEYOND, hints[layer])
                if gap < need:
                    laid.fit[entry] = False
                    return False
            laid.free[entry, layer] = True
        x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
    return True
