"""A* over the states (point of the roadmap, behavior)."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.planning.roadmap.build_kernels import ROAD_WAY, see_points

STATE = np.dtype(
    [("cost", np.float64), ("since", np.float64), ("run", np.float64), ("rest", np.float64)]
    + [("before", np.int64), ("stamp", np.int64)],
    align=True,
)
"""How a state is reached best, in the search that ``stamp`` tells.

since: meters since a turned section, 0 in one, infinite where there was none. run: meters of the section, infinite in
the first. rest: lower bound of what is still to pay. before: the state before, -1 the start.
"""


TELLING = 8
"""Landmarks that a search asks: those that tell most of the way from its start to its goal."""


@helper
def way_cost(way, i, costs):
    """Cost of a way walked in a section of behavior i."""
    preferred = costs[costs.size - 1]
    return preferred * way.length + (costs[i] - preferred) * way.tight


@helper
def _may_follow(i, j, turned):
    """Whether a section of behavior j may follow one of i: a body turns only beside the preferred behavior."""
    return turned[i] == turned[j] or max(i, j) == turned.size - 1


@helper
def _too_short(i, j, run, since, costs, turned, terms, paid):
    """About what it costs that a section of behavior i, ``run`` meters long, is too short before one of j.

    ``paid``: what the changes into it and out of it count for its least length already.
    """
    if costs[i] > costs[j]:
        return max(0.0, (costs[i] - costs[j]) * (terms[1] - run) - paid)
    needed = terms[1]
    if turned[j]:
        needed = terms[3] if since == run else terms[1] + terms[2]
    elif since == run:
        needed = terms[1] + terms[2]
    if run >= needed:
        return 0.0
    # The narrower of its neighbors goes on instead.
    narrow = costs[j]
    for k in range(costs.size):
        if turned[k] and (turned[j] or since == run):
            narrow = max(narrow, costs[k])
    return max(0.0, (narrow - costs[i]) * run - 2.0 * terms[0])


@helper
def bound_to_goal(marks, of_goal, telling, state, straight, cost):
    """Lower bound of the cost from ``state`` to the goal: by the triangle inequality over landmarks, and straight.

    telling: (k,) numbers of the landmarks asked.
    """
    bound = straight * cost
    for i in range(telling.size):
        k = telling[i]
        bound = max(bound, abs(marks[state, k] - of_goal[k]))
    return bound


@helper
def choose_landmarks(marks, of_goal, seen, starts, behaviors, telling):
    """Put the landmarks that tell most of the way from the ``starts`` first points of ``seen`` into ``telling``."""
    bounds = np.zeros(of_goal.size)
    for k in range(of_goal.size):
        for i in range(starts):
            state = np.int64(seen[i].to) * behaviors + seen[i].level
            bounds[k] += abs(marks[state, k] - of_goal[k])
    for i in range(telling.size):
        best = 0
        for k in range(bounds.size):
            if bounds[k] > bounds[best]:
                best = k
        telling[i] = best
        bounds[best] = -1.0


@kernel
def costs_from(points, ways, costs, turned, change, source, heap, out):
    """Fill ``out`` (states,) with the least cost from all states of point ``source``; sections have no least length."""
    n = costs.size
    out[:] = math.inf
    count = np.int64(0)
    for i in range(points[source].level + 1):
        out[source * n + i] = 0.0
        heap, count = push(heap, count, 0.0, source * n + i)
    while count > 0:
        pop(heap, count)
        count -= 1
        cost = heap[count].key
        state = heap[count].item
        if cost > out[state]:
            continue
        p = state // n
        i = state - p * n
        for j in range(points[p].level + 1):
            if j != i and _may_follow(i, j, turned) and cost + change[i, j] < out[p * n + j]:
                out[p * n + j] = cost + change[i, j]
                heap, count = push(heap, count, cost + change[i, j], p * n + j)
        last = points[p + 1].begin if p + 1 < points.size else ways.size
        for k in range(points[p].begin, last):
            way = ways[k]
            if way.level >= i:
                to = way.to * n + i
                value = cost + way_cost(way, i, costs)
                if value < out[to]:
                    out[to] = value
                    heap, count = push(heap, count, value, to)
    return heap


@kernel
def find_road(layers, radii, around, costs, turned, terms, change, points, spans, ways, marks, states, stamp, ends):
    """Points and behaviors (k, 2) of the cheapest way over the roadmap from ends[0] to ends[1], and its cost.

    around: (nv, n) of `corner_radii`. terms: as :data:`crowdsim.planning.labels.labelling_kernels.TERMS`. change: (n,
    n) cost of a change between two behaviors. marks: (states, l) costs from landmarks. states: scratch with the
    ``stamp`` of this search. No rows where there is no way.
    """
    n = costs.size
    hints = np.full(len(layers), NONE)
    seen = np.empty(64, ROAD_WAY)
    near = np.empty(64, ROAD_WAY)
    near, goals = see_points(layers, hints, radii, around, points, spans, ends[1, 0], ends[1, 1], near)
    hints[:] = NONE
    seen, starts = see_points(layers, hints, radii, around, points, spans, ends[0, 0], ends[0, 1], seen)
    best = math.inf
    last = NONE
    gx = ends[1, 0]
    gy = ends[1, 1]
    preferred = costs[n - 1]
    of_goal = np.full(marks.shape[1], math.inf)
    to_goal = np.zeros(points.size, np.int32)
    for k in range(goals):
        to_goal[near[k].to] = k + 1
        for i in range(near[k].level + 1):
            for k_mark in range(of_goal.size):
                of_goal[k_mark] = min(of_goal[k_mark], marks[near[k].to * n + i, k_mark] + way_cost(near[k], i, costs))
    telling = np.empty(min(TELLING, of_goal.size), np.int64)
    choose_landmarks(marks, of_goal, seen, starts, n, telling)
    heap = np.empty(256, HEAP_ROW)
    count = np.int64(0)
    for k in range(starts):
        p = seen[k].to
        for i in range(seen[k].level + 1):
            value = way_cost(seen[k], i, costs)
            state = states[p * n + i]
            if state.stamp != stamp or value < state.cost:
                if state.stamp != stamp:
                    straight = hypot(points[p].x - gx, points[p].y - gy)
                    state.rest = bound_to_goal(marks, of_goal, telling, p * n + i, straight, preferred)
                state.stamp = stamp
                state.cost = value
                state.before = NONE
                state.since = 0.0 if turned[i] else math.inf
                state.run = math.inf
                heap, count = push(heap, count, value + state.rest, p * n + i)
    while count > 0:
        pop(heap, count)
        count -= 1
        if heap[count].key >= best:
            break
        at = heap[count].item
        state = states[at]
        cost = state.cost
        since = state.since
        run = state.run
        if heap[count].key > cost + state.rest + 1e-9:
            continue
        p = at // n
        i = at - p * n
        if to_goal[p] > 0:
            end = near[to_goal[p] - 1]
            if end.level >= i and cost + way_cost(end, i, costs) < best:
                best = cost + way_cost(end, i, costs)
                last = at
        end_ways = points[p + 1].begin if p + 1 < points.size else ways.size
        straight = hypot(points[p].x - gx, points[p].y - gy)
        for j in range(points[p].level + 1):
            if j == i or not _may_follow(i, j, turned):
                continue
            value = (
                cost
                + change[i, j]
                + _too_short(i, j, run, since, costs, turned, terms, 2.0 * (change[i, j] - terms[0] * preferred))
            )
            to = states[p * n + j]
            if to.stamp == stamp and to.cost <= value:
                continue
            if to.stamp != stamp:
                to.rest = bound_to_goal(marks, of_goal, telling, p * n + j, straight, preferred)
            to.stamp = stamp
            to.cost = value
            to.before = at
            to.since = 0.0 if turned[j] else since
            to.run = 0.0
            heap, count = push(heap, count, value + to.rest, p * n + j)
        for k in range(points[p].begin, end_ways):
            way = ways[k]
            if way.level < i:
                continue
            value = cost + way_cost(way, i, costs)
            s = np.int64(way.to) * n + i
            to = states[s]
            if to.stamp == stamp and to.cost <= value:
                continue
            if to.stamp != stamp:
                dx = points[way.to].x - gx
                dy = points[way.to].y - gy
                to.rest = bound_to_goal(marks, of_goal, telling, s, math.sqrt(dx * dx + dy * dy), preferred)
            to.stamp = stamp
            to.cost = value
            to.before = at
            to.since = 0.0 if turned[i] else since + way.length
            to.run = run + way.length
            if value + to.rest < best:
                heap, count = push(heap, count, value + to.rest, s)
    found = 0
    s = last
    while s >= 0:
        found += 1
        s = states[s].before
    road = np.empty((found, 2), np.int64)
    s = last
    while s >= 0:
        found -= 1
        road[found, 0] = s // n
        road[found, 1] = s % n
        s = states[s].before
    return road, best
