"""Find the cheapest taut path along a way over the roadmap, pinned in gates or not, by trying the variants.

Also make any path cheaper where it is narrow, by shifting stations along it repeatedly.
"""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import polyline_length
from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, funnel
from crowdsim.planning.labels.fitting_kernels import annotate
from crowdsim.planning.labels.labelling_kernels import LEAST_SECTION
from crowdsim.planning.roadmap.funnel_kernels import (
    CORNER,
    channel_corners,
    fill_gaps,
    keep_off,
    road_channel,
)
from crowdsim.planning.roadmap.gate_kernels import GATE, find_gates, pinned_path
from crowdsim.planning.roadmap.shifting_kernels import shifted_path

MOST_GATES = 8
"""Largest number of gates of one road that are pinned."""

SPREAD = 0.12
"""Largest shift of stations at first [m]; halved after each attempt that does not pay."""

_LEAST_SPREAD = 0.05
"""Shift below which nothing more is tried [m]."""

_ROUNDS = 4
"""Number of attempts to shift, each from the best path so far."""


@kernel
def polish_road(layers, fitting, points, road, around, reach, ends, radius, least):
    """Find the cheapest taut path along a road; return (points (q, 2), sections (k, 3), cost).

    There are no rows, and the cost is infinite, if the road crosses no chain of triangles, or if all variants tangle or
    fit no behavior.

    The first variant is as wide as the road's behaviors and not pinned, the second is pinned in all gates that fit and
    as wide as possible elsewhere. Each further one differs from the second by one gate, and by those kept before.

    Parameters
    ----------
    layers: (m, 5, 2) of `layers_of`, the legs' first.
    fitting: :class:`crowdsim.planning.labels.fitting_kernels.Fitting`.
    points: (p,) points of the roadmap, records ROAD_POINT of :mod:`crowdsim.planning.roadmap.build_kernels`.
    road: (r, 2) int64, point and behavior, as of `find_road`.
    around: (nv, n) of `corner_radii` [m].
    reach: (nv,) scratch, filled as by `fill_gaps`.
    ends: (2, 2) start and goal [m].
    radius, least: clearance that the path is pulled to on the lowest layer, and that it must keep there [m].
    """
    m = mesh_at(layers[0])
    top = fitting.costs.size - 1
    channel = np.empty(road.shape[0] + 1, np.int64)
    levels = np.empty(road.shape[0] + 1, np.int64)
    corners = np.empty(2 * road.shape[0] + 2, CORNER)
    stack = np.empty(64, SWEPT)
    line = np.empty((0, 2))
    sections = np.empty((0, 3))
    cost = math.inf
    start = triangle_of(m, ends[0, 0], ends[0, 1], NONE)
    goal = triangle_of(m, ends[1, 0], ends[1, 1], NONE)
    # The sides that the road crosses, the vertices beside it, and the gates that the widest behavior does not pass.
    count = road_channel(m, points, road, start, goal, top, channel, levels)
    # The road crosses no chain of triangles.
    if count < 0:
        return line, sections, cost
    filled = channel_corners(m, channel, count, around, radius, ends, corners)
    gates = np.empty(MOST_GATES, GATE)
    found_gates = find_gates(m, channel, levels, count, around, least, gates)
    # The funnel around the corners, each as wide as the behaviors that pass it.
    fill_gaps(m, channel, levels, count, around, corners, filled, radius, reach)
    nodes, size = funnel(m, channel, count, reach, ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])
    taut = np.empty(nodes.size + 4 * found_gates + 64, STRING_NODE)
    narrow = False
    for k in range(count):
        narrow = narrow or levels[k] < top
    pins = 0
    for g in range(found_gates):
        pins += gates[g].fits
    # Variant 0: no pins. 1: pins in all gates that fit. From 2 on: one more gate of the last variant kept is flipped;
    # that is kept if it is not dearer than the cheapest path so far.
    for tried in range(2 + found_gates):
        flip = tried - 2
        if tried == 1:
            # The widest behavior passes everywhere: there are no gates.
            if not narrow:
                break
            for g in range(found_gates):
                gates[g].pinned = gates[g].fits
        elif flip >= 0:
            # A single gate has been tried both ways, and one whose pins do not fit is never pinned.
            if pins < 2 or gates[flip].fits == 0:
                continue
            gates[flip].pinned = 1 - gates[flip].pinned
        if tried == 0:
            for i in range(size):
                taut[i] = nodes[i]
            written = keep_off(taut, size, corners, filled, np.int64(0), count)
        else:
            written = pinned_path(nodes, size, corners, filled, around, gates, found_gates, taut)
        value = math.inf
        if written >= 0:
            # Check and repair the path exactly; label it only if it may be cheaper: no meter costs less than with the
            # widest behavior.
            done, found = pull(m, stack, taut, written, radius, least, start, np.bool_(False))
            if done and polyline_length(found) * fitting.costs[top] < cost:
                labels, value, _ = annotate(fitting, found)
                if value < cost:
                    line, sections, cost = found, labels, value
        # Flip the gate back if that did not pay.
        if flip >= 0 and value > cost:
            gates[flip].pinned = 1 - gates[flip].pinned
    return line, sections, cost


@kernel
def shift_path(layers, fitting, points, sections, cost, radii, least):
    """Shift stations of a path aside where that is cheaper; return (points (q, 2), sections (k, 3), cost).

    Without a cheaper path they are those given.

    Parameters
    ----------
    layers, fitting: as of `polish_road`.
    points, sections, cost: the path (p, 2) [m] as it is, with its sections (k, 3) and cost as of `annotate`.
    radii: (behaviors, m) clearance of each behavior on each of all ``layers`` [m].
    least: clearance that the legs must keep [m].
    """
    stack = np.empty(64, SWEPT)
    hints = np.full(len(layers), NONE)
    spread = SPREAD
    for _ in range(_ROUNDS):
        if spread < _LEAST_SPREAD:
            break
        found = shifted_path(
            layers, hints, radii, fitting.costs, points, sections, fitting.terms[LEAST_SECTION], spread, stack, least
        )
        value = math.inf
        if found.shape[0] > 0:
            labels, value, _ = annotate(fitting, found)
        # Go on from the better path, or try shifts half as wide.
        if value < cost:
            points, sections, cost = found, labels, value
        else:
            spread *= 0.5
    return points, sections, cost
