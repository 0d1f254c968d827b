"""The branches of a motion map laid on the path: steered, judged, tested.

Entries of the map at hand are laid down one by one, each after its parent, and remembered in ``laid`` (rows by
entry): twist, origin, end pose and arc length of the path at the end. A row is of the stage whose serial it carries.
"""

import math

import numpy as np

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.following.follower.path_kernels import path_point, project, sample_before, sample_index
from crowdsim.geometry.elementary_kernels import atan2, cos_sin, hypot
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance

TEST_FRAMES = 4
"""Frames between two samples of the collision test."""

IN_PLACE = 0.15
"""Meters from start to end below which a node counts as turning in place: its heading is free."""

_BEYOND = 1e-6
"""Meters beyond the needed clearance up to which it is measured, so that rounding cannot make it look short."""

_MOST_BACKWARD = 0.1
"""Meters of path that a node may lose: a sway, no step back."""

_MOST_TURNS = 64
"""Full turns that are taken off an angle, at most."""

_HEADING_LEVER = 0.2
"""Meters by which steering weighs an error of heading (radians) against one of place (meters)."""

_HEADING_WINDOW = 0.3
"""Meters of path around the end of a node in which its heading must fit."""

NODE_COST = 0.01
"""Square meters that each node adds to the area between branch and path: few long nodes rather than many short."""

_TIME_COST = 0.02
"""Square meters a second, against standing about."""

_SWITCH_COST = 0.05
"""Square meters for ending where another behavior than the planned goes on."""

MISFIT_COST = 0.15
"""Square meters a meter moved with a behavior one step off the planned one."""

_END_COST = 0.25
"""Weight (meters) of what the end of a branch is off the path: meters aside, and half of the radians."""


@helper
def _fit_heading(maps, guide, rules, node, heading, arc, window):
    """Smallest turn that makes the heading of a body at the end of ``node`` fit the path at ``arc``.

    It fits where the body faces as the node's behavior, or one that may follow it here, asks for. The path's
    direction is taken anywhere within ``window`` meters: a body rounds a corner sooner or later than its path.
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
            if math.isnan(facing):
                continue
            for i in range(begin, end + 1):
                turn = guide.pose[i, 2] + facing - heading
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
    """Extra rotation about the planted foot of ``edge`` that brings the end of its target nearest to the path.

    One joint of the planar chain of the 2011 paper (inverse branch kinematics): the angle that points the end at
    the path and the angle that mends the heading, weighed by the lever each has, clamped to the edge's range.
    (x, y, heading) is the end of the node before, ``arc`` its place on the path.
    """
    low, high = graph.edge_low[edge], graph.edge_high[edge]
    if high - low <= 0.0:
        return 0.0
    node = np.int64(graph.edge_target[edge])
    c, s = cos_sin(heading)
    tx, ty = graph.edge_transform[edge, 0], graph.edge_transform[edge, 1]
    ox, oy, oh = x + c * tx - s * ty, y + s * tx + c * ty, heading + graph.edge_transform[edge, 2]
    px, py = graph.edge_pivot[edge, 0], graph.edge_pivot[edge, 1]
    jx, jy = x + c * px - s * py, y + s * px + c * py
    ex, ey, eh = node_end(graph, np.int64(node), ox, oy, oh)
    aim, _ = project(guide, ex, ey, arc - 0.2, arc + graph.node_length[node] + 0.3)
    gx, gy = path_point(guide, aim)
    lever = (ex - jx) ** 2 + (ey - jy) ** 2
    ax, ay, bx, by = ex - jx, ey - jy, gx - jx, gy - jy
    toward = atan2(ax * by - ay * bx, ax * bx + ay * by)
    if math.isnan(rules.goal_heading) or aim < guide.length - _HEADING_WINDOW:
        mend = _fit_heading(maps, guide, rules, node, eh, aim, 0.0)
    else:
        mend = wrap_angle(rules.goal_heading - eh)
    weight = _HEADING_LEVER * _HEADING_LEVER
    return min(max((lever * toward + weight * mend) / (lever + weight), low), high)


@helper
def _place_entry(graph, maps, guide, rules, laid, root, entry, x, y, heading, arc):
    """Lay an entry down after the pose (x, y, heading) at ``arc``, with the twist that steers it to the path.

    Its node, edge, twist, origin and end go to ``laid``. False if its behavior may not be used here.
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
    """Walk the outline of an entry beside the path from ``arc`` to ``arc_after``.

    Enters whether it is wider than planned anywhere and how far it strays into ``laid``, and returns ``area`` with what
    lies between the two added, and the square of how near it comes to the goal.
    """
    node = laid.node[entry]
    behavior = graph.node_behavior[node]
    travel = graph.node_length[node]
    ox, oy = laid.origin[entry, 0], laid.origin[entry, 1]
    c, s = cos_sin(laid.origin[entry, 2])
    goal_x, goal_y = path_point(guide, guide.length)
    nearest = math.inf
    # Where a node begins its body is there already, which the outline leaves out.
    wide = behavior > guide.behavior[sample_before(guide, arc)]
    begin, end = maps.outline_first[node], maps.outline_first[node + 1]
    step = travel / (end - begin)
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
    """Whether an entry is at the goal: ends there as the rules ask, or comes by (``nearest``, squared meters)."""
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
def _judge_entry(graph, maps, guide, rules, laid, entry, arc, area):
    """Judge an entry that was placed after ``arc``: fit or not, at the goal or not, what it adds to ``area``."""
    node = laid.node[entry]
    x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
    moved = hypot(graph.node_motion[node, 0], graph.node_motion[node, 1])
    arc_after, end_gap = project(guide, x, y, arc - 0.2, arc + graph.node_length[node] + 0.3)
    backward = arc - arc_after
    arc_after = max(arc_after, arc)
    error = abs(_fit_heading(maps, guide, rules, node, heading, arc_after, _HEADING_WINDOW))
    here = sample_index(guide, arc_after)
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
        area += NODE_COST + _TIME_COST * graph.node_frames[node] / CAPTURE_RATE
        if maps.leads_to[node] != guide.behavior[here]:
            area += _SWITCH_COST
    reached = _reaches(graph, guide, rules, laid, entry, nearest)
    # Near the end the heading that is asked for counts, not that of the path.
    if not math.isnan(rules.goal_heading) and arc_after > guide.length - _HEADING_WINDOW:
        error = abs(wrap_angle(rules.goal_heading - heading))
    # Who stands past the end, out of reach of the goal, could only shuffle: there are no steps back.
    stuck = rules.end_standing and graph.node_ends_standing[node]
    last = guide.length if stuck else guide.length + rules.goal_tolerance
    laid.fit[entry] = fit and (reached or arc_after <= last)
    laid.reached[entry] = reached
    for k in range(laid.free.shape[1]):
        laid.free[entry, k] = False
    laid.arc[entry] = arc_after
    laid.area[entry] = area
    laid.off[entry] = 0.0 if reached else _END_COST * (end_gap + 0.5 * error)


