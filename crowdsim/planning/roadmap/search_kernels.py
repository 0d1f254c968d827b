"""A* over the states (point of the roadmap, behavior), with landmarks for the bound.

Arguments of all helpers: ``graph`` (RoadGraph); ``goal`` (_Goal); n ``behaviors``, i and j among them, with ``costs``
(n,) of a meter and ``turned`` (n,), True for those that face away from the direction of motion; ``preferred``, the cost
of a meter with the widest one; p, the index of a point.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.planning.labels.labelling_kernels import CHANGE_COST, FOR_BETWEEN, FOR_TURN, LEAST_SECTION
from crowdsim.planning.roadmap.build_kernels import ROAD_WAY, see_points

STATE = np.dtype(
    [("cost", np.float64), ("since", np.float64), ("run", np.float64), ("rest", np.float64)]
    + [("before", np.int64), ("stamp", np.int64)],
    align=True,
)
"""The cheapest way known to a state; valid in the search whose number is ``stamp``.

cost: up to this state. since: meters walked since the last turned section, 0 in one, infinite if there was none. run:
meters walked in the present section, infinite in the first. rest: about the least cost still to pay, see
`_bound_to_goal`. before: previous state, -1 for the start.
"""


TELLING = 8
"""Landmarks that one search uses: those that give the largest bounds from its start to its goal."""


class Prices(NamedTuple):
    """Costs of walking and of changes of behavior, for n behaviors."""

    costs: NDArray[np.float64]
    """(n,) cost per meter."""
    turned: NDArray[np.bool_]
    """(n,) True if the body faces away from its direction of motion."""
    terms: NDArray[np.float64]
    """(4,) as :data:`crowdsim.planning.labels.labelling_kernels.TERMS`."""
    change: NDArray[np.float64]
    """(n, n) cost of a change from one behavior to another, with a part of the least length of a section."""


class RoadGraph(NamedTuple):
    """Points of a roadmap, the ways between them, and the costs from landmarks.

    State s is behavior s % n at point s // n, for n behaviors.
    """

    points: NDArray[Any]
    """(p,) of :data:`crowdsim.planning.roadmap.build_kernels.ROAD_POINT`."""
    spans: NDArray[Any]
    """(half-edges,) of :data:`crowdsim.planning.roadmap.build_kernels.SPAN_OF`."""
    ways: NDArray[Any]
    """(w,) of :data:`crowdsim.planning.roadmap.build_kernels.ROAD_WAY`."""
    marks: NDArray[np.float32]
    """(states, l) cost between each state and each of l landmarks."""


class _Goal(NamedTuple):
    """Goal of a search, with the data for bounds of the cost to it."""

    x: float
    y: float
    marks: NDArray[np.float64]
    """(l,) cost between the goal and each landmark."""
    telling: NDArray[np.int64]
    """(k,) indices of the landmarks in use."""


@helper
def way_cost(way, i, costs):
    """Return the cost of a way in a section of behavior i: tight meters cost costs[i], others the preferred cost."""
    preferred = costs[costs.size - 1]
    return preferred * way.length + (costs[i] - preferred) * way.tight


@helper
def _may_follow(i, j, turned):
    """Return True if behavior j may follow behavior i: a body turns only next to the preferred behavior."""
    return turned[i] == turned[j] or max(i, j) == turned.size - 1


@helper
def _too_short(i, j, run, since, costs, turned, terms, paid):
    """Estimate the extra cost of a section of behavior i that is ``run`` meters long, followed by one of j.

    It is 0 if the section is long enough. since: meters since the last turned section, as of :data:`STATE`. paid: what
    the changes into and out of the section have already charged for its least length. terms: (4,), see
    :data:`crowdsim.planning.labels.labelling_kernels.TERMS`.
    """
    # A narrow section before a wider one is lengthened at the expense of the wider one.
    if costs[i] > costs[j]:
        return max(0.0, (costs[i] - costs[j]) * (terms[LEAST_SECTION] - run) - paid)
    # A wide section needs room for the turn at either end. since == run: a turned section is right before this one, or
    # this is the first section, which is never too short, as both are infinite.
    needed = terms[LEAST_SECTION]
    if turned[j]:
        needed = terms[FOR_BETWEEN] if since == run else terms[LEAST_SECTION] + terms[FOR_TURN]
    elif since == run:
        needed = terms[LEAST_SECTION] + terms[FOR_TURN]
    if run >= needed:
        return 0.0
    # Too short: it is given to the narrower of its neighbors, which saves two changes. It is not known which behavior
    # was before it: the dearest turned one stands for any turned one, and one that is not turned does not count.
    narrow = costs[j]
    for k in range(costs.size):
        if turned[k] and since == run:
            narrow = max(narrow, costs[k])
    return max(0.0, (narrow - costs[i]) * run - 2.0 * terms[CHANGE_COST] * costs[costs.size - 1])


@helper
def _bound_to_goal(graph, goal, state, p, preferred):
    """Return a bound of the cost from ``state`` of point p to the goal, for the order of the search.

    It is the straight distance times the preferred behavior's cost or, if larger, |cost to goal - cost to state| from
    any landmark in use (triangle inequality). The second bound may be too high by the cost of changes of behavior: a
    landmark's cost to the goal is the least over all behaviors there, but the way from ``state`` may arrive with
    another one.
    """
    bound = hypot(graph.points[p].x - goal.x, graph.points[p].y - goal.y) * preferred
    for i in range(goal.telling.size):
        k = goal.telling[i]
        bound = max(bound, abs(graph.marks[state, k] - goal.marks[k]))
    return bound


@helper
def _reach(graph, goal, preferred, states, stamp, s, p, value, before, since, run):
    """Record that state ``s`` of point p is reached at cost ``value``, if it is cheaper than before; return True if so.

    ``states`` are records :data:`STATE`, whose fields before, since and run are set to these arguments. ``stamp`` is
    the number of the search: states with other stamps are left over from earlier searches.
    """
    state = states[s]
    if state.stamp == stamp and state.cost <= value:
        return False
    # First visit in this search: the bound is computed once for each state.
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
    """Return rows (point, behavior), (k, 2) int64, from the start to state ``last``; no rows if it is -1.

    states: records :data:`STATE`. behaviors: the number of behaviors.
    """
    # Count the states, then fill them in from the end.
    found = 0
    s = last
    while s >= 0:
        found += 1
        # A chain longer than the list of states runs in a circle.
        if found > states.size:
            raise BoundExceeded
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
    """Fill ``telling`` with the landmarks that bound the cost from the start to the goal best (ALT).

    By the triangle inequality, a way from state to goal costs at least the difference of their costs from a landmark,
    but for changes of behavior (see `_bound_to_goal`); the bounds are summed over the points that the start sees,
    ``seen[:starts]``, each with its widest behavior.

    marks: (states, l) cost between each state and each landmark. of_goal: (l,) cost between the goal and each landmark.
    seen: records :data:`crowdsim.planning.roadmap.build_kernels.ROAD_WAY`, the first ``starts`` in use. behaviors: the
    number of behaviors. telling: (k,) int64, k at most l, filled with landmarks, the best one first.
    """
    bounds = np.zeros(of_goal.size)
    for k in range(of_goal.size):
        for i in range(starts):
            state = np.int64(seen[i].to) * behaviors + seen[i].level
            bounds[k] += abs(marks[state, k] - of_goal[k])
    # Take the largest sum, and mark it as taken, as bounds are never negative.
    for i in range(telling.size):
        best = 0
        for k in range(bounds.size):
            if bounds[k] > bounds[best]:
                best = k
        telling[i] = best
        bounds[best] = -1.0


@kernel
def costs_from(points, ways, costs, turned, change, source, heap, out):
    """Fill ``out`` (states,) with the least cost from any state of point ``source`` (Dijkstra); return the heap.

    States that cannot be reached cost infinity. points, ways, costs, turned, change: as of :class:`RoadGraph` and
    :class:`Prices`. heap: scratch, HEAP_ROW of :mod:`crowdsim.navmesh.mesh.heap_kernels`, which may grow.
    Sections that are too short cost nothing extra here, so that the costs bound those of a search from below.
    """
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
        # Pushed before a cheaper way was found.
        if cost > out[state]:
            continue
        p = state // n
        i = state - p * n
        # Changes of behavior at the point, then ways to other points.
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
    """Find about the cheapest way over the roadmap from ends[0] to ends[1]; return (road (k, 2), cost).

    Parameters
    ----------
    layers, radii: (m, 5, 2) of `layers_of`; (n, m) clearances [m].
    around: (nv, n) of `corner_radii` [m].
    prices, graph: :class:`Prices`, :class:`RoadGraph`.
    states: (states,) of :data:`STATE`, scratch kept from search to search.
    stamp: number of this search, unused before with these ``states``.
    ends: (2, 2) start and goal [m].

    Returns
    -------
    Rows (point, behavior), int64, and the cost. No rows and infinite cost if there is no way. The cost is an estimate:
    sections that are too short, but for the first and the last, pay about what the exact labels would cost.
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
    # Points that see the goal (``to_goal``: 1 + the row in ``near``, 0 for none), and the goal's cost from each
    # landmark: the least over these points.
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
    # Start states: all behaviors at the points that the start sees, in a first section that may have any length.
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
        # The heap's least bound is no less than the cost of the way found: that way counts as the cheapest.
        if heap[count].key >= best:
            break
        at = heap[count].item
        state = states[at]
        cost = state.cost
        since = state.since
        run = state.run
        if heap[count].key > cost + state.rest + 1e-9:  # outdated: reached at a lower cost since
            continue
        p = at // n
        i = at - p * n
        # Complete the way if this point sees the goal.
        if to_goal[p] > 0:
            end = near[to_goal[p] - 1]
            if end.level >= i and cost + way_cost(end, i, costs) < best:
                best = cost + way_cost(end, i, costs)
                last = at
        # Change the behavior at the point; a section that was too short costs extra. ``change`` holds more than the
        # cost of a change: a part of the least length, which counts for both ends of the section (``paid``).
        for j in range(points[p].level + 1):
            if j == i or not _may_follow(i, j, turned):
                continue
            paid = 2.0 * (change[i, j] - terms[CHANGE_COST] * preferred)
            value = cost + change[i, j] + _too_short(i, j, run, since, costs, turned, terms, paid)
            s = p * n + j
            if _reach(graph, goal, preferred, states, stamp, s, p, value, at, 0.0 if turned[j] else since, 0.0):
                heap, count = push(heap, count, value + states[s].rest, s)
        # Walk on to other points with the same behavior.
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
            # A state whose bound is no less than the cost of the way found cannot improve on it.
            if fresh and value + states[s].rest < best:
                heap, count = push(heap, count, value + states[s].rest, s)
    return _road_to(states, last, n), best
