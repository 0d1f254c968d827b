"""A* over the states (point of the roadmap, behavior)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class Prices(NamedTuple):
    """What walking and changes of behavior cost."""

    costs: NDArray[np.float64]
    """(n,) cost of a meter of each behavior."""
    turned: NDArray[np.bool_]
    """(n,) whether the body moves turned off its way."""
    terms: NDArray[np.float64]
    """(4,) as :data:`crowdsim.planning.labels.labelling_kernels.TERMS`."""
    change: NDArray[np.float64]
    """(n, n) cost of a change between two behaviors."""


class RoadGraph(NamedTuple):
    """The points of a roadmap, the ways between them, and the costs from landmarks."""

    points: NDArray[Any]
    spans: NDArray[Any]
    ways: NDArray[Any]
    marks: NDArray[np.float32]
    """(states, l)"""


class _Goal(NamedTuple):
    """Where a search leads, and what bounds the costs to it."""

    x: float
    y: float
    marks: NDArray[np.float64]
    """(l,) costs from landmarks to it."""
    telling: NDArray[np.int64]
    """(k,) numbers of the landmarks asked."""


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
def _bound_to_goal(graph, goal, state, p, preferred):
    """Lower bound of the cost from ``state`` of point p to the goal: straight, and by the triangle inequality.

    The latter is over landmarks: |cost to goal - cost to state| from the same landmark.
    """
    bound = hypot(graph.points[p].x - goal.x, graph.points[p].y - goal.y) * preferred
    for i in range(goal.telling.size):
        k = goal.telling[i]
        bound = max(bound, abs(graph.marks[state, k] - goal.marks[k]))
    return bound


@helper
def _reach(graph, goal, preferred, states, stamp, s, p, value, before, since, run):
    """Reach state ``s`` of point p at cost ``value``, if that is less than known; whether it is."""
    state = states[s]
    if state.stamp == stamp and state.cost <= value:
        return False
    if state.stamp != stamp:
        state.rest = _bound_to_goal(graph, goal, s, p, preferred)
    state.stamp = stamp
    state.cost = value
    state.before = before
    state.since = since
    state.run = run
    return True


@helper
def _road_to(states, last, behaviors):
    """Points and behaviors (k, 2) of the way to state ``last``, from the start on; no rows for -1."""
    found = 0
    s = last
    while s >= 0:
        found += 1
        s = states[s].before
    road = np.empty((found, 2), np.int64)
    s = last
    while s >= 0:
        found -= 1
        road[found, 0] = s // behaviors
        road[found, 1] = s % behaviors
        s = states[s].before
    return road


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
def find_road(layers, radii, around, prices, graph, states, stamp, ends):
    """Points and behaviors (k, 2) of the cheapest way over the roadmap from ends[0] to ends[1], and its cost.

    around: (nv, n) of `corner_radii`. prices, graph: of :class:`Prices` and :class:`RoadGraph`. states: scratch with
    the ``stamp`` of this search. No rows where there is no way.
    """
    costs, turned, terms, change = prices
    points, spans, ways, marks = graph
    n = costs.size
    preferred = costs[n - 1]
    hints = np.full(len(layers), NONE)
    seen = np.empty(64, ROAD_WAY)
    near = np.empty(64, ROAD_WAY)
    near, goals = see_points(layers, hints, radii, around, points, spans, ends[1, 0], ends[1, 1], near)
    hints[:] = NONE
    seen, starts = see_points(layers, hints, radii, around, points, spans, ends[0, 0], ends[0, 1], seen)
    # The points that the goal is seen from, and how far the goal is from each landmark over them.
    goal = _Goal(
        ends[1, 0], ends[1, 1], np.full(marks.shape[1], math.inf), np.empty(min(TELLING, marks.shape[1]), np.int64)
    )
    to_goal = np.zeros(points.size, np.int32)
    for k in range(goals):
        to_goal[near[k].to] = k + 1
        for i in range(near[k].level + 1):
            for m in range(goal.marks.size):
                goal.marks[m] = min(goal.marks[m], marks[near[k].to * n + i, m] + way_cost(near[k], i, costs))
    choose_landmarks(marks, goal.marks, seen, starts, n, goal.telling)
    # States at the points that the start sees: in the first section, which may be as short as it likes.
    heap = np.empty(256, HEAP_ROW)
    count = np.int64(0)
    for k in range(starts):
        p = np.int64(seen[k].to)
        for i in range(seen[k].level + 1):
            s = p * n + i
            value = way_cost(seen[k], i, costs)
            since = 0.0 if turned[i] else math.inf
            if _reach(graph, goal, preferred, states, stamp, s, p, value, NONE, since, math.inf):
                heap, count = push(heap, count, value + states[s].rest, s)
    best = math.inf
    last = NONE
    while count > 0:
        pop(heap, count)
        count -= 1
        # What is cheapest at its best costs as much as the way found: that is the cheapest.
        if heap[count].key >= best:
            break
        at = heap[count].item
        state = states[at]
        cost = state.cost
        since = state.since
        run = state.run
        if heap[count].key > cost + state.rest + 1e-9:  # reached cheaper since it was pushed
            continue
        p = at // n
        i = at - p * n
        # Straight to the goal.
        if to_goal[p] > 0:
            end = near[to_goal[p] - 1]
            if end.level >= i and cost + way_cost(end, i, costs) < best:
                best = cost + way_cost(end, i, costs)
                last = at
        # A change of behavior at the point, which costs more where the section behind was too short.
        for j in range(points[p].level + 1):
            if j == i or not _may_follow(i, j, turned):
                continue
            paid = 2.0 * (change[i, j] - terms[0] * preferred)
            value = cost + change[i, j] + _too_short(i, j, run, since, costs, turned, terms, paid)
            s = p * n + j
            if _reach(graph, goal, preferred, states, stamp, s, p, value, at, 0.0 if turned[j] else since, 0.0):
                heap, count = push(heap, count, value + states[s].rest, s)
        # Ways to other points with the same behavior.
        end_ways = points[p + 1].begin if p + 1 < points.size else ways.size
        for k in range(points[p].begin, end_ways):
            way = ways[k]
            if way.level < i:
                continue
            value = cost + way_cost(way, i, costs)
            to = np.int64(way.to)
            s = to * n + i
            after = 0.0 if turned[i] else since + way.length
            fresh = _reach(graph, goal, preferred, states, stamp, s, to, value, at, after, run + way.length)
            if fresh and value + states[s].rest < best:
                heap, count = push(heap, count, value + states[s].rest, s)
    return _road_to(states, last, n), best