@helper
def lay_branch(graph, maps, guide, rules, search, laid, root, depth, stage_end, stage_arc, serial):
    """Lay the first ``depth`` entries of ``search.branch`` after the end pose of a stage; how many are to be taken.

    Less than ``depth`` where an entry reaches the goal before; 0 where one is not fit: where it ends far off, goes
    back, faces wrong, passes the goal, or is of a behavior that may not be used here. Without a root (-1) an entry is a
    node, laid down at the stage's end pose itself. ``laid.area`` gathers the area between branch and path (the sum in
    equation 5 of the 2012 paper, at equal shares of the node's length) and in the same unit a little for each node,
    its time, and behaviors other than the planned.
    """
    x, y, heading = stage_end[0], stage_end[1], stage_end[2]
    arc = stage_arc
    area = 0.0
    for d in range(depth):
        entry = search.branch[d]
        # Branches share their first entries: one that this stage laid before is not laid again.
        if laid.serial[entry] != serial:
            laid.serial[entry] = serial
            laid.fit[entry] = False
            if _place_entry(graph, maps, guide, rules, laid, root, entry, x, y, heading, arc):
                _judge_entry(graph, maps, guide, rules, laid, entry, arc, area)
        if not laid.fit[entry]:
            return 0
        if laid.reached[entry]:
            return d + 1
        x, y, heading = laid.end[entry, 0], laid.end[entry, 1], laid.end[entry, 2]
        arc = laid.arc[entry]
        area = laid.area[entry]
    return depth


@helper
def branch_is_free(graph, rules, mesh, layer, search, laid, depth, stage_end, joined, hints):
    """Whether the body's discs are free on one layer all along a laid branch.

    The first node where they are not is marked unfit for the stage. A node of a wider behavior than the planned
    needs the whole room that a plan would have asked for: the plan is narrow for want of it. The seam to the node
    before fades out over the first frames; there is one to the stage's end where ``joined``.
    """
    x, y, heading = stage_end[0], stage_end[1], stage_end[2]
    for d in range(depth):
        entry = search.branch[d]
        if not laid.free[entry, layer]:
            node = laid.node[entry]
            ox, oy, oh = laid.origin[entry, 0], laid.origin[entry, 1], laid.origin[entry, 2]
            dx, dy, dh = 0.0, 0.0, 0.0
            if joined or d > 0:
                dx, dy, dh = x - ox, y - oy, wrap_angle(heading - oh)
            need = rules.radii[graph.node_behavior[node], layer] + (rules.margin if laid.wide[entry] else rules.slack)
            frames = np.int64(graph.node_frames[node])
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
