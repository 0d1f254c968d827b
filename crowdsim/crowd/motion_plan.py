"""From a place and a goal to a chain of nodes: what a worker thread computes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.place import Place
from crowdsim.crowd.setting import Setting
from crowdsim.errors import PathNotFound
from crowdsim.following.path_follower import FollowOptions, FollowStatus, follow_path
from crowdsim.geometry.planar import compose, wrap_angle
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.annotated_path import AnnotatedPath, PathSamples
from crowdsim.planning.clear_ends import joined_to
from crowdsim.planning.layered import cheapest_uniform
from crowdsim.planning.planner import make_query
from crowdsim.planning.widening import with_slack

WORTHWHILE = 2.0
"""Meters that a motion must lead along the route to be begun though it does not reach the goal: who shuffles on the
spot towards a place it cannot leave had better wait."""

SEARCH_BUDGET = 2000
"""Map queries until a search for motion gives up: several times what any that succeeds has been seen to need."""

PASSING_BUDGET = 200
"""The same for a way around others or by a place beside, which is a try among several."""

SIDE_STEP = 0.5
"""Meters that somebody steps aside who cannot set out from where it stands."""

PASSING_ROOM = 0.02
"""Meters beyond both bodies kept from those who are passed."""

_RING = 12  # points that stand for someone: closer together than any body is wide
_OFF_WALLS = 0.02  # meters


@dataclass(frozen=True)
class Request:
    """What a search starts from.

    position, goal: (2,) meters. stays: whether the motion must end standing. departure: the node behind which the
    motion begins and the pose (3,) that started from, or None before the character entered the world. route: the path
    it follows already, or None to plan one. around: (k, 2) places of others who stand in the way and to be passed.
    """

    position: NDArray[np.float64]
    goal: NDArray[np.float64]
    stays: bool
    departure: tuple[int, NDArray[np.float64]] | None = None
    route: AnnotatedPath | None = None
    around: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True)
class MotionPlan:
    """A chain of P nodes.

    nodes: (P,) int32. origins: (P, 3) world poses where they start. seams: (P, 3), end of the node before minus
    origin. departure: the node before the first, and the pose (3,) it starts from. arrives: whether the chain reaches
    the goal of ``route``. passes: nodes at whose end earlier goals are reached, on the way.
    """

    route: AnnotatedPath
    departure_node: int
    departure: NDArray[np.float64]
    nodes: NDArray[np.int32]
    origins: NDArray[np.float64]
    seams: NDArray[np.float64]
    arrives: bool
    passes: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        return len(self.nodes)

    @property
    def digest(self) -> int:
        """64 bits that name the plan, for the state hash."""
        content = hashlib.blake2b(self.nodes.tobytes(), digest_size=8)
        content.update(self.origins.tobytes())
        return int.from_bytes(content.digest(), "little")

    def until(self, last: int) -> MotionPlan:
        """The plan up to and with node ``last``."""
        if last == self.count - 1:
            return self
        end = last + 1
        return replace(
            self,
            nodes=self.nodes[:end],
            origins=self.origins[:end],
            seams=self.seams[:end],
            arrives=False,
            passes=tuple(p for p in self.passes if p <= last),
        )

    def joined(self, first: int, last: int, more: MotionPlan, reaches: bool) -> MotionPlan:
        """Nodes ``first`` to ``last``, then ``more``; ``reaches`` says that this plan's goal is on the way."""
        kept = slice(first, last + 1)
        passes = [p - first for p in self.passes if first <= p <= last]
        return replace(
            more,
            departure_node=self.departure_node,
            departure=self.departure,
            nodes=np.concatenate([self.nodes[kept], more.nodes]),
            origins=np.concatenate([self.origins[kept], more.origins]),
            seams=np.concatenate([self.seams[kept], more.seams]),
            passes=(*passes, *([last - first] if reaches else [])),
        )


