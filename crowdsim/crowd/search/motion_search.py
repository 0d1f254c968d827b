"""Search for motion: from a position and a goal to a chain of nodes, in slices on worker threads.

Concurrent synthesis (2012 paper, section 6): an agent sets out on the first part of a motion while the rest is
searched. A slice is a number of map queries, never a time, so a result is found in the same step on any machine.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.search.plan_kernels import measure_offsets
from crowdsim.crowd.search.standing import attempts, nearest_end, only_searches_more, quicker_end
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.crowd.state.motion_plan import MotionPlan, Request
from crowdsim.errors import PathNotFound
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import FollowResult, FollowStatus, PathFollower
from crowdsim.geometry.elementary import atan2, cos, distance, sin
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath, PathSamples
from crowdsim.planning.margins.clearance_margin import with_clearance_margin
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.clear_ends import joined_to
from crowdsim.planning.single_behavior import cheapest_uniform

WORTHWHILE = 2.0
"""Least length along the route of a motion that is begun though it does not reach the goal [m]; an agent that could
only shuffle on the spot waits instead."""

SEARCH_BUDGET = 2000
"""Map queries after which a search gives up: several times as many as searches that succeed need."""

PASSING_BUDGET = 200
"""Map queries after which a search for a way around others or for a side step gives up; each is one try of several."""

SLICE_BRANCHES = 1200
"""Candidate branches of the first slice of a search: 1 to 2 ms; most searches end with it. If the motion found is slow,
twice as many are evaluated to quicken it."""

MOTION_WORK = 24
"""Estimated work of a motion for each meter of its route, in branch evaluations: as many as one map query takes in a
quick search."""

ROUTE_WORK = (600, 40)
"""Estimated work of planning a route, in branch evaluations: constant, and for each meter from start to goal."""

PASSING_WORK = 1500
"""Estimated work of a way around others beyond its route and motion, in branch evaluations: that of the meshes which
contain the standing agents."""

RECOVERIES = 3
"""Largest number of searches from the end of the played nodes, if no motion that begins with these reaches the goal."""

SIDE_STEP = 0.5
"""Length of the side step tried when a standing agent has no feasible first node [m]."""

PASSING_ROOM = 0.02
"""Clearance from agents that are passed, beyond both bodies [m]."""

_RING = 12  # points around the disc of a standing agent: closer together than any body is wide
_OFF_WALLS = 0.02  # distance from walls of the points that are inserted [m]

_HIDDEN = -1  # stands for the number of nodes played, if nothing of a motion may be played before it is complete


class _Outcome(NamedTuple):
    """A plan, and how many of its nodes are played already, or will be in any case."""

    plan: MotionPlan
    kept: int


@dataclass
class MotionSearch:
    """A search for the motion of one agent, run by one thread at a time.

    First look for a way around the agents that stand in the way, if there are any; then follow the old route, if there
    is one; then a new one. If nodes of a motion are played already, but it does not reach the goal or the environment
    has changed, search again from the end of these nodes.
    """

    assets: Assets
    environment: EnvironmentState
    request: Request
    always_quicken: bool = False
    """True to look for a quicker motion even if the first one is not slow."""
    excess: int = 0
    """Candidate branches evaluated in quickening a motion, beyond those of the slices. Who reads it may set it to 0."""
    over: bool = False
    """True if the search has ended."""
    slices: int = 0
    """Number of slices so far."""
    backtracks: int = 0
    """Number of times that the search would have had to change nodes already played."""
    recoveries: int = 0
    """Number of searches from the end of the played nodes that found more nodes."""
    _steps: Generator[MotionPlan, None, MotionPlan | PathNotFound] = field(init=False)
    # Arguments of the present call of :meth:`advance`.
    _kept: int = 0
    _branches: int = 0

    def __post_init__(self) -> None:
        self._steps = self._search()

    def advance(self, kept: int = 0, branches: int = SLICE_BRANCHES) -> MotionPlan | PathNotFound:
        """Search for one more slice of about ``branches`` candidate branches.

        Return the plan so far; a plan without nodes means that no motion was found (yet). If there is no path, return
        PathNotFound: it is not raised, as the run goes on. ``kept`` nodes of the plan returned last are played, or will
        be in any case. The environment must not change during a slice; between slices it may.
        """
        self._kept, self._branches = kept, branches
        self.slices += 1
        try:
            return next(self._steps)
        except StopIteration as end:
            self.over = True
            found: MotionPlan | PathNotFound = end.value
            return found

    def close(self) -> None:
        """Release what the search holds, as it is not wanted any more; no slice of it may be running.

        The search and its generator refer to each other: both would stay, with arrays of megabytes, until Python looks
        for such cycles.
        """
        self._steps.close()

    @property
    def is_way_around(self) -> bool:
        """Return True if the search looks for a way around others first."""
        return len(self.request.around) > 0

    @property
    def beginning(self) -> int:
        """Return the estimated work of the first slice, in branch evaluations."""
        request = self.request
        meters = distance(request.goal, request.position)
        work = min(MOTION_WORK * meters, SLICE_BRANCHES) + PASSING_WORK * self.is_way_around
        # A way around others is a route of its own, whether there is an old one or not.
        if request.route is None or self.is_way_around:
            work += ROUTE_WORK[0] + ROUTE_WORK[1] * meters
        return int(work)

    def _search(self) -> Generator[MotionPlan, None, MotionPlan | PathNotFound]:
        """Yield plans so far, and return the final result; begin anew whenever :meth:`_try_all` returns None."""
        while True:
            found = yield from self._try_all()
            if found is not None:
                return found

    def _try_all(self) -> Generator[MotionPlan, None, MotionPlan | PathNotFound | None]:
        """Run all tries in the order that the class describes; yield plans so far, and return the final result.

        Return None if the environment has changed during the tries, no motion arrives, and no node is played yet.
        """
        environment, request = self.environment, self.request
        if self.is_way_around:
            passing = yield from self._passing()
            if passing is not None:
                return passing
        revision = environment.revision
        if request.route is not None:
            plan, kept = yield from self._follow(request, request.route, environment.meshes)
            if plan.arrives:
                return plan
            # Nodes of it are played: go on from their end.
            if kept:
                return (yield from self._recover(plan, kept))
        try:
            route = environment.route(request.position, request.goal)
        except PathNotFound as error:
            return error
        plan, kept = yield from self._follow(request, route, environment.meshes)
        if plan.arrives:
            return plan
        if kept:
            return (yield from self._recover(plan, kept))
        if environment.revision != revision:
            return None
        # The agent stands in an idle node, and no first node is feasible: it may be too near to an obstacle.
        if plan.count == 0 and request.departure is not None and self.assets.graph.node_idle[request.departure[0]]:
            return (yield from self._step_aside(route)) or plan
        return plan

    def _recover(self, plan: MotionPlan, kept: int) -> Generator[MotionPlan, None, MotionPlan]:
        """Search again from the end of the played nodes, on a new route; return these nodes if nothing is found.

        ``kept`` nodes of ``plan`` are played, or will be.
        """
        graph = self.assets.graph
        for attempt in range(RECOVERIES):
            played = plan.until(kept - 1)
            node, origin = int(played.nodes[-1]), played.origins[-1]
            position = np.array(node_end(graph, node, *origin)[:2])
            request = replace(self.request, position=position, departure=(node, origin), route=None)
            try:
                route = self.environment.route(position, request.goal)
            except PathNotFound:
                return played
            revision = self.environment.revision
            # Only the first attempt tries to end exactly as requested; for the others it is enough to come near.
            plan, kept = yield from self._follow(
                request, route, self.environment.meshes, played=played, strictly=attempt == 0
            )
            self.recoveries += plan.count > played.count
            # Try again only if more was played meanwhile, or the environment has changed: else the result is the same.
            if plan.arrives or (kept == played.count and self.environment.revision == revision):
                return plan
        return plan.until(kept - 1)

    def _follow(
        self,
        request: Request,
        route: AnnotatedPath,
        meshes: Sequence[NavMesh],
        budget: int = SEARCH_BUDGET,
        shown: bool = True,
        played: MotionPlan | None = None,
        strictly: bool = True,
    ) -> Generator[MotionPlan, None, _Outcome]:
        """Follow a route, by the attempts of :func:`crowdsim.crowd.search.standing.attempts` until one succeeds.

        See :func:`crowdsim.following.follower.path_follower.follow_path`. ``meshes``: of the layers. ``budget``: map
        queries. ``shown``: parts of the motion may be played before it is complete. ``played``: nodes before it, which
        are played already. ``strictly``: try to end exactly as requested before coming near is enough. Yield plans so
        far; return the final one, which need not arrive, and how many of its nodes are played. Both include the nodes
        of ``played``.
        """
        assets, revision = self.assets, self.environment.revision
        samples = route.sample().rest_from(request.position)
        node, origin = _departure(assets, request, route, samples)
        before = 0 if played is None else played.count
        arrays = tuple(mesh.arrays for mesh in meshes)
        # ``best`` ends ``least`` off the goal [m], infinite if no attempt has arrived; ``plan`` was yielded last, and
        # ``kept`` nodes of it behind ``played`` are played.
        best: FollowResult | None = None
        plan, kept, least = None, 0, np.inf
        vain: list[FollowOptions] = []  # of attempts that found nothing and left out nothing
        for options, exactly in attempts(request, budget, strictly):
            # An attempt has arrived: attempts that only have to come near find nothing better.
            if least < np.inf and not exactly:
                break
            if any(only_searches_more(options, than) for than in vain):
                continue
            search = PathFollower(assets.character, samples, arrays, origin, node, options)
            # Map queries of a slice, and nodes to keep, with the departure, which is the first node of a result.
            while (found := search.advance(max(self._branches // options.branches, 1), kept + 1)) is None:
                plan = _as_plan(assets, route, search.present, played, kept if shown else _HIDDEN)
                yield plan
                kept = self._kept - before
                # The environment has changed: the caller searches anew.
                if self.environment.revision != revision:
                    return _Outcome(plan, before + kept)
            if found.status == FollowStatus.FOUND:
                off = 0.0  # it comes near, which is enough for an attempt that is not bent
                if exactly:
                    found, off = nearest_end(assets.graph, search, found, request, samples.pose[-1, :2], kept + 1)
                # Nothing of it is played, nor will be in any case: look for a quicker one.
                slow = self.always_quicken or search.is_slow(found)
                if slow and off <= request.within and not kept:
                    most, queries = 2 * self._branches // options.branches, search.queries
                    found = quicker_end(assets.graph, search, found, request, samples.pose[-1, :2], exactly, most)
                    self.excess += (search.queries - queries) * options.branches
                if off < least:
                    best, least = found, off
                # Another attempt could begin with other nodes than those played.
                if off <= request.within or kept:
                    break
            else:
                # Without a motion that arrives, keep the one that came farthest.
                if best is None or (least == np.inf and found.reached >= best.reached):
                    best = found
                if found.status == FollowStatus.BLOCKED and not search.left_out:
                    vain.append(options)
            if plan is not None and kept:
                # Return what was yielded: the result that came farthest may begin with other nodes than those played.
                self.backtracks += found.status == FollowStatus.PAST_KEPT
                return _Outcome(plan, before + kept)
        assert best is not None
        return _Outcome(_as_plan(assets, route, best, played, kept), before + kept)

    def _whole(
        self, request: Request, route: AnnotatedPath, meshes: Sequence[NavMesh]
    ) -> Generator[MotionPlan, None, MotionPlan]:
        """Search a motion along a route with PASSING_BUDGET; no part of it is played before it is complete."""
        plan, _ = yield from self._follow(request, route, meshes, PASSING_BUDGET, shown=False)
        return plan

    def _step_aside(self, route: AnnotatedPath) -> Generator[MotionPlan, None, MotionPlan | None]:
        """Search a motion to the goal by way of a position beside, for an agent too near to an obstacle to set out.

        Positions SIDE_STEP away are tried, the one in the direction of ``route`` first. Return None if none arrives.
        """
        request, environment = self.request, self.environment
        ahead = route.at(np.array([SIDE_STEP]))[0] - request.position
        direction = atan2(ahead[1], ahead[0])
        ends = np.array([request.position, request.goal])
        # Angle off that direction, as a share of 180 degrees.
        for turn in (0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0):
            angle = direction + turn * np.pi
            beside = request.position + SIDE_STEP * np.array([cos(angle), sin(angle)])
            try:
                way = environment.route(beside, request.goal)
            except PathNotFound:
                continue
            plan = yield from self._whole(request, joined_to(way, ends, self.assets.need.costs), environment.meshes)
            if plan.arrives:
                return plan
        return None

    def _passing(self) -> Generator[MotionPlan, None, MotionPlan | None]:
        """Search a motion to the goal that keeps clear of the agents ``around`` of the request; None if none arrives.

        These become obstacles: rings of points, inserted in copies of the meshes, on which a route is planned.
        """
        assets, environment, request = self.assets, self.environment, self.request
        turn = np.arange(_RING) * 2.0 * np.pi / _RING
        ring = np.stack([cos(turn), sin(turn)], axis=1)
        # Middle and both ends of the core of each body, (3, k, 2): a capsule counts as three discs.
        x, y, heading = request.around.T
        half = assets.breadths[request.postures, 1]
        core = half[:, None] * np.stack([-sin(heading), cos(heading)], axis=1)
        middles = np.stack([x, y], axis=1) + np.array([-1.0, 0.0, 1.0])[:, None, None] * core
        meshes = []
        for mesh, radii in zip(environment.meshes, assets.body_radii.T, strict=True):
            # Rings of points around the discs of each standing body, as broad as it is on this layer.
            rings = (radii[request.postures] + PASSING_ROOM)[:, None, None] * ring
            points = (middles[:, :, None] + rings).reshape(-1, 2)
            points = points[mesh.clearances(points, 1.0) > _OFF_WALLS]
            meshes.append(mesh.with_points(points) if len(points) else mesh)
        # No point was inserted, as all are in walls or too near to them: there is nothing to go around.
        if all(mesh is before for mesh, before in zip(meshes, environment.meshes, strict=True)):
            return None
        # Without a roadmap, which would be built for this one plan: from the shortest path of each behavior area.
        query = Planner(meshes, assets.behaviors).query(request.position, request.goal)
        route = cheapest_uniform(query).path
        if route is None:
            return None
        route = joined_to(
            with_clearance_margin(query, route), np.array([request.position, request.goal]), assets.need.costs
        )
        plan = yield from self._whole(request, route, meshes)
        return plan if plan.arrives else None


def _departure(
    assets: Assets, request: Request, route: AnnotatedPath, samples: PathSamples
) -> tuple[int, NDArray[np.float64]]:
    """Return the node behind which a motion begins, and the track pose (3,) at which that node starts."""
    if request.departure is not None:
        return request.departure
    # It has not entered yet: it will stand idle, and face as the first behavior of its route does.
    behavior = route.sections[0].behavior
    heading = wrap_angle(samples.pose[0, 2] + assets.facings[behavior, 0])
    return int(assets.idle_nodes[behavior]), np.array([*request.position, heading])


def _as_plan(
    assets: Assets, route: AnnotatedPath, found: FollowResult, played: MotionPlan | None, kept: int
) -> MotionPlan:
    """Return a plan of ``played`` and, behind it, the nodes that were found.

    A motion that neither arrives nor is WORTHWHILE is cut down to its first ``kept`` nodes, which are played. If
    ``kept`` is _HIDDEN, any motion that does not arrive is cut down to none. The first node found is the departure,
    which is no part of the plan.
    """
    origins = found.origins[1:]
    blend_offsets = np.empty(origins.shape)
    measure_offsets(assets.graph.node_motion, found.nodes, found.origins, blend_offsets)
    arrives = found.status == FollowStatus.FOUND
    worthwhile = arrives or (kept != _HIDDEN and found.reached >= WORTHWHILE)
    count = len(origins) if worthwhile else max(kept, 0)
    plan = MotionPlan(
        route=route,
        departure_node=int(found.nodes[0]),
        departure=found.origins[0],
        nodes=found.nodes[1 : count + 1],
        origins=origins[:count],
        blend_offsets=blend_offsets[:count],
        arrives=arrives,
    )
    return plan if played is None else played.joined(0, played.count - 1, plan, reaches=False)
