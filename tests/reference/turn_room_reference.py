"""Slow, obvious twin of the kernel that leads paths aside at turns of bodies: one turn after another, in numpy."""

from dataclasses import replace

import numpy as np

from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.labels.labelling_kernels import TURN_ROOM
from crowdsim.planning.margins.turn_kernels import CHORD, INNER, PROBE, RAMP, SPARED, STATION, WORTH
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

WINDOW = STATION * np.array([-INNER - RAMP, *range(-INNER, INNER + 1), INNER + RAMP], dtype=np.float64)
"""Arc lengths of the stations around the middle of a turn [m]; the first and the last stay on the path."""


def with_turn_room(query: Query, path: AnnotatedPath) -> AnnotatedPath:
    """Return the same as :func:`crowdsim.planning.margins.turns.with_turn_room`."""
    need = query.need
    bends = []
    end = 0.0
    for one, other in zip(path.sections[:-1], path.sections[1:], strict=True):
        if need.turned[one.behavior] == need.turned[other.behavior]:
            continue
        back = bool(need.turned[one.behavior])
        whole = other if back else one
        reach = need.turning[one.behavior if back else other.behavior, int(back)] - SPARED
        if (reach <= need.radii[whole.behavior]).all():
            continue
        arc = WINDOW + (one.end + (0.5 if back else -0.5) * TURN_ROOM)
        if arc[0] > max(whole.start, end) and arc[-1] < whole.end:
            bend = _roomier(query, path, arc, reach, whole.behavior)
            if bend is not None:
                bends.append((arc, *bend))
                end = arc[-1]
    return _bent(path, bends, need.costs) if bends else path


def _bent(path, bends, costs) -> AnnotatedPath:
    """Return the path with the stations at arc lengths (s,) replaced by the places (s, 2) of ``bends``."""
    pieces, kept = [], 0
    for arc, places, _ in bends:
        first, last = np.searchsorted(path.arc, arc[[0, -1]], side="right").tolist()
        pieces += [path.points[kept:first], places]
        kept = last
    points = np.concatenate([*pieces, path.points[kept:]])
    arc = arc_lengths(points)

    def moved(at: float) -> float:
        return at + sum(more for where, _, more in bends if where[-1] <= at)

    sections = [Section(label, moved(start), moved(end)) for label, start, end in path.sections]
    sections[-1] = sections[-1]._replace(end=float(arc[-1]))
    more = [(s.end - s.start) - (old.end - old.start) for s, old in zip(sections, path.sections, strict=True)]
    cost = path.cost + sum(costs[s.behavior] * longer for s, longer in zip(sections, more, strict=True))
    return replace(path, points=points, arc=arc, sections=tuple(sections), cost=float(cost))


def _roomier(query, path, arc, reach, behavior):
    """Return places (s, 2) beside the stations that have ``reach`` (m,) of clearance, and the extra length [m].

    None if the stations have it already, or the path cannot lead there with ``behavior``.
    """
    places = path.at(arc)
    inner = places[1:-1]
    chords = places[2:] - places[:-2]
    across = np.stack([-chords[:, 1], chords[:, 0]], axis=1)
    across /= np.maximum(np.hypot(*across.T), 1e-300)[:, None]
    lack, left, right = (_lacking(query, inner + aside * across, reach, behavior) for aside in (0.0, PROBE, -PROBE))
    if lack.max() <= 0.0:
        return None
    aside = np.where(lack > 0.0, lack + CHORD, 0.0)
    inner += np.where(left <= right, aside, -aside)[:, None] * across
    more = float(np.hypot(*(places[1:] - places[:-1]).T).sum() - (arc[-1] - arc[0]))
    if more * query.need.costs[behavior] > WORTH * path.cost:
        return None
    layers = layers_of(query.meshes)
    pieces = np.concatenate([places[:-1], places[1:]], axis=1)
    return (places, more) if are_free(layers, query.need.radii[behavior] - CONTACT_TOLERANCE, pieces) else None


def _lacking(query, places, reach, behavior):
    """Return how much clearance (n,) ``places`` (n, 2) lack of ``reach`` (m,) over all layers [m]; at most 0 for none.

    Layers in which ``reach`` is no more than the planned radius of ``behavior`` do not count.
    """
    lacking = np.full(len(places), -PROBE)
    for mesh, radius, planned in zip(query.meshes, reach.tolist(), query.need.radii[behavior].tolist(), strict=True):
        if radius > planned:
            lacking = np.maximum(lacking, radius - mesh.clearances(places, radius + PROBE))
    return lacking
