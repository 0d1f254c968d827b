"""Layered behavioral planner: where to walk, and with which behavior (2018 paper, section 3.3)."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import BehaviorError, PathNotFound
from crowdsim.planning.baselines.collision3d import Bodies, plan_collision3d
from crowdsim.planning.baselines.greedy import MeshCopies, plan_greedy
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.labels.labelling_kernels import TERMS
from crowdsim.planning.layered import plan_layered
from crowdsim.planning.margins.clearance_margin import with_clearance_margin
from crowdsim.planning.margins.turns import with_turn_room
from crowdsim.planning.query.behavior_areas import make_areas
from crowdsim.planning.query.clear_ends import clear_ends, joined_to, missing_at_ends
from crowdsim.planning.query.diagnosis import why_not
from crowdsim.planning.query.lower_bound import lower_bound
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import Requirements
from crowdsim.planning.roadmap.roadmap import Roadmap

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_REASONS = 64
"""Queries without a way whose reasons are remembered."""

PLANNERS = ("layered", "greedy_literal", "collision3d")


class Planner:
    """What plans paths through one place for one set of behaviors, and all that its plans share.

    Parameters
    ----------
    meshes: one for each layer, the legs' first, whose obstacles contain those of the layers above.
    behaviors: least preferred and narrowest first; ``radii`` has one entry for each mesh.
    areas: meshes of :func:`~crowdsim.planning.query.behavior_areas.area_polygons`, with which paths stay as
        close to low obstacles as they can; without them each behavior keeps from all obstacles of the lowest mesh the
        largest clearance that it asks of any layer.
    planner: "layered"; or the published "greedy_literal"; or "collision3d", which tests ``bodies`` in 3D where the
        others ask the layers.
    margin: meters added to every body radius. Start and goal alone may be that much nearer to obstacles.
    terms: (4,) what changes of behavior take, as :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.

    Raises
    ------
    BehaviorError: where the behaviors do not fit the layers, or there is no such planner.

    The meshes may be edited between plans, which know by their revisions. Any number of threads may plan at once.
    """

    def __init__(
        self,
        meshes: Sequence[NavMesh],
        behaviors: Sequence[Behavior],
        *,
        areas: Sequence[NavMesh | None] | None = None,
        planner: str = "layered",
        bodies: Bodies | None = None,
        margin: float = TRACKING_MARGIN,
        terms: NDArray[np.float64] = TERMS,
    ) -> None:
        if planner not in PLANNERS:
            raise BehaviorError(f"there is no planner '{planner}'; there are: {', '.join(PLANNERS)}")
        if planner == "collision3d" and bodies is None:
            raise BehaviorError("the planner 'collision3d' needs the bodies that move and the scene they move in")
        self.name = planner
        self.meshes = tuple(meshes)
        self.need = Requirements.of(behaviors, len(meshes), margin)
        self.areas = make_areas(meshes, self.need, areas)
        self.terms = terms
        self._bodies = bodies
        self._copies = MeshCopies(self.meshes[0])
        self._roadmap: Roadmap | None = None
        self._revisions: tuple[int, ...] = ()
        self._making = threading.Lock()
        self._reasons: dict[tuple[int, bytes], str] = {}

    def plan(self, start: ArrayLike, goal: ArrayLike, *, slack: bool = True) -> AnnotatedPath:
        """Cheapest path found from ``start`` to ``goal`` with the behavior for each stretch of it, and a proven bound.

        Parameters
        ----------
        start, goal: x, y in meters.
        slack: whether the path takes a clearance margin where that costs next to nothing, as motions follow paths only
            nearly.

        Raises
        ------
        PathNotFound: where nothing joins the two; the message says which layer is too narrow, where and by how much.
        """
        query = self.query(start, goal)
        self._require_way(query)
        best = self.cheapest(query)
        if best is None:
            raise PathNotFound(why_not(query))
        if slack:
            best = with_clearance_margin(query, best)
        if self.name != "collision3d":  # which knows what bodies reach
            best = with_turn_room(query, best)
        given = np.array([start, goal], dtype=np.float64)
        missing = missing_at_ends(self.meshes, query.need, best, given)
        joined = joined_to(best, given, query.need.costs)
        return replace(joined, missing=missing, certificate=partial(lower_bound, query))

    def query(self, start: ArrayLike, goal: ArrayLike) -> Query:
        """Prepare a query from start to goal (x, y); move ends too close to obstacles to free places nearby."""
        ends = clear_ends(self.meshes, self.need, np.array([start, goal], dtype=np.float64))
        return Query(self.meshes, self.need, self.areas, ends, self.terms)

    def _require_way(self, query: Query) -> None:
        """PathNotFound where components of the lowest mesh tell that nothing joins the ends of a query."""
        mesh, radius = self.meshes[0], self.need.search_radius
        one, other = mesh.components(query.ends, radius).tolist()
        if one == other or min(one, other) < 0:
            return
        # To find out why takes longer than a path, and who stands asks again and again.
        key = (mesh.revision, query.ends.tobytes())
        reasons = self._reasons
        why = reasons[key] if key in reasons else why_not(query)
        kept = {known: said for known, said in reasons.items() if known[0] == mesh.revision}
        self._reasons = {key: why, **dict(list(kept.items())[:_REASONS])}
        raise PathNotFound(why)

    def cheapest(self, query: Query) -> AnnotatedPath | None:
        """The path that the named search finds, without a clearance margin; None if there is none."""
        if self.name == "layered":
            return plan_layered(query, self.roadmap())
        if self.name == "collision3d":
            assert self._bodies is not None
            return plan_collision3d(query, self._bodies)
        return plan_greedy(query, self._copies)

    def roadmap(self) -> Roadmap:
        """The roadmap of the meshes as they are, made at the first call and after every edit."""
        revisions = tuple([mesh.revision for mesh in self.meshes])
        with self._making:
            if self._roadmap is None or self._revisions != revisions:
                self._roadmap = Roadmap(self.meshes, self.need, self.terms)
                self._revisions = revisions
            return self._roadmap