def search_motion(setting: Setting, place: Place, request: Request) -> MotionPlan | PathNotFound:
    """Plan a route where there is none, and follow it; where an old route cannot be followed, plan a new one.

    First of all a way around those who stand in it is looked for, where there are any.

    A plan without nodes says that no motion was found. PathNotFound is returned, not raised: it is a result that
    the run carries on with. Reads its arguments only, on any thread; the place must not change meanwhile.
    """
    if len(request.around):
        passing = _passing(setting, place, request)
        if passing is not None:
            return passing
    if request.route is not None:
        plan = _follow(setting, request, request.route, place.meshes)
        if plan.arrives:
            return plan
    try:
        route = place.route(request.position, request.goal)
    except PathNotFound as error:
        return error
    plan = _follow(setting, request, route, place.meshes)
    if plan.count == 0 and request.departure is not None and setting.graph.node_idle[request.departure[0]]:
        return _stepping_aside(setting, place, request, route) or plan
    return plan


def _stepping_aside(setting: Setting, place: Place, request: Request, route: AnnotatedPath) -> MotionPlan | None:
    """A motion to the goal by way of a place beside, for somebody who stands too near to something to set out.

    Those in the direction of ``route`` come first.
    """
    ahead = route.at(np.array([SIDE_STEP]))[0] - request.position
    direction = np.arctan2(ahead[1], ahead[0])
    ends = np.array([request.position, request.goal])
    for turn in (0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0):
        angle = direction + turn * np.pi
        beside = request.position + SIDE_STEP * np.array([np.cos(angle), np.sin(angle)])
        try:
            way = place.route(beside, request.goal)
        except PathNotFound:
            continue
        way = joined_to(way, ends, setting.need.costs)
        plan = _follow(setting, request, way, place.meshes, PASSING_BUDGET)
        if plan.arrives:
            return plan
    return None


def _passing(setting: Setting, place: Place, request: Request) -> MotionPlan | None:
    """A motion to the goal that keeps clear of the places ``request.around``, or None."""
    legs = place.meshes[0]
    radius = 2.0 * setting.personal_radius + PASSING_ROOM - float(setting.body_radii[:, 0].max())
    turn = np.arange(_RING) * 2.0 * np.pi / _RING
    ring = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (request.around[:, None] + ring).reshape(-1, 2)
    points = points[legs.clearances(points, 1.0) > _OFF_WALLS]
    if not len(points):
        return None
    meshes = (legs.with_points(points), *place.meshes[1:])
    # Not over a roadmap, which would be made for this one plan.
    query = make_query(meshes, setting.behaviors, request.position, request.goal)
    route = cheapest_uniform(query)
    if route is None:
        return None
    route = joined_to(with_slack(query, route), np.array([request.position, request.goal]), setting.need.costs)
    plan = _follow(setting, request, route, meshes, PASSING_BUDGET)
    return plan if plan.arrives else None


def _follow(
    setting: Setting, request: Request, route: AnnotatedPath, meshes: Sequence[NavMesh], budget: int = SEARCH_BUDGET
) -> MotionPlan:
    samples = _rest_of(route.sample(), request.position)
    if request.departure is not None:
        node, origin = request.departure
    else:
        node = int(setting.idle_nodes[route.sections[0].behavior])
        facing = setting.facings[route.sections[0].behavior, 0]
        origin = np.array([*request.position, wrap_angle(samples.pose[0, 2] + facing)])
    graph = setting.graph
    found = follow_path(
        graph,
        setting.maps,
        samples,
        tuple(mesh.arrays for mesh in meshes),
        setting.body_radii,
        setting.facings,
        start_pose=origin,
        start_node=node,
        options=FollowOptions(end_standing=request.stays, budget=budget),
    )
    ends = compose(found.origins[:-1], graph.node_motion[found.nodes[:-1]])
    origins = found.origins[1:]
    seams = ends - origins
    seams[:, 2] = wrap_angle(seams[:, 2])
    arrives = found.status == FollowStatus.FOUND
    count = len(origins) if arrives or found.reached >= WORTHWHILE else 0
    return MotionPlan(
        route=route,
        departure_node=node,
        departure=origin,
        nodes=found.nodes[1 : count + 1],
        origins=origins[:count],
        seams=seams[:count],
        arrives=arrives,
    )


def _rest_of(samples: PathSamples, position: NDArray[np.float64]) -> PathSamples:
    """The samples from the one nearest to ``position`` on."""
    distance = np.hypot(*(samples.pose[:, :2] - position).T)
    first = min(int(np.argmin(distance)), len(samples.arc) - 2)
    return PathSamples(samples.pose[first:], samples.arc[first:] - samples.arc[first], samples.behavior[first:])
