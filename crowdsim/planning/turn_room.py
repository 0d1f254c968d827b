"""Room for hands that swing out while a body turns: the middle of a turn asks for more than walking ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.planning.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.behaviors import Behavior
from crowdsim.planning.labelling_kernels import TURN_ROOM
from crowdsim.planning.query import Query
from crowdsim.planning.requirements import TOUCH
from crowdsim.planning.string_kernels import are_free

Floats = NDArray[np.float64]

STATION = 0.06
"""Meters between the places of a turn that are looked at."""

WORTH = 0.005
"""Share of the cost that the room for a turn may take."""

_PROBE = 0.03
"""Meters to the sides where it is looked for more room."""

_CHORD = 0.002
"""Meters of clearance beyond what is needed, for the straight pieces between stations."""

SPARED = 0.004
"""Meters that a turn may lack of what it reaches: less is not worth a bend."""

_INNER = int(0.25 * TURN_ROOM / STATION) + 1
_RAMP = 2
_STEPS = [-_INNER - _RAMP, *range(-_INNER, _INNER + 1), _INNER + _RAMP]
_WINDOW: Floats = STATION * np.array(_STEPS, dtype=np.float64)
"""Arc lengths of the places about the middle of a turn; the first and the last stay on the path."""


def with_turn_room(query: Query, path: AnnotatedPath, behaviors: Sequence[Behavior]) -> AnnotatedPath:
    """The same way, farther from obstacles where a body reaches beyond its planned clearance while it turns.

    That is the middle half of the room for a turn, in the section of the behavior that is not turned. Where the path
    cannot lead aside it stays as it is.
    """
    turned = query.need.turned.tolist()
    bends: list[tuple[Floats, Floats, float]] = []
    end = 0.0
    for one, other in zip(path.sections[:-1], path.sections[1:], strict=True):
        if turned[one.behavior] == turned[other.behavior]:
            continue
        back = turned[one.behavior]
        whole = other if back else one
        turning = behaviors[one.behavior if back else other.behavior].turning
        if turning is None:
            continue
        reach = turning[int(back)] - SPARED
        if (reach <= query.need.radii[whole.behavior]).all():
            continue
        arc = _WINDOW + (one.end + (0.5 if back else -0.5) * TURN_ROOM)
        if arc[0] > max(whole.start, end) and arc[-1] < whole.end:
            bend = _roomier(query, path, arc, reach, whole.behavior)
            if bend is not None:
                bends.append((arc, *bend))
                end = arc[-1]
    return _bent(path, bends, query.need.costs) if bends else path


def _bent(path: AnnotatedPath, bends: Sequence[tuple[Floats, Floats, float]], costs: Floats) -> AnnotatedPath:
    """The path through the places (s, 2) of ``bends`` instead of those at arc lengths (s,), each so much longer."""
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


def _roomier(
    query: Query, path: AnnotatedPath, arc: Floats, reach: Floats, behavior: int
) -> tuple[Floats, float] | None:
    """Places (s, 2) beside those at arc lengths ``arc`` (s,) with ``reach`` (m,) meters of clearance, and the meters
    by which the path through them is longer; None where it has them, or cannot lead there with ``behavior``."""
    places = path.at(arc)
    inner = places[1:-1]
    chords = places[2:] - places[:-2]
    across = np.stack([-chords[:, 1], chords[:, 0]], axis=1) / np.hypot(chords[:, 0], chords[:, 1])[:, None]
    lack, left, right = _lacking(
        query, np.concatenate([inner, inner + _PROBE * across, inner - _PROBE * across]), reach
    )
    if lack.max() <= 0.0:
        return None
    aside = np.where(lack > 0.0, lack + _CHORD, 0.0)
    inner += np.where(left <= right, aside, -aside)[:, None] * across
    steps = places[1:] - places[:-1]
    more = float(np.hypot(steps[:, 0], steps[:, 1]).sum() - (arc[-1] - arc[0]))
    if more * query.need.costs[behavior] > WORTH * path.cost:
        return None
    layers = tuple([mesh.arrays for mesh in query.meshes])
    pieces = np.concatenate([places[:-1], places[1:]], axis=1)
    return (places, more) if are_free(layers, query.need.radii[behavior] - TOUCH, pieces) else None


def _lacking(query: Query, places: Floats, reach: Floats) -> Floats:
    """(3, n) meters that ``places`` (3 n, 2) lack of the clearance ``reach`` (m,) in all layers; at most 0 for none.

    Layers where that is no more than planned do not count.
    """
    lacking = np.full(len(places), -_PROBE)
    for mesh, radius, planned in zip(query.meshes, reach.tolist(), query.need.radii[-1].tolist(), strict=True):
        if radius > planned:
            np.maximum(lacking, radius - mesh.clearances(places, radius + _PROBE), out=lacking)
    return lacking.reshape(3, -1)
