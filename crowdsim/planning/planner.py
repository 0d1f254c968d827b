"""Layered behavioral planner: where to walk, and with which behavior (2018 paper, section 3.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import BehaviorError, PathNotFound
from crowdsim.planning.baselines.collision3d import Bodies, plan_collision3d
from crowdsim.planning.baselines.greedy import plan_greedy
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.labels.labelling_kernels import TERMS
from crowdsim.planning.layered import plan_layered
from crowdsim.planning.margins.slack import with_slack
from crowdsim.planning.margins.turns import with_turn_room
from crowdsim.planning.query.behavior_areas import make_rooms
from crowdsim.planning.query.clear_ends import clear_ends, joined_to
from crowdsim.planning.query.diagnosis import why_not
from crowdsim.planning.query.lower_bound import lower_bound
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import Requirements

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

PLANNERS: dict[str, Callable[..., AnnotatedPath | None]] = {
    "layered": plan_layered,
    "greedy": partial(plan_greedy, keep_blockers=True),
    "greedy_literal": partial(plan_greedy, keep_blockers=False),
    "collision3d": plan_collision3d,
}
"""Name -> what plans: a path without slack, or None where there is none."""


def plan_path(
    meshes: Sequence[NavMesh],
    behaviors: Sequence[Behavior],
    start: ArrayLike,
    goal: ArrayLike,
    *,
    margin: float = TRACKING_MARGIN,
    rooms: Sequence[NavMesh | None] | None = None,
    planner: str = "layered",
    bodies: Bodies | None = None,
    slack: bool = True,
    terms: NDArray[np.float64] = TERMS,
) -> AnnotatedPath:
    """Cheapest path found from ``start`` to ``goal`` with the behavior for each stretch of it, and a proven bound.

    Parameters
    ----------
    meshes: one for each layer, the legs' first, whose obstacles contain those of the layers above.
    behaviors: least preferred and narrowest first; ``radii`` has one entry for each mesh.
    start, goal: x, y in meters.
    margin: meters added to every body radius. Start and goal alone may be that much nearer to obstacles.
    rooms: meshes of :func:`~crowdsim.planning.query.behavior_areas.room_polygons`, with which a path gets slack close
        to low obstacles where high ones ask for it; without them it does as in the lowest mesh with the largest
        clearance of any layer.
    planner: "layered"; or the published "greedy_literal", or "greedy", which combines detours; or "collision3d", which
        tests ``bodies`` in 3D where the others ask the layers.
    slack: whether the path moves off obstacles where that costs next to nothing, as motions follow paths only nearly.
    terms: (4,) what changes of behavior take, as :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.

    Raises
    ------
    PathNotFound: where nothing joins the two; the message says which layer is too narrow, where and by how much.
    BehaviorError: where the behaviors do not fit the layers, or there is no such planner.

    Reads its arguments only, so that any number of threads may plan on the same meshes.
    """
    if planner not in PLANNERS:
        raise BehaviorError(f"there is no planner '{planner}'; there are: {', '.join(PLANNERS)}")
    plan = PLANNERS[planner]
    if planner == "collision3d":
        if bodies is None:
            raise BehaviorError("the planner 'collision3d' needs the bodies that move and the scene they move in")
        plan = partial(plan_collision3d, bodies=bodies)
    query = make_query(meshes, behaviors, start, goal, margin=margin, rooms=rooms, terms=terms)
    best = plan(query)
    if best is None:
        raise PathNotFound(why_not(query))
    if slack:
        best = with_slack(query, best)
    if planner != "collision3d":  # which knows what bodies reach
        best = with_turn_room(query, best)
    given = np.array([start, goal], dtype=np.float64)
    return replace(joined_to(best, given, query.need.costs), certificate=partial(lower_bound, query))


def make_query(
    meshes: Sequence[NavMesh],
    behaviors: Sequence[Behavior],
    start: ArrayLike,
    goal: ArrayLike,
    *,
    margin: float = TRACKING_MARGIN,
    rooms: Sequence[NavMesh | None] | None = None,
    terms: NDArray[np.float64] = TERMS,
) -> Query:
    """What planners are asked, from the arguments of :func:`plan_path`."""
    need = _requirements(tuple(behaviors), len(meshes), margin)
    ends = clear_ends(meshes, need, np.array([start, goal], dtype=np.float64))
    return Query(tuple(meshes), need, make_rooms(meshes, need, rooms), ends, terms)


_needs: dict[tuple[tuple[int, ...], int, float], tuple[tuple[Behavior, ...], Requirements]] = {}
"""What behaviors require, by who they are: they hold arrays and have no hash. They are kept, so that nobody else is."""

_KEPT_NEEDS = 16


def _requirements(behaviors: tuple[Behavior, ...], layers: int, margin: float) -> Requirements:
    """:meth:`Requirements.of`, worked out once for the same behaviors."""
    key = tuple(map(id, behaviors)), layers, margin
    found = _needs.get(key)
    if found is None:
        found = behaviors, Requirements.of(behaviors, layers, margin)
        if len(_needs) >= _KEPT_NEEDS:
            _needs.clear()
        _needs[key] = found
    return found[1]
