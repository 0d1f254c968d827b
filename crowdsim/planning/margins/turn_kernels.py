"""Bend a path at its turns, where a turning body reaches farther than the path's clearance.

``points`` (p, 2) is the path and ``arc`` (p,) its arc length [m]; ``layers`` (m, 5, 2) are the mesh addresses of
`layers_of`; ``radii`` (n, m) are the clearances of n behaviors, the widest last, and ``turning`` (n, 2, m) those of
turns into and out of them [m].
"""

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
"""Distance between the stations of a turn [m]."""

WORTH = 0.005
"""Largest share of the path's cost that the room for one turn may add."""

PROBE = 0.03
"""Distance to either side at which clearance is probed for the better side [m]."""

CHORD = 0.002
"""Spare clearance of moved stations for the straight pieces between them [m]."""

SPARED = 0.004
"""Shortfall of a turn's reach that is not worth a bend [m]."""

INNER = int(0.25 * TURN_ROOM / STATION) + 1
"""Stations on each side of a turn's middle that may move. They cover the middle half of TURN_ROOM."""

RAMP = 2
"""Steps of a station's length from the outermost station that may move to the end of the bend, where it rejoins the
path."""

_ENDS = INNER + RAMP
"""Station number, counted from the middle, of both ends of the bend."""
_PLACES = 2 * INNER + 3
"""Places of a bend: the middle, INNER on each side and one next to these at each end."""


@helper
def _place_stations(points, arc, middle, places):
    """Fill ``places`` (s, 2) with the stations of the path around the middle of a turn, at arc length ``middle``.

    The first and the last are where the bend leaves and rejoins the path; they stay.
    """
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
def _lacking(layers, radii, turning, label, walking, back, x, y):
    """Return the clearance that (x, y) lacks for a turn of behavior ``label``, less SPARED [m].

    It is negative if there is more than needed, and at least -PROBE. Only layers count in which the turn reaches beyond
    the clearance of ``walking``, the behavior in which a body walks while it turns. ``back`` is 0 for the turn into the
    behavior, 1 for the turn out of it.
    """
    lack = -PROBE
    for i in range(len(layers)):
        reach = turning[label, back, i] - SPARED
        if reach > radii[walking, i]:
            # The distance is -1 outside of free space, which counts as 0.
            distance, _ = disc_clearance(mesh_at(layers[i]), x, y, reach + PROBE, np.int64(NONE))
            lack = max(lack, reach - max(distance, 0.0))
    return lack


@helper
def _lead_aside(layers, radii, turning, label, walking, back, places):
    """Move ``places`` (s, 2) [m] aside by the clearance that they lack for the turn; return True if any lacked it.

    The moved places may still lack some clearance. The first and the last place stay. The other parameters are those of
    :func:`_lacking`.
    """
    bends = False
    x = places[0, 0]
    y = places[0, 1]
    for i in range(1, _PLACES - 1):
        # (ax, ay): PROBE to the left of the path, between the place before, as it was, and the place after.
        ax = y - places[i + 1, 1]
        ay = places[i + 1, 0] - x
        size = hypot(ax, ay)
        ax *= PROBE / size if size > 0.0 else 0.0
        ay *= PROBE / size if size > 0.0 else 0.0
        x = places[i, 0]
        y = places[i, 1]
        lack = _lacking(layers, radii, turning, label, walking, back, x, y)
        if lack <= 0.0:
            continue
        bends = True
        # Move to the side that lacks less, by what is missing here.
        left = _lacking(layers, radii, turning, label, walking, back, x + ax, y + ay)
        right = _lacking(layers, radii, turning, label, walking, back, x - ax, y - ay)
        aside = (lack + CHORD if left <= right else -lack - CHORD) / PROBE
        places[i, 0] += aside * ax
        places[i, 1] += aside * ay
    return bends


@kernel
def bend_turns(layers, points, arc, sections, cost, radii, turning, costs, turned):
    """Bend a path to give each turn its room; return (points (q, 2), arc (q,), sections (k, 3), cost).

    Parameters
    ----------
    layers: all meshes, as of `layers_of`.
    points, arc, sections, cost: the path as it is.
    radii, turning, costs, turned: as of :class:`crowdsim.planning.query.requirements.Requirements`.

    Returns
    -------
    The bent path, whose sections behind a bend begin and end later; no points (0, 2) if nothing is bent, and the rest
    as given.
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
        # The body turns where a section that faces ahead meets a turned one (label). back = 0: into it, back = 1: out
        # of it. It turns while walking in the section that faces ahead (index whole, behavior walking).
        back = 1 if turned[one] else 0
        label = one if back == 1 else other
        whole = k + back
        walking = int(sections[whole, 0])
        # Skip a turn that reaches no farther than the plan, or whose bend does not fit in its section or overlaps the
        # bend before.
        reaches = False
        for i in range(len(layers)):
            reaches = reaches or turning[label, back, i] - SPARED > radii[walking, i]
        middle = sections[k, 2] + (0.5 if back == 1 else -0.5) * TURN_ROOM
        first = middle - STATION * _ENDS
        last = middle + STATION * _ENDS
        if not reaches or first <= max(sections[whole, 1], end) or last >= sections[whole, 2]:
            continue
        _place_stations(points, arc, middle, places)
        if not _lead_aside(layers, radii, turning, label, walking, back, places):
            continue
        # Keep the bend only if it is free and costs little more.
        more = first - last
        for i in range(_PLACES - 1):
            more += hypot(places[i + 1, 0] - places[i, 0], places[i + 1, 1] - places[i, 1])
            for c in range(4):
                pieces[i, c] = places[i + c // 2, c % 2]
        for i in range(len(layers)):
            least[i] = radii[walking, i] - CONTACT_TOLERANCE
        if more * costs[walking] > WORTH * cost or not are_free(layers, least, pieces):
            continue
        # Copy the path up to the turn, then the bend, whose extra length shifts all sections behind it.
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
    # No bends: the caller keeps its path.
    if filled == 0:
        return line[:0], arc, sections, cost
    for i in range(kept, points.shape[0]):
        line[filled, 0] = points[i, 0]
        line[filled, 1] = points[i, 1]
        filled += 1
    # Arc lengths anew; each section costs more by what it became longer.
    lengths = np.empty(filled)
    lengths[0] = 0.0
    for i in range(1, filled):
        lengths[i] = lengths[i - 1] + hypot(line[i, 0] - line[i - 1, 0], line[i, 1] - line[i - 1, 1])
    bent[count - 1, 2] = lengths[filled - 1]
    for k in range(count):
        cost += costs[int(sections[k, 0])] * ((bent[k, 2] - bent[k, 1]) - (sections[k, 2] - sections[k, 1]))
    return line[:filled], lengths, bent, cost
