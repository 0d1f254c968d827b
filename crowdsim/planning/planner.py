"""Layered behavioral planner: the route, and the behavior of each stretch of it (2018 paper, section 3.3)."""

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
"""Largest number of queries without a way whose messages are kept."""

PLANNERS = ("layered", "greedy_literal", "collision3d")
"""Names of the planners, see :class:`Planner`."""


class Planner:
    """Plan paths through one place for one set of behaviors; own all data that its plans share.

    The meshes may be edited between plans: shared data is remade if their revisions have changed. Any number of threads
    may plan at once.

    Parameters
    ----------
    meshes : sequence of NavMesh
        One mesh per layer, the legs' first. Its obstacles contain those of the other layers.
    behaviors : sequence of Behavior
        Narrowest and least preferred first; ``radii`` has one entry per mesh.
    areas : sequence of NavMesh or None, optional
        Meshes of :func:`~crowdsim.planning.query.behavior_areas.area_polygons`, in which paths may pass low obstacles
        closely. Without them, each behavior keeps the largest clearance that it needs on any layer from all obstacles
        of the lowest mesh.
    planner : str
        "layered", the published "greedy_literal", or "collision3d", which tests ``bodies`` in 3D instead of the layers.
    bodies : Bodies, optional
        Moving bodies and their scene, for "collision3d".
    margin : float
        Added to every body radius [m]. Only start and goal may be closer to obstacles, by this much.
    terms : (4,) float64
        Costs and lengths of changes of behavior, as :data:`~crowdsim.planning.labels.labelling_kernels.TERMS`.

    Raises
    ------
    BehaviorError
        If the behaviors do not match the layers, or there is no such planner.

    Examples
    --------
    >>> behaviors = load_behavior_set(["lateral", "frontal"], [(0.0, 0.6), (0.6, 2.0)]).behaviors
    >>> room, table = shapely.box(0, 0, 8, 3), shapely.box(3, 0, 5, 2.5)
    >>> planner = Planner([NavMesh(room - table), NavMesh(room)], behaviors)
    >>> [behaviors[section.behavior].name for section in planner.plan((1, 1), (7, 1)).sections]
    ['frontal', 'lateral', 'frontal']
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
            raise BehaviorError(
                "the planner 'collision3d' needs the argument 'bodies': the moving bodies and their scene"
            )
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

    def plan(self, start: ArrayLike, goal: ArrayLike, *, margin: bool = True) -> AnnotatedPath:
        """Find the cheapest path from ``start`` to ``goal`` and the behavior of each stretch of it.

        Parameters
        ----------
        start, goal : (2,) float64
            x, y [m].
        margin : bool
            True to take a clearance margin if that costs almost nothing, as motions follow paths only approximately.
            The planner "collision3d" takes none.

        Returns
        -------
        AnnotatedPath
            Points, sections with their behaviors, cost, and a proven lower bound of the cost (0 for "collision3d").

        Raises
        ------
        PathNotFound
            If no way joins the two; the message names the layer that is too narrow, the place and the shortfall.
        """
        query = self.query(start, goal)
        self._require_way(query)
        best = self.cheapest(query)
        in_3d = self.name == "collision3d"
        if best is None:
            raise PathNotFound(why_not(query, in_3d))
        # Whole bodies also pass where discs on layers do not: layers can neither label their paths nor bound the cost.
        if not in_3d:
            if margin:
                best = with_clearance_margin(query, best)
            best = with_turn_room(query, best)
        given = np.array([start, goal], dtype=np.float64)
        missing = missing_at_ends(self.meshes, query.need, best, given)
        joined = joined_to(best, given, query.need.costs)
        return replace(joined, missing=missing, certificate=None if in_3d else partial(lower_bound, query))

    def query(self, start: ArrayLike, goal: ArrayLike) -> Query:
        """Prepare a query from ``start`` to ``goal``.

        Parameters
        ----------
        start, goal : (x, y)
            Ends of the path [m]; those too close to obstacles move to free places nearby.

        Returns
        -------
        Query
            What the planners take.
        """
        ends = clear_ends(self.meshes, self.need, np.array([start, goal], dtype=np.float64))
        return Query(self.meshes, self.need, self.areas, ends, self.terms)

    def _require_way(self, query: Query) -> None:
        """Raise PathNotFound if components of the lowest mesh show that no way joins the ends of a query."""
        mesh, radius = self.meshes[0], self.need.search_radius
        one, other = mesh.components(query.ends, radius).tolist()
        # Below 0: an end is not free for the legs, and the search itself says why.
        if one == other or min(one, other) < 0:
            return
        # Finding the reason takes longer than a path, and a standing agent retries often: keep the messages.
        key = (mesh.revision, query.ends.tobytes())
        reasons = self._reasons
        why = reasons[key] if key in reasons else why_not(query)
        kept = {known: said for known, said in reasons.items() if known[0] == mesh.revision}
        self._reasons = {key: why, **dict(list(kept.items())[: _REASONS - 1])}
        raise PathNotFound(why)

    def cheapest(self, query: Query) -> AnnotatedPath | None:
        """Find the cheapest path by the chosen planner alone, without clearance margin and room for turns.

        Parameters
        ----------
        query : Query
            Ends, meshes and behaviors.

        Returns
        -------
        AnnotatedPath or None
            The path; None if there is none.
        """
        if self.name == "layered":
            return plan_layered(query, self.roadmap())
        if self.name == "collision3d":
            assert self._bodies is not None
            return plan_collision3d(query, self._bodies)
        return plan_greedy(query, self._copies)

    def roadmap(self) -> Roadmap:
        """Return the roadmap of the meshes as they are.

        Returns
        -------
        Roadmap
            The roadmap, made at the first call, and anew at the first one after an edit.
        """
        revisions = tuple([mesh.revision for mesh in self.meshes])
        with self._making:
            if self._roadmap is None or self._revisions != revisions:
                self._roadmap = Roadmap(self.meshes, self.need, self.terms)
                self._revisions = revisions
            return self._roadmap
