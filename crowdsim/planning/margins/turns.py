"""Room for hands that swing out while a body turns: the middle of a turn needs more clearance than walking ahead."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

import numpy as np

from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.margins.turn_kernels import bend_turns
from crowdsim.planning.query.query import Query, as_sections


def with_turn_room(query: Query, path: AnnotatedPath) -> AnnotatedPath:
    """Return the route led away from obstacles where a turning body reaches beyond its planned clearance.

    A behavior is turned if its body faces away from its direction of motion, as in walking sideways. Around each change
    between a turned behavior and another one the body turns on a stretch of the path. On the middle half of that
    stretch, as far as the behavior there is not turned, it needs the radii ``need.turning`` [m]. The path stays as
    it is where there is no room.
    """
    need = query.need
    turned = need.turned.tolist()
    # No change between the two kinds: nobody turns.
    if len({turned[section.behavior] for section in path.sections}) < 2:
        return path
    layers = layers_of(query.meshes)
    # Rows of start and end [m] and behavior.
    given = np.fromiter(chain.from_iterable(path.sections), np.float64).reshape(-1, 3)
    radii, turning, costs = need.radii, need.turning, need.costs
    points, arc, sections, cost = bend_turns(
        layers, path.points, path.arc, given, path.cost, radii, turning, costs, need.turned
    )
    # Without points nothing was bent.
    return replace(path, points=points, arc=arc, sections=as_sections(sections), cost=cost) if len(points) else path
