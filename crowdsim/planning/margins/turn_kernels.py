"""The middle of each turn of a path led aside by what it lacks of what a body reaches while it turns."""

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.planning.labels.labelling_kernels import TURN_ROOM
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

STATION = 0.06
"""Meters between the places of a turn that are looked at."""

WORTH = 0.005
"""Share of the cost that the room for a turn may take."""

PROBE = 0.03
"""Meters to the sides where it is looked for more room."""

CHORD = 0.002
"""Meters of clearance beyond what is needed, for the straight pieces between stations."""

SPARED = 0.004
"""Meters that a turn may lack of what it reaches: less is not worth a bend."""

INNER = int(0.25 * TURN_ROOM / STATION) + 1
"""Places on both sides of the middle of a turn that may be led aside."""

RAMP = 2
"""Stations from the last of these to the place where the path is as it was."""

_ENDS = INNER + RAMP
_PLACES = 2 * INNER + 3


@helper
def _place_stations(points, arc, middle, places):
    """Fill ``places`` (s, 2) of the path about the middle of a turn, an arc length; the first and the last stay."""
    piece = np.int64(0)
    for i in range(_PLACES):
        step = i - INNER - 1
        if i == 0:
            step = -_ENDS
        elif i == _PLACES - 1:
            step = _ENDS
        at = middle + STATION * step
        while piece < points.shape[0] - 2 and arc[piece + 1] <= at:
            piece += 1
        size = arc[piece + 1] - arc[piece]
        share = min((at - arc[piece]) / size, 1.0) if size > 0.0 else 0.0
        for c in range(2):
            places[i, c] = points[piece, c] + share * (points[piece + 1, c] - points[piece, c])


@helper
def _lacking(layers, radii, turning, label, back, x, y):
    """Meters that (x, y) lacks of what the turn reaches, in layers where that is beyond the plan; at least -PROBE."""
    top = radii.shape[0] - 1
    lack = -PROBE
    for i in range(len(layers)):
        reach = turning[label, back, i] - SPARED
        if reach > radii[top, i]:
            distance, _ = disc_clearance(mesh_at(layers[i]), x, y, reach + PROBE, np.int64(NONE))
            lack = max(lack, reach - max(distance, 0.0))
    return lack


@helper
def _lead_aside(layers, radii, turning, label, back, places):
    """Move ``places`` (s, 2) to where they have the clearance of the turn; whether any lacks of it."""
    bends = False
    x = places[0, 0]
    y = places[0, 1]
    for i in range(1, _PLACES - 1):
        # To the left of the path, of which the places before may have moved.
        ax = y - places[i + 1, 1]
        ay = places[i + 1, 0] - x
        size = hypot(ax, ay)
        ax *= PROBE / size if size > 0.0 else 0.0
        ay *= PROBE / size if size > 0.0 else 0.0
        x = places[i, 0]
        y = places[i, 1]
        lack = _lacking(layers, radii, turning, label, back, x, y)
        if lack <= 0.0:
            continue
        bends = True
        left = _lacking(layers, radii, turning, label, back, x + ax, y + ay)
        right = _lacking(layers, radii, turning, label, back, x - ax, y - ay)
        aside = (lack + CHORD if left <= right else -lack - CHORD) / PROBE
        places[i, 0] += aside * ax
        places[i, 1] += aside * ay
    return bends


@kernel
def bend_turns(layers, points, arc, sections, cost, radii, turning, costs, turned):
    """The path with room to turn: its polyline (n, 2), arc lengths (n,), sections (k, 3) and cost.

    No points where nothing bends. layers: all meshes, as of `layers_of`. points, arc, sections, cost: the path as it
    is. Others: as of :class:`crowdsim.planning.query.requirements.Requirements`.
    """
    count = sections.shape[0]
    least = np.empty(len(layers))
    pieces = np.empty((_PLACES - 1, 4))
    places = np.empty((_PLACES, 2))
    line = np.empty((points.shape[0] + _PLACES * count, 2))
    bent = np.empty((count, 3))
    for k in range(count):
        for c in range(3):
            bent[k, c] = sections[k, c]
    filled = 0
    kept = 0
    end = 0.0
    for k in range(count - 1):
        one = int(sections[k, 0])
        other = int(sections[k + 1, 0])
        if turned[one] == turned[other]:
            continue
        # Off the way into a turned section (back = 0), or back from one: the turn is walked in the section that is not.
        back = 1 if turned[one] else 0
        label = one if back == 1 else other
        whole = k + back
        walking = int(sections[whole, 0])
        # Nothing to do where the turn reaches no farther than what is planned, or has no room within its section.
        reaches = False
        for i in range(len(layers)):
            reaches = reaches or turning[label, back, i] - SPARED > radii[walking, i]
        middle = sections[k, 2] + (0.5 if back == 1 else -0.5) * TURN_ROOM
        first = middle - STATION * _ENDS
        last = middle + STATION * _ENDS
        if not reaches or first <= max(sections[whole, 1], end) or last >= sections[whole, 2]:
            continue
        _place_stations(points, arc, middle, places)
        if not _lead_aside(layers, radii, turning, label, back, places):
            continue
        # The bent part must be free and cost little more.
        more = first - last
        for i in range(_PLACES - 1):
            more += hypot(places[i + 1, 0] - places[i, 0], places[i + 1, 1] - places[i, 1])
            for c in range(4):
                pieces[i, c] = places[i + c // 2, c % 2]
        for i in range(len(layers)):
            least[i] = radii[walking, i] - CONTACT_TOLERANCE
        if more * costs[walking] > WORTH * cost or not are_free(layers, least, pieces):
            continue
        # The path up to the turn as it is, then the bent part, whose length moves all that comes after.
        while kept < arc.size and arc[kept] <= first:
            line[filled, 0] = points[kept, 0]
            line[filled, 1] = points[kept, 1]
            filled += 1
            kept += 1
        for i in range(_PLACES):
            line[filled, 0] = places[i, 0]
            line[filled, 1] = places[i, 1]
            filled += 1
        while kept < arc.size and arc[kept] <= last:
            kept += 1
        bent[whole, 2] += more
        for later in range(whole + 1, count):
            bent[later, 1] += more
            bent[later, 2] += more
        end = last
    if filled == 0:
        return line[:0], arc, sections, cost
    for i in range(kept, points.shape[0]):
        line[filled, 0] = points[i, 0]
        line[filled, 1] = points[i, 1]
        filled += 1
    lengths = np.empty(filled)
    lengths[0] = 0.0
    for i in range(1, filled):
        lengths[i] = lengths[i - 1] + hypot(line[i, 0] - line[i - 1, 0], line[i, 1] - line[i - 1, 1])
    bent[count - 1, 2] = lengths[filled - 1]
    for k in range(count):
        cost += costs[int(sections[k, 0])] * ((bent[k, 2] - bent[k, 1]) - (sections[k, 2] - sections[k, 1]))
    return line[:filled], lengths, bent, cost
