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
    """Return the path, bent away from obstacles at turns of the body that reach beyond the planned clearance.

    A behavior is turned if the body faces away from its direction of motion, for example when it walks sideways. Before
    a section of a turned behavior the body turns into it, behind that section it turns out of it. Both happen on
    TURN_ROOM meters of the section that is not turned; the middle half of these may be bent. A turn keeps its path if
    the bend is not free, does not fit in its section, or costs too much (see
    :func:`crowdsim.planning.margins.turn_kernels.bend_turns`).

    Parameters
    ----------
    query: meshes of the layers, and ``need``, from which clearances, reach of turns and costs are taken.
    path: path with sections.

    Returns
    -------
    The bent path with its arc lengths, sections and cost; ``path`` itself if no turn is bent.
    """
    need = query.need
    turned = need.turned.tolist()
    # A body that is turned all along, or nowhere, does not turn.
    if len({turned[section.behavior] for section in path.sections}) < 2:
        return path
    layers = layers_of(query.meshes)
    # Sections as rows (k, 3): behavior, start and end [m].
    given = np.fromiter(chain.from_iterable(path.sections), np.float64).reshape(-1, 3)
    radii, turning, costs = need.radii, need.turning, need.costs
    points, arc, sections, cost = bend_turns(
        layers, path.points, path.arc, given, path.cost, radii, turning, costs, need.turned
    )
    # Without a bend there are no points.
    return replace(path, points=points, arc=arc, sections=as_sections(sections), cost=cost) if len(points) else path
