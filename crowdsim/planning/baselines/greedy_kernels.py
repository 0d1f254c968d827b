"""The published planner (2018 paper, algorithm 1) in one kernel: detours around conflict points, while they pay."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.editing.detour_kernels import DONE, LOST, NO_ROOM, find_detour, keeps_off
from crowdsim.navmesh.editing.point_kernels import INSERT, edit_point
from crowdsim.navmesh.editing.undo_kernels import copy_edited
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.checked_kernels import add_dot
from crowdsim.planning.baselines.candidate_kernels import nothing_known, path_cost
from crowdsim.planning.labels.labelling_kernels import MIN_SECTION

MOST_ROUNDS = 64

SAME_PLACE = 1e-6
"""Meters within which conflict points are the same."""

_INSERT = np.int64(INSERT)

CANDIDATE = np.dtype(
    [(name, np.float64) for name in ("x", "y", "length", "cost", "before", "after")]
    + [(name, np.int64) for name in ("first", "last", "sure", "round", "turn")],
    align=True,
)
"""A conflict point and the detour around it.

length: of the detour, meters. cost: of it, infinite where it is not less than that of the best path, or is known not to
pay. before, after: meters that it has in common with the best path, from the start on and up to the goal. first, last:
its points in the list of all. sure: -1 before it was looked for; 1 where it was found with all blockers that there are
by now; 0 where those that came since changed other parts of the path alone, so that ``cost`` is what it should come to.
round, turn: the last round in which the place was a conflict point, and when it is looked at there.
"""


@helper
def _along(points, first, last, arc):
    """The point at ``arc`` meters along points[first : last]."""
    for i in range(first, last - 1):
        ux = points[i + 1, 0] - points[i, 0]
        uy = points[i + 1, 1] - points[i, 1]
        size = hypot(ux, uy)
        if arc <= size and size > 0.0:
            return points[i, 0] + arc / size * ux, points[i, 1] + arc / size * uy
        arc -= size
    return points[last - 1, 0], points[last - 1, 1]


@helper
def _find_conflicts(points, first, last, length, sections, away, one_by_one, candidates, count, round_):
    """Note the conflict points of the path points[first : last] as of this round; (candidates, count, turns).

    They are every ``MIN_SECTION`` along the sections for the narrowest behavior, or all of the path if it has none, and
    farther than ``away`` from both ends. All have the same turn, or with ``one_by_one`` two for each section: first
    those that are the first and the last of it, then the others.
    """
    turns = 1
    whole = sections.shape[0] == 0
    for k in range(1 if whole else sections.shape[0]):
        start = 0.0 if whole else sections[k, 1]
        end = length if whole else sections[k, 2]
        if not whole and sections[k, 0] != 0.0:
            continue
        start += 0.5 * min(MIN_SECTION, end - start)
        final = NONE
        for i in range(math.ceil((end - start) / MIN_SECTION)):
            x, y = _along(points, first, last, start + i * MIN_SECTION)
            if hypot(x - points[first, 0], y - points[first, 1]) <= away:
                continue
            if hypot(x - points[last - 1, 0], y - points[last - 1, 1]) <= away:
                continue
            c = 0
            while c < count and max(abs(candidates[c].x - x), abs(candidates[c].y - y)) > SAME_PLACE:
                c += 1
            if c == count:
                if count == candidates.size:
                    candidates = longer(candidates)
                candidates[c].x = x
                candidates[c].y = y
                candidates[c].sure = NONE
                count += 1
            candidates[c].round = round_
            candidates[c].turn = 0
            if one_by_one:
                candidates[c].turn = turns - 1 if final < 0 else turns
            final = c
        if one_by_one and final >= 0:
            candidates[final].turn = turns - 1
            turns += 2
    return candidates, count, turns


@helper
def _compare(points, candidate, first, last):
    """Fill in what the detour of ``candidate`` has in common with the path points[first : last]."""
    least = min(candidate.last - candidate.first, last - first)
    candidate.before = 0.0
    candidate.after = 0.0
    for i in range(least):
        a = candidate.first + i
        b = first + i
        if points[a, 0] != points[b, 0] or points[a, 1] != points[b, 1]:
            break
        if i > 0:
            candidate.before += hypot(points[b, 0] - points[b - 1, 0], points[b, 1] - points[b - 1, 1])
    for i in range(least):
        a = candidate.last - 1 - i
        b = last - 1 - i
        if points[a, 0] != points[b, 0] or points[a, 1] != points[b, 1]:
            break
        if i > 0:
            candidate.after += hypot(points[b, 0] - points[b + 1, 0], points[b, 1] - points[b + 1, 1])


@helper
def _keep(points, candidates, count, top, length, longer_by, dearer_by, least):
    """Bring candidates up to date after the detour of number ``top`` became the path, and its place a blocker.

    Those stay whose detours keep off the blocker, which cost more, and those whose detours differ from the path,
    ``length`` meters long before, elsewhere: they should come to as much less. ``longer_by`` and ``dearer_by``
    are by how much length and cost rose. Returns how many are left.
    """
    x = candidates[top].x
    y = candidates[top].y
    before = candidates[top].before
    after = candidates[top].after
    kept = 0
    for c in range(count):
        candidate = candidates[c]
        if c == top or candidate.sure < 0:
            continue
        if candidate.first == candidate.last:
            candidate.cost = math.inf
        elif candidate.sure == 1 and keeps_off(points[candidate.first : candidate.last], x, y, least):
            candidate.cost = math.inf
            candidate.before = 0.0
            candidate.after = 0.0
        elif dearer_by == -math.inf:
            continue
        elif length - candidate.after <= before:
            candidate.after += longer_by
            candidate.cost += dearer_by
            candidate.sure = 0
        elif candidate.before >= length - after:
            candidate.before += longer_by
            candidate.cost += dearer_by
            candidate.sure = 0
        else:
            continue
        candidates[kept] = candidate
        kept += 1
    return kept


@kernel
def plan_around(places, before, work, checked, ends, guide, layers, radii, costs, turned, terms, keep):
    """Algorithm 1: (status, cost, points (n, 2), sections (k, 3)) of the path that no one blocker makes cheaper.

    ``places`` are those of a mesh and its workshop (see address_kernels), in which nothing was put yet, ``before`` of a
    copy of the mesh; ``ends``: x, y of start and goal, radius and least clearance; ``guide``: of `aim_guide`. Layers,
    radii, costs, turned, terms and sections are as of :func:`crowdsim.planning.labels.fitting_kernels.annotate`.
    ``keep``: whether blockers that paid off stay, and then stay in both meshes.

    Where the status is not DONE, the mesh has no room or cannot be used any longer, or a detour could not be traced.
    The cost is infinite, and there are no sections, where nothing fits.
    """
    sx, sy, gx, gy, radius, least = ends
    m = mesh_at(places)
    w = workshop_at(places)
    known = nothing_known(layers, costs.size)
    candidates = np.empty(64, CANDIDATE)
    count = np.int64(0)
    nowhere = math.inf
    status, points, filled, direct_length = find_detour(
        places, before, m, w, work, checked, sx, sy, gx, gy, radius, least, guide, nowhere, nowhere,
        np.empty((2048, 2)), np.int64(0),
    )  # fmt: skip
    if status != DONE:
        return status, math.inf, points[:0], np.empty((0, 3))
    first = np.int64(0)
    last = filled
    direct_last = filled
    length = direct_length
    cost, sections, known = path_cost(layers, radii, costs, turned, terms, points, first, last, length, math.inf, known)
    for round_ in range(MOST_ROUNDS):
        candidates, count, turns = _find_conflicts(
            points, first, last, length, sections, 2.0 * radius, keep, candidates, count, round_
        )
        lowest = cost
        found = sections
        turn = 0
        while turn < turns:
            top = NONE
            for c in range(count):
                candidate = candidates[c]
                if candidate.round != round_ or candidate.turn != turn:
                    continue
                if candidate.sure < 0:
                    top = c
                    break
                if candidate.cost < cost and (top < 0 or candidate.cost < candidates[top].cost):
                    top = c
            if top < 0:
                turn += 1
                continue
            candidate = candidates[top]
            if candidate.sure == 1:
                break
            x = candidate.x
            y = candidate.y
            if not keep and keeps_off(points[:direct_last], x, y, least):
                candidate.first = np.int64(0)
                candidate.last = direct_last
                candidate.length = direct_length
            else:
                candidate.first = filled
                status, points, filled, candidate.length = find_detour(
                    places, before, m, w, work, checked, sx, sy, gx, gy, radius, least, guide, x, y, points, filled
                )
                candidate.last = filled
                if status != DONE:
                    return status, cost, points[first:last], sections
            candidate.sure = 1
            _compare(points, candidate, first, last)
            candidate.cost, labels, known = path_cost(
                layers,
                radii,
                costs,
                turned,
                terms,
                points,
                candidate.first,
                candidate.last,
                candidate.length,
                cost if keep else lowest,
                known,
            )
            if candidate.cost < lowest:
                lowest = candidate.cost
                found = labels
        if turn == turns:
            break
        longer_by = candidates[top].length - length
        dearer_by = lowest - cost
        first = candidates[top].first
        last = candidates[top].last
        sections = found
        if keep:
            if not add_dot(checked, candidates[top].x, candidates[top].y):
                return NO_ROOM, cost, points[first:last], sections
            v = edit_point(places, _INSERT, candidates[top].x, candidates[top].y, NONE)
            if v < NONE or (v >= 0 and not copy_edited(places, places, before)):
                return LOST, cost, points[first:last], sections
            count = _keep(points, candidates, count, top, length, longer_by, dearer_by, least)
        else:
            for c in range(count):
                candidates[c].cost = math.inf
        length += longer_by
        cost = lowest
    return DONE, cost, points[first:last], sections
